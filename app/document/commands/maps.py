"""Edits of a layer's texture and weight map (`engine.material.layer_maps`), and the names of files in documents."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.document.commands.layers import editable_layer
from app.document.document import Document
from app.document.linked_layers import Layers
from engine.core.safe_files import resolved
from engine.material.layer_maps import set_map_field, split_image_name
from engine.scene.builtin import scene_path

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".exr")


@dataclass(frozen=True)
class SetMap:
    """Set a part of a layer's maps; an image's name of "" removes it."""

    key: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.key} {self.name.replace('_', ' ')}"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        return document.with_layer(self.key, layer.replace(maps=set_map_field(layer.maps, self.name, self.value)))


def image_name(path: Path, source: str) -> str:
    """The name of a file in a document of the scene `source`: its path in the scene's folder where it is inside, so
    that the folder can move, else the absolute path."""
    folder = scene_folder(source)
    full = resolved(path)
    return full.relative_to(folder).as_posix() if full.is_relative_to(folder) else str(full)


def with_full_names(layers: Layers, source: str) -> Layers:
    """The layers with absolute names of their images, for another scene or the library."""
    return _renamed(layers, lambda name: str(resolved(scene_folder(source) / name)))


def with_scene_names(layers: Layers, source: str) -> Layers:
    """The layers with the names that documents of the scene `source` have for their images."""
    return _renamed(layers, lambda name: image_name(scene_folder(source) / name, source))


def _renamed(layers: Layers, new_name: Callable[[str], str]) -> Layers:
    """Every file under a new name; of a picture in a GLB file its number stays."""

    def renamed(name: str) -> str:
        file, number = split_image_name(name)
        return "" if not name else new_name(file) if number is None else f"{new_name(file)}#{number}"

    return tuple(
        layer if layer.maps.is_plain
        else layer.replace(maps=replace(
            layer.maps, texture=renamed(layer.maps.texture), weight=renamed(layer.maps.weight)
        ))
        for layer in layers
    )  # fmt: skip


def scene_folder(source: str) -> Path:
    """The folder of a built-in scene or a scene file."""
    return resolved(scene_path(source)).parent
