"""The files that a document names: its picture depends on them besides the scene's own file and meshes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from app.document.commands.maps import scene_folder
from app.document.document import Document, ObjectState
from app.document.measurements import measurement_in
from engine.material.layer_maps import split_image_name
from engine.scene.builtin import builtin_environments, scene_path


def files_of_document(document: Document, known: Document | None = None) -> set[Path]:
    """All of these files, whether they exist or not; without what `known` has as well."""
    before = None if known is None or known.source != document.source else known
    found: set[Path] = set() if before is not None else {scene_path(document.source)}
    light = document.light
    if before is None or light.environment != before.light.environment:
        builtin = builtin_environments().get(light.environment)
        found.update([builtin] if builtin else [Path(light.environment)] if light.is_file else [])
    unchanged = set() if before is None else set(map(id, before.objects))
    changed = [state for state in document.objects if id(state) not in unchanged]
    names = {name for state in changed for name in _names(state)}
    folder = scene_folder(document.source) if names else Path()
    return found | {folder / name for name in names}


def _names(state: ObjectState) -> Iterator[str]:
    """Files of one object, absolute or relative to the scene's folder."""
    images = [state.own_bumps.file, state.bumps.file]
    images += [name for surface in (state.own_surface, state.surface) for _, name in surface.files]
    for layer in state.layers:
        images += [layer.maps.texture, layer.maps.weight]
        measurement = measurement_in(layer)
        if measurement is not None:
            yield measurement.file
    yield from (split_image_name(name)[0] for name in images if name)
