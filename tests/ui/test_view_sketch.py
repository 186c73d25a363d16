"""The boxes that show where a camera goes: projected as the picture is, cut off before the eye."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.document.view_state import SetView
from engine.scene.camera_moves import orbit_camera
from engine.scene.description import Camera
from tests.ui.test_orbit_camera import centre
from ui.headless import HeadlessWindow
from ui.panels.picture_overlays import N_CELLS, has_moved, turned_grid, visible_edges
from ui.panels.status_bar import picture_state

CAMERA = Camera(position=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), fov_y=90.0)
CUBE = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def test_a_cube_before_the_camera_has_twelve_edges() -> None:
    # Its front at depth 2 and its back at 4 reach half and a quarter of the way to the picture's edge, 50 pixels away.
    edges = visible_edges(CUBE, CAMERA, (100.0, 100.0))
    assert len(edges) == 12 and sorted(set(np.round(edges.ravel(), 6))) == [25.0, 37.5, 62.5, 75.0]


def test_what_is_behind_the_camera_is_cut_off() -> None:
    inside = CAMERA.model_copy(update={"position": (0.0, 0.0, 0.5), "target": (0.0, 0.0, -1.0)})
    edges = visible_edges(CUBE, inside, (100.0, 100.0))
    assert len(edges) == 8  # the back's four and the four that lead to it; the front is behind
    assert np.all(np.isfinite(edges))
    behind = CAMERA.model_copy(update={"target": (0.0, 0.0, 9.0)})
    assert len(visible_edges(CUBE, behind, (100.0, 100.0))) == 0


@given(st.lists(st.floats(-5, 5), min_size=6, max_size=6), st.floats(-4, 4), st.floats(-2, 2))
def test_any_box_from_anywhere_has_finite_lines(numbers: list[float], right: float, up: float) -> None:
    box = np.sort(np.reshape(numbers, (2, 3)), axis=0)
    assert np.all(np.isfinite(visible_edges(box, orbit_camera(CAMERA, right, up), (64.0, 48.0))))


def test_a_picture_that_a_camera_went_towards_is_larger_about_its_target() -> None:
    nearer = CAMERA.model_copy(update={"position": (0.0, 0.0, 1.5)})
    grid = turned_grid(CAMERA, nearer, (100.0, 80.0))
    assert grid is not None
    middle = N_CELLS // 2
    assert grid[middle, middle] == pytest.approx((50.0, 40.0), abs=1e-3)
    assert grid[0, 0] == pytest.approx((-50.0, -40.0), abs=1e-3)  # twice as far from the middle as before
    assert grid[-1, -1] == pytest.approx((150.0, 120.0), abs=1e-3)


def test_a_picture_seen_from_where_it_was_is_as_it_was_and_from_behind_there_is_none() -> None:
    grid = turned_grid(CAMERA, CAMERA, (100.0, 80.0))
    assert grid is not None and grid[0, -1] == pytest.approx((100.0, 0.0), abs=1e-3)
    behind = CAMERA.model_copy(update={"position": (0.0, 0.0, -3.0)})
    assert turned_grid(CAMERA, behind, (100.0, 80.0)) is None


@given(st.floats(-180, 180), st.floats(-80, 80))
def test_a_picture_turned_in_any_way_has_finite_places(right: float, up: float) -> None:
    grid = turned_grid(CAMERA, orbit_camera(CAMERA, right, up), (64.0, 48.0))
    assert grid is None or np.all(np.isfinite(grid))


@pytest.mark.gl
def test_they_are_drawn_while_the_view_is_away(window: HeadlessWindow) -> None:
    x, y = centre(window)
    window.move(x, y)
    before = window.pixels()[200:400, 300:800].mean()
    window.press(2)
    window.move(x + 40, y)
    window.frames(2)
    assert window.pixels()[200:400, 300:800].mean() < 0.75 * before
    window.release(2)
    assert window.run_until(lambda: not window.shell.editor.status.is_away, 20.0)
    window.frames(3)
    assert window.pixels()[200:400, 300:800].mean() == pytest.approx(before, rel=0.1)


@pytest.mark.gl
def test_the_picture_stays_bright_while_other_pixels_of_the_same_view_are_awaited(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before = window.pixels()[200:400, 300:800].mean()
    assert editor.do(SetView.of(resolution=(96, 64))) is None
    window.frames(2)
    assert editor.status.is_away  # nothing of it is traced yet, but the camera stands where it stood
    assert window.pixels()[200:400, 300:800].mean() == pytest.approx(before, rel=0.02)
    context = window.shell._context(0.0)
    assert picture_state(context.status, camera_moved=has_moved(context))[1] == "before the change"


@pytest.mark.gl
def test_a_mode_that_draws_while_something_moves_has_the_picture_turned_and_no_boxes(window: HeadlessWindow) -> None:
    assert window.shell.editor.do(SetView.of(mode="orbit")) is None
    window.frames(2)
    x, y = centre(window)
    window.move(x, y)
    before = window.pixels()[200:400, 300:800].astype(float)
    window.press(2)
    window.move(x + 40, y)
    window.frames(2)
    status = window.shell.editor.status
    assert status.is_away and not status.follows_input  # this worker never has a picture of Orbit's
    moved = window.pixels()[200:400, 300:800].astype(float)
    assert moved.mean() > 0.85 * before.mean() and np.abs(moved - before).mean() > 1.0
    window.release(2)


@pytest.mark.gl
def test_in_a_picture_that_is_turned_nothing_is_where_it_was(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    assert editor.do(SetView.of(mode="orbit")) is None
    window.move(*centre(window))
    window.frames(2)
    assert editor.view.hovered is not None
    assert editor.do(SetView.of(camera=orbit_camera(editor.camera_history.camera, 10.0, 0.0))) is None
    window.frames(2)
    assert editor.status.is_away and editor.view.hovered is None
