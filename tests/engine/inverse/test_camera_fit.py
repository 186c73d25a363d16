"""The camera of a photograph: found again from points that it sees, and refused where they say too little."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.core.camera import project
from engine.core.errors import InsituError
from engine.inverse.camera_fit import PointPair, fit_camera
from engine.scene.description import Camera

SIZE = (640, 480)
CORNERS = [(x, y, z) for x in (-0.5, 0.5) for y in (0.0, 0.7) for z in (-0.4, 0.4)]
START = Camera(position=(0.0, 1.0, 4.0), target=(0.0, 0.3, 0.0), fov_y=40.0)


def pairs_of(camera: Camera, points: list, noise: float = 0.0) -> list[PointPair]:
    places = project(camera, SIZE, np.array(points) - np.array(camera.position))
    places = places + noise * np.random.default_rng(3).standard_normal(places.shape)
    return [PointPair(tuple(place), point) for place, point in zip(places.tolist(), points, strict=True)]


@pytest.mark.parametrize("n_points", [4, 5, 8])
def test_finds_a_camera_that_is_near(n_points):
    camera = Camera(position=(0.8, 1.3, 3.4), target=(0.1, 0.3, 0.0), up=(0.05, 1.0, 0.0), fov_y=33.0)
    points = [CORNERS[i] for i in ([0, 3, 5, 6, 1, 2, 4, 7][:n_points])]
    found = fit_camera(pairs_of(camera, points), SIZE, START)
    assert found.error < 0.05
    others = np.array(CORNERS)
    seen, wanted = (project(each, SIZE, others - np.array(each.position)) for each in (found.camera, camera))
    assert np.abs(seen - wanted).max() < 2.0  # also of points that are not among the pairs


@settings(max_examples=10, deadline=None)
@given(
    st.floats(0.0, 2.0 * math.pi), st.floats(0.1, 1.2), st.floats(2.5, 8.0), st.floats(20.0, 70.0), st.floats(-0.3, 0.3)
)
def test_finds_a_camera_on_any_side(azimuth, elevation, distance, fov, roll):
    level = math.cos(elevation)
    direction = np.array([level * math.sin(azimuth), math.sin(elevation), level * math.cos(azimuth)])
    camera = Camera(
        position=tuple((distance * direction).tolist()), target=(0.0, 0.3, 0.0),
        up=(roll * math.cos(azimuth), 1.0, -roll * math.sin(azimuth)), fov_y=fov,
    )  # fmt: skip
    found = fit_camera(pairs_of(camera, CORNERS), SIZE, START)
    assert found.error < 1e-2
    assert np.allclose(found.camera.position, camera.position, atol=1e-2)
    assert found.camera.fov_y == pytest.approx(camera.fov_y, rel=1e-2)


def test_half_a_pixel_of_error_stays_half_a_pixel():
    camera = Camera(position=(-1.0, 1.6, 3.0), target=(0.0, 0.3, 0.0), fov_y=38.0)
    found = fit_camera(pairs_of(camera, CORNERS, noise=0.5), SIZE, START)
    assert 0.05 < found.error < 1.0
    assert np.linalg.norm(np.subtract(found.camera.position, camera.position)) < 0.05


def test_refuses_too_few_pairs():
    with pytest.raises(InsituError, match="3 point pairs, expected 4 or more"):
        fit_camera(pairs_of(START, CORNERS[:3]), SIZE, START)


def test_refuses_points_on_a_line():
    points = [(0.1 * i, 0.2 * i, 0.05 * i) for i in range(5)]
    with pytest.raises(InsituError, match="on one line"):
        fit_camera(pairs_of(START, points), SIZE, START)


def test_refuses_the_same_place_for_all():
    with pytest.raises(InsituError, match="places of the pairs are on one line"):
        fit_camera([PointPair((100.0, 100.0), point) for point in CORNERS], SIZE, START)


def test_refuses_numbers_that_are_not_finite():
    pairs = [*pairs_of(START, CORNERS), PointPair((math.nan, 0.0), (0.0, 0.0, 0.0))]
    with pytest.raises(InsituError, match="pair 9: .*expected finite numbers"):
        fit_camera(pairs, SIZE, START)


def test_names_the_pair_that_does_not_fit():
    pairs = pairs_of(START, CORNERS)
    pairs[2] = PointPair((pairs[2].place[0] + 400.0, pairs[2].place[1] - 300.0), pairs[2].point)
    with pytest.raises(InsituError, match="pair 3 contradicts the others"):
        fit_camera(pairs, SIZE, START)


def test_says_by_how_much_four_pairs_are_missed():
    pairs = pairs_of(START, [CORNERS[i] for i in (0, 3, 5, 6)])
    pairs = [PointPair(place, pairs[(i + 1) % 4].point) for i, (place, _) in enumerate(pairs)]
    pairs[0] = PointPair((pairs[0].place[0] + 300.0, pairs[0].place[1]), pairs[0].point)
    with pytest.raises(InsituError, match="no camera sees these points at their places"):
        fit_camera(pairs, SIZE, START)
