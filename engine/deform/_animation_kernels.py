"""Compiled skinning: vertices moved by the mean of what their bones do.

Kernels never validate: `engine.deform.animation` does.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def skin_range(
    positions: Floats, bones: NDArray[np.int32], weights: Floats, moves: Floats,
    start: int, stop: int, moved: Floats, linear: Floats,
) -> None:  # fmt: skip
    """Fill moved[start:stop] (V, 3) and their linear parts (V, 3, 3).

    bones (V, K) and weights (V, K): what each hangs on; moves (B, 3, 4): what a bone does beyond leaving all in place.
    """
    move = np.empty((3, 4))
    for v in range(start, stop):
        move[:] = 0.0
        for k in range(bones.shape[1]):
            share = weights[v, k]
            if share > 0.0:
                move += share * moves[bones[v, k]]
        x, y, z = positions[v]
        for a in range(3):
            moved[v, a] = positions[v, a] + (move[a, 0] * x + move[a, 1] * y + move[a, 2] * z + move[a, 3])
            for b in range(3):
                linear[v, a, b] = move[a, b] + (1.0 if a == b else 0.0)
