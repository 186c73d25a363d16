"""The operator list and the numbers beside the curve."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.curves import SetOperators
from app.document.view_state import SetView
from engine.curve.operators import Operator, TabulatedCurve
from ui.headless import HeadlessWindow
from ui.panels.operator_list import magnitude_text
from ui.theme import CHANNELS

pytestmark = pytest.mark.gl

KEY, FACTOR = "teapot.1", "theta_h"
LOW = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=0.5)
HIGH = Operator("amplify", "y", 0.3, 0.4, 0.5, 0.6, magnitude=2.0)


@pytest.fixture
def listed(window: HeadlessWindow) -> HeadlessWindow:
    """The window with two operators on the curve."""
    window.shell.editor.do(SetOperators(KEY, FACTOR, (LOW, HIGH)))
    window.frames(3)
    return window


def operators(window: HeadlessWindow) -> tuple[object, ...]:
    return window.shell.editor.document.layer(KEY).operators(FACTOR)


def hover_row(window: HeadlessWindow, index: int) -> None:
    """Rows show their buttons only under the mouse."""
    window.frame()
    window.move(*window.shell.handle_position(f"curve.operator.{index}"))
    window.frames(2)


def test_mute_and_unmute(listed: HeadlessWindow) -> None:
    listed.click_handle("button.mute.0")
    assert [o.muted for o in operators(listed)] == [True, False]  # type: ignore[attr-defined]
    listed.click_handle("button.mute.0")
    assert operators(listed) == (LOW, HIGH)


def test_reorder_and_delete(listed: HeadlessWindow) -> None:
    hover_row(listed, 0)
    listed.click_handle("button.up.0")
    assert operators(listed) == (HIGH, LOW)
    hover_row(listed, 1)
    listed.click_handle("button.down.1")
    assert operators(listed) == (LOW, HIGH)
    hover_row(listed, 1)
    listed.click_handle("button.delete.1")
    assert operators(listed) == (LOW,)
    listed.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert operators(listed) == (LOW, HIGH)


def test_a_row_is_marked_with_the_channels_it_changes_where_it_spares_one(listed: HeadlessWindow) -> None:
    green = dataclasses.replace(HIGH, channels=(False, True, False))
    listed.shell.editor.do(SetOperators(KEY, FACTOR, (LOW, green)))
    listed.leave()

    def is_marked(row: int, channel: int) -> bool:
        x, y = (round(place) for place in listed.shell.handle_position(f"curve.operator.{row}"))
        seen = listed.pixels()[y - 8 : y + 8, x - 80 : x + 80]
        return bool((np.abs(seen - 255.0 * np.array(CHANNELS[channel][:3])).max(axis=-1) < 40.0).any())

    assert [is_marked(0, channel) for channel in range(3)] == [False, False, False]
    assert [is_marked(1, channel) for channel in range(3)] == [False, True, False]


def test_selecting_a_row_puts_the_handles_there(listed: HeadlessWindow) -> None:
    listed.click_handle("curve.operator.1")
    view = listed.shell.editor.view
    assert view.operator == 1
    assert view.active_tool == "amplify_y"
    assert view.regions == HIGH.regions
    listed.drag_handle("curve.magnitude", (0, -20))
    low, high = operators(listed)
    assert low == LOW
    assert isinstance(high, Operator) and high.magnitude > 2.0


def test_collapse_keeps_the_curve_and_reset_removes_all(listed: HeadlessWindow) -> None:
    editor = listed.shell.editor
    gamma = np.linspace(0.0, math.pi / 2, 500)
    before = editor.document.layer(KEY).curve(FACTOR)(gamma)
    listed.click_handle("button.curve.collapse")
    (table,) = operators(listed)
    assert isinstance(table, TabulatedCurve)
    after = editor.document.layer(KEY).curve(FACTOR)(gamma)
    # A table of about a thousand samples: within a thousandth of the curve's height.
    np.testing.assert_allclose(after, before, atol=1e-3 * before.max())
    listed.click_handle("button.curve.reset")
    assert operators(listed) == ()
    listed.key(imgui.Key.z, imgui.Key.mod_ctrl)
    listed.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert operators(listed) == (LOW, HIGH)


def type_into(window: HeadlessWindow, handle: str, text: str) -> None:
    """Double-click a field, type over what it holds, confirm."""
    for _ in range(2):
        window.click_handle(handle)
    window.type(text)
    window.key(imgui.Key.enter)
    window.frames(2)


def test_numbers_are_typed_in_degrees(listed: HeadlessWindow) -> None:
    listed.click_handle("curve.operator.0")
    type_into(listed, "curve.d.number", "45")
    low, _ = operators(listed)
    assert isinstance(low, Operator)
    assert low.d == pytest.approx(math.radians(45.0))
    type_into(listed, "curve.magnitude.y.number", "1.25")
    low, _ = operators(listed)
    assert isinstance(low, Operator) and low.magnitude == 1.25
    # An end that is typed past the others takes them along.
    type_into(listed, "curve.a.number", "60")
    low, _ = operators(listed)
    assert isinstance(low, Operator)
    assert low.regions == pytest.approx((math.radians(60.0),) * 4)


def test_a_typed_magnitude_makes_an_operator(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetView.of(active_tool="translate_x", operator=None, regions=(0.2, 0.6, 0.8, 1.2)))
    window.frames(2)
    type_into(window, "curve.magnitude.x.number", "3")
    (made,) = operators(window)
    assert isinstance(made, Operator)
    assert made.magnitude == pytest.approx(math.radians(3.0))


def test_typing_does_not_press_shortcuts(listed: HeadlessWindow) -> None:
    tool = listed.shell.editor.view.active_tool
    listed.click_handle("curve.d.number")
    listed.key(imgui.Key.t)
    listed.key(imgui.Key.delete)
    listed.key(imgui.Key.escape)
    assert operators(listed) == (LOW, HIGH)
    assert listed.shell.editor.view.active_tool == tool


def test_frozen_curves_are_not_edited(listed: HeadlessWindow) -> None:
    listed.click_handle("button.frozen.teapot")
    before = listed.shell.editor.document
    assert before.object("teapot").frozen
    assert "curve.magnitude" not in listed.shell.handles.names()
    listed.click_handle("button.mute.0")
    listed.drag_handle("material.alpha", (-40, 0))
    assert listed.shell.editor.document == before


def test_magnitudes_are_written_for_people() -> None:
    assert magnitude_text(LOW) == "+0.5"
    assert magnitude_text(HIGH) == "× 2"
    assert magnitude_text(Operator("translate", "x", 0, 0, 0, 0, magnitude=math.radians(-4.0))) == "-4°"
    assert magnitude_text(TabulatedCurve((0.0, 1.0), ((1.0, 1.0, 1.0),) * 2)) == "2 samples"
