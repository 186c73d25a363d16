"""A key of all that a project's picture depends on: a project whose picture may differ has another key.

It is made of every field of the project, whatever fields are added, so that none can be forgotten; a value of an
unknown kind is an error and not left out. Files that are read again while a picture is drawn count by their contents.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from app.document.named_files import files_of_document
from app.project.project import Project
from app.worker.cache import KeyPart, content_key
from engine.material.model import Model
from engine.texture.texture_store import TextureStore


def picture_key(project: Project, *settings: object) -> str:
    """The key of a project, and of the settings of its drawing."""
    files = project.scene.files | files_of_document(project.document)
    return content_key(parts_of(project), parts_of(settings), tuple(_contents(file) for file in sorted(files)))


def parts_of(value: object) -> KeyPart:
    """A value as a part of a cache key, field by field. Raises TypeError for one of an unknown kind."""
    match value:
        case None | str() | bool() | int() | float() | bytes() | np.ndarray():
            return value
        case np.generic():
            return np.asarray(value)
        case Path():
            return str(value)
        case Enum():
            return type(value).__name__, value.name
        case Model():
            return value.name  # there is one instance of each
        case TextureStore():
            return None  # what was read already; its files count by their contents
        case BaseModel():
            return _named(value, type(value).model_fields)
        case tuple() | list():
            return tuple(map(parts_of, value))
        case set() | frozenset():
            return tuple(sorted(content_key(parts_of(each)) for each in value))
        case Mapping():
            return tuple((parts_of(key), parts_of(each)) for key, each in value.items())
    if dataclasses.is_dataclass(value):
        return _named(value, [field.name for field in dataclasses.fields(value)])
    raise TypeError(f"{type(value).__name__} in what a picture depends on: say how it counts")


def _named(value: object, names: Iterable[str]) -> KeyPart:
    return type(value).__name__, tuple((name, parts_of(getattr(value, name))) for name in names)


def _contents(file: Path) -> KeyPart:
    """The content of a file, by its name; None where it cannot be read, which its reader reports."""
    try:
        with file.open("rb") as opened:
            return str(file), hashlib.file_digest(opened, "blake2b").digest()
    except (OSError, ValueError):
        return str(file), None
