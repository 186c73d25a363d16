"""Strokes and control points: what a pointer drew, smoothing against closed forms and a slow twin, and colour."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.curve.drawing import (
    add_point,
    coloured,
    first_point,
    follow_pointer,
    move_point,
    point_height,
    remove_point,
    smooth,
    stroke,
    through_points,
)
from engine.curve.operators import apply_operators
from engine.curve.tables import HALF_PI, LEAST_GAP, ordered_regions
from tests.naive.curves import drawn_height, smoothed

GREY = np.ones(3)


def ramp(gamma):
    """x, 2x, 3x."""
    return gamma[:, None] * np.array([1.0, 2.0, 3.0])


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 20), st.integers(-9, 9)), min_size=2, max_size=30))
def test_the_last_pass_counts(path):
    x, y = follow_pointer(path, 41)
    low, high = min(p[0] for p in path), max(p[0] for p in path)
    assert x[0] == low and x[-1] == high
    assert y == pytest.approx([drawn_height(path, each) for each in x]) if low < high else y[0] == path[-1][1]


@pytest.mark.parametrize("n", [1, 2, 5, 64])
@pytest.mark.parametrize("deviation", [0.1, 1.0, 3.7, 40.0])
def test_smoothing_is_its_slow_twin(n, deviation):
    y = np.random.default_rng(n).normal(size=n)
    assert smooth(y, deviation) == pytest.approx(smoothed(y, deviation), abs=1e-12)


def test_a_straight_stroke_remains_straight_and_a_wave_loses_what_a_gaussian_takes():
    line = np.linspace(2.0, 5.0, 100)
    assert smooth(line, 4.0) == pytest.approx(line)
    # A Gaussian multiplies a wave of angular frequency k by exp(-k^2 s^2 / 2); the ends' reflections do not reach far.
    k, s = 2.0 * math.pi / 25.0, 3.0
    wave = np.sin(k * np.arange(400.0))
    assert smooth(wave, s)[50:350] == pytest.approx(math.exp(-0.5 * (k * s) ** 2) * wave[50:350], abs=2e-4)
    ends = smooth(wave, s)[[0, -1]]
    assert ends == pytest.approx(wave[[0, -1]])


def test_a_stroke_keeps_the_colour_of_what_is_below():
    x = np.linspace(0.4, 0.8, 9)
    drawn = stroke(x, np.full(9, 6.0), ramp(x), 0.1)
    edited = apply_operators([drawn], ramp)(x)
    # The largest channel, 3x, is 6 everywhere; the others are 1/3 and 2/3 of it.
    assert edited == pytest.approx(np.tile([2.0, 4.0, 6.0], (9, 1)))
    assert drawn.regions == pytest.approx((0.3, 0.4, 0.8, 0.9)) and drawn.kind == "stroke"
    red = stroke(x, np.full(9, 6.0), ramp(x), 0.1, (True, False, False))
    assert apply_operators([red], ramp)(x) == pytest.approx(np.stack([np.full(9, 6.0), 2 * x, 3 * x], axis=-1))


def test_where_there_is_nothing_below_a_stroke_is_grey():
    below = np.array([[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, 0.0, 4.0]])
    found = coloured(np.array([2.0, 2.0, 2.0]), below, (True, True, True))
    assert found.tolist() == [[2.0, 2.0, 2.0], [2.0, 2.0, 2.0], [0.0, 0.0, 2.0]]


def test_the_curve_goes_through_the_points():
    points = first_point(0.5, 2.0, GREY, 0.1)
    points, first = add_point(points, 0.9, 4.0, GREY)
    points, middle = add_point(points, 0.7, 1.0, GREY)
    assert (first, middle) == (1, 1) and points.gammas == (0.5, 0.7, 0.9)
    assert points.regions == pytest.approx((0.4, 0.5, 0.9, 1.0))
    edited = apply_operators([points], ramp)(np.array([0.5, 0.7, 0.9]))
    assert edited == pytest.approx(np.repeat([[2.0], [1.0], [4.0]], 3, axis=1))


def test_points_keep_between_their_neighbours_and_in_the_domain():
    points = through_points((0.2, 0.5, 0.8), ((1.0, 2.0, 4.0),) * 3, 0.1)
    far = move_point(points, 1, 2.0, 4.0)
    assert far.gammas[1] == pytest.approx(0.8 - LEAST_GAP) and far.values == points.values
    outer = move_point(points, 2, 5.0, 8.0)
    assert outer.gammas[2] == HALF_PI and outer.values[2] == (2.0, 4.0, 8.0) and outer.regions[2:] == (HALF_PI,) * 2
    assert point_height(outer, 2) == 8.0
    assert move_point(points, 1, 0.5, 4.0) == points


def test_a_point_on_another_takes_its_place_and_the_last_one_takes_the_operator():
    points = through_points((0.2, 0.5), ((1.0, 1.0, 1.0),) * 2, 0.1)
    moved, index = add_point(points, 0.5 + 1e-6, 3.0, GREY)
    assert (index, moved.gammas, moved.values[1]) == (1, (0.2, 0.5), (3.0, 3.0, 3.0))
    one = remove_point(points, 0)
    assert one is not None and one.gammas == (0.5,) and one.regions == pytest.approx((0.4, 0.5, 0.5, 0.6))
    assert remove_point(one, 0) is None


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.sampled_from("amr"), st.floats(-0.2, 2.0), st.floats(-3.0, 9.0)), max_size=30))
def test_whatever_is_done_to_points_they_remain_valid(steps):
    points = first_point(0.5, 2.0, GREY, 0.1)
    for what, gamma, height in steps:
        index = int(abs(gamma) * 1e6) % len(points.gammas)
        if what == "a":
            points, _ = add_point(points, min(max(gamma, 0.0), HALF_PI), height, GREY)
        elif what == "m":
            points = move_point(points, index, gamma, height)
        else:
            points = remove_point(points, index) or points
        assert ordered_regions(points.regions) == points.regions and points.regions[1] >= 0.0
        assert np.isfinite(apply_operators([points], ramp)(np.linspace(0.0, HALF_PI, 50))).all()
