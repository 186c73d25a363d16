"""Handles of lamps in the real window by mouse: the sides and the corner of a rectangle, the rim of a disc and a ball,
and the rims of a spot's cone; a drag is one step, Esc takes it back, and the picture follows."""

from __future__ import annotations

import pytest

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)
BRIGHTNESS = "float(window._feed.source.renderer.display_image()[..., :3].mean())"


def value(real: RealWindow, name: str) -> float:
    """One of the selected lamp's values by number."""
    state = "editor.document.object(editor.view.selected.object)"
    return real.ask(f"__import__('app.document.commands.lamps', fromlist=['any']).lamp_value({state}, {name!r})")


def select_added(real: RealWindow, what: str) -> None:
    """Add a light where the camera sees it, and select it."""
    real.fresh(select="ball.1.theta_h")
    adds = f"editor.do(AddObject('{what} light', 'added', (-0.5, 0.8, 0.3), 0.3))"
    real.do(f"from app.document.commands import AddObject; {adds}")
    real.wait_until("editor.status.is_finished and 'added' in [s.name for s in editor.document.objects]")
    real.do("editor.select('added')")


def test_the_sides_and_the_corner_of_a_rectangle(real: RealWindow) -> None:
    real.fresh(select="lamp")
    real.settle()
    assert {"light.width", "light.height", "light.size"} <= set(real.handles())
    width, height = value(real, "width"), value(real, "height")
    # Half a metre wide, and 0.35 √2 m high, askew in the scene's file.
    assert (width, height) == pytest.approx((0.5, 0.35 * 2.0**0.5))
    before = real.ask(BRIGHTNESS)
    real.drag("light.width", by=(30.0, 0.0))
    wide = value(real, "width")
    assert wide > 1.1 * width and value(real, "height") == pytest.approx(height) and real.n_steps() == 1
    real.move((1.0, 1.0))
    real.wait_until(f"editor.status.is_finished and {BRIGHTNESS} > {before} + 0.001")
    real.drag("light.height", by=(0.0, -20.0))
    assert value(real, "height") > 1.05 * height and value(real, "width") == pytest.approx(wide)
    proportion = value(real, "width") / value(real, "height")
    real.drag("light.size", by=(15.0, -15.0))
    assert value(real, "width") / value(real, "height") == pytest.approx(proportion)
    assert value(real, "width") > wide and real.n_steps() == 3
    real.quick("ctrl+z", 3)
    assert real.ask("editor.document.object('lamp').transform.is_identity")
    real.drag("light.width", by=(30.0, 0.0), let_go=False)
    real.key("escape")
    real.release()
    assert real.ask("editor.document.object('lamp').transform.is_identity") and real.n_steps() == 0


@pytest.mark.parametrize("what", ["disc", "sphere"])
def test_the_rim_of_a_round_light(real: RealWindow, what: str) -> None:
    select_added(real, what)
    radius = value(real, "radius")
    assert radius == pytest.approx(0.15, rel=1e-3)
    steps = real.n_steps()
    x, y = real.at("light.radius")
    real.click((x + 1.0, y))  # a click without a drag is no edit
    assert value(real, "radius") == radius and real.n_steps() == steps
    real.drag((x, y), by=(20.0, 0.0))
    grown = value(real, "radius")
    assert grown > 1.1 * radius and real.n_steps() == steps + 1
    # Its grip stays under the mouse.
    assert real.at("light.radius") == pytest.approx((x + 20.0, y), abs=3.0)
    real.drag("light.radius", by=(-20.0, 0.0))
    assert value(real, "radius") == pytest.approx(radius, rel=0.05)


def test_the_rims_of_a_cone(real: RealWindow) -> None:
    select_added(real, "spot")
    steps = real.n_steps()
    assert (value(real, "inner_angle"), value(real, "outer_angle")) == (20.0, 30.0)
    # The grips are opposite each other: away from the inner one is outward.
    (x, y), (there_x, there_y) = real.at("light.inner_angle"), real.at("light.outer_angle")
    away = complex(there_x - x, there_y - y) / abs(complex(there_x - x, there_y - y))
    real.drag("light.outer_angle", by=(25.0 * away.real, 25.0 * away.imag))
    outer = value(real, "outer_angle")
    assert 31.0 < outer <= 90.0 and value(real, "inner_angle") == pytest.approx(outer * 20.0 / 30.0)
    before = real.ask(BRIGHTNESS)
    real.drag("light.inner_angle", by=(8.0 * away.real, 8.0 * away.imag))
    inner = value(real, "inner_angle")
    assert inner < outer * 20.0 / 30.0 - 1.0 and value(real, "outer_angle") == outer
    assert real.n_steps() == steps + 2
    real.move((1.0, 1.0))
    real.wait_until(f"editor.status.is_finished and abs({BRIGHTNESS} - {before}) > 1e-4")
    # Never wider than the outer angle.
    real.drag("light.inner_angle", by=(-150.0 * away.real, -150.0 * away.imag))
    assert value(real, "inner_angle") <= value(real, "outer_angle") == outer
    real.quick("ctrl+z", 3)
    assert (value(real, "inner_angle"), value(real, "outer_angle")) == (20.0, 30.0)


def test_handles_leave_for_those_that_move_and_come_back(real: RealWindow) -> None:
    real.fresh(select="lamp")
    real.settle()
    real.key("v")
    assert "light.width" not in real.handles() and "gizmo.x" in real.handles()
    real.key("escape")
    assert "light.width" in real.handles()
    real.click("objects.ball", held="ctrl")
    assert "light.width" not in real.handles()


def test_a_rectangle_over_the_picture_selects_what_it_meets(real: RealWindow) -> None:
    real.fresh(select="ball.1.theta_h")
    x, y = real.at("viewport.centre")
    real.key("b")
    real.drag((x + 15.0, y + 10.0), by=(-30.0, -20.0))
    assert real.ask("editor.view.selected_objects") == ("ball",) and real.ask("state.grip is None")
    left, top = real.at("viewport.corner")
    real.key("b")
    real.drag((left + 2.0, 2.0 * y - top - 2.0), to=(x, y), held="shift")
    assert set(real.ask("editor.view.selected_objects")) == {"ball", "ground"}
    real.key("b")
    real.drag((x + 15.0, y + 10.0), by=(-30.0, -20.0), held="ctrl")
    assert real.ask("editor.view.selected_objects") == ("ground",)
    real.key("b")
    real.drag((left + 2.0, top + 2.0), to=(x, y), let_go=False)
    real.key("escape")
    real.release()
    assert real.ask("editor.view.selected_objects") == ("ground",) and real.n_steps() == 0
