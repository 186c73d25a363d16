"""The picture's place: zoom about the mouse, pan, the picture alone; what is picked under the mouse stays right."""

from __future__ import annotations

import random

import pytest
from imgui_bundle import imgui

from app.document.view_state import SetView, ViewState
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import ViewportRect, zoom_at

ROOM = ViewportRect(100.0, 50.0, 600.0, 400.0, Picture(imgui.ImTextureRef(1), 300, 300))


def test_zoom_keeps_the_point_under_the_mouse() -> None:
    view = ViewState()
    # Near the middle, so that no edge holds the picture back.
    for steps, mouse in ((6.0, (410.0, 260.0)), (3.0, (380.0, 240.0)), (-2.0, (400.0, 250.0))):
        before = ROOM.place(view)
        view = zoom_at(ROOM, before, steps, *mouse).apply(view)
        after = ROOM.place(view)
        assert after.scale == pytest.approx(before.scale * 1.2**steps)
        # To within half a pixel of the screen: the picture's corner stands on a whole one.
        assert after.point(*mouse) == pytest.approx(before.point(*mouse), abs=0.51 / after.scale + 1e-9)


def test_however_it_is_moved_the_picture_fills_the_room_or_stands_in_its_middle() -> None:
    chance = random.Random(5)
    view = ViewState()
    for _ in range(400):
        placed = ROOM.place(view)
        x, y = chance.uniform(100, 700), chance.uniform(50, 450)
        if chance.random() < 0.5:
            view = zoom_at(ROOM, placed, chance.uniform(-8, 8), x, y).apply(view)
        else:
            view = ROOM.shown(placed.scale, x, y).apply(view)
        placed = ROOM.place(view)
        for start, extent, corner, room in (
            (placed.x, placed.width, ROOM.x, ROOM.width), (placed.y, placed.height, ROOM.y, ROOM.height),
        ):  # fmt: skip
            if extent <= room:
                assert start + 0.5 * extent == pytest.approx(corner + 0.5 * room, abs=1.0)
            else:
                assert start <= corner + 1.0 and start + extent >= corner + room - 1.0
        # What is shown is what the view says: placing it again changes nothing.
        assert ROOM.place(ROOM.shown(placed.scale, placed.x, placed.y).apply(view)) == placed or view.fit


def test_zooming_out_ends_at_all_of_it() -> None:
    view = zoom_at(ROOM, ROOM.place(ViewState()), 3.0, 300.0, 200.0).apply(ViewState())
    # All of it is 400 pixels high at a scale of 4/3; smaller than that, down to pixel for pixel, is allowed.
    view = zoom_at(ROOM, ROOM.place(view), -100.0, 300.0, 200.0).apply(view)
    assert not view.fit and view.zoom == 1.0
    small = ViewportRect(0.0, 0.0, 150.0, 150.0, ROOM.picture)
    view = zoom_at(small, small.place(view), -100.0, 20.0, 20.0).apply(view)
    assert view.fit


def centre(window: HeadlessWindow) -> tuple[float, float]:
    window.frames(1)
    return window.shell.handle_position("viewport.centre")


@pytest.mark.gl
def test_with_ctrl_and_alt_the_wheel_zooms_and_a_drag_pans(window: HeadlessWindow) -> None:
    view = window.shell.editor.view
    assert view.fit
    x, y = centre(window)
    window.move(x, y)
    for key in (imgui.Key.mod_ctrl, imgui.Key.mod_alt):
        window.hold(key, True)
    for _ in range(6):
        window.wheel(1.0)
    view = window.shell.editor.view
    assert not view.fit and view.zoom > 20.0
    for button in (2, 0):
        corner = window.shell.handle_position("viewport.corner")
        window.drag((x, y), (x - 40, y + 25), button=button)
        moved = window.shell.handle_position("viewport.corner")
        assert moved == pytest.approx((corner[0] - 40, corner[1] + 25), abs=1.5)
    assert window.shell.editor.view.zoom == view.zoom and window.shell.state.grip is None
    assert window.shell.editor.view.camera is None and window.shell.editor.view.lobe_pixel is None
    # It is no edit, and selects nothing.
    assert not window.shell.editor.history.undo_steps
    assert window.shell.editor.view.selected is not None and window.shell.editor.view.selected.object == "teapot"


