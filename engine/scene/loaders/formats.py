"""Formats of geometry: the reader of each, by the suffix of the file's name.

A reader is imported when a file of its format is first read, and only in the worker: the window's process needs the
suffixes alone (`engine.scene.mesh.MESH_ENDINGS`).
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from engine.core.errors import LoadError
from engine.scene.loaders.model import ImportedModel
from engine.scene.mesh import MESH_ENDINGS, has_area

# The module, in this package, and its function, from a path to an `ImportedModel`.
_READERS = {
    ".glb": ("gltf", "read_gltf"),
    ".gltf": ("gltf", "read_gltf"),
    ".obj": ("obj", "read_obj"),
    ".ply": ("ply", "read_ply"),
    ".off": ("off", "read_off"),
    ".stl": ("stl", "read_stl"),
    ".3mf": ("threemf", "read_3mf"),
    ".dae": ("dae", "read_dae"),
    ".mtlx": ("mtlx", "read_mtlx"),
    ".usd": ("usd", "read_usd"),
    ".usda": ("usd", "read_usd"),
    ".usdc": ("usd", "read_usd"),
    ".usdz": ("usd", "read_usd"),
}


def read_model(file: Path, variants: Mapping[str, str] = MappingProxyType({})) -> ImportedModel:
    """Read a file of geometry, a stage of USD with these variants of its sets; parts of which no face has an area are
    left out, with a note, where there are others. Raises LoadError."""
    if file.suffix.lower() not in _READERS:
        raise LoadError(file, "type", file.suffix or file.name, f"a mesh of type {', '.join(MESH_ENDINGS)}")
    module, function = _READERS[file.suffix.lower()]
    if variants and module != "usd":
        raise LoadError(file, "set of variants", next(iter(variants)), "none: only stages of USD have some")
    read = getattr(importlib.import_module(f"{__package__}.{module}"), function)
    model: ImportedModel = read(file, variants) if variants else read(file)
    flat = {id(part) for part in model.parts if not has_area(part.mesh)}
    if not flat or len(flat) == len(model.parts):
        return model
    parts = tuple(part for part in model.parts if id(part) not in flat)
    names = ", ".join(part.name or "one without a name" for part in model.parts if id(part) in flat)
    return replace(
        model, parts=parts, notes=(*model.notes, f"parts of which no face has an area are left out: {names}")
    )
