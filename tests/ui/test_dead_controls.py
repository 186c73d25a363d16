"""No control that can be pressed does nothing, and no pixel of a control is dead."""

from __future__ import annotations

import pytest

from app.document.commands.curves import AddOperator
from app.document.view_state import SetView
from engine.curve.operators import Operator
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl
CURVE = "teapot.1", "theta_h"


def press_reset(window: HeadlessWindow) -> None:
    """Choose "Reset the curve" in the menu, which stays open where that is grey."""
    window.click_handle("menu.Edit")
    window.frames(3)
    window.click_handle("menu.reset_curve")
    window.frames(3)


def test_a_curve_that_nobody_edited_cannot_be_reset(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    press_reset(window)
    assert "menu.reset_curve" in window.shell.handles.names() and not editor.history.undo_steps
    window.click_handle("menu.Edit")  # closes it
    window.frames(3)
    assert editor.do(AddOperator(*CURVE, Operator("amplify", "y", 0.0, 0.1, 0.3, 0.5, magnitude=2.0))) is None
    press_reset(window)
    assert "menu.reset_curve" not in window.shell.handles.names()
    assert not editor.document.layer(CURVE[0]).operators(CURVE[1]) and len(editor.history.undo_steps) == 2


def test_between_two_joined_buttons_no_pixel_is_dead(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.frame()
    (left, y), (right, _) = (window.shell.handle_position(f"mode.{index}") for index in range(2))
    middle = round(0.5 * (left + right))
    for x in range(middle - 2, middle + 3):
        assert editor.do(SetView.of(mode="deform")) is None
        window.frames(2)
        window.click(x + 0.5, y)
        assert editor.view.mode in ("placement", "orbit"), f"a click {x - middle} pixels off the middle is lost"
