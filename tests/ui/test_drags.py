"""Every draggable handle, moved by mouse events: what it does to the document, and that undo takes it all back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.document import Document
from app.document.view_state import SetView
from engine.curve.operators import Operator
from ui.headless import HeadlessWindow
from ui.panels.curve_gestures import core

pytestmark = pytest.mark.gl

KEY, FACTOR = "teapot.1", "theta_h"


def operators(window: HeadlessWindow) -> tuple[Operator, ...]:
    found = window.shell.editor.document.layer(KEY).operators(FACTOR)
    assert all(isinstance(operator, Operator) for operator in found)
    return found  # type: ignore[return-value]


def picture(window: HeadlessWindow) -> np.ndarray:
    """The exact linear picture of now."""
    editor = window.shell.editor
    window.frames(2)
    assert window.run_until(lambda: editor.status.picture == "exact", 90.0), editor.status
    source = window.shell.source
    assert source is not None
    return source.source.renderer.linear_image()  # type: ignore[attr-defined]


def set_view(window: HeadlessWindow, **changes: object) -> None:
    window.shell.editor.do(SetView.of(**changes))
    window.frames(2)


def undone(window: HeadlessWindow, before: Document, shown: np.ndarray, steps: int = 1) -> None:
    """Ctrl-Z restores document and picture; Ctrl-Y brings the edit back."""
    editor = window.shell.editor
    after = editor.document
    assert after != before
    for _ in range(steps):
        window.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert editor.document == before
    # The picture is stepped back in single precision and then rebuilt: equal to what float32 sums allow.
    np.testing.assert_allclose(picture(window), shown, rtol=2e-5, atol=1e-6)
    for _ in range(steps):
        window.key(imgui.Key.y, imgui.Key.mod_ctrl)
    assert editor.document == after


@pytest.mark.parametrize(
    ("tool", "by", "kinds"),
    [
        ("translate_y", (0, -60), [("translate", "y")]),
        pytest.param("translate_x", (25, 0), [("translate", "x")], marks=pytest.mark.sweep),
        ("translate_xy", (20, -50), [("translate", "y"), ("translate", "x")]),
        pytest.param("amplify_y", (0, -40), [("amplify", "y")], marks=pytest.mark.sweep),
        pytest.param("amplify_x", (30, 0), [("amplify", "x")], marks=pytest.mark.sweep),
        ("amplify_xy", (20, -30), [("amplify", "y"), ("amplify", "x")]),
    ],
)
def test_the_ring_makes_operators(
    window: HeadlessWindow, tool: str, by: tuple[int, int], kinds: list[tuple[str, str]]
) -> None:
    before, shown = window.shell.editor.document, picture(window)
    set_view(window, active_tool=tool, regions=(0.1, 0.3, 0.5, 0.9))
    window.drag_handle("curve.magnitude", by)
    made = operators(window)
    # Y stands below X: X moves the regions in which Y acts [BenArtzi07, 9.2].
    assert [(operator.kind, operator.axis) for operator in made] == kinds
    assert all(operator.regions == (0.1, 0.3, 0.5, 0.9) for operator in made)
    # Up and right is more, for every tool.
    assert all(operator.magnitude > operator.neutral_magnitude for operator in made)
    assert np.abs(picture(window) - shown).max() > 1e-3
    undone(window, before, shown)


def test_the_ring_follows_the_mouse(window: HeadlessWindow) -> None:
    # The axes stand still: 0 to 90 degrees, values 0 to 1, which are drawn evenly.
    set_view(window, active_tool="translate_y", regions=(0.3, 0.5, 0.7, 1.0), curve_zoom=(0.0, math.pi / 2, 0.0, 1.0))
    window.drag_handle("curve.magnitude", (0, -50))
    (first,) = operators(window)
    x, y = window.shell.handle_position("curve.magnitude")
    window.drag_handle("curve.magnitude", (0, -50))
    (second,) = operators(window)
    assert window.shell.handle_position("curve.magnitude") == pytest.approx((x, y - 50), abs=1e-3)
    # A linear axis: twice the pixels, twice the translation.
    assert second.magnitude == pytest.approx(2.0 * first.magnitude, rel=1e-9)


@pytest.mark.parametrize(
    ("handle", "by"),
    [
        ("b", 15), ("d", 40), ("b", 200), ("region", 60),
        *(pytest.param(*each, marks=pytest.mark.sweep) for each in (("a", -20), ("c", -12))),
    ],
)  # fmt: skip
def test_bars_move_regions(window: HeadlessWindow, handle: str, by: int) -> None:
    set_view(window, active_tool="translate_y", regions=(0.2, 0.4, 0.6, 0.8))
    window.drag_handle("curve.magnitude", (0, -40))
    before, shown = window.shell.editor.document, picture(window)
    (old,) = operators(window)
    window.drag_handle(f"curve.{handle}", (by, 0))
    (new,) = operators(window)
    assert new.magnitude == old.magnitude
    assert list(new.regions) == sorted(new.regions)
    moved = {name: after - start for name, after, start in zip("abcd", new.regions, old.regions, strict=True)}
    if handle == "region":
        # All four by the same angle: the widths stay.
        assert all(shift == pytest.approx(moved["a"]) for shift in moved.values())
    else:
        assert math.copysign(1.0, moved[handle]) == math.copysign(1.0, by)
    undone(window, before, shown)


def test_a_drag_is_one_step_and_returns_exactly(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    steps = len(editor.history.undo_steps)
    window.drag_handle("curve.magnitude", (0, -70), steps=25)
    assert len(editor.history.undo_steps) == steps + 1
    made = editor.document
    window.frame()
    x, y = window.shell.handle_position("curve.b")
    window.move(x, y)
    window.press()
    for place in (x + 30, x - 10, x):
        window.move(place, y)
    window.release()
    # Measured against the gesture's beginning, a hand that comes back changes nothing, and makes no step.
    assert editor.document == made
    assert len(editor.history.undo_steps) == steps + 1


def test_pulling_the_curve_puts_a_new_operator_there(window: HeadlessWindow) -> None:
    set_view(window, active_tool="amplify_y", regions=(1.2, 1.3, 1.4, 1.5))
    window.drag_handle("curve.line", (0, -25))
    (made,) = operators(window)
    # The handle is on the curve at a twentieth of the visible 90 degrees.
    assert made.b <= 0.05 * math.pi / 2 <= made.c
    assert made.kind == "amplify" and made.magnitude > 1.0


def test_one_channel_is_edited_alone(window: HeadlessWindow) -> None:
    window.click_handle("curve.channel.1")
    window.drag_handle("curve.magnitude", (0, -50))
    (made,) = operators(window)
    assert made.channels == (True, False, False)
    gamma = np.array([core(made.regions)])
    layer = window.shell.editor.document.layer(KEY)
    change = layer.curve(FACTOR)(gamma) - layer.generated_curve(FACTOR)(gamma)
    assert change[0, 0] > 0.0
    assert change[0, 1] == change[0, 2] == 0.0


def test_a_slider_edits_a_parameter(window: HeadlessWindow) -> None:
    before, shown = window.shell.editor.document, picture(window)
    window.drag_handle("material.alpha", (-40, 0))
    after = window.shell.editor.document.layer(KEY).values["alpha"]
    assert after < before.layer(KEY).values["alpha"]  # type: ignore[operator]
    undone(window, before, shown)


def test_a_colour_number_edits_one_channel(window: HeadlessWindow) -> None:
    before = window.shell.editor.document.layer(KEY).values["eta"]
    window.drag_handle("material.eta.g", (60, 0))
    after = window.shell.editor.document.layer(KEY).values["eta"]
    assert isinstance(before, tuple) and isinstance(after, tuple)
    assert (after[0], after[2]) == (before[0], before[2])
    assert after[1] > before[1]


@pytest.mark.parametrize("handle", ["light.rotation", "light.wheel", "light.picture", "viewport.centre"])
def test_the_light_turns(window: HeadlessWindow, handle: str) -> None:
    before, shown = window.shell.editor.document, picture(window)
    shift = handle == "viewport.centre"
    if shift:
        window.hold(imgui.Key.mod_shift, True)
    window.drag_handle(handle, (-40, 20) if handle != "light.rotation" else (60, 0))
    if shift:
        window.hold(imgui.Key.mod_shift, False)
    rotation = window.shell.editor.document.light.rotation
    # To the left is counter-clockwise from above, a growing rotation; the slider grows to the right.
    assert 10.0 < rotation < 200.0
    undone(window, before, shown)


@pytest.mark.parametrize("handle", ["light.wheel", "light.picture"])
def test_shift_turns_the_light_finely(window: HeadlessWindow, handle: str) -> None:
    editor = window.shell.editor
    window.drag_handle(handle, (-30, 10))
    whole = editor.document.light.rotation
    window.key(imgui.Key.z, imgui.Key.mod_ctrl)
    window.hold(imgui.Key.mod_shift, True)
    window.drag_handle(handle, (-30, 10))
    window.hold(imgui.Key.mod_shift, False)
    assert whole > 10.0 and editor.document.light.rotation == pytest.approx(0.1 * whole)


def test_the_dial_goes_on_over_its_top_and_shift_in_mid_drag_makes_no_jump(window: HeadlessWindow) -> None:
    editor, radius = window.shell.editor, 31.0
    window.frame()
    top = window.shell.handle_position("light.wheel")

    def turn_to(*angles: float) -> float:
        """The hand around the dial, radians from its top; the rotation then."""
        for angle in angles:
            window.move(top[0] - radius * math.sin(angle), top[1] + radius * (1.0 - math.cos(angle)))
        return editor.document.light.rotation

    window.move(*top)
    window.press()
    assert (before := turn_to(1.0, 2.0, 3.0, 4.0, 5.0)) == pytest.approx(math.degrees(5.0), abs=2.0)
    window.hold(imgui.Key.mod_shift, True)
    window.frame()
    assert editor.document.light.rotation == before
    assert turn_to(5.5, 6.0, 6.5, 7.0) == pytest.approx(before + 0.1 * math.degrees(2.0), abs=0.2)
    assert turn_to(6.5, 6.0, 5.5, 5.0) == before
    window.hold(imgui.Key.mod_shift, False)
    window.release()
    assert window.shell.state.grip is None


def test_intensity_scales_the_picture(window: HeadlessWindow) -> None:
    before = window.shell.editor.document
    window.drag_handle("light.intensity", (20, 0))
    assert window.shell.editor.document.light.intensity > 1.0
    window.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert window.shell.editor.document == before


def test_view_drags_leave_the_document_alone(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before = editor.document
    window.drag_handle("view.exposure", (15, 0))
    window.drag_handle("accuracy.frame_time", (30, 0))
    window.key(imgui.Key.c)
    assert editor.view.compare is before
    window.drag_handle("viewport.divider", (-50, 0))
    assert editor.view.exposure > 0.0
    assert editor.view.frame_budget_ms > 16.0
    assert editor.view.compare_divider < 0.5
    assert editor.document is before
    assert editor.history.undo_label is None


@pytest.mark.parametrize("pixels", [18, -18])
def test_a_short_drag_of_exposure_is_a_part_of_a_stop(window: HeadlessWindow, pixels: int) -> None:
    editor = window.shell.editor
    before = editor.view.exposure
    window.drag_handle("view.exposure", (pixels, 0))
    # 50 pixels a stop, at any width of the control; the first three tell a drag from a click.
    assert abs(editor.view.exposure - before) == pytest.approx((18 - 3) / 50.0, abs=0.02)
    assert (editor.view.exposure > before) == (pixels > 0)
    editor.do(SetView.of(exposure=before))


def test_click_selects_and_hover_names(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    x, y = window.shell.handle_position("viewport.corner")
    centre = window.shell.handle_position("viewport.centre")
    width = 2.0 * (centre[0] - x)
    # Four upright stripes: teapot, tray, wall, lamp; the second is at 3/8 of the width.
    window.move(x + 0.375 * width, centre[1])
    window.frames(2)
    assert editor.view.hovered == "tray"
    window.click(x + 0.375 * width, centre[1])
    assert editor.view.selected is not None and editor.view.selected.object == "tray"
    window.click(x - 5, centre[1])
    assert editor.view.selected is None


def test_wheel_zooms_and_double_click_shows_all(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    x, y = window.shell.handle_position("curve.plot")
    window.move(x, y)
    window.wheel(3.0)
    zoom = editor.view.curve_zoom
    assert zoom is not None
    # About the mouse, in the middle of 0 to 90 degrees: 45 degrees stay in the middle.
    assert 0.5 * (zoom[0] + zoom[1]) == pytest.approx(math.pi / 4, abs=0.02)
    assert zoom[1] - zoom[0] == pytest.approx(math.pi / 2 * 0.85**3, rel=1e-6)
    window.click_handle("button.curve.fit")
    assert editor.view.curve_zoom is None
