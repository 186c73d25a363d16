"""The difference of an object's pictures: independent of noise, and as large as it is."""

from __future__ import annotations

import numpy as np
import pytest

from engine.inverse.placed_error import error_of_halves


def halves(truth: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """Two independent estimates of a picture (p, 3)."""
    return truth + noise * np.random.default_rng(seed).standard_normal((2, *truth.shape))


PICTURE = np.full((4000, 3), 2.0)


def test_a_picture_differs_from_itself_by_nothing_though_both_are_noisy():
    # Root mean square of the noise's difference is 0.28 of the mean: it must not count. What is left is that of 12,000
    # products, 0.08 / sqrt(12,000) = 7e-4, of which the root is 0.027.
    assert error_of_halves(halves(PICTURE, 0.4, 0), halves(PICTURE, 0.4, 1)) < 0.06


def test_a_difference_is_relative_to_the_mean_of_the_original():
    # 10 % brighter everywhere; darker values are not clamped.
    assert error_of_halves(halves(PICTURE, 0.0, 0), halves(0.9 * PICTURE, 0.0, 1)) == pytest.approx(0.1)
    assert error_of_halves(halves(PICTURE, 0.4, 0), halves(0.5 * PICTURE, 0.4, 1)) == pytest.approx(0.5, rel=0.1)


def test_a_black_original_has_no_relative_error():
    assert error_of_halves(np.zeros((2, 5, 3)), np.ones((2, 5, 3))) is None
