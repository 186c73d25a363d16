"""Sliders and number fields in the real window: a click edits nothing, a drag does, a double click types."""

from __future__ import annotations

import math

import pytest

from tests.ui.real_window import RealWindow, real_window_fixture
from ui.panels.number_fields import read_number, slider_share, slider_value

pytestmark = pytest.mark.window

real = real_window_fixture()
LONG = 70.0
ALPHA = "editor.document.layer('teapot.1').values['alpha']"
CONTROLS = ("material.alpha", "material.eta.g", "light.intensity", "light.rotation", "view.exposure", "curve.a.number",
            "curve.magnitude.y.number", "accuracy.frame_time")  # fmt: skip
OPERATORS = "editor.document.layer('teapot.1').operators('theta_h')"


def everything(real: RealWindow) -> object:
    """All that a number on screen could change."""
    view = "(editor.view.exposure, editor.view.regions, editor.view.frame_budget_ms, editor.view.operator)"
    layer = "{n: v for n, v in editor.document.layer('teapot.1').values.items()}"
    light = "(editor.document.light.intensity, editor.document.light.rotation)"
    return real.ask(f"({view}, {layer}, {light}, {OPERATORS}, len(editor.history.undo_steps))")


def test_a_click_changes_nothing_and_a_drag_is_one_step(real: RealWindow) -> None:
    real.fresh()
    real.drag("curve.magnitude", by=(0, -30))
    for control in CONTROLS:
        before, steps = everything(real), real.n_steps()
        x, y = real.at(control)
        real.click((x + 6, y))  # beside where its value stands
        real.drag((x + 6, y), by=(2, 0), steps=1)
        assert everything(real) == before, control
        real.drag((x + 2, y), by=(-9 if control == "light.intensity" else 9, 0), steps=3)
        assert everything(real) != before, control
        assert real.n_steps() == steps + (not control.startswith(("view", "accuracy"))), control


@pytest.mark.parametrize("milliseconds", [pytest.param(0.0, marks=pytest.mark.sweep), LONG])
def test_a_double_click_types_over_the_whole_number(real: RealWindow, milliseconds: float) -> None:
    real.fresh()
    real.drag("curve.magnitude", by=(0, -30))
    real.slow(milliseconds)
    for control, typed, found in (
        ("material.alpha", "0.37", ALPHA),
        ("light.rotation", "137.5°", "editor.document.light.rotation"),
        ("curve.c.number", "12,5", f"np.degrees({OPERATORS}[0].c)"),
        ("material.k.b", "3", "editor.document.layer('teapot.1').values['k'][2]"),
    ):
        before, steps = everything(real), real.n_steps()
        real.double_click(control)
        assert real.ask("shell.io.want_text_input") and everything(real) == before
        real.text(typed)
        real.key("enter")
        assert real.ask(found) == pytest.approx(float(typed.replace(",", ".").rstrip("°")))
        assert real.n_steps() == steps + 1


def test_quick_clicks_and_ctrl_type_too(real: RealWindow) -> None:
    real.fresh()
    real.slow(LONG)
    for opened in (lambda: real.quick_clicks("material.alpha"), lambda: real.click("material.alpha", held="ctrl")):
        opened()
        assert real.ask("shell.io.want_text_input") and real.n_steps() == 0
        real.text("9")
        real.key("escape")
        assert real.n_steps() == 0 and "expected" not in real.notice()
    real.quick_clicks("curve.a.number")
    real.key("enter")  # what is not changed stays to the last bit
    assert real.n_steps() == 0 and real.ask("editor.view.regions") == (0.1, 0.25, 0.45, 0.6)


