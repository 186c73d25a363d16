"""Compiled shading of glossy points by rows of a factored reflection.

Kernels never validate: `engine.realtime.zonal_harmonics.gloss_rows` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_local, to_world
from engine.realtime.zonal_harmonics._shading_kernels import look_up

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def add_rows_range(
    which: NDArray[np.int64], start: int, stop: int,
    low: Float32Array, axes: Float32Array, coefficients: Float32Array, views: Float32Array,
    frames: Float32Array, places: Float32Array, camera_position: Float64Array,
    light: Float32Array, table: Float32Array, reached: Float32Array, sent: Float32Array,
) -> None:  # fmt: skip
    """Add to sent (S, 3) what points which[start:stop] (P,) send to the camera [Sloan05, eq. 16].

    low (P K, 4), axes (P K, N, 3), coefficients (P K, N, n): lobes of the K rows of each of the P points, in its own
    axes, the rows of frames (S, 3, 3). views (D, D, K, 3): the weight of each row by the direction of wo, over a
    square. light (n^2, 3), table (rows, columns, n, 3): see `shade_range`; reached (P,): the share of the light that
    others leave.
    """
    n, n_rows, side = coefficients.shape[2], views.shape[2], views.shape[0]
    bands, value, total = np.empty((n, 3), np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    for at in range(start, stop):
        p = which[at]
        frame = frames[p]
        x, y, z = (
            camera_position[0] - places[p, 0],
            camera_position[1] - places[p, 1],
            camera_position[2] - places[p, 2],
        )
        length = math.sqrt(x * x + y * y + z * z)
        x, y, z = to_local(frame, x, y, z)
        if not z > 0.0:  # seen from below
            continue
        # Where wo is on the square, and its four nearest entries.
        across, down = square_place(x / length, y / length, min(z / length, 1.0))
        row = min(max((across + 1.0) * (0.5 * side) - 0.5, 0.0), side - 1.0)
        column = min(max((down + 1.0) * (0.5 * side) - 0.5, 0.0), side - 1.0)
        top, left = min(int(row), side - 2), min(int(column), side - 2)
        below, beside = np.float32(row - top), np.float32(column - left)
        for c in range(3):
            total[c] = 0.0
        for k in range(n_rows):
            # The row times the light, as of a diffuse point [Sloan05, eq. 25].
            r = at * n_rows + k
            x, y, z = to_world(frame, -low[r, 3], -low[r, 1], low[r, 2])
            for c in range(3):
                value[c] = low[r, 0] * light[0, c]
                if n > 1:
                    value[c] += -y * light[1, c] + z * light[2, c] - x * light[3, c]
            for i in range(axes.shape[1]):
                x, y, z = to_world(frame, axes[r, i, 0], axes[r, i, 1], axes[r, i, 2])
                look_up(table, x, y, z, bands)
                for l in range(n):  # noqa: E741
                    for c in range(3):
                        value[c] += coefficients[r, i, l] * bands[l, c]
            for c in range(3):
                before = views[top, left, k, c] + beside * (views[top, left + 1, k, c] - views[top, left, k, c])
                after = views[top + 1, left, k, c] + beside * (
                    views[top + 1, left + 1, k, c] - views[top + 1, left, k, c]
                )
                total[c] += (before + below * (after - before)) * value[c]
        for c in range(3):
            sent[p, c] += reached[at] * max(total[c], np.float32(0.0))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def square_place(x: float, y: float, z: float) -> tuple[float, float]:
    """The place on [-1, 1]^2 of a direction of the upper hemisphere: the inverse of the map of [Shirley97] after the
    area-preserving map of the hemisphere to the disc."""
    radius = math.sqrt(max(1.0 - z, 0.0))
    if abs(x) > abs(y):
        side = 1.0 if x > 0.0 else -1.0
        return side * radius, side * radius * math.atan2(side * y, side * x) * (4.0 / math.pi)
    if y == 0.0:
        return 0.0, 0.0
    side = 1.0 if y > 0.0 else -1.0
    return side * radius * math.atan2(side * x, side * y) * (4.0 / math.pi), side * radius
