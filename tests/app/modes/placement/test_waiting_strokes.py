"""Strokes on a highlight that begin before the last answer to the one before: none is lost, and each is a step."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.editor.editor import Editor
from app.modes.placement.inverse_messages import FitCurves
from tests.app.fake_worker import FakeClient
from tests.app.modes.placement.test_highlight_controller import (
    added,
    answer,
    go_on,
    newest,
    operators,
    press,
    release,
    strokes_of,
)


def test_a_stroke_before_the_answer_to_the_last_one_waits_for_it(settled: Editor, client: FakeClient):
    press(settled)
    release(settled)
    settled.tick(1.1)
    first = newest(client)
    press(settled)
    strokes_of(settled).extend([(0.6, 0.5)])
    settled.tick(1.2)
    assert newest(client) is first and not strokes_of(settled).can_go_on
    answer(client, 0.25, request=first)
    settled.tick(1.3)
    assert added(settled) == pytest.approx(0.25) and strokes_of(settled).can_go_on
    go_on(settled)
    settled.tick(1.4)
    answer(client, 0.125)
    settled.tick(1.5)
    release(settled)
    settled.tick(1.6)
    answer(client, 0.5)
    settled.tick(1.7)
    assert added(settled) == pytest.approx(0.75) and len(operators(settled)) == 1
    settled.undo()
    assert added(settled) == pytest.approx(0.25)
    settled.undo()
    assert not operators(settled) and settled.undo() is None


def test_escape_in_a_stroke_that_waits_keeps_the_one_before(settled: Editor, client: FakeClient):
    press(settled)
    settled.tick(1.1)
    answer(client, 0.1)
    settled.tick(1.2)
    release(settled)
    settled.tick(1.3)
    press(settled)
    answer(client, 0.25)
    settled.tick(1.4)
    settled.cancel_drag()
    settled.tick(1.5)
    assert added(settled) == pytest.approx(0.25) and not strokes_of(settled).can_go_on
    assert settled.undo() and not operators(settled) and settled.undo() is None


def test_another_selection_does_not_lose_a_released_stroke(settled: Editor, client: FakeClient):
    press(settled)
    release(settled)
    settled.tick(1.1)
    settled.select("pot.0")
    settled.tick(1.2)
    answer(client, 0.25)
    settled.tick(1.3)
    assert added(settled) == pytest.approx(0.25)


@settings(deadline=None, max_examples=80)
@given(st.lists(st.sampled_from(("press", "extend", "release", "tick", "answer", "go_on")), min_size=5, max_size=60))
def test_no_released_stroke_is_lost(steps):
    client = FakeClient()
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    now, held, n_released, pending = 1.0, False, 0, list[FitCurves]()

    def tick() -> None:
        nonlocal now
        now += 0.1
        known = len(client.sent(FitCurves))
        editor.tick(now)
        pending.extend(client.sent(FitCurves)[known:])

    for step in [*steps, "release"]:
        if step == "press" and not held:
            press(editor)
            held = True
        elif step == "extend" and held:
            strokes_of(editor).extend([(0.5, 0.5)])
        elif step == "release" and held:
            release(editor)
            held, n_released = False, n_released + 1
        elif step == "answer" and pending:
            answer(client, 0.25, request=pending.pop())
        elif step == "go_on":
            go_on(editor)
        tick()
    while strokes_of(editor).is_busy:
        if pending:
            answer(client, 0.25, request=pending.pop())
        tick()
        go_on(editor)
    assert added(editor) == pytest.approx(0.25 * n_released)
    for n in reversed(range(n_released)):
        assert editor.undo() and added(editor) == pytest.approx(0.25 * n)
    assert editor.undo() is None
