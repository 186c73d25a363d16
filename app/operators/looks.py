"""Operators on looks: made, chosen, renamed, moved, deleted, and shown side by side."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field

from app.document.commands.looks import AddLook, DeleteLook, MoveLook, RenameLook, SetLook
from app.document.looks import look_names
from app.document.view_state import LooksShown, SetView
from app.editor.editor import Editor
from app.operators.operator import LOOK, SCENE, Gesture, Need, Operator, OperatorContext, ScriptKey
from engine.scene.description import Text

LookName = Annotated[Text, Field(min_length=1)]
Place = Annotated[int, Field(ge=0, strict=True)]
SEVERAL = Need("make a second look first", lambda context: len(context.document.looks) > 1)
SHOWN_WORDS: dict[LooksShown, str] = {1: "One look", 2: "Two looks", 4: "Four looks", 6: "Six looks"}


def _new(editor: Editor, name: str | None) -> str | None:
    return editor.do(AddLook(name or ""))


def _step(editor: Editor, by: int) -> str | None:
    names = look_names(editor.document)
    return editor.do(SetLook(names[(names.index(editor.document.look) + by) % len(names)]))


def _move(editor: Editor, by: int) -> str | None:
    document = editor.document
    return editor.do(MoveLook(document.look, max(look_names(document).index(document.look) + by, 0)))


def _show(editor: Editor, count: LooksShown | None) -> str | None:
    """Show so many looks; None: the next number of them."""
    counts = get_args(LooksShown)
    after = counts[(counts.index(editor.view.looks_shown) + 1) % len(counts)]
    return editor.do(SetView.of(looks_shown=count or after))


def _shows(count: LooksShown) -> Operator:
    return Operator(
        f"looks_{count}", lambda editor, value: _show(editor, count), entry=SHOWN_WORDS[count], needs=SCENE,
        is_on=lambda context: context.view.looks_shown == count,
        help="The picture of the current look alone." if count == 1
        else "The current look, which is edited, and others beside it as finished pictures.",
    )  # fmt: skip


def _look_now(context: OperatorContext) -> str:
    return f": {context.document.look}" if context.document.looks else ""


LOOKS: tuple[Operator | Gesture, ...] = (
    Operator(
        "new_look", _new, ("Ctrl L",), "A new look, like the one that is shown", entry="New look", needs=SCENE,
        waits=True, script=ScriptKey(LookName, "Makes a look of this name, equal to the current one, and current."),
    ),
    Operator(
        "look", lambda editor, name: editor.do(SetLook(name)), entry="Look", detail=_look_now, needs=LOOK, waits=True,
        script=ScriptKey(LookName, "Makes a look current, by its name."),
    ),
    Operator(
        "previous_look", lambda editor, value: _step(editor, -1), (",",), "The look before, the next one", ",   .",
        entry="Look before", needs=SEVERAL, waits=True,
    ),
    Operator(
        "next_look", lambda editor, value: _step(editor, 1), (".",), entry="Next look", needs=SEVERAL, waits=True,
    ),
    Operator(
        "rename_look", lambda editor, name: editor.do(RenameLook(editor.document.look, name)), entry="Rename the look…",
        needs=LOOK, waits=True, help="Gives the current look another name.",
        script=ScriptKey(LookName, "Gives the current look another name."),
    ),
    Operator(
        "move_look", lambda editor, place: editor.do(MoveLook(editor.document.look, place)), needs=LOOK,
        script=ScriptKey(Place, "Moves the current look to this place among the looks, from 0."),
    ),
    Operator(
        "look_up", lambda editor, value: _move(editor, -1), entry="Move the look forward", needs=SEVERAL, waits=True,
        help="One place nearer to the first look.",
    ),
    Operator(
        "look_down", lambda editor, value: _move(editor, 1), entry="Move the look back", needs=SEVERAL, waits=True,
        help="One place nearer to the last look.",
    ),
    Operator(
        "delete_look", lambda editor, name: editor.do(DeleteLook(name or editor.document.look)),
        entry="Delete the look", needs=LOOK, waits=True, help="Deletes the current look; the next one is shown.",
        script=ScriptKey(LookName, "Deletes a look, by its name."),
    ),
    Operator(
        "side_by_side", _show, ("U",), "Looks side by side: two, four, six, one", needs=SCENE,
        script=ScriptKey(Literal[1, 2, 4, 6], "Shows so many looks side by side."),
    ),
    *(_shows(count) for count in get_args(LooksShown)),
    Gesture("Click a picture", "Edit that look, where several are shown"),
)  # fmt: skip
