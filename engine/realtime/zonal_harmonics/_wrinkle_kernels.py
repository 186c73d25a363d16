"""Compiled error of lobes that are bilinear between the nodes of a map, and its gradient with respect to the nodes.

Kernels never validate: `engine.realtime.zonal_harmonics.wrinkle` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.sphere._kernels import basis_at

Float64Array = NDArray[np.float64]

FIRST = 2  # lower bands are stored exactly


@njit(cache=True, nogil=True, error_model="numpy")
def error_range(
    targets: Float64Array, places: Float64Array, axes: Float64Array, coefficients: Float64Array, start: int, stop: int,
    of_axes: Float64Array, of_coefficients: Float64Array,
) -> float:  # fmt: skip
    """Return the squared error of samples start to stop [Sloan05, eq. 17]; add its gradient with respect to the nodes
    [Sloan05, eqs. 19 to 21].

    targets (S, n^2) at places (S, 2) on the map, in nodes; axes (H, W, N, 3) of any length, coefficients (H, W, N, n).
    """
    n_rows, n_columns, n_lobes, n = coefficients.shape
    legendre, values, slopes = np.zeros((n, n + 1)), np.empty((n_lobes, n * n)), np.empty((n_lobes, n * n, 3))
    axis, size, share = np.empty((n_lobes, 3)), np.empty(n_lobes), np.empty((n_lobes, n))
    rest, turned, weight = np.empty(n * n), np.empty(3), np.empty(4)
    error = 0.0
    for s in range(start, stop):
        # The map's cell, and bilinear weights of its four nodes.
        row, column = min(int(places[s, 0]), n_rows - 2), min(int(places[s, 1]), n_columns - 2)
        down, right = places[s, 0] - row, places[s, 1] - column
        for r in range(2):
            for c in range(2):
                weight[2 * r + c] = (down if r else 1.0 - down) * (right if c else 1.0 - right)
        axis[:], share[:] = 0.0, 0.0
        # Interpolate axes and coefficients, normalize the axes, and evaluate the harmonics and their gradients there.
        for i in range(n_lobes):
            for corner in range(4):
                r, c = row + corner // 2, column + corner % 2
                for k in range(3):
                    axis[i, k] += weight[corner] * axes[r, c, i, k]
                for l in range(FIRST, n):  # noqa: E741
                    share[i, l] += weight[corner] * coefficients[r, c, i, l]
            size[i] = math.sqrt(max(axis[i, 0] ** 2 + axis[i, 1] ** 2 + axis[i, 2] ** 2, 1e-24))
            for k in range(3):
                axis[i, k] /= size[i]
            basis_at(axis[i, 0], axis[i, 1], axis[i, 2], legendre, values[i], slopes[i])
        # Residual t~ - t, with t~ by [Sloan05, eq. 11], and its squared length [Sloan05, eq. 17].
        for l in range(FIRST, n):  # noqa: E741
            for k in range(l * l, (l + 1) * (l + 1)):
                rest[k] = targets[s, k]
                for i in range(n_lobes):
                    rest[k] -= share[i, l] * values[i, k]
                error += rest[k] * rest[k]
        # Gradient by the coefficients [Sloan05, eq. 19] and by the axis [Sloan05, eq. 20].
        for i in range(n_lobes):
            turned[:] = 0.0
            for l in range(FIRST, n):  # noqa: E741
                along = 0.0
                for k in range(l * l, (l + 1) * (l + 1)):
                    along -= 2.0 * rest[k] * values[i, k]
                    for c in range(3):
                        turned[c] -= 2.0 * rest[k] * share[i, l] * slopes[i, k, c]
                for corner in range(4):
                    of_coefficients[row + corner // 2, column + corner % 2, i, l] += weight[corner] * along
            # The axis is normalized, so only the tangential part counts, divided by the length [Sloan05, eq. 21]; the
            # chain rule through the interpolation multiplies by the node's weight.
            outward = turned[0] * axis[i, 0] + turned[1] * axis[i, 1] + turned[2] * axis[i, 2]
            for corner in range(4):
                for c in range(3):
                    change = weight[corner] * (turned[c] - outward * axis[i, c]) / size[i]
                    of_axes[row + corner // 2, column + corner % 2, i, c] += change
    return error
