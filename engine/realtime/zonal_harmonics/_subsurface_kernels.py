"""Compiled sums over the places at which light enters a medium.

Kernels never validate: `engine.realtime.zonal_harmonics.subsurface` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

_NEAR = 16.0  # squared distance in squared radii, below which the area around a place does not act as a point


@njit(cache=True, nogil=True, error_model="numpy")
def gather_range(
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
                share = areas[s] * _look_up(table, reach, square)
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
    total = 2.0 * _look_up(table, reach, square)
    total += _look_up(table, reach, further + cross) + _look_up(table, reach, max(further - cross, 0.0))
    total += 2.0 * (_look_up(table, reach, further + 0.5 * cross) + _look_up(table, reach, further - 0.5 * cross))
    return total / 8.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _look_up(table: Float64Array, reach: float, square: float) -> float:
    """Interpolate the table of the reflectance at a squared distance; 0 beyond reach."""
    at = math.sqrt(square) / reach * (table.shape[0] - 1)
    k = int(at)
    if k >= table.shape[0] - 1:
        return 0.0
    return table[k] + (at - k) * (table[k + 1] - table[k])
