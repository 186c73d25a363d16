"""Edits of a layer's texture and weight map (`engine.material.maps`), and the names that documents have for files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.document import Document
from engine.errors import InsituError
from engine.material.maps import set_map_field
from engine.scene.builtin import builtin_scenes

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".exr")


@dataclass(frozen=True)
class SetMap:
    """Give a part of a layer's maps a value; an image's name of "" takes it away."""

    key: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.key} {self.name.replace('_', ' ')}"

    def apply(self, document: Document) -> Document:
        layer = document.layer(self.key)
        if document.is_frozen(self.key):
            raise InsituError(f"{self.key} is frozen; thaw it to edit it")
        return document.with_layer(self.key, layer.replace(maps=set_map_field(layer.maps, self.name, self.value)))


def image_name(path: Path, source: str) -> str:
    """What a document of the scene `source` calls a file: by its place in the scene's folder where it stands there, so
    that the folder can move, else in full."""
    folder = scene_folder(source)
    full = path.resolve()
    return full.relative_to(folder).as_posix() if full.is_relative_to(folder) else str(full)


def scene_folder(source: str) -> Path:
    """The folder of a built-in scene or a scene file."""
    return (builtin_scenes().get(source) or Path(source)).resolve().parent
