"""Compiled sums over the rays of a transfer simulation, and rotation of vectors of harmonics.

Kernels never validate: `engine.realtime.zonal_harmonics.transfer` does.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.sphere._kernels import basis_at

Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]


@njit(cache=True, nogil=True, error_model="numpy")
def turn_range(
    vectors: Float64Array,
    frames: Float64Array,
    places: Float64Array,
    weighed: Float64Array,
    start: int,
    stop: int,
    turned: Float64Array,
) -> None:
    """Fill turned[start:stop] with the functions (P, n^2), expressed in the axes that `frames` (P, 3, 3) map to their
    own.

    places (D, 3), weighed (D, n^2): directions of a quadrature, and the harmonics there times its weights.
    """
    n2 = vectors.shape[1]
    n = int(np.sqrt(n2))
    legendre, values, none = np.zeros((n, n + 1)), np.empty(n2), np.empty((0, 3))
    for p in range(start, stop):
        turned[p] = 0.0
        frame = frames[p]
        for d in range(places.shape[0]):
            # Evaluate the function in the rotated direction: Σ_k y_k(R d) f_k.
            x, y, z = places[d]
            basis_at(
                frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
                frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
                frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
                legendre, values, none,
            )  # fmt: skip
            value = 0.0
            for k in range(n2):
                value += values[k] * vectors[p, k]
            # Project it onto the harmonics by quadrature.
            for k in range(n2):
                turned[p, k] += weighed[d, k] * value


@njit(cache=True, nogil=True, error_model="numpy")
def gather_range(
    firsts: NDArray[np.int64], triangle: Int32Array, u: NDArray[np.float32], v: NDArray[np.float32],
    corners: Int32Array,
    share: float, sent: Float64Array, start: int, stop: int, gathered: Float64Array,
) -> None:  # fmt: skip
    """Fill gathered[start:stop] with `share` times the sum of what each point's hits send (P, n^2).

    The hits of point p are firsts[p] to firsts[p + 1]: a triangle, and u and v on it; corners (T, 3): the triangle's
    points.
    """
    for p in range(start, stop):
        gathered[p] = 0.0
        for h in range(firsts[p], firsts[p + 1]):
            # Barycentric weights of the hit.
            a, b, c = corners[triangle[h]]
            of_b, of_c = share * u[h], share * v[h]
            of_a = share - of_b - of_c
            for k in range(sent.shape[1]):
                gathered[p, k] += of_a * sent[a, k] + of_b * sent[b, k] + of_c * sent[c, k]
