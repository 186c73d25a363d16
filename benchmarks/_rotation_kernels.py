"""Compiled rotation of spherical harmonics by angles, and of axes by matrices; `benchmarks.rotation_cost` validates."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]


@njit(cache=True, nogil=True)
def rotate_harmonics(
    vectors: Float64Array, angles: Float64Array, firsts: Int64Array, columns: Int64Array, values: Float64Array,
    rotated: Float64Array,
) -> None:  # fmt: skip
    """Fill rotated (P, n^2) with functions rotated by angles (P, 3) about z, x, z, x and z [Sloan05, 3.4].

    firsts, columns, values: what is not 0 of the quarter turns about x, row by row, all bands one after another.
    """
    n = int(math.sqrt(vectors.shape[1]))
    here, there = np.empty(vectors.shape[1]), np.empty(vectors.shape[1])
    for p in range(len(vectors)):
        here[:] = vectors[p]
        _about_z(here, angles[p, 2], n)
        there[:] = 0.0  # the quarter turn back: the transposed matrix
        for row in range(n * n):
            for k in range(firsts[row], firsts[row + 1]):
                there[columns[k]] += values[k] * here[row]
        _about_z(there, angles[p, 1], n)
        for row in range(n * n):
            here[row] = 0.0
            for k in range(firsts[row], firsts[row + 1]):
                here[row] += values[k] * there[columns[k]]
        _about_z(here, angles[p, 0], n)
        rotated[p] = here


@njit(cache=True, nogil=True)
def _about_z(vector: Float64Array, angle: float, n: int) -> None:
    cosine, sine = math.cos(angle), math.sin(angle)
    c, s = 1.0, 0.0
    for m in range(1, n):
        c, s = cosine * c - sine * s, sine * c + cosine * s
        for l in range(m, n):  # noqa: E741
            middle = l * l + l
            low, high = vector[middle - m], vector[middle + m]
            vector[middle + m] = c * high - s * low
            vector[middle - m] = s * high + c * low


@njit(cache=True, nogil=True)
def rotate_axes(axes: Float64Array, frames: Float64Array, rotated: Float64Array) -> None:
    """Fill rotated (P, N, 3) with axes turned by frames (P, 3, 3) [Sloan05, eq. 10]."""
    for p in range(len(axes)):
        for i in range(axes.shape[1]):
            for k in range(3):
                rotated[p, i, k] = (
                    frames[p, k, 0] * axes[p, i, 0] + frames[p, k, 1] * axes[p, i, 1] + frames[p, k, 2] * axes[p, i, 2]
                )
