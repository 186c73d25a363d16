"""Tables over a part of a curve: what they leave, how they go over into it, and cubics through control points."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from engine.curve.operators import Operator, apply_operators, collapse, strength
from engine.curve.tables import HALF_PI, OperatorError, TabulatedCurve, monotone_slopes

GAMMA = np.linspace(0.0, HALF_PI, 1001)
REGIONS = (0.3, 0.5, 0.8, 1.2)
TABLE = TabulatedCurve((0.5, 0.8), ((2.0, 3.0, 4.0), (5.0, 6.0, 7.0)), regions=REGIONS)


def ramp(gamma):
    """x, 2x, 3x."""
    return gamma[:, None] * np.array([1.0, 2.0, 3.0])


def test_a_table_over_a_region_is_exact_inside_and_absent_outside():
    edited = apply_operators([TABLE], ramp)(GAMMA)
    inside, outside = (GAMMA >= 0.5) & (GAMMA <= 0.8), (GAMMA <= 0.3) | (GAMMA >= 1.2)
    assert (edited[inside] == TABLE(GAMMA[inside])).all()
    assert (edited[outside] == ramp(GAMMA[outside])).all()
    # In the middle of a falloff, strength 1/2: the mean of the curve and of the table's last value.
    middle = apply_operators([TABLE], ramp)(np.array([1.0]))[0]
    assert middle == pytest.approx([0.5 * (1.0 + 5.0), 0.5 * (2.0 + 6.0), 0.5 * (3.0 + 7.0)])


def test_a_table_goes_over_smoothly():
    # All derivatives of the strength vanish at a [BenArtzi07, 9.2]: beside it the curve leaves f faster than any power.
    x = 0.3 + np.array([0.004, 0.002])
    left = np.abs(apply_operators([TABLE], ramp)(x) - ramp(x)).max(axis=1)
    assert left.max() < 1e-15
    table_on_flat = apply_operators([TABLE], lambda gamma: np.zeros((gamma.size, 3)))(GAMMA)
    assert table_on_flat == pytest.approx(TABLE(GAMMA) * strength(TABLE, GAMMA)[:, None])


def test_magnitude_scales_and_channels_are_left_out():
    changed = dataclasses.replace(TABLE, magnitude=0.5, channels=(True, False, True))
    assert not changed.replaces_all
    at = apply_operators([changed], ramp)(np.array([0.5]))[0]
    assert at == pytest.approx([1.0, 2 * 0.5, 2.0])
    everywhere = TabulatedCurve((0.0, 1.0), ((1.0,) * 3, (2.0,) * 3))
    assert everywhere.replaces_all
    assert not dataclasses.replace(everywhere, channels=(True, True, False)).replaces_all


def test_a_moved_table_takes_its_samples_along():
    moved = TABLE.moved(0.125)
    x = np.array([0.5, 0.7, 0.75])
    assert moved(x + 0.125) == pytest.approx(TABLE(x))
    assert moved.regions == pytest.approx([end + 0.125 for end in REGIONS])
    assert TABLE.moved(0.0) == TABLE


def test_operators_below_and_above_a_table_apply():
    lift = Operator("translate", "y", 0.0, 0.0, HALF_PI, HALF_PI, magnitude=1.0)
    x = np.array([0.1, 0.6])
    below = apply_operators([lift, TABLE], ramp)(x)
    assert below == pytest.approx(np.array([[1.1, 1.2, 1.3], [3.0, 4.0, 5.0]]))
    above = apply_operators([TABLE, lift], ramp)(x)
    assert above == pytest.approx(np.array([[1.1, 1.2, 1.3], [4.0, 5.0, 6.0]]))
    # An X-operator above one channel moves the table in that channel alone.
    slide = Operator("translate", "x", 0.0, 0.0, HALF_PI, HALF_PI, magnitude=0.1, channels=(True, False, False))
    slid = apply_operators([TABLE, slide], ramp)(np.array([0.7]))[0]
    assert slid == pytest.approx([3.0, 5.0, 6.0])


def test_collapsing_a_stack_with_partial_tables_keeps_the_curve():
    points = TabulatedCurve(
        (0.9, 1.1, 1.3), ((1.0,) * 3, (3.0,) * 3, (2.0,) * 3), False, "points", (0.8, 0.9, 1.3, 1.4)
    )
    stack = [TABLE, points, Operator("translate", "x", 0.1, 0.3, 1.0, 1.3, magnitude=0.05)]
    edited = apply_operators(stack, ramp)(GAMMA)
    assert collapse(stack, ramp)(GAMMA) == pytest.approx(edited, rel=1e-3, abs=1e-5 * edited.max())


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 900), min_size=2, max_size=12, unique=True), st.integers(0, 2**32 - 1))
def test_control_points_are_the_monotone_cubic_of_scipy(places, seed):
    gammas = np.sort(np.array(places)) * (HALF_PI / 1000.0)
    values = np.random.default_rng(seed).integers(-5, 6, (gammas.size, 3)) / 3.0
    points = TabulatedCurve(tuple(gammas.tolist()), tuple(map(tuple, values.tolist())), kind="points")
    x = np.linspace(gammas[0], gammas[-1], 301)
    assert points(x) == pytest.approx(PchipInterpolator(gammas, values)(x), rel=1e-9, abs=1e-9)
    # Constant beyond the ends, and between two points never beyond them.
    assert (points(np.array([-1.0, 3.0])) == values[[0, -1]]).all()
    i = np.clip(np.searchsorted(gammas, x, side="right") - 1, 0, gammas.size - 2)
    low, high = np.minimum(values[i], values[i + 1]), np.maximum(values[i], values[i + 1])
    assert (points(x) >= low - 1e-9).all() and (points(x) <= high + 1e-9).all()


def test_one_control_point_is_a_level():
    point = TabulatedCurve((0.6,), ((1.0, 2.0, 3.0),), False, "points", (0.4, 0.6, 0.6, 0.8))
    assert apply_operators([point], ramp)(np.array([0.6]))[0] == pytest.approx([1.0, 2.0, 3.0])
    assert monotone_slopes(np.array([0.6]), np.ones((1, 3))).tolist() == [[0.0, 0.0, 0.0]]


def test_features_name_what_bends_inside_the_region():
    table = dataclasses.replace(TABLE, gammas=(0.1, 0.6))
    features = apply_operators([table], ramp).features
    assert 0.6 in features and 0.1 not in features and set(REGIONS) <= set(features)


@pytest.mark.parametrize(
    "change",
    [{"regions": (0.5, 0.3, 0.8, 1.2)}, {"regions": (0.0, 0.3, 0.8, math.inf)}, {"magnitude": math.nan},
     {"magnitude": 1e13}, {"kind": "spline"}, {"kind": "points", "gammas": (0.5, 0.5)}, {"gammas": (0.5, 1e13)}],
)  # fmt: skip
def test_bad_tables_are_refused(change):
    with pytest.raises(OperatorError):
        dataclasses.replace(TABLE, **change)
