"""The edits of one curve's operators [BenArtzi07, ch. 9].

Lists of operators are in the order in which they apply: the first works on the generated curve, each next one on the
result of those before it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from app.document.commands.layers import editable_layer
from app.document.document import Document
from engine.core.errors import InsituError
from engine.curve.operators import Edit, collapse, edit_at, move_edit
from engine.curve.tables import TabulatedCurve

CurveEdit = Edit
MAX_OPERATORS = 256


@dataclass(frozen=True)
class SetOperators:
    """Replace all operators of one curve (a drag does this each frame)."""

    key: str
    factor: str
    operators: tuple[CurveEdit, ...]

    @property
    def label(self) -> str:
        return f"{self.key} {self.factor} curve"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        if len(self.operators) > MAX_OPERATORS:
            raise InsituError(f"{self.key}.{self.factor} has {MAX_OPERATORS} operators; collapse them to add more")
        return document.with_layer(self.key, layer.with_operators(self.factor, self.operators))


@dataclass(frozen=True)
class AddOperator:
    """Add an operator to a curve: on top, or at ``index`` of the list."""

    key: str
    factor: str
    operator: CurveEdit
    index: int | None = None

    @property
    def label(self) -> str:
        return f"{self.key} {self.factor} {operator_title(self.operator)}"

    def apply(self, document: Document) -> Document:
        operators = list(document.layer(self.key).operators(self.factor))
        operators.insert(len(operators) if self.index is None else self.index, self.operator)
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class ReplaceOperator:
    """Change one operator (its regions, magnitude, baseline or channels)."""

    key: str
    factor: str
    index: int
    operator: CurveEdit

    @property
    def label(self) -> str:
        return f"{self.key} {self.factor} {operator_title(self.operator)}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        operators[self.index] = self.operator
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class RemoveOperator:
    """Delete one operator, of a diagonal edit both."""

    key: str
    factor: str
    index: int

    @property
    def label(self) -> str:
        return f"delete an operator of {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        there = edit_at(operators, self.index)
        del operators[there.start : there.stop]
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class MoveOperator:
    """Move one operator, of a diagonal edit both, to the place of another."""

    key: str
    factor: str
    index: int
    to: int

    @property
    def label(self) -> str:
        return f"reorder the operators of {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        to = min(max(self.to, 0), len(operators) - 1)
        return _with_operators(document, self, list(move_edit(operators, self.index, to)))


@dataclass(frozen=True)
class MuteOperator:
    """Mute one operator, of a diagonal edit both, or turn it on again, at its place."""

    key: str
    factor: str
    index: int
    muted: bool = True

    @property
    def label(self) -> str:
        return f"{'mute' if self.muted else 'unmute'} an operator of {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        for index in edit_at(operators, self.index):
            operators[index] = replace(operators[index], muted=self.muted)
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class CollapseOperators:
    """Evaluate the edited curve into a table that replaces its operators [BenArtzi07, sect. 9.2].

    The table no longer follows the layer's parameters: what was generated below it is replaced.
    """

    key: str
    factor: str

    @property
    def label(self) -> str:
        return f"collapse {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        layer = document.layer(self.key)
        operators = layer.operators(self.factor)
        if not operators:
            return document
        return _with_operators(document, self, [collapse(operators, layer.generated_curve(self.factor))])


@dataclass(frozen=True)
class ResetCurve:
    """Remove all operators of one curve: it becomes the generated one again."""

    key: str
    factor: str

    @property
    def label(self) -> str:
        return f"reset {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        return _with_operators(document, self, [])


def operator_title(*edit: CurveEdit) -> str:
    """The name of an edit in lists and in the undo menu: ``Translate Y``, ``Amplify XY``, ``Table``, ``Stroke``,
    ``Points``."""
    first = edit[0]
    if isinstance(first, TabulatedCurve):
        return "Table" if first.kind == "curve" else first.kind.capitalize()
    return f"{first.kind.capitalize()} {'XY' if len(edit) > 1 else first.axis.upper()}"


def _operators_with(
    document: Document, command: ReplaceOperator | RemoveOperator | MoveOperator | MuteOperator
) -> list[CurveEdit]:
    """The command's curve's operators as a list, when there is one at its index."""
    operators = document.layer(command.key).operators(command.factor)
    if not 0 <= command.index < len(operators):
        there = f"{len(operators)} operators" if operators else "no operators"
        raise InsituError(f"{command.key} {command.factor} has {there}, none at {command.index}")
    return list(operators)


def _with_operators(document: Document, command: Any, operators: list[CurveEdit]) -> Document:
    return SetOperators(command.key, command.factor, tuple(operators)).apply(document)
