"""Between frames: what of the worker's words is worth a frame, and when."""

from __future__ import annotations

import pytest

from app.jobs.messages import Failed, Progress
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow
from ui.shell import PROGRESS_SECONDS

pytestmark = pytest.mark.gl


@pytest.fixture
def client(window: HeadlessWindow) -> StandInClient:
    """The window's worker; its picture is settled."""
    window.frames(3)
    found = window.shell.editor._client
    assert isinstance(found, StandInClient)
    assert not window.shell.idle(window._time)
    return found


def test_progress_alone_waits_for_its_turn(window: HeadlessWindow, client: StandInClient) -> None:
    client.say(Progress("final", 0.25, text="ball.0"))
    window.frame()
    drawn_at = window._time
    client.say(Progress("final", 0.5, text="ball.1"))
    assert not window.shell.idle(drawn_at + 0.5 * PROGRESS_SECONDS)
    assert window.shell.editor.status.fraction == 0.5  # heard, though not shown
    assert window.shell.idle(drawn_at + 1.01 * PROGRESS_SECONDS)


def test_another_stage_or_a_message_is_shown_at_once(window: HeadlessWindow, client: StandInClient) -> None:
    client.say(Progress("preview", 0.9))
    window.frame()
    client.say(Progress("final", 0.9))
    assert window.shell.idle(window._time)
    window.frame()
    client.say(Failed("out of memory"))
    assert window.shell.idle(window._time)


def test_a_window_nobody_touches_asks_for_no_frames(window: HeadlessWindow, client: StandInClient) -> None:
    window._time += 60.0  # since the last event of a hand
    result = window.frame()
    assert not result.busy and result.redraw_in is None
    window.shell.note_change()  # it was uncovered: one frame, and no more after it
    result = window.frame()
    assert not result.busy and result.redraw_in is None
