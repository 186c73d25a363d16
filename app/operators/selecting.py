"""Operators that select objects."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.editor.editor import Editor
from app.operators.edits import PictureIndex
from app.operators.operator import SCENE, Gesture, Operator, ScriptKey, ValueRecord


def _select_all(editor: Editor, value: None) -> str | None:
    """All that are shown; the active one stays active."""
    shown = [state.name for state in editor.document.objects if state.visible]
    active = [name for name in editor.view.selected_objects[-1:] if name in shown]
    return editor.select(tuple(name for name in shown if name not in active) + tuple(active))


def _select_none(editor: Editor, value: None) -> str | None:
    return editor.select(None)


def _invert(editor: Editor, value: None) -> str | None:
    """All that are shown and not selected now."""
    chosen = set(editor.view.selected_objects)
    return editor.select(tuple(s.name for s in editor.document.objects if s.visible and s.name not in chosen))


BoxMode = Literal["replace", "add", "remove"]
PicturePlace = tuple[PictureIndex, PictureIndex]


class BoxSelection(ValueRecord):
    """A rectangle of the picture, whose objects are selected; corners are column and row of pixels."""

    start: Annotated[PicturePlace, Field(alias="from", description="A corner.")]
    to: Annotated[PicturePlace, Field(description="The corner opposite.")]
    mode: Annotated[BoxMode, Field(description="Instead of what is selected, as well, or no longer.")] = "replace"


SELECTING = (
    Gesture("Shift click", "Select another one as well, or no longer"),
    Gesture("Double click", "Select one object of a group alone"),
    Operator(
        "box_select", keys=("B",), help="Select by a rectangle; Shift adds, Ctrl removes", entry="By a rectangle",
        needs=SCENE, waits=True, script=ScriptKey(BoxSelection, "Selects what is seen in a rectangle: see below."),
    ),
    Operator("select_all", _select_all, ("Ctrl A",), "Select all objects; with Shift none",
             entry="All", needs=SCENE),
    Operator("select_none", _select_none, ("Ctrl Shift A",), entry="None", needs=SCENE),
    Operator("select_others", _invert, ("Ctrl I",), "Select the others instead", entry="The others instead",
             needs=SCENE),
)  # fmt: skip
