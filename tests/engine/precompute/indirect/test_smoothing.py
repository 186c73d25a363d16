"""The filter that takes noise out of what gather points reflect."""

import numpy as np
import pytest

from engine.precompute.indirect._reflection_kernels import smooth_planes, smooth_rows
from engine.precompute.indirect.smoothing import Smoothing, no_smoothing, smoothing_for
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, placement_of

HITS = placement_of(CORNER, **CORNER_VIEW, n=48).hits
ROWS = np.arange(len(HITS.pixel), dtype=np.int32)
OBJECTS = HITS.object_image.ravel()[HITS.pixel]
X = HITS.pixel % HITS.resolution[0]


def filtered(smoothing: Smoothing, values: np.ndarray) -> np.ndarray:
    out = np.empty_like(values)
    smooth_rows(*smoothing, values, out)
    return out


def filter_of(light: np.ndarray, noise: float, seed: int = 3) -> tuple[Smoothing, np.ndarray]:
    """The filter for two halves of noisy light (p, 3), and their mean."""
    random = np.random.default_rng(seed)
    halves = [np.float32(light + noise * light * random.normal(size=(len(light), 1))) for _ in range(2)]
    return smoothing_for(HITS, ROWS, np.full(len(CORNER), 0.9, np.float32), *halves), 0.5 * (halves[0] + halves[1])


def error(light: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean((light - truth) ** 2)) / truth.mean())


STEP = np.where(X > 20, 1.0, 0.2)[:, None] * np.array([1.0, 0.8, 0.6])


def test_noise_goes_and_a_step_stays():
    beside, left, kept = abs(X - 20.5) < 1.0, [], []
    for seed in range(8):  # of neighbours equally far one is chosen by chance, and beside a step are few points
        smoothing, noisy = filter_of(STEP, 0.15, seed)
        clean = filtered(smoothing, noisy)
        left.append(error(clean, STEP) / error(noisy, STEP))
        kept.append(error(clean[beside], STEP[beside]) / error(noisy[beside], STEP[beside]))
        assert clean.mean() == pytest.approx(STEP.mean(), rel=0.01)
    assert np.mean(left) < 0.55 and np.mean(kept) < 0.75


def test_what_is_quiet_stays_as_it_is():
    smoothing, light = filter_of(STEP, 0.002)
    np.testing.assert_allclose(filtered(smoothing, light), light, rtol=1e-6)


def test_a_lamp_mirrored_in_two_pixels_stays():
    # Few rays find it, so that it is noisy; compared by means of nine points it all but goes under in its slope.
    spot = (abs(X - 20.5) < 1.0) & (HITS.pixel // HITS.resolution[0] == 20)
    slope = np.clip(3.0 - 0.5 * (X - 18), 0.3, 4.0)
    light = np.where(spot, 9.0, slope)[:, None] * np.array([1.0, 0.8, 0.6])
    chance = np.where(spot, 0.2, 0.02 * np.random.default_rng(3).normal(size=len(X)))[:, None]
    halves = [np.float32(light * (1.0 + sign * chance)) for sign in (-1, 1)]
    smoothing = smoothing_for(HITS, ROWS, np.full(len(CORNER), 0.9, np.float32), *halves)
    assert spot.sum() == 2
    assert error(filtered(smoothing, np.float32(light))[spot], light[spot]) < 0.1  # 0.6 without a look at the halves


def test_weights_are_a_mean_within_one_object():
    smoothing, _ = filter_of(STEP, 0.3)
    point = np.repeat(ROWS, np.diff(smoothing.start))
    np.testing.assert_allclose(np.bincount(point, smoothing.weight), 1.0, rtol=1e-5)
    assert (smoothing.weight > 0.0).all()
    np.testing.assert_array_equal(OBJECTS[smoothing.neighbour], OBJECTS[point])


def test_planes_are_filtered_as_points_are():
    smoothing, light = filter_of(STEP, 0.3)
    planes = np.empty((3, len(ROWS)), np.float32)
    smooth_planes(*smoothing, np.ascontiguousarray(light.T), 0, 3, planes)
    np.testing.assert_allclose(planes.T, filtered(smoothing, light), rtol=1e-5)


def test_a_part_is_that_of_its_own_points():
    smoothing, light = filter_of(STEP, 0.3)
    begin, end = np.searchsorted(OBJECTS, (1, 2))
    own = filtered(smoothing.part(begin, end), np.ascontiguousarray(light[begin:end]))
    np.testing.assert_array_equal(own, filtered(smoothing, light)[begin:end])


def test_points_without_a_filter_stand_for_themselves():
    light = np.float32(STEP)
    np.testing.assert_array_equal(filtered(no_smoothing(len(light)), light), light)


def test_black_light_and_single_points_are_borne():
    nothing = np.zeros_like(STEP)
    smoothing, light = filter_of(nothing, 1.0)
    assert not filtered(smoothing, light).any()
    one = smoothing_for(HITS, ROWS[:1], np.ones(len(CORNER), np.float32), np.ones((1, 3)), np.ones((1, 3)))
    np.testing.assert_array_equal(one.neighbour, [0])
