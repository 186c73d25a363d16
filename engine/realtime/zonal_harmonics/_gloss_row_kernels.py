"""Compiled shading of glossy points by rows of a factored reflection.

Kernels never validate: `engine.realtime.zonal_harmonics.gloss_rows` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
_ONE = np.float32(1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def weigh_range(
    start: int, stop: int, seen: NDArray[np.int64], values: Float32Array, wo: Float32Array, views: Float32Array,
    reached: Float32Array, which: NDArray[np.int64], sent: Float32Array,
) -> None:  # fmt: skip
    """Add to sent (S, 3), at the points which (P,), what those seen[start:stop] among these send to the camera
    [Sloan05, eq. 16].

    values (P K, 3): of the K rows of each point under the light; wo (P, 3): in the point's axes, above the surface;
    views (D, D, K, 3): the weight of each row by the direction of wo, over a square; reached (P,): the share of the
    light that others leave.
    """
    side, n_rows = views.shape[0], views.shape[2]
    for at in range(start, stop):
        p = seen[at]
        # Where wo is on the square, and the shares of its four nearest entries.
        across, down = square_place(wo[p, 0], wo[p, 1], wo[p, 2])
        row = min(max((across + 1.0) * (0.5 * side) - 0.5, 0.0), side - 1.0)
        column = min(max((down + 1.0) * (0.5 * side) - 0.5, 0.0), side - 1.0)
        top, left = min(int(row), side - 2), min(int(column), side - 2)
        below, beside = np.float32(row - top), np.float32(column - left)
        share_a, share_b = (_ONE - below) * (_ONE - beside), (_ONE - below) * beside
        share_c, share_d = below * (_ONE - beside), below * beside
        red = green = blue = np.float32(0.0)
        for k in range(n_rows):
            a, b = views[top, left, k], views[top, left + 1, k]
            c, d = views[top + 1, left, k], views[top + 1, left + 1, k]
            value = values[p * n_rows + k]
            red += (share_a * a[0] + share_b * b[0] + share_c * c[0] + share_d * d[0]) * value[0]
            green += (share_a * a[1] + share_b * b[1] + share_c * c[1] + share_d * d[1]) * value[1]
            blue += (share_a * a[2] + share_b * b[2] + share_c * c[2] + share_d * d[2]) * value[2]
        sent[which[p], 0] += reached[p] * max(red, np.float32(0.0))
        sent[which[p], 1] += reached[p] * max(green, np.float32(0.0))
        sent[which[p], 2] += reached[p] * max(blue, np.float32(0.0))


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
