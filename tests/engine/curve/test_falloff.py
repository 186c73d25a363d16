"""The smooth step: values, symmetry, flat ends, and the steepest slope that limits translations."""

import math

import numpy as np
import pytest

from engine.curve.falloff import STEEPEST, lever_extremes, smooth_step


def test_is_the_textbook_quotient():
    # e(t) / (e(t) + e(1 - t)) with e(t) = exp(-1/t).
    t = np.linspace(0.05, 0.95, 37)
    rising, falling = np.exp(-1.0 / t), np.exp(-1.0 / (1.0 - t))
    assert smooth_step(t) == pytest.approx(rising / (rising + falling), rel=1e-12)


def test_ends_are_exact():
    # Exactly 0 and 1 at and beyond the ends, 1/2 in the middle.
    t = np.array([-math.inf, -1.0, 0.0, 1e-300, 0.5, 1.0, 2.0, math.inf])
    assert smooth_step(t).tolist() == [0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0]


def test_rises_and_mirrors():
    t = np.linspace(0.0, 1.0, 2001)
    step = smooth_step(t)
    assert (np.diff(step) >= 0.0).all()
    assert step + step[::-1] == pytest.approx(np.ones_like(t), abs=1e-15)


def test_steepest_slope():
    # s' = s (1 - s) (1/t^2 + 1/(1-t)^2) = 1/4 * 8 in the middle, and nowhere more.
    t = np.linspace(0.0, 1.0, 100_001)
    slope = np.diff(smooth_step(t)) / np.diff(t)
    assert slope.max() == pytest.approx(STEEPEST, rel=1e-6)
    assert t[slope.argmax()] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_vanish_at_the_ends(order):
    # Finite differences of any order near 0 are below any power of the distance: here below h^6 for h = 1/50.
    t = np.linspace(0.0, 0.02, 21)
    assert np.abs(np.diff(smooth_step(t), order)).max() < 0.02**6


def test_lever_extremes_bound_the_bracket():
    # w + (x - base) w' on the fade from 1 to 0.2, by differences of (x - base) w.
    x = np.linspace(1.0, 0.2, 50_001)
    product = (x - 0.4) * smooth_step((x - 1.0) / (0.2 - 1.0))
    bracket = np.diff(product) / np.diff(x)
    low, high = lever_extremes(1.0, 0.2, 0.4)
    assert low <= bracket.min() <= low + 1e-2
    assert high - 1e-2 <= bracket.max() <= high
