"""Scripts of edits for ``insitu screenshot --script``: a TOML list of ``[[step]]``, each one action of a user.

    [[step]]
    select = "teapot.1.theta_h"
    [[step]]
    drag = { item = "curve.b", by = [40, -25] }
    [[step]]
    wait = "exact"

A step has one key, the name of an operator that scripts have (`app.operators.registry`), and its value. The whole
script is read and checked before its first step runs. The owner of the window carries the steps out, with the same
mouse events and operators as a user's.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, create_model, model_validator

from app.files.bookmarks import MAX_NAME, is_name
from app.files.old_names import upgrade_script
from app.operators.operator import ValueRecord
from app.operators.registry import OPERATORS
from engine.core.errors import LoadError
from engine.core.safe_files import resolved
from engine.scene.toml_text import first_validation_error, load_toml

MAX_SCRIPT_BYTES = 2**20
MAX_STEPS = 10_000
# The steps that write a file, and how its name may end; a folder's as it likes.
WRITTEN_FILES: dict[str, tuple[str, ...]] = {
    "capture": (".png",), "picture": (".png", ".exr"), "save_as": (".insitu",), "save_scene": (), "export_scene": ()
}  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One step: the name of an operator, and the value that it is carried out with. Files are absolute paths."""

    name: str
    value: Any


class _OneKey(ValueRecord):
    @model_validator(mode="after")
    def _has_one_key(self) -> _OneKey:
        if len(self.model_fields_set) != 1:
            raise ValueError(f"exactly one of {', '.join(type(self).model_fields)}")
        return self


# One step: exactly one of its keys.
_FIELDS: dict[str, Any] = {
    name: (Annotated[each.script.value | None, Field(description=each.script.meaning)], None)
    for name, each in OPERATORS.items()
    if each.script is not None
}
StepRecord = create_model("StepRecord", __base__=_OneKey, **_FIELDS)


class ScriptRecord(ValueRecord):
    """A whole script."""

    steps: Annotated[
        tuple[StepRecord, ...],  # type: ignore[valid-type]
        Field(alias="step", min_length=1, max_length=MAX_STEPS, description="Each `[[step]]` is one: see below."),
    ]


def load_script(path: Path, folder: Path | None = None) -> tuple[Step, ...]:
    """Read and check a script; files that it writes go to ``folder`` (default: the script's own).

    Raises LoadError that names the step and the key of the first error.
    """
    tree = load_toml(path, MAX_SCRIPT_BYTES)
    return parse_script(tree, path, resolved(path).parent if folder is None else folder)


def parse_script(tree: dict[str, Any], file: Path, folder: Path) -> tuple[Step, ...]:
    """The steps of a script's tree."""
    tree = upgrade_script(tree)
    try:
        record = ScriptRecord.model_validate(tree)
    except ValidationError as error:
        raise first_validation_error(error, tree, file, ScriptRecord) from None
    return tuple(_step(number, step, file, folder) for number, step in enumerate(record.steps))


def _step(number: int, record: _OneKey, file: Path, folder: Path) -> Step:
    """The step of a record; what names of files and views can be is checked here, beyond their type."""
    (name,) = record.model_fields_set
    value, where = getattr(record, name), f"step {number}: {name}"
    if name in WRITTEN_FILES:
        endings = WRITTEN_FILES[name]
        if endings and not value.lower().endswith(endings):
            raise LoadError(file, where, value, f"a file name that ends in {' or '.join(endings)}")
        if "\0" in value:
            raise LoadError(file, where, value, "the name of a file, without NUL")
        value = Path(os.path.abspath(folder / value))
    if name == "save_view" and not is_name(value):
        raise LoadError(file, where, value, f"a name of 1 to {MAX_NAME} characters")
    return Step(name, value)
