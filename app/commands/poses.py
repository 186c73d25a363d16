"""The edits of poses: the row of deformers that each object goes through, as commands like those of `app.commands`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.document import Document
from engine.deform.deformers import KINDS
from engine.deform.pose import Deformation
from engine.errors import InsituError, LoadError

MAX_DEFORMERS = 16


@dataclass(frozen=True)
class SetPose:
    """Let an object go through these deformers, one after another, and no others; none: as its file has it."""

    object: str
    deformations: tuple[Deformation, ...] = ()

    @property
    def label(self) -> str:
        return f"pose of {self.object}"

    def apply(self, document: Document) -> Document:
        if len(self.deformations) > MAX_DEFORMERS:
            raise InsituError(f"{self.object} has {MAX_DEFORMERS} deformers; remove one to add another")
        return document.with_object(replace(document.object(self.object), deformations=self.deformations))


@dataclass(frozen=True)
class AddDeformer:
    """Put a deformer of a kind behind the others of an object."""

    object: str
    kind: str
    amount: float = 0.0
    axis: str = "y"

    @property
    def label(self) -> str:
        return f"{self.kind} {self.object}"

    def apply(self, document: Document) -> Document:
        row = document.object(self.object).deformations
        return SetPose(self.object, (*row, _deformation(self.kind, self.amount, self.axis))).apply(document)


@dataclass(frozen=True)
class SetDeformer:
    """Give one of an object's deformers another amount or another axis; None: the one it has."""

    object: str
    index: int
    amount: float | None = None
    axis: str | None = None

    @property
    def label(self) -> str:
        return f"deform {self.object}"

    def apply(self, document: Document) -> Document:
        row = _row(document, self.object, self.index)
        old = row[self.index]
        amount = old.amount if self.amount is None else self.amount
        row[self.index] = _deformation(old.kind, amount, self.axis or old.axis)
        return SetPose(self.object, tuple(row)).apply(document)


@dataclass(frozen=True)
class MoveDeformer:
    """Move one of an object's deformers to the place of another."""

    object: str
    index: int
    to: int

    @property
    def label(self) -> str:
        return f"reorder the deformers of {self.object}"

    def apply(self, document: Document) -> Document:
        row = _row(document, self.object, self.index)
        row.insert(min(max(self.to, 0), len(row) - 1), row.pop(self.index))
        return SetPose(self.object, tuple(row)).apply(document)


@dataclass(frozen=True)
class RemoveDeformer:
    """Take one of an object's deformers away."""

    object: str
    index: int

    @property
    def label(self) -> str:
        return f"remove a deformer of {self.object}"

    def apply(self, document: Document) -> Document:
        row = _row(document, self.object, self.index)
        del row[self.index]
        return SetPose(self.object, tuple(row)).apply(document)


def with_amounts(document: Document, name: str, amounts: Mapping[str, Any]) -> SetPose:
    """The command that gives an object's deformers, by kind, these amounts: the first of a kind, and where there is
    none a new one behind the others. Raises InsituError."""
    row = list(document.object(name).deformations)
    for kind, amount in amounts.items():
        there = next((i for i, each in enumerate(row) if each.kind == kind), len(row))
        row[there : there + 1] = [_deformation(kind, amount, row[there].axis if there < len(row) else "y")]
    return SetPose(name, tuple(row))


def _row(document: Document, name: str, index: int) -> list[Deformation]:
    row = list(document.object(name).deformations)
    if not 0 <= index < len(row):
        raise InsituError(f"{name} has {len(row) or 'no'} deformers, none at {index}")
    return row


def _deformation(kind: str, amount: Any, axis: str) -> Deformation:
    if isinstance(amount, bool) or not isinstance(amount, (int, float)):
        low, high = KINDS[kind].limits if kind in KINDS else (0.0, 0.0)
        raise LoadError(kind, "value", amount, f"a number from {low:g} to {high:g}")
    try:
        return Deformation(kind, float(amount), axis)
    except ValueError as error:
        raise InsituError(str(error)) from None
