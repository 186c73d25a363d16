"""Formats of geometry: the reader of each, by the suffix of the file's name.

A reader is imported when a file of its format is first read, and only in the worker: the window's process needs the
suffixes alone (`engine.scene.mesh.MESH_ENDINGS`).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from engine.core.errors import LoadError
from engine.scene.loaders.model import ImportedModel, ImportedPart
from engine.scene.mesh import MESH_ENDINGS, read_mesh_file

Reader = Callable[[Path], ImportedModel]


def read_model(file: Path) -> ImportedModel:
    """Read a file of geometry; raises LoadError."""
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise LoadError(file, "type", file.suffix or file.name, f"a mesh of type {', '.join(MESH_ENDINGS)}")
    return reader(file)


def _read_gltf(file: Path) -> ImportedModel:
    from engine.scene.loaders.gltf import read_glb

    return read_glb(file)


def _read_mesh(file: Path) -> ImportedModel:
    """A mesh without materials."""
    found = read_mesh_file(file)
    return ImportedModel((ImportedPart(found.mesh),), found.notes, unread=found.materials)


_READERS: dict[str, Reader] = {".glb": _read_gltf, ".ply": _read_mesh, ".obj": _read_mesh}
