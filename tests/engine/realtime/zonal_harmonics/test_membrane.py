"""Membranes: the coefficients of [Sloan05, eq. 23] are what eq. 22 projects to."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.realtime.zonal_harmonics.zonal import membrane
from engine.sphere.harmonics import basis

N = 10
ALPHAS = np.array([0.0, 0.3, 1.0])


def by_eq_23(alpha: float) -> list[float]:
    """g*_l of l < N, as radiance of a white matt sheet."""
    found = []
    for l in range(N):  # noqa: E741
        even = 2.0 * (1.0 + alpha) * (-1.0) ** (l // 2 - 1) / ((l + 2) * (l - 1)) if l != 1 else 0.0
        share = math.factorial(l) / (2.0**l * math.factorial(l // 2) ** 2)
        found.append(2.0 / 3.0 * (1.0 - alpha) if l == 1 else even * share if l % 2 == 0 else 0.0)
    return found


def projected_eq_22(alpha: float) -> np.ndarray:
    """The vector (N^2,) of g(s) = s above and -alpha s below, over pi, by a quadrature of either half."""
    nodes, weights = np.polynomial.legendre.leggauss(N)
    half, phi = (nodes + 1.0) / 2.0, (np.arange(2 * N) + 0.5) * np.pi / N
    total = np.zeros(N * N)
    for side, value in ((1.0, half), (-1.0, alpha * half)):
        sine = np.sqrt(1.0 - half**2)[:, None]
        ways = np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), side * half[:, None])
        each = basis(np.stack(ways, axis=-1).reshape(-1, 3), N)
        total += (np.repeat(value * weights / 2.0, 2 * N) * np.pi / N) @ each
    return total / np.pi


@pytest.mark.parametrize("alpha", ALPHAS)
def test_the_lobe_is_eq_23_and_the_projection_of_eq_22(alpha: float) -> None:
    vector = membrane([alpha], N).harmonics()[0]
    about_normal = basis([0.0, 0.0, 1.0], N)
    by_band = np.repeat(by_eq_23(alpha), 2 * np.arange(N) + 1) * about_normal
    assert vector == pytest.approx(by_band, abs=1e-12)
    assert vector == pytest.approx(projected_eq_22(alpha), abs=1e-6)


def test_translucency_is_a_share() -> None:
    with pytest.raises(ValueError, match="translucency, expected 0 to 1"):
        membrane([1.5], 3)
