"""The line of time below the picture: there where something is animated, Space plays it, and a scrub is one step."""

from __future__ import annotations

from dataclasses import replace

import pytest
from imgui_bundle import imgui

from app.document.view_state import SetView
from app.editor.editor import Editor
from engine.scene.rig import Animation
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def flying(window: HeadlessWindow) -> Editor:
    """The editor in Deform, its teapot with two animations."""
    editor = window.shell.editor
    teapot = replace(editor.document.objects[0], animations=(Animation("flap", 1.2), Animation("glide", 3.0)))
    editor.history.document = editor.document.with_object(teapot)
    editor.do(SetView.of(mode="deform"))
    window.frames(3)
    return editor


def time_of(editor: Editor) -> float | None:
    moment = editor.document.object("teapot").moment
    return None if moment is None else moment.time


def test_only_what_is_animated_has_a_line_of_time(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetView.of(mode="deform"))
    window.frames(2)
    assert "timeline.time" not in window.shell.handles.names()
    before = window.shell.state.single_panel
    window.key(imgui.Key.space)
    assert window.shell.state.single_panel is not before


def test_a_scrub_is_one_step(window: HeadlessWindow, flying: Editor) -> None:
    window.drag_handle("timeline.time", (60, 0))
    assert 0.0 < (time_of(flying) or 0.0) < 1.2 and len(flying.history.undo_steps) == 1
    flying.undo()
    assert time_of(flying) is None


def test_a_press_takes_the_time_there_and_a_drag_goes_on_from_it(window: HeadlessWindow, flying: Editor) -> None:
    window.drag_handle("timeline.time", (60, 0))
    window.frames(2)
    x, y = window.shell.handle_position("timeline.time")
    after, steps = time_of(flying), len(flying.history.undo_steps)
    window.click(x + 100, y)
    window.frames(2)
    assert window.shell.handle_position("timeline.time")[0] == pytest.approx(x + 100, abs=1.0)
    window.drag((x - 30, y), (x, y))
    assert time_of(flying) == pytest.approx(after, abs=0.01) and len(flying.history.undo_steps) == steps + 2


def test_space_plays_and_stops(window: HeadlessWindow, flying: Editor) -> None:
    window.key(imgui.Key.space)
    assert flying.view.playing is not None and not window.shell.state.single_panel
    window.frames(3)
    window.key(imgui.Key.space)
    assert flying.view.playing is None and time_of(flying) is not None and not flying.history.undo_steps


def test_taking_hold_of_the_time_stops_it(window: HeadlessWindow, flying: Editor) -> None:
    window.click_handle("button.timeline.play")
    window.frames(2)
    window.drag_handle("timeline.time", (30, 0))
    assert flying.view.playing is None and len(flying.history.undo_steps) == 1


def test_the_way_back_to_rest_and_whether_it_loops(window: HeadlessWindow, flying: Editor) -> None:
    window.drag_handle("timeline.time", (60, 0))
    window.frames(2)
    window.click_handle("button.timeline.rest")
    assert flying.document.object("teapot").moment is None
    window.click_handle("button.timeline.loop")
    assert not flying.view.loops
