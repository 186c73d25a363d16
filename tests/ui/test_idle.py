"""Between frames: what of the worker's words is worth a frame, and when."""

from __future__ import annotations

import pytest
from imgui_bundle import imgui

from app.editor.editor import Editor
from app.messages.worker_messages import Progress, RequestFailed
from tests.ui.stand_in import StandInClient
from ui.frame_times import PROGRESS_SECONDS
from ui.headless import HeadlessWindow

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
    client.say(RequestFailed("out of memory"))
    assert window.shell.idle(window._time)


def test_a_window_nobody_touches_asks_for_no_frames(window: HeadlessWindow, client: StandInClient) -> None:
    window.frames(60)  # until the library has been read
    window._time += 60.0  # since the last event of a hand
    result = window.frame()
    assert not result.busy and result.redraw_in is None
    window.shell.pacing.note_change()  # it was uncovered: one frame, and no more after it
    result = window.frame()
    assert not result.busy and result.redraw_in is None


def test_an_event_gets_two_frames_however_long_they_take(window: HeadlessWindow, client: StandInClient) -> None:
    window.frames(60)
    window.shell.pacing.note_input()
    window._time += 60.0
    assert window.frame().busy and not window.frame().busy


def test_what_the_worker_changed_is_drawn_in_a_step_of_its_own(
    window: HeadlessWindow, client: StandInClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = _count_pictures(window, monkeypatch)
    window.prepare()
    assert len(drawn) == 1
    window.draw()
    assert len(drawn) == 1  # the frame shows what was prepared
    window.draw()
    assert len(drawn) == 2  # and the next one is a frame like any other


def test_the_hand_s_own_change_is_in_the_frame_that_took_it(
    window: HeadlessWindow, client: StandInClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    x, y = window.shell.handle_position("curve.magnitude")
    window.move(x, y)
    window.press()
    drawn = _count_pictures(window, monkeypatch)
    window.prepare()
    assert not drawn  # a drag is under way: picture and panels go together
    window.move(x, y - 40)
    assert len(drawn) == 1
    window.release()
    drawn.clear()
    window.prepare()
    window.shell.pacing.note_input()
    window.shell.events.key(imgui.Key.mod_ctrl, True)
    window.shell.events.key(imgui.Key.z, True)
    window.draw()
    assert len(drawn) == 2  # undo came after the picture had been prepared
    for key in (imgui.Key.z, imgui.Key.mod_ctrl):
        window.hold(key, False)


def _count_pictures(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A list that grows with each picture that is brought up to date."""
    source = window.shell.source
    assert source is not None
    real, drawn = source.draw, list[float]()

    def draw(editor: Editor, last_frame_ms: float) -> bool:
        drawn.append(last_frame_ms)
        return real(editor, last_frame_ms)

    monkeypatch.setattr(source, "draw", draw)
    return drawn
