"""The real window at several sizes: the picture's room, the picture alone, zoom and pan by mouse and keyboard."""

from __future__ import annotations

import pytest

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window
real = real_window_fixture()
PICTURE = "imgui.internal.find_window_by_name('Picture###viewport').size"


def picture_size(real: RealWindow) -> tuple[float, float]:
    return real.ask(f"({PICTURE}.x, {PICTURE}.y)")


def test_the_picture_keeps_most_of_a_window_that_is_made_smaller(real: RealWindow) -> None:
    real.fresh()
    # Of a square picture; before, a window that was made smaller left it 428, 168 and nothing.
    for size, least in (((1380, 860), 540.0), ((800, 600), 310.0), ((400, 300), 200.0), ((1380, 860), 540.0)):
        real.resize(*size)
        real.move((5.0, 5.0))  # a few frames for the layout to settle
        assert min(picture_size(real)) >= least, size
    assert real.ask("editor.view.panel_open('curve')")


def test_space_gives_the_picture_the_whole_width_and_esc_takes_it_back(real: RealWindow) -> None:
    real.fresh()
    before = picture_size(real)
    real.key("space")
    assert picture_size(real)[0] == 1380.0
    real.key("escape")
    assert picture_size(real) == before
    real.quick("space", 2)  # there and back between two frames
    assert picture_size(real) == before
    assert real.ask("editor.view.selected.object") == "teapot"


def test_with_ctrl_and_alt_the_wheel_zooms_about_the_mouse_and_a_drag_pans(real: RealWindow) -> None:
    real.fresh()
    x, y = real.at("viewport.centre")
    real.wheel(1.0, (x + 60, y + 30), held="ctrl+alt", times=4)
    assert real.ask("editor.view.fit") is False
    zoom = real.ask("editor.view.zoom")
    real.wheel(1.0, held="ctrl+alt")
    assert real.ask("editor.view.zoom") == pytest.approx(1.2 * zoom)
    corner = real.at("viewport.corner")
    real.drag((x, y), by=(-50, 20), button=2, held="ctrl+alt")
    assert real.at("viewport.corner") == pytest.approx((corner[0] - 50, corner[1] + 20), abs=1.5)
    real.key("0")
    assert real.ask("editor.view.fit") is True
    real.key("1")
    assert real.ask("(editor.view.fit, editor.view.zoom)") == (False, 1.0)
    # It was no edit, and the wheel over another panel does not zoom the picture.
    real.wheel(1.0, "objects.teapot", times=3)
    assert real.ask("editor.view.zoom") == 1.0 and real.n_steps() == 0


def test_the_window_has_a_least_size(real: RealWindow) -> None:
    real.fresh()
    # Without a window manager nothing enforces it: what matters is that it is asked for.
    real.do(
        "asked = []; old = glfw.set_window_size_limits; glfw.set_window_size_limits = lambda *a: asked.append(a[1:3]);"
        "window._limit_size(); glfw.set_window_size_limits = old; stage.asked = asked"
    )
    assert real.ask("stage.asked") == [(400, 300)]
