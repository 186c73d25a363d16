"""Grips of deformers in the picture: they stand where the object's axis ends, and a drag brings them under the hand."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands import AddDeformer
from app.document.view_state import SetView
from app.editor.editor import Editor
from engine.realtime.deformers import KINDS
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def bending(window: HeadlessWindow) -> Editor:
    """The editor in Deform, its teapot selected and a metre high."""
    editor = window.shell.editor
    boxes = np.tile([[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]], (len(editor.document.objects), 1, 1))
    editor.camera_history.scene_opened(editor.scenes.opened.description, boxes)
    editor.do(SetView.of(mode="deform"))
    editor.select("teapot")
    return editor


def amount(editor: Editor) -> float:
    return editor.document.object("teapot").deformations[-1].amount


@pytest.mark.parametrize("kind", KINDS)
def test_a_grip_goes_with_the_hand_in_one_step(window: HeadlessWindow, bending: Editor, kind: str) -> None:
    bending.do(AddDeformer("teapot", kind, 0.0 if kind != "twist" else 60.0))
    window.frames(2)
    before, start = amount(bending), window.shell.handle_position("pose.handle.0")
    across = 25.0 if kind != "twist" else -15.0
    window.drag_handle("pose.handle.0", (across, 0.0))
    window.frames(2)
    end = window.shell.handle_position("pose.handle.0")
    assert amount(bending) != before and len(bending.history.undo_steps) == 2
    assert end[0] - start[0] == pytest.approx(across, abs=8.0)
    bending.undo()
    assert amount(bending) == before


@pytest.mark.parametrize("kinds", [("bend", "bend"), ("twist", "taper")])
def test_grips_that_would_lie_on_one_another_stand_apart(
    window: HeadlessWindow, bending: Editor, kinds: tuple[str, str]
) -> None:
    for kind in kinds:
        bending.do(AddDeformer("teapot", kind))
    window.frames(2)
    (_, lower), (_, upper) = (window.shell.handle_position(f"pose.handle.{i}") for i in range(2))
    assert lower - upper > 6.0


def test_escape_takes_a_drag_back(window: HeadlessWindow, bending: Editor) -> None:
    bending.do(AddDeformer("teapot", "bend"))
    window.frames(2)
    x, y = window.shell.handle_position("pose.handle.0")
    window.move(x, y)
    window.press()
    window.move(x + 40.0, y)
    window.frames(2)
    assert amount(bending) > 1.0
    window.key(imgui.Key.escape)
    window.release()
    assert amount(bending) == 0.0 and len(bending.history.undo_steps) == 1


def test_dividers_of_a_split_picture_push_each_other(window: HeadlessWindow, bending: Editor) -> None:
    window.frames(2)
    window.click_handle("button.deform.split")
    assert bending.view.split == pytest.approx((1 / 3, 2 / 3))
    window.frames(2)
    window.drag_handle("split.0", (20.0, 0.0))
    assert bending.view.split is not None and bending.view.split[0] > 1 / 3
    window.drag_handle("split.0", (2000.0, 0.0))
    assert bending.view.split == (1.0, 1.0)
    window.frames(2)
    x, y = window.shell.handle_position("split.1")
    window.drag((x, y + 60.0), (x - 40.0, y + 60.0))  # a divider is taken anywhere
    assert bending.view.split[0] < 0.98
    window.drag_handle("split.1", (-2000.0, 0.0))
    assert bending.view.split == (0.0, 0.0)
    window.frames(2)
    window.drag_handle("split.0", (60.0, 0.0))
    assert bending.view.split[1] > 0.02  # neither is stuck
    assert not bending.history.undo_steps  # the view is no edit
    window.click_handle("button.deform.split")
    assert bending.view.split is None


def test_what_a_grip_says_has_room_around_it(window: HeadlessWindow, bending: Editor) -> None:
    bending.do(AddDeformer("teapot", "bend"))
    window.frames(2)
    window.move(*window.shell.handle_position("pose.handle.0"))
    for _ in range(120):  # a tooltip comes after a delay, for which a real window draws frames
        window.frames(1)
        if any(map(is_tooltip, imgui.get_current_context().windows)):
            break
    (said,) = filter(is_tooltip, imgui.get_current_context().windows)
    assert said.window_padding.x > 8.0


def is_tooltip(window: imgui.internal.Window) -> bool:
    return "Tooltip" in window.name and window.active


def test_other_modes_and_objects_have_none(window: HeadlessWindow, bending: Editor) -> None:
    bending.do(AddDeformer("teapot", "bend"))
    for change in (lambda: bending.select("tray"), lambda: bending.do(SetView.of(mode="placement"))):
        change()
        window.frames(2)
        assert "pose.handle.0" not in window.shell.handles.names()


def test_grips_go_with_what_an_animation_carries(window: HeadlessWindow, bending: Editor, monkeypatch) -> None:
    bending.do(AddDeformer("teapot", "bend"))
    window.frames(2)
    before = window.shell.handle_position("pose.handle.0")
    monkeypatch.setattr(bending.controller._drawing, "_carried", (("teapot", (0.2, 0.0, 0.0)),))
    window.frames(2)
    after = window.shell.handle_position("pose.handle.0")
    assert after[0] - before[0] > 5.0 and after[1] == pytest.approx(before[1], abs=2.0)
