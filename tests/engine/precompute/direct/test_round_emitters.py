"""Lamps that are round, against closed forms: a disc, a tube, each in many triangles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from engine.light.emitters import merge_triangles
from tests.direct_rooms import polygon_irradiance
from tests.engine.precompute.direct.by_hand import irradiance, light_of, points_at

UP = np.array([[0.0, 1.0, 0.0]])
N_PATCHES = 768  # as a still has
# Places on the floor, up to far beside the lamps, which hang at a height of 1.
PLACES = np.stack([np.linspace(0.0, 3.0, 40), np.zeros(40), np.linspace(0.0, 1.2, 40)], axis=1)


def disc(radius: float, n: int) -> NDArray[np.float64]:
    """n triangles of the area of a circle about (0, 1, 0) that faces down."""
    # A polygon of n corners has the circle's area where its corners lie a little outside.
    corner_radius = radius * np.sqrt(2.0 * np.pi / n / np.sin(2.0 * np.pi / n))
    angle = 2.0 * np.pi * np.arange(n + 1) / n
    rim = np.stack([corner_radius * np.cos(angle), np.ones(n + 1), corner_radius * np.sin(angle)], axis=1)
    return np.stack([np.tile([0.0, 1.0, 0.0], (n, 1)), rim[:-1], rim[1:]], axis=1)


def disc_irradiance(points: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """E / L (P,) of points that face the plane of the disc: π times the form factor

        F = 1/2 (1 - (h² + r² - R²) / sqrt((h² + r² + R²)² - 4 r² R²))

    at distance r from the axis and h from the plane [Howell, B-13]."""
    square, r2 = radius**2, points[:, 0] ** 2 + points[:, 2] ** 2
    root = np.sqrt((1.0 + r2 + square) ** 2 - 4.0 * r2 * square)
    return np.pi / 2.0 * (1.0 - (1.0 + r2 - square) / root)


def rings(radius: float, length: float, n: int) -> NDArray[np.float64]:
    """The two ends (2, n, 3) of a tube along x about (0, 1, 0)."""
    angle = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    y, z = 1.0 + radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([np.stack([np.full(n, x), y, z], axis=1) for x in (-0.5 * length, 0.5 * length)])


def tube(radius: float, length: float, n: int) -> NDArray[np.float64]:
    """A tube of n sides with ends, 4 n triangles that face outwards."""
    # Its sides have the width of a round tube's, averaged over the directions, where it is as far around.
    left, right = rings(radius * (np.pi / n) / np.sin(np.pi / n), length, n)
    left_next, right_next = np.roll(left, -1, axis=0), np.roll(right, -1, axis=0)
    ends = [np.broadcast_to(end.mean(axis=0), end.shape) for end in (left, right)]
    sides = [(left, left_next, right), (right, left_next, right_next)]
    sides += [(ends[0], left_next, left), (ends[1], right, right_next)]
    return np.concatenate([np.stack(corners, axis=1) for corners in sides])


def tube_irradiance(points: NDArray[np.float64], radius: float, length: float) -> NDArray[np.float64]:
    """E / L (P,): Lambert's formula of the tube's outline, the convex hull of its ends as a point sees them."""
    ends = rings(radius, length, 720).reshape(-1, 3)
    found = []
    for place in points:
        towards = ends - place
        axis = np.array([0.0, 1.0, 0.0]) - place
        axis /= np.linalg.norm(axis)
        u = np.cross(axis, [0.0, 0.0, 1.0])
        u /= np.linalg.norm(u)
        flat = np.stack([towards @ u, towards @ np.cross(axis, u)], axis=1) / (towards @ axis)[:, None]
        found.append(polygon_irradiance(ends[ConvexHull(flat).vertices], place, UP[0]))
    return np.array(found)


def found_of(lamp: NDArray[np.float64]) -> NDArray[np.float64]:
    """E / L (P,) as pictures have it, many triangles merged."""
    hits = points_at(PLACES, UP)
    merged = merge_triangles(lamp, np.ones((len(lamp), 3)), N_PATCHES // 2).corners
    return irradiance(hits, light_of(hits, emitters=merged, n_patches=N_PATCHES))[:, 0]


@pytest.mark.parametrize("n", [32, 1024])
@pytest.mark.parametrize("radius", [0.02, 0.4])
def test_a_disc_shines_as_a_disc(radius: float, n: int) -> None:
    found, expected = found_of(disc(radius, n)), disc_irradiance(PLACES, radius)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005)
    np.testing.assert_allclose(found, expected, rtol=0.01)


@pytest.mark.parametrize("n", [24, 384])
@pytest.mark.parametrize("radius", [0.013, 0.1])
def test_a_tube_shines_as_a_tube(radius: float, n: int) -> None:
    # Like a fluorescent lamp of 1.2 m.
    found, expected = found_of(tube(radius, 1.2, n)), tube_irradiance(PLACES, radius, 1.2)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005)
    np.testing.assert_allclose(found, expected, rtol=0.01)
