"""Undo restores the very value; a drag is one step."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import app.document.history
from app.document.background import BACKGROUND_KINDS
from app.document.commands import EditCommand
from app.document.commands.layers import SetParameter
from app.document.commands.light import SetBackground, SetBackgroundColour, SetIntensity, SetRotation
from app.document.described import document_from_description
from app.document.document import Document
from app.document.history import History
from engine.core.errors import InsituError
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE

DOCUMENT = document_from_description("shelf", parse_description(SCENE, "scene.toml"))

EDITS: st.SearchStrategy[EditCommand] = st.one_of(
    st.builds(SetRotation, st.floats(0.0, 359.0)),
    st.builds(SetIntensity, st.floats(0.0, 10.0)),
    st.builds(SetBackground, st.sampled_from(BACKGROUND_KINDS)),
    st.builds(SetBackgroundColour, st.tuples(*[st.floats(0.0, 1.0)] * 3)),
    st.builds(SetParameter, st.just("pot.1"), st.just("alpha"), st.floats(0.01, 1.0)),
)


@settings(max_examples=50, deadline=None)
@given(st.lists(EDITS, max_size=20))
def test_undo_goes_back_through_every_value(edits: list[EditCommand]) -> None:
    history = History(DOCUMENT)
    values = [history.document]
    for edit in edits:
        if history.do(edit):
            values.append(history.document)
    for value in reversed(values[:-1]):
        assert history.undo() is not None
        assert history.document is value
    assert history.undo() is None
    for value in values[1:]:
        assert history.redo() is not None
        assert history.document is value
    assert history.redo() is None


def test_commands_that_change_nothing_are_no_steps(document: Document) -> None:
    history = History(document)
    assert not history.do(SetRotation(30.0))  # as it is
    assert history.undo_label is None


def test_a_refused_command_changes_nothing(document: Document) -> None:
    history = History(document)
    history.do(SetRotation(1.0))
    with pytest.raises(InsituError):
        history.do(SetIntensity(-1.0))
    assert (history.undo_label, history.document.light.rotation) == ("rotate the environment", 1.0)


def test_edits_with_one_merge_key_are_one_step(document: Document) -> None:
    history = History(document)
    for degrees in (1.0, 2.0, 3.0):
        history.do(SetRotation(degrees), "wheel")
    history.do(SetRotation(4.0), "other wheel")
    history.undo()
    assert history.document.light.rotation == 3.0
    history.undo()
    assert history.document is document


def test_a_drag_is_one_step_named_by_its_first_command(document: Document) -> None:
    history = History(document)
    history.begin_drag()
    for degrees in (1.0, 2.0, 3.0):
        history.do(SetRotation(degrees))
    assert history.dragging and history.undo_label is None
    history.end_drag()
    assert history.undo_label == "rotate the environment"
    history.undo()
    assert history.document is document


def test_a_drag_back_to_its_start_is_no_step_and_keeps_redo(document: Document) -> None:
    history = History(document)
    history.do(SetIntensity(2.0))
    history.undo()
    history.begin_drag()
    history.do(SetRotation(90.0))
    history.do(SetRotation(30.0))
    history.end_drag()
    assert history.undo_label is None and history.redo_label == "light intensity"


def test_a_cancelled_drag_leaves_no_trace(document: Document) -> None:
    history = History(document)
    history.begin_drag("turn")
    history.do(SetRotation(90.0))
    history.cancel_drag()
    assert history.document is document and history.undo_label is None and not history.dragging


def test_undo_in_a_drag_takes_back_the_drag(document: Document) -> None:
    history = History(document)
    history.begin_drag("turn")
    history.do(SetRotation(90.0))
    assert history.undo() == "turn"
    assert history.document is document and not history.dragging


def test_a_new_edit_ends_redo(document: Document) -> None:
    history = History(document)
    history.do(SetRotation(1.0))
    history.undo()
    history.do(SetRotation(2.0))
    assert history.redo() is None and history.document.light.rotation == 2.0


def test_the_oldest_steps_are_forgotten(document: Document, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(app.document.history, "MAX_STEPS", 3)
    history = History(document)
    for degrees in range(10):
        history.do(SetRotation(float(degrees)))
    assert len(history.undo_steps) == 3  # of the ten steps the last three can be undone: back to 6 degrees
    while history.undo():
        pass
    assert history.document.light.rotation == 6.0
