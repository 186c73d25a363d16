"""TOML in and out: reading with the standard library's parser, and the writer that it lacks.

Whatever a file holds ends as a tree of plain values or as one LoadError; what the tree means is for pydantic models.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from engine.errors import LoadError
from engine.scene.files import read_regular_file


def load_toml(path: Path, max_bytes: int) -> dict[str, Any]:
    """The tree of a TOML file; LoadError when it is not a regular file, too large, or not TOML."""
    data = read_regular_file(path, max_bytes)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise LoadError(path, f"byte {error.start}", hex(data[error.start]), "UTF-8 text") from None
    except RecursionError:
        raise LoadError(path, "nesting", "too deep", "a TOML file with a few levels") from None
    except ValueError as error:
        raise LoadError(path, "TOML", str(error), "a valid TOML file") from None


def check_version(tree: Mapping[str, Any], file: Path, supported: int) -> None:
    """Refuse a file of another version; one from the future says so."""
    version = tree.get("version")
    if isinstance(version, int) and version > supported:
        raise LoadError(file, "version", f"{version} (made by a newer version)", f"version {supported}")
    if version != supported or isinstance(version, bool):
        raise LoadError(file, "version", "nothing" if version is None else version, str(supported))


def toml_lines(values: Mapping[str, Any]) -> list[str]:
    """``key = value`` lines; keys at None are left out."""
    return [f"{_key(key)} = {toml_value(value)}" for key, value in values.items() if value is not None]


def toml_value(value: object) -> str:
    """A TOML value; floats in the shortest form that reads back the same."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        plain = value.isprintable() and '"' not in value and "\\" not in value  # a map's strokes are a megabyte
        return f'"{value}"' if plain else '"' + "".join(_escape(character) for character in value) + '"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(toml_lines(value)) + " }"
    if isinstance(value, Iterable):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    raise TypeError(f"{type(value).__name__} has no form in TOML")


def _key(key: str) -> str:
    bare = key.isascii() and key.replace("_", "a").replace("-", "a").isalnum()
    return key if bare else toml_value(key)


def _escape(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08x}"
