"""The curve without a mouse, and Esc in mid-drag: key events of the window, and what they make of the document."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetFrozen
from app.document.document import Document
from app.document.view_state import SetView
from app.operators.registry import GROUPS, listed_lines
from engine.curve.operators import Operator
from tests.ui.small_scene import linear_picture, wait_until_exact
from ui.headless import HeadlessWindow
from ui.layout import PANELS
from ui.panels.curve_gestures import END_NAMES
from ui.panels.curve_keyboard import next_handle

pytestmark = pytest.mark.gl

KEY, FACTOR = "teapot.1", "theta_h"
LIFT = Operator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=0.5)
HANDLES = ("magnitude", *END_NAMES, "region")
DEGREE = math.pi / 180.0
Key = imgui.Key


@pytest.fixture
def lifted(window: HeadlessWindow) -> HeadlessWindow:
    """The window with one operator on the curve, selected; the axes stand still."""
    editor = window.shell.editor
    editor.do(SetOperators(KEY, FACTOR, (LIFT,)))
    editor.do(SetView.of(operator=0, regions=LIFT.regions, curve_zoom=(0.0, math.pi / 2, 0.0, 10.0)))
    wait_until_exact(window)
    return window


def operator(window: HeadlessWindow) -> Operator:
    (found,) = window.shell.editor.document.layer(KEY).operators(FACTOR)
    assert isinstance(found, Operator)
    return found


def n_steps(window: HeadlessWindow) -> int:
    return len(window.shell.editor.history.undo_steps)


def choose(window: HeadlessWindow, handle: str) -> None:
    """Tab to a handle."""
    for _ in range(len(HANDLES)):
        if window.shell.state.handle == handle:
            return
        window.key(Key.tab)
    assert window.shell.state.handle == handle


def test_tab_goes_round_the_handles_both_ways(lifted: HeadlessWindow) -> None:
    for expected in (*HANDLES, HANDLES[0]):
        lifted.key(Key.tab)
        assert lifted.shell.state.handle == expected
    for expected in ("region", "d", "c"):
        lifted.key(Key.tab, Key.mod_shift)
        assert lifted.shell.state.handle == expected
    # Choosing is no edit.
    assert operator(lifted) == LIFT
    assert next_handle(HANDLES, None, back=True) == "region"


@pytest.mark.parametrize("handle", ["a", "b", "c", "d"])
def test_arrows_move_an_end_by_a_degree_and_with_shift_by_a_tenth(lifted: HeadlessWindow, handle: str) -> None:
    choose(lifted, handle)
    before, steps = getattr(operator(lifted), handle), n_steps(lifted)
    lifted.key(Key.right_arrow)
    assert getattr(operator(lifted), handle) == pytest.approx(before + DEGREE, abs=1e-9)
    lifted.key(Key.left_arrow, Key.mod_shift)
    assert getattr(operator(lifted), handle) == pytest.approx(before + 0.9 * DEGREE, abs=1e-9)
    assert operator(lifted).magnitude == LIFT.magnitude
    assert n_steps(lifted) == steps + 2
    # The other arrows mean nothing to an end, and make no step.
    lifted.key(Key.up_arrow)
    assert n_steps(lifted) == steps + 2


def test_arrows_move_the_whole_region(lifted: HeadlessWindow) -> None:
    choose(lifted, "region")
    lifted.key(Key.left_arrow)
    assert operator(lifted).regions == pytest.approx([end - DEGREE for end in LIFT.regions], abs=1e-9)


def test_arrows_move_the_ring(lifted: HeadlessWindow) -> None:
    lifted.shell.editor.do(SetView.of(curve_zoom=(0.0, math.pi / 2, 0.0, 1.0)))
    choose(lifted, "magnitude")
    lifted.key(Key.up_arrow)
    # A fiftieth of the height shown, 0 to 1; with Shift a tenth of that.
    assert operator(lifted).magnitude == pytest.approx(0.52, abs=1e-9)
    lifted.key(Key.down_arrow, Key.mod_shift)
    assert operator(lifted).magnitude == pytest.approx(0.518, abs=1e-9)
    lifted.key(Key.right_arrow)
    assert operator(lifted).magnitude == pytest.approx(0.518, abs=1e-9)


def test_the_first_arrow_makes_the_operator_of_the_tool(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(active_tool="amplify_y", curve_zoom=(0.0, math.pi / 2, 0.0, 10.0)))
    window.frames(2)
    before = editor.document
    window.key(Key.up_arrow)
    assert operator(window).kind == "amplify" and operator(window).magnitude == pytest.approx(1.05)
    assert editor.view.operator == 0 and window.shell.state.handle == "magnitude"
    window.key(Key.z, Key.mod_ctrl)
    assert editor.document == before


def test_a_key_held_is_one_step(lifted: HeadlessWindow) -> None:
    before, steps = lifted.shell.editor.document, n_steps(lifted)
    choose(lifted, "b")
    lifted.hold(Key.right_arrow, True)
    lifted.frames(40)  # however long: it is the system that repeats a key
    for _ in range(5):
        lifted.shell.events.repeat(Key.right_arrow)
    lifted.hold(Key.right_arrow, False)
    lifted.frames(8)  # an event a frame, where a frame is too slow for more
    assert (operator(lifted).b - LIFT.b) / DEGREE == pytest.approx(6.0, abs=1e-6)
    assert n_steps(lifted) == steps + 1
    lifted.key(Key.z, Key.mod_ctrl)
    assert lifted.shell.editor.document == before


def test_an_operator_is_deleted_by_its_key(lifted: HeadlessWindow) -> None:
    before = lifted.shell.editor.document
    lifted.key(Key.delete)
    assert lifted.shell.editor.document.layer(KEY).operators(FACTOR) == ()
    lifted.key(Key.z, Key.mod_ctrl)
    assert lifted.shell.editor.document == before


def test_keys_are_left_to_who_types(lifted: HeadlessWindow) -> None:
    for _ in range(2):
        lifted.click_handle("curve.a.number")
    assert lifted.shell.io.want_text_input
    for key in (Key.tab, Key.left_arrow, Key.delete):
        lifted.key(key)
    # The next number has lost a digit; the operator is there, and no handle was chosen or moved.
    assert operator(lifted) == LIFT
    lifted.key(Key.escape)
    assert operator(lifted) == LIFT
    assert lifted.shell.state.handle is None


def test_other_panels_keep_their_arrows(lifted: HeadlessWindow) -> None:
    # Ctrl-Tab puts the keyboard into another panel; there the arrows step through its controls.
    before = lifted.shell.editor.document
    go_to_another_panel(lifted, times=1)
    assert lifted.shell.io.nav_visible
    at = imgui.get_current_context().nav_id  # type: ignore[attr-defined]
    for _ in range(3):
        lifted.key(Key.down_arrow)
    assert imgui.get_current_context().nav_id != at  # type: ignore[attr-defined]
    assert lifted.shell.state.handle is None
    assert lifted.shell.editor.document == before


def test_the_curve_has_its_keys_when_ctrl_tab_goes_there(lifted: HeadlessWindow) -> None:
    times = 1
    go_to_another_panel(lifted, times)
    while not imgui.get_current_context().nav_window.name.endswith("###curve"):  # type: ignore[attr-defined]
        times += 1  # the order is that in which panels were gone to last
        assert times < len(PANELS)
        go_to_another_panel(lifted, times)
    lifted.key(Key.up_arrow)
    assert operator(lifted).magnitude > LIFT.magnitude


def go_to_another_panel(window: HeadlessWindow, times: int) -> None:
    for key in (Key.left_ctrl, Key.mod_ctrl):
        window.hold(key, True)
    window.frames(2)
    for _ in range(times):
        window.key(Key.tab)
    for key in (Key.mod_ctrl, Key.left_ctrl):
        window.hold(key, False)
    window.frames(2)


def test_a_frozen_curve_has_no_keys(lifted: HeadlessWindow) -> None:
    editor = lifted.shell.editor
    editor.do(SetFrozen("teapot", True))
    lifted.frames(2)
    before = editor.document
    lifted.key(Key.up_arrow)
    assert editor.document == before and not editor.status.is_error


# ---------------------------------------------------------------------------------------------------------------- Esc


def _curve_drag(window: HeadlessWindow) -> None:
    _press_and_move(window, "curve.magnitude", (0, -60))


def _pull(window: HeadlessWindow) -> None:
    _press_and_move(window, "curve.line", (0, -40))


def _end_drag(window: HeadlessWindow) -> None:
    _press_and_move(window, "curve.c", (50, 0))


def _slider_drag(window: HeadlessWindow) -> None:
    _press_and_move(window, "material.alpha", (-40, 0))


def _wheel_drag(window: HeadlessWindow) -> None:
    _press_and_move(window, "light.wheel", (-40, 20))


def _key_drag(window: HeadlessWindow) -> None:
    window.hold(Key.up_arrow, True)
    window.frames(3)


def _press_and_move(window: HeadlessWindow, handle: str, by: tuple[int, int]) -> None:
    x, y = window.shell.handle_position(handle)
    window.move(x, y)
    window.frame()
    window.press()
    for share in (0.5, 1.0):
        window.move(x + share * by[0], y + share * by[1])


@pytest.mark.parametrize("drag", [_curve_drag, _pull, _end_drag, _slider_drag, _wheel_drag, _key_drag])
def test_escape_cancels_the_gesture(lifted: HeadlessWindow, drag: Callable[[HeadlessWindow], None]) -> None:
    editor = lifted.shell.editor
    before, view, steps, shown = editor.document, editor.view, n_steps(lifted), linear_picture(lifted)
    drag(lifted)
    assert editor.document != before
    lifted.key(Key.escape)
    _untouched(lifted, before, steps)
    # The hand still holds on and moves: nothing follows it until it takes hold anew.
    x, y = lifted.shell.handle_position("curve.plot")
    lifted.move(x, y)
    lifted.frames(20)
    _untouched(lifted, before, steps)
    lifted.release()
    lifted.hold(Key.up_arrow, False)
    lifted.frames(2)
    _untouched(lifted, before, steps)
    assert editor.history.redo_label is None
    assert (editor.view.operator, editor.view.regions, editor.view.selected) == (0, view.regions, view.selected)
    wait_until_exact(lifted)
    np.testing.assert_allclose(linear_picture(lifted), shown, rtol=2e-5, atol=1e-6)


def _untouched(window: HeadlessWindow, before: Document, steps: int) -> None:
    """The very document of before, bit by bit, with no step more and no gesture under way."""
    assert window.shell.editor.document is before
    assert n_steps(window) == steps
    assert window.shell.state.grip is None
    assert not window.shell.editor.history.dragging


def test_a_drag_after_a_cancelled_one_is_a_step(lifted: HeadlessWindow) -> None:
    steps = n_steps(lifted)
    _curve_drag(lifted)
    lifted.key(Key.escape)
    lifted.release()
    lifted.drag_handle("curve.magnitude", (0, -30))
    assert n_steps(lifted) == steps + 1
    assert operator(lifted).magnitude > LIFT.magnitude


def test_the_keys_are_listed() -> None:
    listed = dict(line for group in GROUPS for line in listed_lines(group))
    assert {"Tab", "Arrow keys", "Delete", "Esc"} <= listed.keys()
    assert "Shift" in listed["Arrow keys"] and "drag" in listed["Esc"]


@pytest.mark.parametrize("handle", ["mode.1", "button.undo"])
def test_keys_work_after_a_click_in_the_menu_bar(lifted: HeadlessWindow, handle: str) -> None:
    editor = lifted.shell.editor
    editor.do(SetOperators(KEY, FACTOR, ()))
    lifted.frames(2)
    lifted.click_handle(handle)
    before = n_steps(lifted)
    lifted.key(Key.z, Key.mod_ctrl)
    assert n_steps(lifted) == before - 1
