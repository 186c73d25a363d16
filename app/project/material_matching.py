"""Matches a material with a model, for the editor's process and for `import insitu`: what a name stands for, the
matched layer, and how far it is from the original, as a BRDF and in place."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.commands.layers import SetMaterial
from app.document.document import Document, reflecting_layers
from app.document.linked_layers import Layers
from app.document.material_match import MaterialAnswer, MaterialMatch, MaterialMatchErrors, material_of
from app.files.materials import Library, load_material, measured_layers
from app.system.paths import is_file_name
from engine.core.errors import InsituError
from engine.core.generators import map_steps
from engine.inverse.brdf_fit import match_layer
from engine.material.layer import Layer, evaluate_layers, object_of
from engine.measured.measurement import ENDINGS

if TYPE_CHECKING:
    from app.project.project import Project

READING, FITTING, DRAWING = "reading the material", "fitting curves", "drawing both in place"
# The share of the work that the fit is.
_FIT = 0.7
Stage = tuple[float, str]


def found_source(match: MaterialMatch, document: Document) -> MaterialMatch:
    """The match with the layers of its source, unread where they are in files, once it is known to be possible. Raises
    InsituError."""
    layers, title = source_layers(document, match.source)
    match = replace(match, layers=layers, title=title)
    match.start(document)
    return match


def source_layers(document: Document, name: str) -> tuple[Layers, str]:
    """The layers of a material, which may be unread, and what to call it: an object or a layer of the document by its
    path, a material of the library or of a file, or a measured BRDF's file. Raises InsituError."""
    found = material_of(document, name)
    if found is not None:
        return found
    if Path(name).suffix.lower() in ENDINGS:
        return measured_layers(Path(name)), Path(name).stem
    if is_file_name(name):
        material = load_material(Path(name))
        return material.layers, material.name
    try:
        return Library().entry(name).material.layers, name
    except InsituError as error:
        raise InsituError(f"{error}, and no object or layer of that path in the scene") from None


def match_material(project: Project, match: MaterialMatch) -> Generator[Stage, None, MaterialAnswer]:
    """The matched layer and its errors, once the source is found; a generator of the share that is done, and of what is
    being done. Raises InsituError."""
    from app.project.reading import read_measurements

    yield 0.0, READING
    # The files are read as those of a document with this material are.
    with_source = read_measurements(SetMaterial(match.object, match.layers, match.title).apply(project.document))
    layers = with_source.object(match.object).layers
    start, original = match.start(project.document), tuple(layer for layer in layers if layer.visible)
    fitting = match_layer(lambda wi, wo: evaluate_layers(original, wi, wo), start, match.names, match.parameters)
    found = yield from map_steps(fitting, lambda share: (_FIT * share, FITTING))
    yield _FIT, DRAWING
    drawing = _picture_error(project, match.object, original, found.layer)
    seen = yield from map_steps(drawing, lambda share: (_FIT + (1.0 - _FIT) * share, DRAWING))
    return MaterialAnswer(found.layer, MaterialMatchErrors(found.before, found.error, seen))


def _picture_error(
    project: Project, name: str, original: Layers, matched: Layer
) -> Generator[float, None, float | None]:
    """The error of the object's picture; None where no pixel sees it."""
    from engine.inverse.placed_error import placed_error  # late: few programs trace paths
    from engine.precompute.direct.pipeline import Placement
    from engine.scene.cutouts import scene_caster

    document, names = project.picture_document, project.object_names
    state = document.object(name)
    if name not in names or not (state.visible and any(layer.visible for layer in state.layers)):
        return None
    layers_of: dict[int, list[Layer]] = {}
    for key, layer in reflecting_layers(document):
        layers_of.setdefault(names.index(object_of(key)), []).append(layer)
    placement, n_bounces = Placement(project.scene, scene_caster(project.scene)), project.editor_settings.n_bounces
    return (yield from placed_error(
        placement, layers_of, names.index(name), original, (matched,), project.sky, max(n_bounces, 1)
    ))  # fmt: skip
