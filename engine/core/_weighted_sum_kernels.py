"""Compiled: adds weighted pictures, see `engine.core.weighted_sum`."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def add_four(
    total: Float32Array, first: Float32Array, second: Float32Array, third: Float32Array, fourth: Float32Array,
    weights: Float32Array, begin: int, end: int,
) -> None:  # fmt: skip
    """total += Σ_l w_l B_l from `begin`, a multiple of 3, to `end`, for four pictures B_l, all flat (3p,). weights
    (4, 3n): w_l (3,), each repeated n times."""
    n = weights.shape[1]
    for i in range(begin, end, n):
        last = min(i + n, end)
        part, a, b, c, d = total[i:last], first[i:last], second[i:last], third[i:last], fourth[i:last]
        for j in range(part.shape[0]):
            part[j] += weights[0, j] * a[j] + weights[1, j] * b[j] + weights[2, j] * c[j] + weights[3, j] * d[j]
