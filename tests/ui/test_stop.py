"""*Stop* and *Resume* by their buttons, over a real worker."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import moderngl
import pytest

from app.worker.client import Client
from tests.ui.small_scene import opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.panels.status_bar import work_line

pytestmark = pytest.mark.gl


def test_what_was_stopped_goes_on(context: moderngl.Context, tmp_path: Path) -> None:
    client = Client()
    with opened_window(context, write_small_scene(tmp_path), client, n_lights=2000) as window:
        editor = window.shell.editor
        assert window.run_until(lambda: editor.status.stage in ("preview", "final"), 600.0), editor.status
        press_stop(window, client)
        assert editor.status.stopped and not editor.status.is_finished
        assert work_line(editor.status) == "stopped" and "button.cancel" not in window.shell.handles.names()
        rests_for(window, 1.0)
        window.click_handle("button.resume")
        wait_until_exact(window)
        assert not editor.status.stopped and "button.resume" not in window.shell.handles.names()


def press_stop(window: HeadlessWindow, client: Client) -> None:
    """The worker holds still meanwhile: it might have finished before the hand is there."""
    assert client.pid is not None
    os.kill(client.pid, signal.SIGSTOP)
    try:
        window.frames(3)
        window.click_handle("button.cancel")
    finally:
        os.kill(client.pid, signal.SIGCONT)
    window.frames(3)
    if not window.shell.editor.status.stopped:  # a plan that was on its way has asked anew
        press_stop(window, client)


def rests_for(window: HeadlessWindow, seconds: float) -> None:
    """Nothing comes while the work is stopped."""
    status = window.shell.editor.status
    assert not window.run_until(lambda: window.shell.editor.status.picture != status.picture, seconds)
    assert window.shell.editor.status.stopped