@pytest.mark.gl
def test_a_click_selects_what_is_under_it_at_any_zoom(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    chance = random.Random(3)
    names = ("teapot", "tray", "wall", "lamp")  # upright stripes, each a quarter of the width
    x, y = centre(window)
    for _ in range(6):
        editor.do(SetView.of(fit=False, zoom=chance.uniform(1.0, 40.0), centre=(chance.random(), chance.random())))
        window.frames(2)
        left, top = window.shell.handle_position("viewport.corner")
        mouse = (round(x + chance.uniform(-300, 300)), round(y + chance.uniform(-200, 200)))
        column, row = ((m - c) / editor.view.zoom for m, c in zip(mouse, (left, top), strict=True))
        window.click(*mouse)
        inside = 0 <= column < WIDTH and 0 <= row < HEIGHT
        stripe = names[int(column * 4 / WIDTH)] if inside else None
        selected = editor.view.selected
        assert (selected and selected.object) == stripe, (column, row)


@pytest.mark.gl
def test_a_lobe_is_picked_at_the_pixel_under_the_mouse(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetView.of(fit=False, zoom=32.0, centre=(0.1, 0.5)))
    window.frames(2)
    left, top = window.shell.handle_position("viewport.corner")
    window.hold(imgui.Key.mod_alt, True)
    window.click(left + 32.0 * 5.5, top + 32.0 * 16.5)
    window.hold(imgui.Key.mod_alt, False)
    assert window.shell.editor.view.lobe_pixel == (5, 16)


@pytest.mark.gl
def test_pixels_are_squares_beyond_twice_their_size(window: HeadlessWindow) -> None:
    def levels(zoom: float) -> int:
        """How many levels of green there are along a row about the border of two stripes."""
        window.shell.editor.do(SetView.of(fit=False, zoom=zoom, centre=(0.5, 0.5), hovered=None))
        window.shell.editor.select(None)
        window.leave()
        x, y = (round(v) for v in centre(window))
        return len(set(window.pixels()[y, x - int(zoom) + 2 : x + int(zoom) - 2, 1].tolist()))

    assert levels(10.0) == 2  # one pixel of either stripe, below the zoom that shows the grid of pixels
    window.shell.editor.do(SetView.of(fit=True))
    window.frames(2)
    x, y = (round(v) for v in window.shell.handle_position("viewport.corner"))
    fitted = window.pixels()[y + 100, x + 60 : x + 260, 1]
    assert len(set(fitted.tolist())) > 2  # fitted, they are smoothed


@pytest.mark.gl
def test_space_shows_the_picture_alone_and_esc_brings_the_panels_back(window: HeadlessWindow) -> None:
    def width() -> float:
        window.frames(3)
        node = imgui.internal.find_window_by_name("Picture###viewport")
        return float(node.size.x)

    before = width()
    for back in (imgui.Key.space, imgui.Key.escape):
        window.key(imgui.Key.space)
        assert window.shell.state.single_panel and width() == 1280.0
        window.key(back)
        assert not window.shell.state.single_panel and width() == before
    assert window.shell.editor.view.selected is not None  # Esc did one thing


@pytest.mark.gl
def test_keys_fit_the_picture_and_show_it_pixel_for_pixel(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    for key, expected in ((imgui.Key._1, (False, 1.0)), (imgui.Key._0, (True, 1.0))):
        editor.do(SetView.of(zoom=1.0))
        window.key(key)
        assert (editor.view.fit, editor.view.zoom) == expected
