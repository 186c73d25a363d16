"""Messages are read to their end, at any size of the window."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import pytest
from imgui_bundle import imgui

from app.messages.worker_messages import Progress
from tests.ui.conftest import opened
from ui.headless import HeadlessWindow
from ui.panels.status_bar import HEIGHT

LONG = (
    "/home/somebody/with/a/rather/long/path/of/many/folders/torn.ply: rows in the body = 7, expected 8 rows, as the "
    "header counts; nothing was changed - the built-in teatray is open instead"
)


def say(window: HeadlessWindow, text: str) -> None:
    window.shell.editor.notify(text, True)
    window.frames(4)


@pytest.mark.parametrize("size", [(1380, 860), (800, 600)])
def test_what_the_line_has_no_room_for_stands_above_it(context: moderngl.Context, size: tuple[int, int]) -> None:
    for window in opened(context, size, 1.0):
        handles = window.shell.handles
        say(window, "a short word")
        assert "status.strip.start" not in handles.names()  # in the line
        say(window, LONG)
        (left, top), (right, bottom) = (handles.position(f"status.strip.{end}") for end in ("start", "end"))
        assert 0 < left and right < size[0] and bottom <= size[1] - HEIGHT
        assert bottom - top > 2 * 13  # more than two lines of 13 pixels: all of it, no line cut off
        window.click_handle("status.message")
        window.frames(2)
        assert window.shell.state.message is None and "status.message" not in window.shell.handles.names()


def test_long_work_goes_up_too(context: moderngl.Context) -> None:
    for window in opened(context, (800, 600), 1.0):
        gauges = window.shell.editor.metrics
        gauges.progress = Progress("a stage of the work that has a long name " * 3, 0.5, 12.0)
        window.frames(4)
        assert "status.strip.start" in window.shell.handles.names()
        gauges.progress = replace(gauges.progress, stage="preview")
        window.frames(4)
        assert "status.strip.start" not in window.shell.handles.names()


def test_long_work_leaves_its_panel_the_button_that_stops_it(context: moderngl.Context) -> None:
    for window in opened(context, (1380, 860), 1.0):
        window.shell.editor.metrics.progress = Progress("a stage of the work that has a long name", 0.5, 480.0)
        window.frames(4)
        x, _ = window.shell.handles.position("button.cancel")
        side = imgui.get_frame_height()
        right = imgui.internal.find_window_by_name("Accuracy###accuracy").inner_rect.max.x
        assert x + side / 2 <= right
