"""Different values in order."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from engine.curve.unique_values import unique_sorted


def test_each_value_once_least_first() -> None:
    assert_array_equal(unique_sorted(np.array([3.0, -1.0, 3.0, 0.0, -1.0])), [-1.0, 0.0, 3.0])
    assert_array_equal(unique_sorted(np.array([])), [])


def test_as_numpy_has_it() -> None:
    values = np.random.default_rng(3).integers(0, 50, 200) / 7.0
    assert_array_equal(unique_sorted(values), np.unique(values))
