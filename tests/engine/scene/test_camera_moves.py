"""Camera moves: expected places, and at any scale of the scene no pole, no NaN and no invalid camera."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from engine.core.camera import camera_frame, project
from engine.scene.camera_moves import (
    MOST_ELEVATION,
    SIDES,
    depth_of,
    distance,
    dolly_camera,
    field_of_view,
    focal_length,
    frame_box,
    is_level,
    level_horizon,
    orbit_camera,
    pan_camera,
    point_at,
    view_from_side,
    with_focal_length,
)
from engine.scene.description import MAX_COORDINATE, Camera

CAMERA = Camera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov_y=40.0)
RESOLUTION = (64, 48)
UNIT = [(-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)]

anywhere = st.one_of(st.floats(-1e9, 1e9), st.floats(-5.0, 5.0), st.floats(-1e-6, 1e-6), st.sampled_from([0.0, 1.0]))
vectors = st.tuples(anywhere, anywhere, anywhere)
numbers = st.floats(-1e6, 1e6)


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    """Any camera that a scene file may have: huge and tiny scenes, all but parallel to its up, tilted, upside down."""
    try:
        return Camera(
            position=draw(vectors), target=draw(vectors), up=draw(vectors), fov_y=draw(st.floats(0.01, 179.0))
        )
    except ValidationError:
        assume(False)
        raise


MOVES: dict[str, Callable[[Camera, float, float], Camera]] = {
    "orbit": lambda camera, a, b: orbit_camera(camera, a, b),
    "pan": lambda camera, a, b: pan_camera(camera, a, b),
    "pan at a depth": lambda camera, a, b: pan_camera(camera, a, b, abs(a)),
    "dolly": lambda camera, a, b: dolly_camera(camera, 2.0 ** max(min(a, 300.0), -300.0)),
    "dolly about": lambda camera, a, b: dolly_camera(camera, abs(b), (a, b, a)),
    "frame": lambda camera, a, b: frame_box(camera, [(a, b, 0.0), (a + abs(b), b, 1.0)], 1.5),
    "frame a point": lambda camera, a, b: frame_box(camera, [(a, b, 0.0)] * 2, 1.0),
    "level": lambda camera, a, b: level_horizon(camera),
    "lens": lambda camera, a, b: with_focal_length(camera, abs(a)),
    **{side: lambda camera, a, b, side=side: view_from_side(camera, side) for side in SIDES},
}


@given(cameras(), st.lists(st.tuples(st.sampled_from(sorted(MOVES)), numbers, numbers), min_size=1, max_size=6))
def test_no_move_makes_a_camera_that_cannot_see(camera: Camera, moves: list[tuple[str, float, float]]) -> None:
    for name, a, b in moves:
        camera = MOVES[name](camera, a, b)
        # As a scene file would be checked: finite, in range, its target elsewhere, its up not along the view.
        assert Camera.model_validate(camera.model_dump()) == camera
        frame = camera_frame(camera)
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-6)


@given(cameras(), numbers, numbers)
def test_an_orbit_keeps_distance_and_horizon(camera: Camera, right: float, up: float) -> None:
    camera = level_horizon(camera)
    # A move that would end beyond the largest coordinate is not made.
    assume(np.abs([camera.position, camera.target]).max() <= MAX_COORDINATE / 8.0)
    moved = orbit_camera(camera, right, up)
    # Positions are known to a part in 1e16 of the largest coordinate, the nearest distance is 1e-8 of it.
    assert distance(moved) == pytest.approx(distance(camera), rel=1e-6)
    assert moved.target == camera.target and is_level(moved)
    outwards = -camera_frame(moved)[2]
    assert abs(math.asin(np.clip(outwards[1], -1, 1))) <= MOST_ELEVATION + 1e-6


def test_an_orbit_goes_right_and_up() -> None:
    # From +Z a quarter to its right is +X; 30 degrees up is at sin 30 of the distance.
    assert orbit_camera(CAMERA, math.pi / 2, 0.0).position == pytest.approx((4.0, 0.0, 0.0))
    assert orbit_camera(CAMERA, 0.0, math.pi / 6).position == pytest.approx((0.0, 2.0, 4.0 * math.cos(math.pi / 6)))
    there = orbit_camera(orbit_camera(CAMERA, 0.7, 0.4), -0.7, -0.4)
    assert there.position == pytest.approx(CAMERA.position)


def test_orbits_stop_at_the_pole_and_come_back_over_the_same_way() -> None:
    top = orbit_camera(CAMERA, 0.0, 10.0)
    assert top.position == pytest.approx((0.0, 4.0, 0.0), abs=1e-3)
    assert camera_frame(top)[1] == pytest.approx((0.0, 0.0, -1.0), abs=1e-3)  # what was far is up
    back = orbit_camera(top, 0.0, -MOST_ELEVATION)
    assert back.position == pytest.approx(CAMERA.position, abs=1e-6)


def test_a_scene_with_another_up_turns_about_that() -> None:
    z_up = Camera(position=(0.0, -4.0, 1.0), target=(0.0, 0.0, 1.0), up=(0.0, 0.0, 1.0))
    assert orbit_camera(z_up, math.pi / 2, 0.0).position == pytest.approx((4.0, 0.0, 1.0))
    # Up as another program writes it, perpendicular to the view: the horizon is level, so Y is the axis.
    tipped = Camera(position=(0.0, 1.0, 1.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, -1.0))
    assert orbit_camera(tipped, math.pi, 0.0).position == pytest.approx((0.0, 1.0, -1.0))


def test_a_tilted_horizon_stays_until_it_is_levelled() -> None:
    tilted = Camera(position=(0.0, 1.0, 4.0), target=(0.0, 0.0, 0.0), up=(0.3, 1.0, 0.0))
    assert not is_level(tilted) and not is_level(orbit_camera(tilted, 0.3, 0.1))
    level = level_horizon(tilted)
    assert is_level(level) and level.position == pytest.approx(tilted.position) and level.up == (0.0, 1.0, 0.0)


@given(cameras(), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_pan_moves_the_picture_by_heights(camera: Camera, right: float, up: float) -> None:
    moved = pan_camera(camera, right, up)
    # Where positions are exact enough for it, and the range ends nowhere near.
    largest = max(map(abs, (*camera.position, *camera.target)))
    assume(moved.position != camera.position and distance(camera) > 1e-6 * max(largest, 1.0))
    place = project(moved, RESOLUTION, np.subtract(camera.target, moved.position))
    assume(np.abs(place).max() < 1e4)
    # What was in the middle stands so many picture heights, of 48 pixels, to the left and below of it.
    assert place == pytest.approx((32.0 - 48.0 * right, 24.0 + 48.0 * up), abs=0.1)


@given(st.floats(0.01, 100.0), st.floats(0, 64), st.floats(0, 48), st.floats(0.1, 50.0))
def test_a_dolly_keeps_what_is_under_the_mouse(factor: float, column: float, row: float, depth: float) -> None:
    point = point_at(CAMERA, RESOLUTION, column, row, depth)
    assert depth_of(CAMERA, point) == pytest.approx(depth, rel=1e-6)
    moved = dolly_camera(CAMERA, factor, point)
    assert project(moved, RESOLUTION, point - moved.position) == pytest.approx((column, row), abs=1e-3)
    assert depth_of(moved, point) == pytest.approx(factor * depth, rel=1e-5)
    assert distance(dolly_camera(CAMERA, factor)) == pytest.approx(4.0 * factor)


def test_focal_lengths_are_those_of_35_mm_film() -> None:
    # A 50 mm lens sees 27.0 degrees over the 24 mm side, one of 12 mm 90 degrees.
    assert field_of_view(50.0) == pytest.approx(26.99, abs=0.01)
    assert field_of_view(12.0) == pytest.approx(90.0)
    assert field_of_view(0.0) == 179.0 and field_of_view(1e9) == 0.01


@given(st.floats(0.01, 179.0))
def test_focal_length_and_field_of_view_are_inverse(fov_y: float) -> None:
    assert field_of_view(focal_length(fov_y)) == pytest.approx(fov_y)


@given(
    st.tuples(*[st.floats(-10, 10)] * 3), st.tuples(*[st.floats(1e-3, 10)] * 3), st.floats(0.2, 4.0),
    st.floats(1.0, 120.0), st.floats(-3, 3), st.floats(-1.5, 1.5),
)  # fmt: skip
def test_a_framed_box_fills_the_picture(
    low: tuple[float, ...], size: tuple[float, ...], aspect: float, fov_y: float, right: float, up: float
) -> None:
    high = np.add(low, size)
    seen_before = orbit_camera(CAMERA.model_copy(update={"fov_y": fov_y}), right, up)
    camera = frame_box(seen_before, [low, high], aspect)
    np.testing.assert_allclose(camera_frame(camera), camera_frame(seen_before), atol=1e-6)
    corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    width, height = 1000.0 * aspect, 1000.0
    assert all(depth_of(camera, corner) > 0.0 for corner in corners)
    places = project(camera, (width, height), corners - camera.position) / (width, height)
    reach = np.abs(places - 0.5).max()
    assert reach <= 0.4501
    # Nearer is not possible: the box turned over, as deep as it is, would touch the edge. A box seen through so wide a
    # lens that the eye would be in it is seen from without.
    assert reach > 0.05


def test_a_cube_is_framed_by_its_front() -> None:
    # Its front, at a depth d - 1 and 2 wide, covers 0.9 of what tan 20 degrees either side sees there.
    camera = frame_box(CAMERA, UNIT, 1.0)
    expected = 1.0 + 1.0 / (0.9 * math.tan(math.radians(20.0)))
    assert camera.position == pytest.approx((0.0, 0.0, expected)) and camera.target == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("side", "position"),
    [("front", (0, 0, 4)), ("back", (0, 0, -4)), ("right", (4, 0, 0)), ("left", (-4, 0, 0)), ("top", (0, 4, 0)),
     ("bottom", (0, -4, 0))],
)  # fmt: skip
def test_the_sides_of_a_scene(side: str, position: tuple[float, ...]) -> None:
    camera = view_from_side(orbit_camera(CAMERA, 0.7, 0.3), side)  # type: ignore[arg-type]
    assert camera.position == pytest.approx(position, abs=2e-3) and is_level(camera)
    if side in ("front", "top", "bottom"):
        assert camera_frame(camera)[0] == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)  # X stays to the right
