"""Compiled: applies the filter of `smoothing` to light by gather point and to planes of it."""

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True, error_model="numpy")
def smooth_rows(start, neighbour, weight, values, out):
    """Filters values (q, m) into out (p, m)."""
    for i in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[i, c] = np.float32(0.0)
        for at in range(start[i], start[i + 1]):
            row, w = neighbour[at], weight[at]
            for c in range(out.shape[1]):
                out[i, c] += w * values[row, c]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def smooth_planes(start, neighbour, weight, values, begin, end, out):
    """Filters the planes [begin, end) of values (m, q) along q into out (m, p)."""
    for plane in range(begin, end):
        for i in range(out.shape[1]):
            total = np.float32(0.0)
            for at in range(start[i], start[i + 1]):
                total += weight[at] * values[plane, neighbour[at]]
            out[plane, i] = total
