"""Compiled: the chain rule over a sequence of deformers, and the axes that points get [Sloan05, 5].

Kernels never validate: `engine.realtime.zonal_harmonics.pose` does.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import orthonormalize

Float64Array = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def chain_range(
    start: int, stop: int, moved: Float64Array, jacobian: Float64Array, axes: NDArray[np.int64], foot: Float64Array,
    height: float, positions: Float64Array, jacobians: Float64Array,
) -> None:  # fmt: skip
    """Fill positions[start:stop] (V, 3) with what a deformer moved to moved (V, 3), in units of height from the foot
    (3,), and multiply jacobians (V, 3, 3) by its jacobian (V, 3, 3).

    axes (3,): the object's axes that are the deformer's x, y, z.
    """
    before = np.empty((3, 3))
    for v in range(start, stop):
        for a in range(3):
            positions[v, axes[a]] = moved[v, a] * height + foot[axes[a]]
            for b in range(3):
                before[a, b] = jacobians[v, a, b]
        for a in range(3):
            for b in range(3):
                total = 0.0
                for c in range(3):
                    total += jacobian[v, a, c] * before[axes[c], b]
                jacobians[v, axes[a], b] = total


@njit(cache=True, nogil=True, error_model="numpy")
def deformed_frames_range(
    start: int, stop: int, frames: Float64Array, jacobians: Float64Array, out: Float64Array
) -> None:
    """Fill out[start:stop] (V, 3, 3) as `engine.realtime.zonal_harmonics.pose.deformed_frames` documents."""
    tangent, normal, cofactors = np.empty(3), np.empty(3), np.empty((3, 3))
    for v in range(start, stop):
        j, f = jacobians[v], frames[v]
        # det(J) J^-T, also where there is no inverse: rows are cross products of rows.
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            for i in range(3):
                k, m = (i + 1) % 3, (i + 2) % 3
                cofactors[a, i] = j[b, k] * j[c, m] - j[b, m] * j[c, k]
        determinant = j[0, 0] * cofactors[0, 0] + j[0, 1] * cofactors[0, 1] + j[0, 2] * cofactors[0, 2]
        sign = -1.0 if determinant < 0.0 else 1.0
        for a in range(3):
            normal[a] = tangent[a] = 0.0
            for i in range(3):
                normal[a] += sign * cofactors[a, i] * f[2, i]
                tangent[a] += j[a, i] * f[0, i]
        orthonormalize(tangent, normal, f, out[v])
