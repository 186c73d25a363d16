"""The files that a document names: measured BRDFs, images, its light, the scene.

A measured layer that a scene, a session or a material describes has only a file's name. The worker reads the file and
answers with a `Measurement`, small enough to be the layer's parameter; its table stays there. An image has a name in
the scene's folder, so that the folder can move, or an absolute path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path

from app.document.document import Document, ObjectState, Variant
from app.document.linked_layers import Layers
from app.document.looks import in_all_looks, lights_of_looks, objects_of_looks
from app.document.scene_files import files_of_scene, scene_file
from app.system.paths import full_path
from engine.core.safe_files import named_in, resolved
from engine.material.layer import Layer
from engine.material.layer_maps import split_image_name
from engine.material.measured import HIGHLIGHT_MODELS
from engine.material.parameter_maps import with_map_files
from engine.measured.measurement import Measurement
from engine.scene.builtin import builtin_environments

FILE = "file"


def measurement_in(layer: Layer) -> Measurement | None:
    """The measurement of a layer, read or not; None for one that is not measured."""
    value = layer.values.get(FILE)
    return value if isinstance(value, Measurement) and value.file else None


def unread_files(layers: Iterable[Layer]) -> tuple[str, ...]:
    """The files that layers name and that have not been read for them, each once."""
    found = (measurement_in(layer) for layer in layers)
    return tuple(dict.fromkeys(each.file for each in found if each is not None and not each.is_read))


def layers_of_document(document: Document) -> list[Layer]:
    """All layers, those of its other looks as well."""
    return [layer for state in objects_of_looks(document) for layer in state.layers]


def layers_with_variants(document: Document) -> list[Layer]:
    """All layers, and those of the variants of objects."""
    variants = (each.layers for state in document.objects for each in state.variants)
    return [*layers_of_document(document), *chain.from_iterable(variants)]


def measured_files(layers: Iterable[Layer]) -> tuple[tuple[str, int], ...]:
    """(file, number) of all measurements that were read, each once."""
    found = (measurement_in(layer) for layer in layers)
    return tuple(dict.fromkeys((each.file, each.number) for each in found if each is not None and each.is_read))


def with_measurements(layers: Layers, found: Mapping[str, Measurement]) -> Layers:
    """The layers with the measurements read from their files; the highlight of an import has the curves that fit
    best."""
    return tuple(_with_measurement(layer, found) for layer in layers)


def document_with_measurements(document: Document, found: Mapping[str, Measurement]) -> Document:
    """The document with the measurements read from the files of its layers and its variants."""
    if not found:
        return document
    known = dict[int, ObjectState]()  # looks share objects

    def measured(state: ObjectState) -> ObjectState:
        if id(state) not in known:
            known[id(state)] = replace(
                state, layers=with_measurements(state.layers, found),
                variants=tuple(replace(each, layers=with_measurements(each.layers, found)) for each in state.variants),
            )  # fmt: skip
        return known[id(state)]

    return in_all_looks(document, lambda each: replace(each, objects=tuple(map(measured, each.objects))))


def with_full_paths(layers: Layers, folder: Path) -> Layers:
    """The layers with absolute names for files that are named from `folder`."""
    names = unread_files(layers)
    return with_measurements(layers, {name: Measurement(full_path(name, folder)) for name in names})


def _with_measurement(layer: Layer, found: Mapping[str, Measurement]) -> Layer:
    there = measurement_in(layer)
    if there is None or there.is_read or there.file not in found:
        return layer
    read = found[there.file]
    if there.is_import and read.is_read and layer.model.name == "measured":
        layer = layer.replace(model=HIGHLIGHT_MODELS[read.highlight])
    return layer.with_parameter(FILE, read)


# ------------------------------------------------------------------------------------------------------------ images


def image_name(path: Path, source: str) -> str:
    """The name of a file in a document of the scene `source`: its path in the scene's folder where it is inside, so
    that the folder can move, else the absolute path."""
    folder = scene_folder(source)
    full = resolved(path)
    return full.relative_to(folder).as_posix() if full.is_relative_to(folder) else str(full)


def with_full_names(layers: Layers, source: str) -> Layers:
    """The layers with absolute names of their images, for another scene or the library."""
    return _with_image_names(layers, lambda name: str(resolved(named_in(scene_folder(source), name))))


def with_scene_names(layers: Layers, source: str) -> Layers:
    """The layers with the names that documents of the scene `source` have for their images."""
    return _with_image_names(layers, lambda name: image_name(named_in(scene_folder(source), name), source))


def variant_with_scene_names(variant: Variant, source: str) -> Variant:
    """The same of a whole material."""

    def renamed(name: str) -> str:
        return renamed_image(name, lambda file: image_name(named_in(scene_folder(source), file), source))

    bumps, opacity = variant.bumps, variant.opacity
    if bumps is not None:
        bumps = bumps.with_files(renamed)
    if opacity is not None:
        opacity = replace(opacity, opacity_map=opacity.opacity_map and renamed(opacity.opacity_map))
    return replace(variant, layers=with_scene_names(variant.layers, source), bumps=bumps, opacity=opacity)


def renamed_image(name: str, new_name: Callable[[str], str]) -> str:
    """An image's file under a new name; its number in that file stays."""
    file, number = split_image_name(name)
    return new_name(file) if number is None else f"{new_name(file)}#{number}"


