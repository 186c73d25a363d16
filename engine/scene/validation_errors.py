"""Converts pydantic's errors to one line of ours: the place in the file, what was found, what was expected."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from engine.core.errors import LoadError

_PREFIXES = ("Input should be ", "Value should have ", "Tuple should have ", "String should have ")
_MESSAGES = {"tuple_type": "a list", "model_type": "a table", "bool_type": "true or false", "string_type": "a string",
             "int_type": "an integer", "float_type": "a number", "dict_type": "a table"}  # fmt: skip


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
