"""Compiled shading of points by zonal lobes, under light that is tabulated over directions of lobe axes.

Kernels never validate: `engine.realtime.zonal_harmonics.shading` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def shade_range(
    low: Float32Array, axes: Float32Array, coefficients: Float32Array, frames: Float32Array, light: Float32Array,
    table: Float32Array,
    start: int, stop: int, radiance: Float32Array,
) -> None:  # fmt: skip
    """Fill radiance[start:stop] (P, 3) [Sloan05, eq. 25].

    low (P, 4), axes (P, N, 3), coefficients (P, N, n): lobes in the points' own axes, the rows of frames (P, 3, 3).
    light (n^2, 3); table (rows, columns, n, 3): the light of each band along each direction [Sloan05, eq. 24].
    """
    n = coefficients.shape[2]
    bands = np.empty((n, 3), np.float32)
    for p in range(start, stop):
        frame = frames[p]
        # The constant band, and the linear band, which rotates like the vector (-low_3, -low_1, low_2).
        x, y, z = _to_world(frame, -low[p, 3], -low[p, 1], low[p, 2])
        for c in range(3):
            radiance[p, c] = low[p, 0] * light[0, c]
            if n > 1:
                radiance[p, c] += -y * light[1, c] + z * light[2, c] - x * light[3, c]
        for i in range(axes.shape[1]):
            # Rotate the lobe's axis [Sloan05, eq. 10], look up the light along it, and take the dot product with the
            # lobe's coefficients [Sloan05, eq. 25].
            x, y, z = _to_world(frame, axes[p, i, 0], axes[p, i, 1], axes[p, i, 2])
            _look_up(table, x, y, z, bands)
            for l in range(n):  # noqa: E741
                for c in range(3):
                    radiance[p, c] += coefficients[p, i, l] * bands[l, c]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _to_world(frame: Float32Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Rotate a vector from a point's axes, the rows of frame, to world axes."""
    return (
        frame[0, 0] * x + frame[1, 0] * y + frame[2, 0] * z,
        frame[0, 1] * x + frame[1, 1] * y + frame[2, 1] * z,
        frame[0, 2] * x + frame[1, 2] * y + frame[2, 2] * z,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(table: Float32Array, x: float, y: float, z: float, bands: Float32Array) -> None:
    """Interpolate the light of each band (n, 3) along a direction between four entries; rows beyond a pole continue on
    the opposite side."""
    n_rows, n_columns = table.shape[0], table.shape[1]
    # Latitude and longitude in units of table entries.
    row = math.acos(min(max(z, -1.0), 1.0)) * (n_rows / math.pi) - 0.5
    column = (math.atan2(y, x) + math.pi) * (n_columns / (2.0 * math.pi)) - 0.5
    top, left = math.floor(row), math.floor(column)
    below, beside = np.float32(row - top), np.float32(column - left)
    bands[:] = 0.0
    for down in range(2):
        for right in range(2):
            r, c = int(top) + down, int(left) + right
            if r < 0 or r >= n_rows:
                r, c = min(max(r, 0), n_rows - 1), c + n_columns // 2
            c %= n_columns
            share = (below if down else np.float32(1.0) - below) * (beside if right else np.float32(1.0) - beside)
            for l in range(bands.shape[0]):  # noqa: E741
                for k in range(3):
                    bands[l, k] += share * table[r, c, l, k]
