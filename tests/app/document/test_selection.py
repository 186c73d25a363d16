"""Selection by path and after edits; one layer seen alone: what is shown of which object, and that it is no edit."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from app.document.commands.curves import (
    AddOperator,
    MoveOperator,
    MuteOperator,
    RemoveOperator,
    ReplaceOperator,
    ResetCurve,
    SetOperators,
)
from app.document.commands.layers import SetParameter
from app.document.document import Document, ObjectState
from app.document.selection import is_layer_visible, solo_layer, toggle_solo
from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from engine.curve.operators import Edit, Operator, diagonal, edit_at
from engine.material import MODELS, make_layer
from tests.app.fake_worker import FakeClient

CURVE = ("pot.1", "theta_h")
LOW = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
HIGH = Operator("amplify", "y", 0.5, 0.6, 0.7, 0.8, magnitude=2.0)
PAIR = diagonal((0.2, 0.3, 0.4, 0.5), 0.01, 0.5)


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    """An editor with three edits on the selected curve: LOW, a diagonal one, HIGH."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    editor.do(SetOperators(*CURVE, (LOW, *PAIR, HIGH)))
    return editor


def operators(editor: Editor) -> tuple[Edit, ...]:
    return editor.document.layer("pot.1").operators("theta_h")


def chosen(editor: Editor) -> Edit | None:
    """The selected operator itself."""
    index = editor.view.operator
    return None if index is None else operators(editor)[index]


def test_the_operator_in_hand_stays_in_hand(editor: Editor) -> None:
    editor.do(SetView.of(operator=3))
    editor.do(ReplaceOperator(*CURVE, 3, replace(HIGH, magnitude=3.0)))
    editor.undo()
    assert chosen(editor) == HIGH
    editor.redo()
    assert chosen(editor) == replace(HIGH, magnitude=3.0)


def test_selection_follows_a_reorder_and_its_undo(editor: Editor) -> None:
    editor.do(SetView.of(operator=3))
    editor.do(MoveOperator(*CURVE, 3, 0))
    assert (editor.view.operator, chosen(editor)) == (0, HIGH)
    editor.undo()
    assert (editor.view.operator, chosen(editor)) == (3, HIGH)
    editor.redo()
    assert (editor.view.operator, chosen(editor)) == (0, HIGH)


def test_what_is_deleted_and_comes_back_is_selected_again(editor: Editor) -> None:
    editor.do(SetView.of(operator=1))
    editor.do(RemoveOperator(*CURVE, 1))
    assert editor.view.operator is None
    editor.undo()
    assert editor.view.operator == 1
    editor.do(SetView.of(operator=0))
    editor.do(RemoveOperator(*CURVE, 3))  # another one
    assert chosen(editor) == LOW


def test_a_new_operator_that_is_undone_and_redone_is_in_hand(editor: Editor) -> None:
    editor.do(ResetCurve(*CURVE))
    editor.do(SetOperators(*CURVE, (LOW,)))
    editor.do(SetView.of(operator=0))
    editor.undo()
    assert editor.view.operator is None
    editor.redo()
    assert chosen(editor) == LOW


def test_an_undo_elsewhere_leaves_it_alone(editor: Editor) -> None:
    editor.do(SetView.of(operator=3))
    editor.do(SetParameter("pot.1", "alpha", 0.4))
    editor.undo()
    assert editor.view.operator == 3


@pytest.mark.parametrize("seed", range(40))
def test_whatever_is_done_the_selected_one_is_the_same_or_none(editor: Editor, seed: int) -> None:
    """Each edit carries a magnitude of its own; the selected one may change place, or go, and never become another."""
    chance = random.Random(seed)
    for step in range(30):
        before, there = chosen(editor), operators(editor)
        index = chance.randrange(max(len(there), 1))
        command = chance.choice(["add", "remove", "move", "mute", "undo", "redo", "select"])
        if command == "undo":
            editor.undo()
        elif command == "redo":
            editor.redo()
        elif command == "add":
            editor.do(AddOperator(*CURVE, replace(HIGH, magnitude=100.0 * seed + step + 3.0)))
        elif not there:
            continue
        elif command == "remove":
            editor.do(RemoveOperator(*CURVE, index))
        elif command == "move":
            editor.do(MoveOperator(*CURVE, index, chance.randrange(len(there))))
        elif command == "mute":
            editor.do(MuteOperator(*CURVE, index, chance.random() < 0.5))
        else:
            editor.do(SetView.of(operator=edit_at(there, index).start))
            continue
        after = chosen(editor)
        assert editor.view.operator is None or edit_at(operators(editor), editor.view.operator)
        if before is not None and after is not None and any(same(before, each) for each in operators(editor)):
            assert same(before, after)


def same(one: Edit, other: Edit) -> bool:
    return replace(one, muted=False) == replace(other, muted=False)


BASE, COAT = make_layer(MODELS["lambert"], name="base"), make_layer(MODELS["ward"], name="coat").with_fresnel(0.5)
TERM = COAT.replace(name="fresnel", follows="coat", rises=True)
POT, TRAY = ObjectState("pot", (BASE, COAT, TERM)), ObjectState("tray", (BASE, BASE.replace(name="two")))
DOCUMENT = Document("x", (POT, TRAY))


def seen(document: Document, view: ViewState) -> list[str]:
    return [key for key, _ in document.layers() if is_layer_visible(document, view, key)]


def test_solo_hides_the_others_of_its_object() -> None:
    view = toggle_solo(ViewState(), "pot.0").apply(ViewState())
    assert view.solo == "pot.0" and seen(DOCUMENT, view) == ["pot.0", "tray.0", "tray.1"]
    assert seen(DOCUMENT, toggle_solo(view, "pot.0").apply(view)) == ["pot.0", "pot.1", "pot.2", "tray.0", "tray.1"]


def test_a_fresnel_term_stays_with_its_layer() -> None:
    assert seen(DOCUMENT, ViewState(solo="pot.1")) == ["pot.1", "pot.2", "tray.0", "tray.1"]


def test_a_hidden_layer_is_seen_alone_and_hidden_objects_stay_so() -> None:
    hidden = DOCUMENT.with_layer("pot.0", BASE.replace(visible=False))
    assert seen(hidden, ViewState(solo="pot.0")) == ["pot.0", "tray.0", "tray.1"]
    assert seen(hidden, ViewState()) == ["pot.1", "pot.2", "tray.0", "tray.1"]
    away = DOCUMENT.with_object(replace(DOCUMENT.object("pot"), visible=False))
    assert seen(away, ViewState(solo="pot.0")) == ["tray.0", "tray.1"]


def test_a_layer_that_is_gone_hides_nothing() -> None:
    view = ViewState(solo="pot.7")
    assert solo_layer(DOCUMENT, view) is None and len(seen(DOCUMENT, view)) == 5
