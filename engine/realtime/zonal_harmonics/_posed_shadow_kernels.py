"""Compiled part of `posed_shadows`. It does not validate."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def mark_near(
    places: Float32Array, normals: Float32Array, towards: Float32Array, centre: Float32Array,
    square_radius: np.float32, start: int, stop: int, near: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Mark in near (B, L) the lights (L,) above the horizon of points start to stop whose rays pass a sphere.

    The distance of a ray from the centre is |c|² - (c · ω)², where c leads from the point to the centre.
    """
    for p in range(start, stop):
        x, y, z = centre[0] - places[p, 0], centre[1] - places[p, 1], centre[2] - places[p, 2]
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        square = x * x + y * y + z * z
        is_inside = square <= square_radius
        for m in range(towards.shape[0]):
            wx, wy, wz = towards[m, 0], towards[m, 1], towards[m, 2]
            along = x * wx + y * wy + z * wz
            passes = is_inside or (along > np.float32(0.0) and square - along * along <= square_radius)
            near[p, m] = passes and nx * wx + ny * wy + nz * wz > np.float32(0.0)
