"""Loads the images of a scene's objects, so that errors in them are reported at once.

An image that a mesh file brings may be damaged inside, which only decoding tells: its material is then shown without
it, as white, or without its emission, and the image is listed as not shown. An image that the scene file or the user
names is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from engine.core.errors import LoadError
from engine.core.safe_files import resolve_inside
from engine.material.bumps import NO_BUMPS, Bumps
from engine.material.layer_maps import ChannelImage, Images, LayerMaps, split_image_name
from engine.scene.description import ObjectDescription
from engine.scene.loaders.gltf_materials import without_images
from engine.scene.loaders.model import UnshownProperty

if TYPE_CHECKING:
    from engine.scene.scene_loader import Scene


def load_images(scene: Scene, is_imported: Sequence[bool]) -> Scene:
    """The scene with all images loaded, without those of imported materials that are damaged; is_imported: whose
    objects' materials are their files' own. Raises LoadError."""
    try:
        _load(scene)
        return scene
    except LoadError:
        faults = dict[str, LoadError]()
        with scene.textures.open_files():
            for described, imported in zip(scene.description.objects, is_imported, strict=True):
                faults |= _faults(scene, described) if imported else {}
        objects = tuple(
            _without(described, faults) if imported else described
            for described, imported in zip(scene.description.objects, is_imported, strict=True)
        )
        listed = [UnshownProperty("images", 1, f"shown as white: {error}") for error in map(_reason, faults.items())]
        description = scene.description.model_copy(update={"objects": objects})
        scene = replace(scene, description=description, unshown=(*scene.unshown, *listed))
        _load(scene)
        return scene


def check_image_places(scene: Scene) -> None:
    """Raise LoadError for an image outside the scene's folder: a scene file may name only files in it; only the user
    may choose full paths."""
    for described in scene.description.objects:
        for what, name in _images_of(described):
            resolve_inside(scene.folder, split_image_name(name)[0], scene.file, what)
        for what, name in described.deform.files:
            resolve_inside(scene.folder, name, scene.file, what)


def _images_of(described: ObjectDescription) -> list[tuple[str, str]]:
    """What each image of an object's material is, and its name."""
    layers = [*described.layers, *(layer for variant in described.variants for layer in variant.layers)]
    files = [file for variant in described.variants for file in variant.files]
    files += [file for layer in layers for file in layer.maps.files]
    files += [
        (f"{name} map", str(each.get("map", ""))) for layer in layers for name, each in layer.parameter_maps.items()
    ]
    files += [("opacity_map", described.opacity.opacity_map)] if described.opacity.opacity_map else []
    files += [] if described.is_lamp else described.bumps.files
    return [*files, *described.emission_texture.files]


def _load(scene: Scene) -> None:
    """Read all images. Textures and weights of other variants are read when these are chosen."""
    wanted, bumps, opacities, channels = [], [], [], []
    for described in scene.description.objects:
        every = [*described.layers, *(layer for variant in described.variants for layer in variant.layers)]
        wanted += [layer.maps.images for layer in described.layers if not layer.maps.is_plain]
        wanted += [Images(weight=name) for _, name in described.deform.files]
        wanted += [described.emission_texture.images] if described.emission_texture.is_of_files else []
        channels += [
            ChannelImage(str(each.get("map", ""))) for layer in every for each in layer.parameter_maps.values()
        ]
        opacities.append(described.opacity)
        bumps += [] if described.is_lamp else [described.bumps, described.bumps.of_coat]
    scene.textures.load(wanted, bumps, opacities, channels)


def _faults(scene: Scene, described: ObjectDescription) -> dict[str, LoadError]:
    """The images of an object's material that cannot be decoded, by their names."""
    found = {}
    for name, read in _readers(scene, described):
        try:
            read()
        except LoadError as error:
            found[name] = error
    return found


def _readers(scene: Scene, described: ObjectDescription) -> Iterator[tuple[str, Callable[[], object]]]:
    store = scene.textures
    for layer in (*described.layers, *(each for variant in described.variants for each in variant.layers)):
        for _, name in layer.maps.files:
            yield name, partial(store.texture, Images(name, "linear"))
        for table in layer.parameter_maps.values():
            yield str(table["map"]), partial(store.numbers, ChannelImage(str(table["map"])))
    for bumps in (described.bumps, described.bumps.of_coat):
        if bumps.file:
            yield bumps.file, partial(store.slopes, bumps)
    if described.emission_texture.is_of_files:
        yield described.emission_texture.texture, partial(store.texture, described.emission_texture.images)
    if described.opacity.opacity_map:
        yield described.opacity.opacity_map, partial(store.opacity, described.opacity)


def _without(described: ObjectDescription, faults: dict[str, LoadError]) -> ObjectDescription:
    """The object without these images."""
    variants = tuple(
        each.model_copy(update={"layers": without_images(each.layers, faults)}) for each in described.variants
    )
    opacity, shines = described.opacity, described.emission_texture.texture not in faults
    return described.model_copy(
        update={
            "layers": without_images(described.layers, faults), "variants": variants,
            "bumps": _bumps_without(described.bumps, faults),
            "emission": described.emission if shines or described.unlit else None,
            "emission_texture": described.emission_texture if shines else LayerMaps(),
            "opacity": replace(opacity, opacity_map="") if opacity.opacity_map in faults else opacity,
        }
    )  # fmt: skip


def _bumps_without(bumps: Bumps, faults: dict[str, LoadError]) -> Bumps:
    left = NO_BUMPS.with_coat(bumps.of_coat) if bumps.file in faults else bumps
    return left.with_coat(NO_BUMPS) if left.coat_normal_map in faults else left


def _reason(fault: tuple[str, LoadError]) -> str:
    return f"{fault[0]}: {fault[1].reason}"
