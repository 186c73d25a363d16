"""Compiled: the product of a point's light with the slices around an outgoing direction."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float32]
_TURN = 2.0 * math.pi / 5.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def shade_range(
    start: int,
    stop: int,
    points: NDArray[np.int64],
    wo: Floats,
    number: NDArray[np.int16],
    value: Floats,
    table: Floats,
    images: NDArray[np.int32],
    steepest: float,
    radiance: Floats,
) -> None:
    """Fill radiance[start:stop]: Σ coefficients × those of four slices, weighed by ωo between them.

    images (10, C) for slices over 36 degrees, (1, C) for slices all around (`slices.inverse_images`).
    """
    n_polar, n_azimuths = table.shape[1], table.shape[2]
    n_terms = number.shape[1]
    for j in range(start, stop):
        p = points[j]
        polar = min(math.acos(min(max(wo[j, 1], 0.0), 1.0)), steepest) / steepest * (n_polar - 1)
        azimuth = math.atan2(wo[j, 0], wo[j, 2])
        if azimuth < 0.0:
            azimuth += 2.0 * math.pi
        symmetry = 0
        if len(images) > 1:
            turn = int(azimuth / _TURN)
            inside = azimuth - turn * _TURN
            symmetry = turn % 5
            if inside > 0.5 * _TURN:
                inside = _TURN - inside
                symmetry = 5 + (turn + 1) % 5
            place = inside / (0.5 * _TURN) * (n_azimuths - 1)
        else:
            place = azimuth / (2.0 * math.pi) * n_azimuths
        row = min(int(polar), n_polar - 2)
        column = int(place)
        if len(images) > 1:
            column = min(column, n_azimuths - 2)
        right = (column + 1) % n_azimuths
        down, across = np.float32(polar - row), np.float32(place - column)
        column %= n_azimuths
        w00, w01 = (1 - down) * (1 - across), (1 - down) * across
        w10, w11 = down * (1 - across), down * across
        red = green = blue = np.float32(0.0)
        for k in range(n_terms):
            c = images[symmetry, number[p, k]]
            a, b = table[c, row, column], table[c, row, right]
            d, e = table[c, row + 1, column], table[c, row + 1, right]
            red += value[p, k, 0] * (w00 * a[0] + w01 * b[0] + w10 * d[0] + w11 * e[0])
            green += value[p, k, 1] * (w00 * a[1] + w01 * b[1] + w10 * d[1] + w11 * e[1])
            blue += value[p, k, 2] * (w00 * a[2] + w01 * b[2] + w10 * d[2] + w11 * e[2])
        radiance[j, 0], radiance[j, 1], radiance[j, 2] = red, green, blue
