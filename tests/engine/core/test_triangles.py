"""Triangles cut into four: in the plane by area, on the sphere as the geodesic grid is cut."""

import numpy as np

from engine.core.triangles import quarters
from engine.sphere.geodesic import geodesic


def test_parts_are_quarters_and_wind_as_the_whole() -> None:
    whole = np.array([[[0.0, 0.0], [4.0, 0.0], [0.0, 2.0]]])  # of area 4
    expected = [
        [[0, 0], [2, 0], [0, 1]], [[2, 0], [4, 0], [2, 1]], [[0, 1], [2, 1], [0, 2]], [[2, 0], [2, 1], [0, 1]],
    ]  # fmt: skip
    parts = quarters(whole)
    np.testing.assert_array_equal(parts, [expected])
    one, two = parts[0, :, 1] - parts[0, :, 0], parts[0, :, 2] - parts[0, :, 0]
    np.testing.assert_array_equal(0.5 * (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]), 1.0)


def test_parts_on_the_sphere_are_the_triangles_of_the_next_level() -> None:
    coarse, fine = geodesic(2), geodesic(3)
    parts = quarters(coarse.vertices[coarse.triangles], on_sphere=True)
    np.testing.assert_allclose(parts.reshape(-1, 3, 3), fine.vertices[fine.triangles], atol=1e-12)
