"""TOML in and out: reads with the standard library's parser, adds the writer that it lacks, and states pydantic's
errors in one line of ours.

All TOML that Insitu reads passes through `parse_toml`: any text becomes either a tree of plain values or one LoadError;
pydantic models interpret the tree. The parser's memory grows with the square of a key's parts, and its stack with each
bracket, so both are counted before it sees the text.

tomli-w was tried for writing: it gives each number of an array a line of its own, so that a colour takes five lines and
a transform eighteen in files that people read, and takes 43 ms for a map's strokes of a megabyte, ours 3 ms.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from engine.core.errors import InsituError, LoadError
from engine.core.safe_files import read_regular_file

MAX_PARTS = 16
MAX_LEVELS = 16
MAX_WORD = 256  # no number is longer: beyond it are integers that cannot even be printed

# Strings and comments as single tokens, so that their content does not count; an unclosed one extends to where the
# parser fails. Nothing is matched twice: every repetition is possessive.
_TOKEN = re.compile(
    r"""
      \"""(?:[^"\\]++|\\.?|"(?!""))*+(?:"{3,5}|\Z)
    | '''(?:[^']++|'(?!''))*+(?:'{3,5}|\Z)
    | "(?:[^"\\\n]++|\\[^\n]?)*+"?
    | '[^'\n]*+'?
    | \#[^\n]*+
    | [\[\]{}=,.\n]
    | [^\s\[\]{}=,."'\#]++
    """,
    re.VERBOSE | re.DOTALL,
)

# How pydantic's messages begin, and what replaces some of them.
_PREFIXES = ("Input should be ", "Value should have ", "Tuple should have ", "String should have ")
_MESSAGES = {"tuple_type": "a list", "model_type": "a table", "bool_type": "true or false", "string_type": "a string",
             "int_type": "an integer", "float_type": "a number", "dict_type": "a table"}  # fmt: skip


def load_toml(path: Path, max_bytes: int) -> dict[str, Any]:
    """The tree of a TOML file; LoadError if it is not a regular file, too large, or not TOML."""
    return parse_toml_bytes(read_regular_file(path, max_bytes), path)


