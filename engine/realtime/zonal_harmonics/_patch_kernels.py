"""Compiled look-ups in textures of zonal lobes.

Kernels never validate: `engine.realtime.zonal_harmonics.patches` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def look_up_range(
    low: Float32Array, axes: Float32Array, coefficients: Float32Array, uvs: NDArray[np.float64],
    start: int, stop: int, found_low: Float32Array, found_axes: Float32Array, found_coefficients: Float32Array,
) -> None:  # fmt: skip
    """Fill found_... [start:stop] (P, ...) at texture coordinates (P, 2), v upwards, from maps (H, W, ...)."""
    n_rows, n_columns = low.shape[0], low.shape[1]
    for p in range(start, stop):
        column = (uvs[p, 0] - math.floor(uvs[p, 0])) * n_columns - 0.5
        row = (1.0 - (uvs[p, 1] - math.floor(uvs[p, 1]))) * n_rows - 0.5
        left, top = math.floor(column), math.floor(row)
        beside, below = np.float32(column - left), np.float32(row - top)
        # Bilinear interpolation of the low bands.
        found_low[p] = 0.0
        for down in range(2):
            for right in range(2):
                share = (below if down else np.float32(1.0) - below) * (beside if right else np.float32(1.0) - beside)
                texel = low[(int(top) + down) % n_rows, (int(left) + right) % n_columns]
                for k in range(4):
                    found_low[p, k] += share * texel[k]
        # Nearest texel for the lobes: those of neighbours do not correspond.
        nearest_row = (int(top) + (1 if below >= 0.5 else 0)) % n_rows
        nearest_column = (int(left) + (1 if beside >= 0.5 else 0)) % n_columns
        for i in range(axes.shape[2]):  # by element: for whole rows the compiler generates error messages
            for k in range(axes.shape[3]):
                found_axes[p, i, k] = axes[nearest_row, nearest_column, i, k]
            for k in range(coefficients.shape[3]):
                found_coefficients[p, i, k] = coefficients[nearest_row, nearest_column, i, k]
