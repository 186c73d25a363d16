"""Compiled linear blend skinning: each vertex moves by the weighted mean of its bones' transforms.

Kernels never validate: `engine.realtime.zonal_harmonics.posed_scene` does.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def skin_range(
    places: Float64Array, normals: Float64Array, bones: NDArray[np.int32], weights: Float64Array, moves: Float64Array,
    turns: Float64Array,
    start: int, stop: int, moved: Float64Array, linear: Float64Array, turned: Float64Array,
) -> None:  # fmt: skip
    """Add the bones' displacement of places (V, 3) to moved[start:stop] (V, 3), and its Jacobian to linear (V, 3, 3);
    fill turned (V, 3) with the transformed normals (V, 3).

    bones (V, K) and weights (V, K): the bones of each vertex; moves (B, 3, 4): a bone's matrix minus that at rest;
    turns (B, 3, 3): its matrix for normals.
    """
    move, turn = np.empty((3, 4)), np.empty((3, 3))
    for v in range(start, stop):
        # Blend the matrices by the weights.
        move[:] = 0.0
        turn[:] = 0.0
        for k in range(bones.shape[1]):
            share = weights[v, k]
            if share > 0.0:
                move += share * moves[bones[v, k]]
                turn += share * turns[bones[v, k]]
        # Apply them to position and normal.
        x, y, z = places[v]
        nx, ny, nz = normals[v]
        for a in range(3):
            moved[v, a] += move[a, 0] * x + move[a, 1] * y + move[a, 2] * z + move[a, 3]
            turned[v, a] = turn[a, 0] * nx + turn[a, 1] * ny + turn[a, 2] * nz
            for b in range(3):
                linear[v, a, b] += move[a, b]
