"""Spherical harmonics: basis, rotations, gradients, clamped cosine and bands without ringing, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.spatial.transform import Rotation

from engine.light.environment import constant_environment, triangle_integrals
from engine.sphere import _kernels as kernels
from engine.sphere.harmonics import (
    MAX_ORDER,
    bands,
    basis,
    clamped_cosine,
    convolve,
    order_of,
    project,
    quadrature,
    rotate,
    without_rings,
)  # fmt: skip

TURNS = {
    "none": Rotation.identity(),
    "quarter about x": Rotation.from_euler("x", 90, degrees=True),
    "half about x": Rotation.from_euler("x", 180, degrees=True),
    "half about z": Rotation.from_euler("z", 180, degrees=True),
    "a hair": Rotation.from_euler("y", 1e-9),
    "at the pole of its angles": Rotation.from_euler("zyx", [1.0, -math.pi / 2, 0.3]),
    "any": Rotation.from_euler("zyx", [0.3, 1.1, -2.0]),
}


def directions(count: int, seed: int = 1) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


@pytest.mark.parametrize("n", range(1, MAX_ORDER + 1))
def test_they_are_orthonormal(n: int) -> None:
    places, weights = quadrature(n)
    values = basis(places, n)
    assert np.abs((values * weights[:, None]).T @ values - np.eye(n * n)).max() < 1e-14


def test_each_band_is_as_strong_everywhere_also_at_the_poles() -> None:
    places = np.concatenate([directions(50), [[0, 0, 1], [0, 0, -1], [-1, 0, 0], [-1, -0.0, 0]]])
    squares = basis(places, MAX_ORDER) ** 2
    of_bands = np.add.reduceat(squares, np.arange(MAX_ORDER) ** 2, axis=1)
    assert of_bands == pytest.approx(np.broadcast_to((2 * np.arange(MAX_ORDER) + 1) / (4 * math.pi), of_bands.shape))


def test_the_first_bands_are_what_they_are_called() -> None:
    x, y, z = place = directions(1)[0]
    half, root3 = 0.5 / math.sqrt(math.pi), math.sqrt(3.0)
    assert basis(place, 2) == pytest.approx([half, -half * root3 * y, half * root3 * z, -half * root3 * x])


def test_gradients_are_those_of_the_values() -> None:
    n, h = MAX_ORDER, 1e-6
    place = directions(1, seed=4)[0]

    def at(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, gradients = np.empty(n * n), np.empty((n * n, 3))
        kernels.basis_at(*point, np.zeros((n, n + 1)), values, gradients)
        return values, gradients

    differences = [(at(place + h * e)[0] - at(place - h * e)[0]) / (2 * h) for e in np.eye(3)]
    assert at(place)[1] == pytest.approx(np.stack(differences, axis=1), abs=2e-8)


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
def test_turned_coefficients_are_of_the_turned_function(turn: Rotation) -> None:
    matrix, places = turn.as_matrix(), directions(30)
    vector = np.random.default_rng(2).normal(size=MAX_ORDER**2)
    there = rotate(vector, matrix)
    assert basis(places, MAX_ORDER) @ there == pytest.approx(basis(places @ matrix, MAX_ORDER) @ vector, abs=1e-12)
    assert np.linalg.norm(there) == pytest.approx(np.linalg.norm(vector), rel=1e-13)
    assert rotate(there, matrix.T) == pytest.approx(vector, abs=1e-12)


def test_a_diffuse_surface_gathers_known_shares() -> None:
    expected = np.array([1, 2 / 3, 1 / 4, 0, -1 / 24, 0, 1 / 64]) * math.pi
    assert np.abs(clamped_cosine(7) - expected).max() < 1e-14


def test_constant_light_is_the_constant_band() -> None:
    light = project(triangle_integrals(constant_environment((1.0, 2.0, 0.5)), 0.7, level=5), 6)
    assert light[0] == pytest.approx(np.array([1.0, 2.0, 0.5]) * math.sqrt(4 * math.pi), rel=1e-6)
    assert np.abs(light[1:]).max() < 2e-3
    irradiance = basis(directions(5), 6) @ convolve(light.T, clamped_cosine(6)).T
    assert irradiance == pytest.approx(np.broadcast_to(math.pi * np.array([1.0, 2.0, 0.5]), (5, 3)), rel=2e-3)


@pytest.mark.parametrize("n", [0, MAX_ORDER + 1])
def test_orders_that_there_are_not_are_refused(n: int) -> None:
    for call in (lambda: basis([0.0, 0.0, 1.0], n), lambda: bands(n)):
        with pytest.raises(ValueError, match=rf"order {n}, expected 1 to 10"):
            call()


@pytest.mark.parametrize("direction", [(0.0, 0.0, 0.0), (0.0, 2.0, 0.0), (math.nan, 0.0, 1.0)])
def test_directions_of_another_length_are_refused(direction: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="expected one of length 1"):
        basis([(0.0, 0.0, 1.0), direction], 3)


def test_vectors_of_no_order_are_refused() -> None:
    with pytest.raises(ValueError, match="35 coefficients, expected the square of an order"):
        order_of(np.zeros(35))


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
