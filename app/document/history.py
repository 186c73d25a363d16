"""Undo and redo over values: the document and the viewpoint each have a history of their own.

A step holds the whole value before it; documents share what an edit did not touch, so a step costs little more than the
edit. Undo therefore restores bit by bit. One drag is one step, however many commands it took, and a drag that ends
where it began is no step at all. Rejected: inverse commands, which restore only up to rounding.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

MAX_STEPS = 1000
Value = TypeVar("Value")


class Command(Protocol[Value]):
    """An edit: makes a new value, or raises InsituError and leaves all as it was."""

    @property
    def label(self) -> str: ...

    def apply(self, document: Value, /) -> Value: ...


@dataclass(frozen=True)
class HistoryStep(Generic[Value]):
    """The value to go back (or forward) to, and the label of the edit between."""

    document: Value
    label: str


@dataclass
class History(Generic[Value]):
    """The present document (or view) and the steps around it."""

    document: Value
    undo_steps: list[HistoryStep[Value]] = field(default_factory=list)
    redo_steps: list[HistoryStep[Value]] = field(default_factory=list)
    _merge_key: str | None = None
    _drag: Drag[Value] | None = None

    @property
    def dragging(self) -> bool:
        return self._drag is not None

    @property
    def undo_label(self) -> str | None:
        """The label of what undo would take back; None when there is nothing."""
        return self.undo_steps[-1].label if self.undo_steps else None

    @property
    def redo_label(self) -> str | None:
        return self.redo_steps[-1].label if self.redo_steps else None

    def do(self, command: Command[Value], merge_key: str | None = None) -> bool:
        """Apply a command; returns whether the document changed.

        Within a drag, and among consecutive commands with the same ``merge_key``, only the first makes a step. Raises
        what ``command.apply`` raises; nothing changes then.
        """
        changed = command.apply(self.document)
        if changed == self.document:
            return False
        if self._drag is not None:
            self._drag.label = self._drag.label or command.label
        elif merge_key is None or merge_key != self._merge_key:
            self._push(self.document, command.label)
        self._merge_key = merge_key
        self.document = changed
        return True

    def apply_unrecorded(self, command: Command[Value]) -> None:
        """Apply a command that is no step of its own. Raises what it raises; nothing changes then."""
        self.document, self._merge_key = command.apply(self.document), None

    @contextlib.contextmanager
    def before_drag(self) -> Iterator[None]:
        """What is done within it comes before the drag under way, if there is one, which has changed nothing yet."""
        drag, self._drag = self._drag, None
        try:
            yield
        finally:
            self._drag = None if drag is None else Drag(self.document, drag.label)

    def begin_drag(self, label: str | None = None) -> None:
        """Make one step of all commands until ``end_drag``. A drag that is already open continues."""
        if self._drag is None:
            self._drag = Drag(self.document, label)

    def end_drag(self) -> None:
        """Close the drag; without one, nothing happens."""
        drag, self._drag, self._merge_key = self._drag, None, None
        if drag is not None and drag.start != self.document:
            self._push(drag.start, drag.label or "drag")

    def cancel_drag(self) -> None:
        """Close the drag and take back what it did."""
        if self._drag is not None:
            self.document = self._drag.start
        self._drag = self._merge_key = None

    def undo(self) -> str | None:
        """Go one step back; returns the label of what was taken back, or None."""
        return self._move(self.undo_steps, self.redo_steps)

    def redo(self) -> str | None:
        """Go one step forward again; returns its label, or None."""
        return self._move(self.redo_steps, self.undo_steps)

    def map(self, change: Callable[[Value], Value]) -> None:
        """Replace every value, as where the scene that documents belong to was read again. Steps that change nothing
        any more are left out."""
        self.document = change(self.document)
        if self._drag is not None:
            self._drag.start = change(self._drag.start)
        beside = self.document if self._drag is None else self._drag.start
        self.undo_steps[:] = _mapped_steps(self.undo_steps, beside, change)
        self.redo_steps[:] = _mapped_steps(self.redo_steps, self.document, change)

    def retract(self, is_harmless: Callable[[Value], bool]) -> bool:
        """Remove the last step from the history, where the document before it is one to go back to."""
        if self._drag is not None or not self.undo_steps or not is_harmless(self.undo_steps[-1].document):
            return False
        self.document, self._merge_key = self.undo_steps.pop().document, None
        return True

    def _move(self, source: list[HistoryStep[Value]], destination: list[HistoryStep[Value]]) -> str | None:
        self.end_drag()
        if not source:
            return None
        step = source.pop()
        destination.append(HistoryStep(self.document, step.label))
        self.document = step.document
        return step.label

    def _push(self, before: Value, label: str) -> None:
        self.undo_steps.append(HistoryStep(before, label))
        del self.undo_steps[:-MAX_STEPS]
        self.redo_steps.clear()


def _mapped_steps(
    steps: list[HistoryStep[Value]], beside: Value, change: Callable[[Value], Value]
) -> list[HistoryStep[Value]]:
    """The steps from the oldest (or the farthest) to the one beside the present value."""
    found: list[HistoryStep[Value]] = []
    for step in reversed(steps):
        value = change(step.document)
        if value != beside:
            found.append(HistoryStep(value, step.label))
        beside = value
    return found[::-1]


@dataclass
class Drag(Generic[Value]):
    """A drag under way: the value it began from, and its name (the first command's unless given)."""

    start: Value
    label: str | None = None
