"""The declaration of an operator: something that the user can do, by a key, in a menu or in a script.

A declaration has everything that the program needs of it: name, value, keys, menu entry, script key, when it can run,
and a line of help. The keyboard, the menus, the list under `?`, scripts and docs/reference/ derive from it
(`app.operators.registry`). What only the window can carry out has no `run` here: `ui.panels.window_operators` has it by
the operator's name, or `ui.script_runner` where only scripts have it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from pydantic import BaseModel, ConfigDict

from app.document.document import Document
from app.document.selection import layer_shown
from app.document.view_state import ViewState
from app.editor.editor import Editor


class OperatorContext(Protocol):
    """What decides whether an operator can run; the editor and the arguments of panels both have it."""

    @property
    def document(self) -> Document: ...

    @property
    def view(self) -> ViewState: ...

    @property
    def undo_label(self) -> str | None: ...

    @property
    def redo_label(self) -> str | None: ...

    @property
    def camera_undo_label(self) -> str | None: ...

    @property
    def camera_redo_label(self) -> str | None: ...


@dataclass(frozen=True)
class Need:
    """A condition of an operator, and the line that says why it cannot run where that is not met."""

    reason: str
    is_met: Callable[[OperatorContext], bool]


@dataclass(frozen=True)
class ScriptKey:
    """An operator as a key of a `[[step]]`: the type of its value, as pydantic checks it; what it does, in Markdown."""

    value: Any
    meaning: str


@dataclass(frozen=True)
class Operator:
    """Something that the user can do. `name` is its key in scripts, too, where it is a `script` step.

    run: carries it out on an editor with a value (None: its default), and returns None or one line that says why it was
    refused; None: the window does. keys: such as "Ctrl Shift S"; the first one is shown. help: its line in the list
    under `?`, the tooltip of its menu entry where it has no keys; "" where it shares the line of the one before it,
    whose `listed_keys` name the keys of both. entry: its text in a menu, "" where it is in none; detail: what follows
    that text now; is_on: whether the entry is checked. needs: the condition under which it can run. repeats: whether a
    key that is held repeats it. waits: whether it would change what a gesture is based on, and its keys do nothing
    during one.
    """

    name: str
    run: Callable[[Editor, Any], str | None] | None = None
    keys: tuple[str, ...] = ()
    help: str = ""
    listed_keys: str = ""
    entry: str = ""
    detail: Callable[[OperatorContext], str] | None = None
    is_on: Callable[[OperatorContext], bool] | None = None
    needs: Need | None = None
    script: ScriptKey | None = None
    repeats: bool = False
    waits: bool = False

    def why_not(self, context: OperatorContext) -> str:
        """Why it cannot run now, in one line; "" where it can."""
        return "" if self.needs is None or self.needs.is_met(context) else self.needs.reason

    def entry_text(self, context: OperatorContext) -> str:
        """The text of its menu entry now."""
        return self.entry if self.detail is None else f"{self.entry}{self.detail(context)}"


@dataclass(frozen=True)
class Gesture:
    """A line in the list under `?` about what the mouse does, or keys that no operator has."""

    listed_keys: str
    help: str


class ValueRecord(BaseModel):
    """A value of several parts; each part's description says what it means."""

    # Built when a script is read: it would take 10 ms of the window's start.
    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


def _has_curve(context: OperatorContext) -> bool:
    selected = layer_shown(context.document, context.view.selected)
    return selected is not None and selected.factor is not None


SCENE = Need("no scene is open yet", lambda context: context.document.is_open)
LAYER = Need(
    "select an object with a material", lambda context: layer_shown(context.document, context.view.selected) is not None
)
CURVE = Need("select a curve", _has_curve)
LOOK = Need("make a look first", lambda context: bool(context.document.looks))
OBJECT = Need("select an object", lambda context: context.view.selected is not None)