def _with_image_names(layers: Layers, new_name: Callable[[str], str]) -> Layers:
    """Every file under a new name."""

    def renamed(name: str) -> str:
        return renamed_image(name, new_name)

    return tuple(
        layer if layer.maps.is_plain and not layer.parameter_maps
        else layer.replace(
            maps=layer.maps.with_files(renamed), parameter_maps=with_map_files(layer.parameter_maps, renamed)
        )
        for layer in layers
    )  # fmt: skip


def with_file_names(state: ObjectState, new_name: Callable[[str], str], new_path: Callable[[str], str]) -> ObjectState:
    """An object with other names of the files that the user gave it: of images by new_name, of measured BRDFs and of a
    mesh that was added by new_path."""

    def renamed(name: str) -> str:
        return renamed_image(name, new_name)

    def measured(layer: Layer) -> Layer:
        there = measurement_in(layer)
        return layer if there is None else layer.with_parameter(FILE, replace(there, file=new_path(there.file)))

    bumps, opacity, surface, added = state.new_bumps, state.new_opacity, state.new_surface, state.added
    if opacity is not None:
        opacity = replace(opacity, opacity_map=opacity.opacity_map and renamed(opacity.opacity_map))
    if added is not None:
        texture = added.emission_texture.with_files(lambda name: renamed_image(name, new_path))
        added = added.model_copy(update={"mesh": added.mesh and new_path(added.mesh), "emission_texture": texture})
    return replace(
        state, added=added, layers=tuple(map(measured, _with_image_names(state.layers, new_name))),
        new_bumps=None if bumps is None else bumps.with_files(renamed), new_opacity=opacity,
        new_surface=None if surface is None else surface.with_files(renamed),
    )  # fmt: skip


def scene_folder(source: str) -> Path:
    """The folder of a built-in scene or a scene file."""
    return resolved(scene_file(source)).parent


# ----------------------------------------------------------------------------------------------------- all of these


def files_of_document(document: Document, known: Document | None = None) -> set[Path]:
    """All of these files, whether they exist or not; without what `known` has as well."""
    before = None if known is None or known.source != document.source else known
    found = set[Path]() if before is not None else files_of_scene(document.source)
    shown = () if before is None else {light.environment for light in lights_of_looks(before)}
    for light in (each for each in lights_of_looks(document) if each.environment not in shown):
        builtin = builtin_environments().get(light.environment)
        found.update([builtin] if builtin else [Path(light.environment)] if light.is_file else [])
    pictures = set() if before is None else {each for light in lights_of_looks(before) for each in light.painted}
    painted = (each for light in lights_of_looks(document) for each in light.painted if each not in pictures)
    found.update(Path(each.file) for each in painted if each.file)
    unchanged = set() if before is None else set(map(id, objects_of_looks(before)))
    changed = [state for state in objects_of_looks(document) if id(state) not in unchanged]
    names = {name for state in changed for name in names_of_object(state)}
    folder = scene_folder(document.source) if names else Path()
    return found | {named_in(folder, name) for name in names}


def names_of_object(state: ObjectState) -> Iterator[str]:
    """The files that an object names, absolute or relative to the scene's folder."""
    if state.added is not None and state.added.mesh is not None:
        yield state.added.mesh
    images = [name for bumps in (state.own_bumps, state.bumps) for _, name in bumps.files]
    images += [name for _, name in state.emission_texture.files]
    images += [state.own_opacity.opacity_map, state.opacity.opacity_map]
    images += [name for surface in (state.own_surface, state.surface) for _, name in surface.files]
    for layer in state.layers:
        images += [name for _, name in layer.maps.files]
        images += [each.image.file for each in layer.parameter_maps]
        measurement = measurement_in(layer)
        if measurement is not None:
            yield measurement.file
    yield from (split_image_name(name)[0] for name in images if name)
