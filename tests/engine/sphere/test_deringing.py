"""Bands without rings: their lobes only fall, are never negative, and none of such lobes is nearer to those given."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import legendre

from engine.sphere.deringing import without_rings
from engine.sphere.harmonics import clamped_cosine

COSINE = np.linspace(-1.0, 1.0, 2001)
DEGREES = 2.0 * np.arange(6) + 1.0


def lobe(bands: np.ndarray) -> np.ndarray:
    """From its far side to its axis."""
    return legendre.legval(COSINE, (2.0 * np.arange(len(bands)) + 1.0) * bands)


def sharp(width: float, n: int = 6) -> np.ndarray:
    """The bands of a cap with this half angle, times what it covers: P_(l-1) - P_(l+1) at its rim, over 2l + 1."""
    rim = [legendre.legval(np.cos(width), row) for row in np.eye(n + 1)]
    of_bands = [(rim[l - 1] - rim[l + 1]) / (2 * l + 1) for l in range(1, n)]  # noqa: E741
    return np.array([1.0, *(np.array(of_bands) / (1.0 - np.cos(width)))])


@pytest.mark.parametrize(
    "bands", [np.ones(6), sharp(0.1), sharp(0.6), sharp(1.5), clamped_cosine(6) / np.pi, np.ones(3)]
)
def test_a_lobe_falls_from_its_axis_to_no_less_than_zero(bands: np.ndarray) -> None:
    found = without_rings(bands)
    values = lobe(found)
    assert found[0] == bands[0]
    assert np.diff(values).min() > -1e-5 * values.max() and values.min() > -1e-6 * values.max()
    assert lobe(bands).min() < -0.01 * lobe(bands).max()  # it rang


@pytest.mark.parametrize(
    "bands", [[1.0], [1.0, 0.3], [0.5, 0.15, 0.01, 0.0], np.exp(-0.3 * np.arange(6) * np.arange(1, 7))]
)
def test_a_lobe_that_falls_stays_as_it_is(bands: list[float]) -> None:
    assert np.array_equal(without_rings(bands), bands)


@pytest.mark.parametrize("bands", [np.ones(6), sharp(0.6), clamped_cosine(6)])
def test_no_bands_without_rings_are_nearer(bands: np.ndarray) -> None:
    """The nearest of a convex set is that from which no other of it lies on the side of what was given. Lobes that
    only fall, of degree 5: what squares of degree 2 sum up to along the cosine, over something."""
    found, rng = without_rings(bands), np.random.default_rng(5)
    for _ in range(500):
        square = np.polynomial.polynomial.polypow(rng.normal(size=3), 2)
        rise = np.polynomial.Polynomial(square).integ(lbnd=-1.0) + rng.exponential()
        other = legendre.poly2leg(rise.coef) / DEGREES
        other *= bands[0] / other[0]
        assert (DEGREES * (bands - found) * (other - found)).sum() < 1e-4 * (DEGREES * bands**2).sum()