def test_what_is_out_of_range_is_said(real: RealWindow) -> None:
    real.fresh()
    before = everything(real)
    for control, typed, said in (
        ("material.alpha", "3", "Roughness α = 3, expected 0.0001 to 1; nothing was changed"),
        ("curve.a.number", "537", "a = 537°, expected 0° to 90°; nothing was changed"),
        ("light.intensity", "-1", "Intensity = -1, expected 0.01 to 100; nothing was changed"),
        ("view.exposure", "12ev", "Exposure = 12ev, expected a number; nothing was changed"),
        ("accuracy.frame_time", "900 ms", "Frame time = 900 ms, expected 2 ms to 200 ms; nothing was changed"),
    ):
        real.double_click(control)
        real.text(typed)
        real.key("enter")
        assert real.notice() == said
        assert everything(real) == before


def test_an_x_edit_that_would_fold_the_curve_is_said(real: RealWindow) -> None:
    real.fresh()
    real.key("x")
    real.drag("curve.magnitude", by=(8, 0))
    ((magnitude, high),) = real.ask(f"[(o.magnitude, 0.5 * (o.b - o.a)) for o in {OPERATORS}]")
    real.double_click("curve.magnitude.x.number")
    real.text("60")
    real.key("enter")
    assert real.notice().startswith("magnitude = 60°, expected -")
    assert f"° to {math.degrees(high):.5g}°; nothing was changed" in real.notice()
    assert real.ask(f"{OPERATORS}[0].magnitude") == magnitude


def test_shift_is_fine_and_a_hand_that_returns_is_back(real: RealWindow) -> None:
    real.fresh()
    rotation = "editor.document.light.rotation"
    x, y = real.at("light.rotation")
    real.drag((x, y), by=(40, 0))
    coarse = real.ask(rotation)
    real.key("ctrl+z")
    real.drag((x, y), by=(40, 0), held="shift")
    assert real.ask(rotation) == pytest.approx(0.1 * coarse)
    real.key("ctrl+z")
    start, (x, y) = real.ask(ALPHA), real.at("material.alpha")
    real.drag((x, y), by=(-40, 0), let_go=False)
    assert real.ask(ALPHA) < start
    real.events(("move", x, y))
    assert real.ask(ALPHA) == start
    real.release()
    assert real.ask(ALPHA) == start


def test_a_drag_changes_what_is_seen_alike_for_every_parameter(real: RealWindow) -> None:
    real.fresh()
    start, (x, y) = real.ask(ALPHA), real.at("material.alpha")
    real.drag((x, y), by=(100, 0))
    assert real.ask(ALPHA) == pytest.approx(2.0 * start)
    # The width of a highlight goes with the root of its exponent.
    real.do("from app.document.commands import SetModel; editor.do(SetModel('teapot.1', 'ashikhmin_shirley'))")
    exponent = "editor.document.layer('teapot.1').values['n_u']"
    real.drag("material.n_u", by=(50, 0))
    assert real.ask(exponent) + 1.0 == pytest.approx(2.0 * 21.0)
    real.drag("material.n_u", by=(-1000, 0))
    assert real.ask(exponent) == 0.0
    real.drag("material.n_u", by=(50, 0))
    assert real.ask(exponent) == pytest.approx(1.0)


def test_tab_goes_from_field_to_field(real: RealWindow) -> None:
    real.fresh()
    real.double_click("curve.a.number")
    real.text("2")
    real.key("tab")
    real.text("11")
    real.key("enter")
    assert real.ask("np.degrees(editor.view.regions)[:2].tolist()") == pytest.approx([2.0, 11.0])


def test_numbers_are_read_as_people_write_them() -> None:
    assert [read_number(text, "°") for text in ("5", " 5° ", "1e-3", "2,5", "+4")] == [5.0, 5.0, 1e-3, 2.5, 4.0]
    assert [read_number(text) for text in ("", "abc", "nan", "inf", "1_0", "1e999")] == [None] * 6


@pytest.mark.parametrize(("low", "high", "logarithmic"), [(0.0, 1.0, False), (-8.0, 8.0, False), (0.01, 100.0, True)])
def test_shares_and_values_are_inverse(low: float, high: float, logarithmic: bool) -> None:
    for share in (0.0, 0.1, 0.5, 0.93, 1.0):
        assert slider_share(slider_value(share, low, high, logarithmic), low, high, logarithmic) == pytest.approx(share)
