"""Deform where numbers are odd: the paper's coefficients of a membrane, surfaces that collapse, light far from 1."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics.posed_scene import mesh_jacobians
from engine.realtime.zonal_harmonics.shading import band_light, lobes, shade
from engine.realtime.zonal_harmonics.zonal import Zonal, fit, membrane
from engine.sphere.harmonics import MAX_ORDER


def coefficient(band: int, alpha: float) -> float:
    """g*_l [Sloan05, eq. 23], as it stands there."""
    if band == 1:
        return 2.0 / 3.0 * (1.0 - alpha)
    if band % 2:
        return 0.0
    sign = (-1.0) ** (band // 2 - 1) / ((band + 2) * (band - 1))
    return 2.0 * (1.0 + alpha) * sign * math.factorial(band) / (2.0**band * math.factorial(band // 2) ** 2)


@pytest.mark.parametrize("alpha", [0.0, 0.25, 1.0])
def test_a_membrane_has_the_papers_coefficients(alpha: float) -> None:
    found = membrane([alpha], MAX_ORDER)
    expected = [coefficient(band, alpha) for band in range(MAX_ORDER)]
    assert found.coefficients[0, 0, 1:] == pytest.approx(expected[1:], abs=1e-12)
    assert found.low[0, 0] * math.sqrt(4.0 * math.pi) == pytest.approx(expected[0], abs=1e-12)


def some_lobes(count: int = 30) -> Zonal:
    vectors = np.random.default_rng(2).normal(size=(count, 36)) / (1.0 + np.arange(36.0))
    return run_to_end(fit(vectors, 3))


@pytest.mark.parametrize("scale", [1e-8, 1e8, 1e24])
def test_radiance_goes_by_the_light_however_much_there_is(scale: float) -> None:
    zonal, light = lobes(some_lobes()), np.random.default_rng(1).normal(size=(36, 3))
    frames = np.tile(np.eye(3), (30, 1, 1))
    once, scaled = (shade(zonal, frames, band_light(each * light)).astype(float) for each in (1.0, scale))
    assert scaled / scale == pytest.approx(once, rel=1e-6, abs=1e-6 * np.abs(once).max())
    assert (shade(zonal, frames, band_light(0.0 * light)) == 0.0).all()


@pytest.mark.parametrize("map_", [np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0]), np.diag([-1.0, 1.0, 1.0])])
def test_a_mesh_that_collapses_or_is_mirrored_has_finite_jacobians(map_: np.ndarray) -> None:
    places = np.random.default_rng(3).normal(size=(9, 3))
    triangles = np.array([[0, 1, 2], [2, 3, 4], [4, 5, 6], [6, 6, 7]], np.int32)  # the last has no area, 8 no triangle
    found = mesh_jacobians(places, places @ map_.T, triangles)
    assert np.isfinite(found).all() and (found[8] == np.eye(3)).all() and (found[7] == np.eye(3)).all()
    a, b, c = places[:3]
    for edge in (b - a, c - a):
        assert found[0] @ edge == pytest.approx(map_ @ edge, abs=1e-9)


def test_a_turn_of_a_mesh_has_itself_for_a_jacobian() -> None:
    places = np.random.default_rng(4).normal(size=(6, 3))
    turn = Rotation.from_euler("zyx", [0.3, 1.1, -2.0]).as_matrix()
    found = mesh_jacobians(places, 2.0 * places @ turn.T, np.array([[0, 1, 2], [3, 4, 5], [0, 3, 5]], np.int32))
    assert found == pytest.approx(np.broadcast_to(2.0 * turn, found.shape), abs=1e-9)
