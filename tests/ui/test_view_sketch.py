"""The boxes that show where a camera goes: projected as the picture is, cut off before the eye."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.view_state import SetView
from engine.scene.camera_moves import orbited
from engine.scene.description import Camera
from tests.ui.test_orbit_camera import centre
from ui.headless import HeadlessWindow
from ui.panels.status_bar import picture_state
from ui.panels.view_sketch import has_moved, seen_edges

CAMERA = Camera(position=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), fov_y=90.0)
CUBE = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def test_a_cube_before_the_camera_has_twelve_edges() -> None:
    # Its front at depth 2 and its back at 4 reach half and a quarter of the way to the picture's edge, 50 pixels away.
    edges = seen_edges(CUBE, CAMERA, (100.0, 100.0))
    assert len(edges) == 12 and sorted(set(np.round(edges.ravel(), 6))) == [25.0, 37.5, 62.5, 75.0]


def test_what_is_behind_the_eye_is_cut_off() -> None:
    inside = CAMERA.model_copy(update={"position": (0.0, 0.0, 0.5), "target": (0.0, 0.0, -1.0)})
    edges = seen_edges(CUBE, inside, (100.0, 100.0))
    assert len(edges) == 8  # the back's four and the four that lead to it; the front is behind
    assert np.all(np.isfinite(edges))
    behind = CAMERA.model_copy(update={"target": (0.0, 0.0, 9.0)})
    assert len(seen_edges(CUBE, behind, (100.0, 100.0))) == 0


@given(st.lists(st.floats(-5, 5), min_size=6, max_size=6), st.floats(-4, 4), st.floats(-2, 2))
def test_any_box_from_anywhere_has_finite_lines(numbers: list[float], right: float, up: float) -> None:
    box = np.sort(np.reshape(numbers, (2, 3)), axis=0)
    assert np.all(np.isfinite(seen_edges(box, orbited(CAMERA, right, up), (64.0, 48.0))))


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
