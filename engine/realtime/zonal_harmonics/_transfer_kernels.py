"""Compiled sums over the rays of a transfer simulation and over the places at which light enters a medium, and rotation
of vectors of harmonics.

Kernels never validate: `engine.realtime.zonal_harmonics.transfer` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_local
from engine.sphere._kernels import basis_at

Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]

_NEAR = 16.0  # squared distance in squared radii, below which the area around a place does not act as a point


@njit(cache=True, nogil=True, error_model="numpy")
def rotate_range(
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
            x, y, z = to_local(frame, x, y, z)
            basis_at(x, y, z, legendre, values, none)
            value = 0.0
            for k in range(n2):
                value += values[k] * vectors[p, k]
            # Project it onto the harmonics by quadrature.
            for k in range(n2):
                turned[p, k] += weighed[d, k] * value


@njit(cache=True, nogil=True, error_model="numpy")
def gather_bounces(
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


@njit(cache=True, nogil=True, error_model="numpy")
def gather_subsurface(
    entering: Float64Array, places: Float64Array, areas: Float64Array, numbers: NDArray[np.int32],
    points: Float64Array, own: Float64Array,
    table: Float64Array, reach: float, start: int, stop: int, leaving: Float64Array,
) -> None:  # fmt: skip
    """Fill leaving[start:stop] (P, n^2).

    places (S, 3), areas (S,), numbers (S,): where light enters, and its row in `entering`; own (S,): share of a place's
    light that leaves at the same place. table: the reflectance at equal steps of distance up to `reach`.
    """
    for p in range(start, stop):
        leaving[p] = 0.0
        x, y, z = points[p]
        # Sum reflectance × area × entering light over all places within reach [Jensen01].
        for s in range(places.shape[0]):
            square = (places[s, 0] - x) ** 2 + (places[s, 1] - y) ** 2 + (places[s, 2] - z) ** 2
            if square > reach * reach:
                continue
            disc = areas[s] / math.pi
            # At the place itself and close to it, integrate over the disc with the place's area.
            if square < 1e-6 * disc:
                share = own[s]
            elif square < _NEAR * disc:
                share = areas[s] * _over_disc(table, reach, square, disc)
            else:
                share = areas[s] * _reflectance_at(table, reach, square)
            row = numbers[s]
            for i in range(entering.shape[1]):
                leaving[p, i] += share * entering[row, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _over_disc(table: Float64Array, reach: float, square: float, disc: float) -> float:
    """Mean over a disc in the plane, given the squared distance of its centre and its squared radius, by a seven-point
    rule that is exact for polynomials of degree 5 [Abramowitz64, 25.4.61]."""
    # The centre, weight 1/4, and six points on the circle of radius sqrt(2/3) r, weight 1/8 each; two pairs are
    # symmetric.
    further, cross = square + 2.0 / 3.0 * disc, 2.0 * math.sqrt(2.0 / 3.0 * disc * square)
    total = 2.0 * _reflectance_at(table, reach, square)
    total += _reflectance_at(table, reach, further + cross) + _reflectance_at(table, reach, max(further - cross, 0.0))
    total += 2.0 * (
        _reflectance_at(table, reach, further + 0.5 * cross) + _reflectance_at(table, reach, further - 0.5 * cross)
    )
    return total / 8.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _reflectance_at(table: Float64Array, reach: float, square: float) -> float:
    """Interpolate the table of the reflectance at a squared distance; 0 beyond reach."""
    at = math.sqrt(square) / reach * (table.shape[0] - 1)
    k = int(at)
    if k >= table.shape[0] - 1:
        return 0.0
    return table[k] + (at - k) * (table[k + 1] - table[k])
