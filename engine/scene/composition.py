"""Which objects a scene has that does not have those of its file: duplicates, other names, objects of its own."""

from __future__ import annotations

from dataclasses import dataclass

from engine.scene.description import ObjectDescription


@dataclass(frozen=True)
class SceneObject:
    """An object of a composed scene. source: the name of an object of the scene's file, or the description of one that
    the file does not have, whose files are named by full paths."""

    name: str
    source: str | ObjectDescription


Composition = tuple[SceneObject, ...]  # in their order; empty for a scene as its file has it
