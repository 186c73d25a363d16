"""Points shaded by lobes: against the vectors that they stand for, and light that is turned instead of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics.shading import band_light, lobes, shade
from engine.realtime.zonal_harmonics.zonal import Zonal, fit, membrane
from engine.sphere.harmonics import basis, rotate

N = 6


def some_light(seed: int = 1) -> np.ndarray:
    """Light (n^2, 3) that falls off over the bands, as that of rooms and skies does."""
    bands = np.repeat(np.arange(N), 2 * np.arange(N) + 1)
    return np.random.default_rng(seed).normal(size=(N * N, 3)) / (1.0 + bands[:, None]) ** 2


def some_lobes(n_lobes: int, count: int = 40) -> Zonal:
    vectors = np.random.default_rng(2).normal(size=(count, N * N)) / (1.0 + np.arange(N * N)) ** 0.5
    return run_to_end(fit(vectors, n_lobes))


def frames_of(count: int) -> np.ndarray:
    return np.asarray(Rotation.random(count, random_state=3).as_matrix())


@pytest.mark.parametrize("n_lobes", [1, 4])
def test_it_is_the_product_of_light_and_turned_lobes(n_lobes: int) -> None:
    zonal, light = some_lobes(n_lobes), some_light()
    frames = frames_of(len(zonal.low))
    expected = zonal.rotate(frames.transpose(0, 2, 1)).harmonics() @ light
    error = shade(lobes(zonal), frames, band_light(light)) - expected
    assert np.linalg.norm(error) < 0.01 * np.linalg.norm(expected)  # between the table's entries


def test_turning_all_points_is_turning_the_light() -> None:
    zonal, light = some_lobes(4), some_light()
    turn = Rotation.from_euler("zyx", [0.3, 1.1, -2.0]).as_matrix()
    frames = frames_of(len(zonal.low))
    there = shade(lobes(zonal), frames @ turn.T, band_light(light))
    here = shade(lobes(zonal), frames, band_light(rotate(light.T, turn.T).T))
    assert np.linalg.norm(there - here) < 0.01 * np.linalg.norm(here)


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (1e-9, 0, 1), (-1, 0, 0), (-1, -1e-9, 0), (0, 1, 0)])
def test_poles_and_the_seam_are_as_anywhere(axis: tuple[float, float, float]) -> None:
    """A lobe about them under light that is smooth: within what lies between two entries."""
    unit = np.array([[axis]]) / np.linalg.norm(axis)
    zonal = Zonal(np.zeros((1, 4)), unit, np.ones((1, 1, N)), np.zeros(1))
    light = some_light()
    expected = zonal.harmonics() @ light
    assert shade(lobes(zonal), np.eye(3)[None], band_light(light)) == pytest.approx(expected, abs=0.02)


def test_a_membrane_is_the_projection_of_its_cosines() -> None:
    """Eq. 22 by Gauss's points on either side of its crease, which make its polynomials exact."""
    alpha = np.array([0.0, 0.3, 1.0])
    points, weights = np.polynomial.legendre.leggauss(8)
    cosine, weights = (points + 1.0) / 2.0, weights / 2.0
    above = np.stack([np.sqrt(1.0 - cosine**2), 0.0 * cosine, cosine], axis=1)
    sides = [(weights * cosine) @ basis(side, N) * 2.0 for side in (above, above * (1.0, 1.0, -1.0))]
    about_z = basis([0.0, 0.0, 1.0], N) != 0.0
    expected = np.where(about_z, sides[0] + alpha[:, None] * sides[1], 0.0)
    assert np.abs(membrane(alpha, N).harmonics() - expected).max() < 1e-14


def test_translucency_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="translucency, expected 0 to 1"):
        membrane([0.5, 1.5], 3)
