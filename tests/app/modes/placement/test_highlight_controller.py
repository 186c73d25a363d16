"""Strokes on a highlight and their answers: what is asked, what becomes of the document, and in which steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetRotation
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import RequestFailed
from app.modes.placement.highlight_controller import MOST_COMPARED, HighlightController
from app.modes.placement.inverse_messages import CurvesFitted, FitCurves
from app.modes.placement.placement_messages import ComputeTransport
from engine.core.errors import InsituError
from engine.curve.operators import Operator
from engine.curve.tables import TabulatedCurve
from engine.inverse.curve_fit import SCALE, CurveFit
from engine.inverse.highlight_brush import HighlightBrush
from tests.app.fake_worker import FRAME, FakeClient

BRUSH = HighlightBrush("brighter", stops=1.0, radius=4.0)
RADIANCE = 0.5
KEY, CURVE = "pot.1", "theta_h"
LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)


def read(radiance: float):
    """The picture of the one point that is seen."""
    return lambda i_object: np.full((1, 3), radiance, np.float32)


def go_on(editor: Editor) -> None:
    """What the window does once the picture has the answer."""
    if strokes_of(editor).can_go_on:
        strokes_of(editor).go_on(read(RADIANCE), FRAME)


def strokes_of(editor: Editor) -> HighlightController:
    return editor.controller.highlights  # type: ignore[attr-defined,no-any-return]


def press(editor: Editor, solved="curve", place=(0.5, 0.5), brush=BRUSH) -> None:
    editor.begin_drag()
    strokes_of(editor).begin(brush, solved, place)
    go_on(editor)


def release(editor: Editor) -> None:
    strokes_of(editor).end()
    editor.end_drag()


def newest(client: FakeClient) -> FitCurves:
    return client.sent(FitCurves)[-1]


def answer(client: FakeClient, height: float, left: float = 0.0, request: FitCurves | None = None) -> None:
    """The answer that adds so much in each band of each curve."""
    request = request or newest(client)
    layer = request.layers[0]
    fits = {}
    for name in request.names:
        n = 1 if name == SCALE else len(layer.coefficients[layer.factors.index(name)])
        fits[name] = CurveFit(np.full((n, 3), height), np.zeros((n, 3)))
    client.answer(request, CurvesFitted(fits, np.full((1, 3), left)))


def operators(editor: Editor, curve: str = CURVE) -> tuple:
    return editor.document.layer(KEY).operators(curve)


def added(editor: Editor, curve: str = CURVE) -> float:
    """What strokes add to each band of a curve."""
    return sum(each.values[0][0] for each in operators(editor, curve) if isinstance(each, TabulatedCurve))


def test_a_stroke_asks_for_its_pixels_and_becomes_one_operator_and_one_step(settled: Editor, client: FakeClient):
    press(settled)
    settled.tick(1.1)
    asked = newest(client)
    assert (asked.names, asked.points.tolist(), asked.touched.tolist()) == ((CURVE,), [0], [0])
    assert asked.layers[0].key == KEY
    assert asked.seen == pytest.approx(np.full((1, 3), 0.5)) and asked.wanted == pytest.approx(np.full((1, 3), 1.0))
    answer(client, 0.25, left=0.1)
    settled.tick(1.2)
    assert added(settled) == pytest.approx(0.25) and settled.history.dragging
    assert strokes_of(settled).outcome.reached == pytest.approx(0.8)
    release(settled)
    settled.tick(1.3)
    assert newest(client) is not asked
    answer(client, 0.5)
    settled.tick(1.4)
    assert added(settled) == pytest.approx(0.5) and len(operators(settled)) == 1
    assert settled.undo() == "paint highlight of pot" and not operators(settled)
    assert settled.undo() is None
    settled.redo()
    assert added(settled) == pytest.approx(0.5)


def test_an_answer_after_the_release_alone_is_a_step_of_its_own(settled: Editor, client: FakeClient):
    press(settled)
    release(settled)
    settled.tick(1.1)
    assert len(client.sent(FitCurves)) == 1
    answer(client, 0.5)
    settled.tick(1.2)
    assert added(settled) == pytest.approx(0.5)
    assert settled.undo() is not None and not operators(settled) and settled.undo() is None


def test_one_request_at_a_time_for_the_newest_form(settled: Editor, client: FakeClient):
    press(settled)
    for now in (1.1, 1.2, 1.3):
        strokes_of(settled).extend([(0.5, 0.5 + now)])
        settled.tick(now)
    assert len(client.sent(FitCurves)) == 1
    answer(client, 0.1)
    settled.tick(1.4)
    settled.tick(1.5)
    assert len(client.sent(FitCurves)) == 2  # it had gone on meanwhile
    answer(client, 0.1)
    settled.tick(1.6)
    settled.tick(1.7)
    assert len(client.sent(FitCurves)) == 2  # a brush at rest asks for nothing


def test_strokes_one_after_the_other_go_on_with_one_operator(settled: Editor, client: FakeClient):
    for k in (1, 2):
        press(settled)
        release(settled)
        settled.tick(k + 0.1)
        answer(client, 0.25)
        settled.tick(k + 0.2)
    assert len(operators(settled)) == 1 and added(settled) == pytest.approx(0.5)
    settled.undo()
    assert len(operators(settled)) == 1 and added(settled) == pytest.approx(0.25)


def test_after_another_edit_a_stroke_begins_an_operator(settled: Editor, client: FakeClient):
    press(settled)
    release(settled)
    settled.tick(1.1)
    answer(client, 0.25)
    settled.tick(1.2)
    settled.do(AddOperator(KEY, CURVE, LIFT))
    press(settled)
    release(settled)
    settled.tick(1.3)
    answer(client, 0.25)
    settled.tick(1.4)
    assert [type(each) for each in operators(settled)] == [TabulatedCurve, Operator, TabulatedCurve]


def test_a_table_of_the_user_is_not_taken_for_a_stroke(settled: Editor, client: FakeClient):
    """A stroke that changed nothing left none to go on with."""
    n_bands = len(settled.document.layer(KEY).coefficients(CURVE, 64))
    own = TabulatedCurve(tuple(np.linspace(0.0, 1.5, n_bands).tolist()), ((1.0, 1.0, 1.0),) * n_bands)
    settled.do(AddOperator(KEY, CURVE, own))
    for k, height in ((1, 0.0), (2, 0.25)):
        press(settled)
        release(settled)
        settled.tick(k + 0.1)
        assert len(newest(client).layers[0].coefficients[0]) == n_bands
        answer(client, height)
        settled.tick(k + 0.2)
        assert operators(settled)[0] == own
    assert len(operators(settled)) == 2


@pytest.mark.parametrize("command", [SetParameter("pot.0", "albedo", 0.1), SetRotation(50.0)])
def test_an_answer_after_an_edit_of_what_it_was_painted_on_changes_nothing(
    settled: Editor, client: FakeClient, command
):
    press(settled)
    release(settled)
    settled.tick(1.1)
    late = newest(client)
    settled.do(command)
    assert settled.status.message.startswith("the stroke on pot was dropped: an edit changed")
    answer(client, 0.25, request=late)
    settled.tick(1.2)
    assert not operators(settled) and not strokes_of(settled).is_busy


@pytest.mark.parametrize("has_live_answer", [False, True])
def test_an_edit_of_another_object_before_the_answer_keeps_both(
    settled: Editor, client: FakeClient, has_live_answer: bool
):
    begun = settled.document
    press(settled)
    settled.tick(1.1)
    if has_live_answer:
        answer(client, 0.125)
        settled.tick(1.2)
    release(settled)
    settled.tick(1.3)
    settled.do(SetParameter("floor.0", "albedo", 0.1))
    edited = settled.document
    answer(client, 0.25)
    settled.tick(1.4)
    # All of the answer, not on top of the live one; and the edit is there.
    assert added(settled) == 0.25 and settled.document.layer("floor.0") == edited.layer("floor.0")
    assert settled.undo() == "paint highlight of pot" and settled.document == edited
    while settled.undo() is not None:
        pass
    assert settled.document == begun


def test_an_undo_before_the_only_answer_drops_the_stroke(settled: Editor, client: FakeClient):
    settled.do(SetParameter("floor.0", "albedo", 0.1))
    settled.tick(1.05)
    press(settled)
    release(settled)
    settled.tick(1.1)
    settled.undo()
    answer(client, 0.25)
    settled.tick(1.2)
    assert not operators(settled) and settled.redo() is not None


def test_an_undo_before_the_last_answer_stays(settled: Editor, client: FakeClient):
    press(settled)
    settled.tick(1.1)
    answer(client, 0.25)
    settled.tick(1.2)
    release(settled)
    settled.tick(1.3)
    late = newest(client)
    settled.undo()
    answer(client, 0.5, request=late)
    settled.tick(1.4)
    assert not operators(settled)


def test_escape_takes_the_stroke_back(settled: Editor, client: FakeClient):
    press(settled)
    settled.tick(1.1)
    answer(client, 0.25)
    settled.tick(1.2)
    settled.cancel_drag()
    settled.tick(1.3)
    assert not operators(settled) and not strokes_of(settled).is_busy and settled.undo() is None


def test_both_curves_and_the_scale(settled: Editor, client: FakeClient):
    press(settled, "curves")
    release(settled)
    settled.tick(1.1)
    assert newest(client).names == (CURVE, "theta_d")
    answer(client, 0.25)
    settled.tick(1.2)
    assert added(settled) == pytest.approx(0.25) and added(settled, "theta_d") == pytest.approx(0.25)
    assert settled.undo() and not operators(settled) and not operators(settled, "theta_d")
    before = np.array(settled.document.layer(KEY).values["scale"])
    press(settled, "scale")
    release(settled)
    settled.tick(1.3)
    assert newest(client).names == (SCALE,)
    answer(client, -0.5)
    settled.tick(1.4)
    assert np.array(settled.document.layer(KEY).values["scale"]) == pytest.approx(0.5 * before)


def test_a_failure_ends_the_stroke(settled: Editor, client: FakeClient):
    press(settled)
    release(settled)
    settled.tick(1.1)
    client.answer(newest(client), RequestFailed("pot: its light is still coarse"))
    settled.tick(1.2)
    settled.tick(1.3)
    assert not strokes_of(settled).is_busy and len(client.sent(FitCurves)) == 1
    assert settled.status.message == "pot: its light is still coarse"


def test_a_request_that_other_transport_makes_void_is_sent_again(settled: Editor, client: FakeClient):
    press(settled)
    release(settled)
    settled.tick(1.1)
    first = newest(client)
    settled.do(SetView.of(n_lights=5000))  # nothing of the document
    for now in (2.0, 2.4, 2.5):
        settled.tick(now)
    assert client.sent(ComputeTransport) and newest(client) is not first
    answer(client, 0.25, request=first)
    settled.tick(2.6)
    assert not operators(settled)
    answer(client, 0.5)
    settled.tick(2.7)
    assert added(settled) == pytest.approx(0.5)


def test_what_is_not_in_the_picture_is_not_painted(settled: Editor, client: FakeClient):
    settled.do(SetVisible(KEY, False))
    with pytest.raises(InsituError, match="pot.1 is not in the picture"):
        strokes_of(settled).begin(BRUSH, "curve", (0.5, 0.5))


def test_a_stroke_beside_the_object_is_nothing(settled: Editor, client: FakeClient):
    press(settled, place=(40.0, 40.0))
    release(settled)
    settled.tick(1.1)
    assert not client.sent(FitCurves) and not strokes_of(settled).is_busy and settled.undo() is None


def test_the_finished_picture_is_compared_and_solved_for_again(settled: Editor, client: FakeClient):
    strokes = strokes_of(settled)
    press(settled)
    release(settled)
    settled.tick(1.1)
    answer(client, 0.25)
    settled.tick(1.2)
    assert strokes.wants_picture
    strokes.compare(read(0.8))  # wanted was 1
    again = newest(client)
    assert again.seen == pytest.approx(np.full((1, 3), 0.8)) and again.wanted == pytest.approx(np.full((1, 3), 1.0))
    assert again.layers[0].layer.operators(CURVE) == operators(settled)
    answer(client, 0.125)
    settled.tick(1.3)
    assert added(settled) == pytest.approx(0.375) and len(operators(settled)) == 1
    strokes.compare(read(0.995))
    assert not strokes.wants_picture and not strokes.is_busy and strokes.outcome.reached == pytest.approx(0.99)
    assert settled.undo() and not operators(settled) and settled.undo() is None


def test_what_cannot_be_reached_is_not_asked_for_for_ever(settled: Editor, client: FakeClient):
    strokes, now = strokes_of(settled), 1.1
    press(settled)
    release(settled)
    settled.tick(now)
    n = 0
    while strokes.is_busy or strokes.wants_picture:
        if strokes.wants_picture:
            strokes.compare(read(RADIANCE))
        else:
            answer(client, 0.01)
        now, n = now + 0.1, n + 1
        settled.tick(now)
        assert n < 20
    assert len(client.sent(FitCurves)) == 1 + MOST_COMPARED


@pytest.mark.parametrize("selected, words", [
    (None, "select an object"), ("lamp", "select an object"), ("pot.1.nothing", ""),
])  # fmt: skip
def test_what_cannot_be_painted_is_said_in_one_line(settled: Editor, selected, words):
    settled.select(selected)
    if settled.view.selected is not None and settled.view.selected.object == "pot":
        return  # refused by the selection itself
    with pytest.raises(InsituError, match=words):
        strokes_of(settled).begin(BRUSH, "curve", (0.5, 0.5))


def test_a_pixel_that_is_not_finite_decides_nothing(settled: Editor, client: FakeClient):
    settled.begin_drag()
    strokes_of(settled).begin(BRUSH, "curve", (0.5, 0.5))
    strokes_of(settled).go_on(read(np.nan), FRAME)
    release(settled)
    settled.tick(1.1)
    assert not client.sent(FitCurves) and not strokes_of(settled).is_busy
    press(settled)
    release(settled)
    settled.tick(1.2)
    answer(client, 0.25)
    settled.tick(1.3)
    strokes_of(settled).compare(read(np.inf))
    settled.tick(1.4)
    assert strokes_of(settled).outcome.reached == 1.0 and not strokes_of(settled).is_busy


STEPS = ("press", "extend", "release", "tick", "answer", "fail", "undo", "redo", "edit", "edit_other", "escape",
         "compare", "select", "go_on")  # fmt: skip


@settings(deadline=None, max_examples=80)
@given(st.lists(st.sampled_from(STEPS), min_size=5, max_size=60))
def test_any_sequence_leaves_whole_steps_that_undo_to_the_bit(steps):
    client = FakeClient()
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    strokes, now, held, begun = strokes_of(editor), 1.0, False, editor.document
    pending: list[FitCurves] = []

    for step in steps:
        now += 0.1
        known = len(client.sent(FitCurves))
        if step == "press" and not held:
            press(editor)
            held = True
        elif step == "extend":
            strokes.extend([(0.5, 0.5)])
        elif step == "release" and held:
            release(editor)
            held = False
        elif step == "answer" and pending:
            answer(client, 0.25, request=pending.pop())
        elif step == "fail" and pending:
            client.answer(pending.pop(), RequestFailed("no"))
        elif step in ("undo", "redo") and not held:
            getattr(editor, step)()
        elif step == "edit" and not held:
            editor.do(SetParameter("pot.0", "albedo", 0.05 * (len(editor.history.undo_steps) % 10)))
        elif step == "edit_other" and not held:
            editor.do(SetParameter("floor.0", "albedo", 0.05 * (len(editor.history.undo_steps) % 10)))
        elif step == "escape" and held:
            editor.cancel_drag()
            held = False
        elif step == "compare" and strokes.wants_picture:
            strokes.compare(read(RADIANCE))
        elif step == "go_on":
            go_on(editor)
        elif step == "select" and not held:
            editor.select("pot.0" if editor.view.selected.layer else "pot.1")
        editor.tick(now)
        pending += client.sent(FitCurves)[known:]
        assert len(client.sent(FitCurves)) - known <= 1
    if held:
        release(editor)
    now += 0.1
    editor.tick(now)
    final = editor.document
    n = 0
    while editor.undo() is not None:
        n += 1
    assert editor.document == begun
    for _ in range(n):
        editor.redo()
    assert editor.document == final