def parse_toml_bytes(data: bytes, path: Path) -> dict[str, Any]:
    """The tree of a TOML file's bytes; LoadError if they are not TOML."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise LoadError(path, f"byte {error.start}", hex(data[error.start]), "UTF-8 text") from None
    return parse_toml(text, path)


def parse_toml(text: str, file: str | Path) -> dict[str, Any]:
    """The tree of a TOML text, called `file` in LoadError."""
    _check_depth(text, file)
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise LoadError(file, "TOML", str(error), "a valid TOML file") from None


def _check_depth(text: str, file: str | Path) -> None:
    """Raise LoadError for a key of many parts, for deeply nested brackets and for endless words."""
    parts, levels, begin = 1, 0, 0
    for token in _TOKEN.finditer(text):
        kind = text[token.start()]
        if kind in "[]{}=,\n":
            levels = max(levels + (kind in "[{") - (kind in "]}"), 0)
            parts, begin = 1, token.end()
            if levels > MAX_LEVELS:
                raise _too_much(text, token.start(), file, "brackets", f"at most {MAX_LEVELS} in each other")
        elif kind == ".":
            parts += 1
            if parts > MAX_PARTS:
                raise _too_much(text, begin, file, "key", f"at most {MAX_PARTS} parts")
        elif kind not in "\"'#" and token.end() - token.start() > MAX_WORD:
            raise _too_much(text, token.start(), file, "word", f"at most {MAX_WORD} characters")


def _too_much(text: str, place: int, file: str | Path, what: str, expected: str) -> LoadError:
    line = text.count("\n", 0, place) + 1
    return LoadError(file, f"line {line}: {what}", text[place : place + MAX_WORD].strip(), expected)


def check_version(tree: Mapping[str, Any], file: str | Path, supported: int) -> None:
    """Reject a file of another version; the message says if it is newer than this program."""
    version = tree.get("version")
    if isinstance(version, int) and version > supported:
        raise LoadError(file, "version", f"{version} (made by a newer version)", f"version {supported}")
    if version != supported or isinstance(version, bool):
        raise LoadError(file, "version", "nothing" if version is None else version, str(supported))


def toml_lines(values: Mapping[str, Any]) -> list[str]:
    """``key = value`` lines; keys with None are left out."""
    return [f"{_key(key)} = {toml_value(value)}" for key, value in values.items() if value is not None]


def toml_value(value: object) -> str:
    """A TOML value; floats in the shortest form that reads back the same. InsituError for a text that no file can
    store: one with an unpaired surrogate."""
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
    if "\ud800" <= character <= "\udfff":
        raise InsituError(f"a text with the character {ascii(character)}, which no file can hold")
    return character if character.isprintable() else f"\\U{ord(character):08x}"


def first_validation_error(
    error: ValidationError, tree: dict[str, Any], file: str | Path, model: type[BaseModel]
) -> LoadError:
    """The first error in the tree of a file that should become `model`."""
    first = error.errors()[0]
    location = list(first["loc"])
    if first["type"] == "value_error":
        key, separator, expected = str(first["ctx"]["error"]).rpartition(": ")
        location += [key] if separator else []
        return LoadError(file, _place(location, tree), _found(location, tree), expected)
    if first["type"] == "missing":
        return LoadError(file, _place(location, tree), "nothing", "a value")
    if first["type"] == "extra_forbidden":
        return LoadError(file, _place(location, tree), first["input"], f"one of {_known_keys(location, model)}")
    return LoadError(file, _place(location, tree), first["input"], _expected(dict(first)))


def _expected(first: dict[str, Any]) -> str:
    """What pydantic expected, without its preamble."""
    if first["type"] in ("too_short", "too_long"):
        words = (("at least", "min_length"), ("at most", "max_length"))
        return " and ".join(f"{text} {first['ctx'][key]} items" for text, key in words if key in first["ctx"])
    message = _MESSAGES.get(first["type"], str(first["msg"]))
    for prefix in _PREFIXES:
        message = message.removeprefix(prefix)
    return message


def _known_keys(location: list[int | str], model: type[BaseModel]) -> str:
    """The keys of the table that contains the unknown one."""
    for part in location[:-1]:
        fields = {field.alias or key: field for key, field in model.model_fields.items()}
        if part in fields:
            model = _inner_model(fields[part].annotation) or model
    return ", ".join(field.alias or key for key, field in model.model_fields.items())


def _inner_model(annotation: Any) -> type[BaseModel] | None:
    """The model inside `Model`, `Model | None` or `tuple[Model, ...]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for inner in get_args(annotation) if (found := _inner_model(inner))), None)


def _place(location: list[int | str], tree: dict[str, Any]) -> str:
    """`object 2 'ball': transform 3`: the path to a value with the names of the objects on it."""
    words: str = ""
    node: Any = tree
    for part in location:
        node = _descend(node, part)
        if isinstance(part, int):
            name = node.get("name") if isinstance(node, dict) else None
            words += f" {part}" + (f" {name!r}" if isinstance(name, str) else "")
        elif part != "parameters":  # the models collect a layer's own keys under this name
            words += (": " if words else "") + part
    return words


def _found(location: list[int | str], tree: dict[str, Any]) -> object:
    """The value at a location, or "nothing"."""
    node: Any = tree
    for part in location:
        if part != "parameters":
            node = _descend(node, part)
    return "nothing" if node is None else node


def _descend(node: Any, part: int | str) -> Any:
    """One step down a tree of dicts and lists; None if there is nothing."""
    if isinstance(part, int):
        return node[part] if isinstance(node, (list, tuple)) and part < len(node) else None
    if part == "parameters":
        return node
    return node.get(part) if isinstance(node, dict) else None
