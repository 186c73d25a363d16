"""Materials of MaterialX: .mtlx files, each material on a ball of its own, and networks in other files.

A file opened by itself is rows of balls, objects with the names of the materials, on the floor of meshes that are
opened alone. Patterns in space are those on the ball, by its texture coordinates, also where an object of another shape
gets the material. Images that a network computes are named `FILE.mtlx#N`; they are computed again whenever they are
read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from engine.core.errors import LoadError, printable_name
from engine.core.safe_files import read_regular_file
from engine.scene.import_report import merge_unshown
from engine.scene.loaders.baked_maps import BakedMap, MapMaker
from engine.scene.loaders.graph_fields import Array, Field
from engine.scene.loaders.graph_nodes import ImageSource, ImageValues
from engine.scene.loaders.image_files import FileImages
from engine.scene.loaders.model import ImportedModel, ImportedPart, UnshownProperty
from engine.scene.loaders.mtlx_library import complete_document, complete_network
from engine.scene.loaders.mtlx_surfaces import surface_material
from engine.scene.loaders.mtlx_xml import read_document
from engine.scene.loaders.shader_graph import NetworkNode
from engine.scene.loaders.surface_parts import SurfaceMaterial
from engine.scene.mesh import place_copies
from engine.scene.primitives import sphere, sphere_places
from engine.texture.texture_files import (
    MAX_IMAGE_BYTES,
    has_alpha,
    image_size,
    read_image,
    read_opacity,
    reduction,
)

MOST_MATERIALS = 256
_GAP = 1.25  # between the centres of balls of diameter 1
_LONGEST_NAME = 120
_ON_BALL = Field(lambda samples: sphere_places(samples.uv).astype(np.float32), is_pattern=True)


@dataclass(frozen=True)
class NamedMaterial:
    """A material of a file, by its name there."""

    name: str
    material: SurfaceMaterial


@dataclass(frozen=True)
class MtlxFile:
    """The materials of a file, the maps that their images "#N" are, and what could not be included in it."""

    materials: tuple[NamedMaterial, ...]
    maps: tuple[BakedMap, ...] = ()
    unshown: tuple[UnshownProperty, ...] = ()


def read_materials(file: Path) -> MtlxFile:
    """The materials of a .mtlx file. Raises LoadError."""
    document = read_document(file)
    found = complete_document(document.xml, file)
    if not found:
        raise LoadError(file, "materials", 0, "at least one material or surface shader")
    if len(found) > MOST_MATERIALS:
        raise LoadError(file, "materials", len(found), f"at most {MOST_MATERIALS}")
    maps, images = MapMaker(), folder_images(file.parent)
    materials = []
    for each in found:
        try:
            material = surface_material(each.surface, images, maps, _ON_BALL)
        except RecursionError:
            raise LoadError(file, f"material {each.name!r}", "nodes too deep", "a network of fewer nodes") from None
        if each.is_displaced:
            effect = "the surface is where the mesh is"
            displaced = UnshownProperty("materials.displacementshader", 1, effect)
            material = replace(material, unshown=(*material.unshown, displaced))
        materials.append(NamedMaterial(printable_name(each.name, _LONGEST_NAME), material))
    return MtlxFile(tuple(materials), tuple(maps.maps), document.unshown)


def read_mtlx(file: Path) -> ImportedModel:
    """A .mtlx file as a row of balls, or several rows. Raises LoadError."""
    read = read_materials(file)
    ball, parts = sphere(), []
    n_columns = math.ceil(math.sqrt(len(read.materials)))
    for k, each in enumerate(read.materials):
        place = np.eye(4)
        place[:3, 3] = _GAP * (k % n_columns), 0.5, _GAP * -(k // n_columns)
        own = each.material
        parts.append(
            ImportedPart(
                place_copies(ball, place[None]), own.layers, own.emission, bumps=own.bumps,
                opacity=own.opacity, name=each.name,
            )
        )  # fmt: skip
    unshown = [*read.unshown, *(found for each in read.materials for found in each.material.unshown)]
    return ImportedModel(tuple(parts), unshown=merge_unshown(unshown))


def mtlx_image_reader(file: Path) -> Callable[[int], bytes]:
    """A function from the number of a computed map to its bytes, an OpenEXR file; both raise LoadError."""
    maps = read_materials(file).maps

    def read(number: int) -> bytes:
        if number >= len(maps):
            raise LoadError(file, "computed map", number, f"a number below {len(maps)}")
        return maps[number].exr()

    return read


def read_network(
    nodes: Sequence[NetworkNode], surface: str, images: ImageSource, maps: MapMaker, file: Path
) -> SurfaceMaterial:
    """The material of a network that another file has, whose surface is the node of that name. Raises LoadError that
    names `file`."""
    return surface_material(complete_network(nodes, surface, file), images, maps)


def folder_images(folder: Path) -> NamedImages:
    """The images of a folder, by their names from there."""
    files = FileImages(folder)
    return NamedImages(
        lambda name: read_regular_file(folder / name, MAX_IMAGE_BYTES), lambda name: files.find(folder, name)
    )


class NamedImages:
    """Images by the names that stand in a network (`ImageSource`). read: the bytes of one by its name in layers; find:
    that name; both raise LoadError."""

    def __init__(self, read: Callable[[str], bytes], find: Callable[[str], str]) -> None:
        self._read, self._find = read, find
        self._sizes: dict[str, tuple[int, int]] = {}

    def size(self, name: str) -> tuple[int, int]:
        if name not in self._sizes:
            file = self.file(name)
            data = self._read(file)
            size = image_size(data, file)
            if size is None:  # OpenEXR
                height, width = read_image(data, file, lambda values: np.asarray(values, np.float32)).shape[:2]
                size = width, height
            k = reduction(*size)
            self._sizes[name] = size[0] // k, size[1] // k
        return self._sizes[name]

    def file(self, name: str) -> str:
        return self._find(name)

    def values(self, name: str) -> ImageValues:
        file = self.file(name)
        data = self._read(file)
        kinds: list[Any] = []

        def shares(values: np.ndarray[Any, Any]) -> Array:
            kinds.append(values.dtype)
            most = {"uint8": 255.0, "uint16": 65535.0}.get(values.dtype.name, 1.0)
            return np.asarray(values, np.float32) / np.float32(most)

        texels = read_image(data, file, shares)
        if has_alpha(data, file):
            texels = np.concatenate([texels, read_opacity(data, file)], axis=2)
        return ImageValues(texels, kinds[0] == np.float32)
