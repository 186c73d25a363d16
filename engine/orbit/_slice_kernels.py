"""Compiled: the product of a point's light with the slices around an outgoing direction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.orbit._incident_kernels import Kept, child_at

Floats = NDArray[np.float32]
_TURN = 2.0 * math.pi / 5.0
_MOST_CELLS = 24


class Tables(NamedTuple):
    """Slices by coefficient (5120, polar, azimuth, 3) and by upper triangle (2560, polar, azimuth, 3); where symmetries
    carry coefficients (10, 5120) and upper triangles (10, 2560), over 36 degrees, or (1, ...) of slices all around."""

    table: Floats
    values: Floats
    images: NDArray[np.int32]
    places: NDArray[np.int32]
    steepest: float


class Cell(NamedTuple):
    """Four slices around an outgoing direction, and where it lies between them."""

    symmetry: int
    row: int
    column: int
    right: int
    down: np.float32
    across: np.float32


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def cell_at(x: float, y: float, z: float, t: Tables) -> Cell:
    """The cell of a unit direction in a point's frame."""
    n_polar, n_azimuths = t.table.shape[1], t.table.shape[2]
    polar = min(math.acos(min(max(y, 0.0), 1.0)), t.steepest) / t.steepest * (n_polar - 1)
    azimuth = math.atan2(x, z)
    if azimuth < 0.0:
        azimuth += 2.0 * math.pi
    row, symmetry = min(int(polar), n_polar - 2), 0
    if len(t.images) > 1:
        turn = int(azimuth / _TURN)
        inside = azimuth - turn * _TURN
        symmetry = turn % 5
        if inside > 0.5 * _TURN:
            inside = _TURN - inside
            symmetry = 5 + (turn + 1) % 5
        place = inside / (0.5 * _TURN) * (n_azimuths - 1)
        column = min(int(place), n_azimuths - 2)
        return Cell(symmetry, row, column, column + 1, np.float32(polar - row), np.float32(place - column))
    place = azimuth / (2.0 * math.pi) * n_azimuths
    column = int(place)
    across = np.float32(place - column)
    return Cell(0, row, column % n_azimuths, (column + 1) % n_azimuths, np.float32(polar - row), across)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _unpack(value: NDArray[np.uint16], n: int, words: NDArray[np.uint32]) -> None:
    """bfloat16 values (n, 3) as the bits of float32."""
    for k in range(n):
        for i in range(3):
            words[k, i] = np.uint32(value[k, i]) << np.uint32(16)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _reflect(cell: Cell, number: NDArray[np.int16], value: Floats, n: int, t: Tables, out: Floats) -> None:
    """Σ coefficients × those of the cell's four slices, into out (4, 3)."""
    table, images = t.table, t.images[cell.symmetry]
    row, column, right = cell.row, cell.column, cell.right
    s00 = s01 = s02 = s10 = s11 = s12 = np.float32(0.0)
    s20 = s21 = s22 = s30 = s31 = s32 = np.float32(0.0)
    for k in range(n):
        c = images[number[k]]
        red, green, blue = value[k, 0], value[k, 1], value[k, 2]
        s00 += red * table[c, row, column, 0]
        s01 += green * table[c, row, column, 1]
        s02 += blue * table[c, row, column, 2]
        s10 += red * table[c, row, right, 0]
        s11 += green * table[c, row, right, 1]
        s12 += blue * table[c, row, right, 2]
        s20 += red * table[c, row + 1, column, 0]
        s21 += green * table[c, row + 1, column, 1]
        s22 += blue * table[c, row + 1, column, 2]
        s30 += red * table[c, row + 1, right, 0]
        s31 += green * table[c, row + 1, right, 1]
        s32 += blue * table[c, row + 1, right, 2]
    out[0, 0], out[0, 1], out[0, 2] = s00, s01, s02
    out[1, 0], out[1, 1], out[1, 2] = s10, s11, s12
    out[2, 0], out[2, 1], out[2, 2] = s20, s21, s22
    out[3, 0], out[3, 1], out[3, 2] = s30, s31, s32


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _between(cell: Cell, corners: Floats, i: int) -> float:
    """Channel i of what stands at a cell's corners (4, 3), at its place."""
    upper = corners[0, i] + cell.across * (corners[1, i] - corners[0, i])
    lower = corners[2, i] + cell.across * (corners[3, i] - corners[2, i])
    return float(upper + cell.down * (lower - upper))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def shade_points(
    start: int, stop: int, points: NDArray[np.int64], eye: Floats, n_most: int, position: Floats, frame: Floats,
    slots: NDArray[np.int32], kept: Kept, t: Tables, radiance: Floats,
) -> None:  # fmt: skip
    """Fill rows `points[start:stop]` of radiance (S, 3): what each sends to the eye by its first n_most coefficients
    and the suns, these by their triangles."""
    n = min(n_most, kept.number.shape[1])
    words, corners = np.empty((n, 3), np.uint32), np.empty((4, 3), np.float32)
    value = words.view(np.float32)
    for j in range(start, stop):
        p = points[j]
        slot, f = slots[p], frame[p]
        a, b, c = eye[0] - position[p, 0], eye[1] - position[p, 1], eye[2] - position[p, 2]
        scale = 1.0 / math.sqrt(a * a + b * b + c * c)
        x = (f[0, 0] * a + f[0, 1] * b + f[0, 2] * c) * scale
        y = (f[1, 0] * a + f[1, 1] * b + f[1, 2] * c) * scale
        z = (f[2, 0] * a + f[2, 1] * b + f[2, 2] * c) * scale
        cell = cell_at(x, y, z, t)
        _unpack(kept.value[slot], n, words)
        _reflect(cell, kept.number[slot], value, n, t, corners)
        for s in range(kept.sun_place.shape[1]):
            k = kept.sun_place[slot, s]
            if k < 0:
                break
            own = t.values[t.places[cell.symmetry, k]]
            for i in range(3):
                power = kept.sun_power[slot, s, i]
                corners[0, i] += power * own[cell.row, cell.column, i]
                corners[1, i] += power * own[cell.row, cell.right, i]
                corners[2, i] += power * own[cell.row + 1, cell.column, i]
                corners[3, i] += power * own[cell.row + 1, cell.right, i]
        for i in range(3):
            radiance[p, i] = _between(cell, corners, i)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def shade_corners(
    start: int, stop: int, points: NDArray[np.int64], first: NDArray[np.int64], members: NDArray[np.int64], wo: Floats,
    frame: Floats, slots: NDArray[np.int32], kept: Kept, t: Tables, radiance: Floats,
) -> None:  # fmt: skip
    """Fill radiance (3 N, 3): what points send along wo (N, 3) of the world, without suns.

    The point points[j] is asked by members[first[j]:first[j + 1]] of the 3 N corners. These look at it from about one
    side: most find a cell that another of them has paid for.
    """
    n = kept.number.shape[1]
    words, cells = np.empty((n, 3), np.uint32), np.empty((_MOST_CELLS, 4, 3), np.float32)
    keys = np.empty(_MOST_CELLS, np.int64)
    value = words.view(np.float32)
    for j in range(start, stop):
        p = points[j]
        slot, f, n_cells = slots[p], frame[p], 0
        number = kept.number[slot]
        _unpack(kept.value[slot], n, words)
        for at in range(first[j], first[j + 1]):
            r = members[at]
            a, b, c = wo[r // 3, 0], wo[r // 3, 1], wo[r // 3, 2]
            x = f[0, 0] * a + f[0, 1] * b + f[0, 2] * c
            y = f[1, 0] * a + f[1, 1] * b + f[1, 2] * c
            z = f[2, 0] * a + f[2, 1] * b + f[2, 2] * c
            cell = cell_at(x, y, z, t)
            key = (cell.symmetry * 64 + cell.row) * 64 + cell.column
            i_cell = 0
            while i_cell < n_cells and keys[i_cell] != key:
                i_cell += 1
            if i_cell == n_cells:
                if n_cells == _MOST_CELLS:
                    i_cell = n_cells = 0
                keys[i_cell] = key
                n_cells += 1
                _reflect(cell, number, value, n, t, cells[i_cell])
            for i in range(3):
                radiance[r, i] = _between(cell, cells[i_cell], i)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def sun_slices(
    which: NDArray[np.int64], corners: NDArray[np.int32], weights: Floats, wo: Floats, frame: Floats,
    sun_bits: NDArray[np.uint8], sun_direction: Floats, sun_power: Floats, children: NDArray[np.int16], t: Tables,
    share: Floats, between: Floats, most: Floats,
) -> None:  # fmt: skip
    """Of samples (N,) and suns (M,): fill the share (N, M) that is seen, and what slices say that is reflected of it,
    interpolated (N, M, 3) and the most around (N, M), of the sum of colours. The frame is that of the nearest point."""
    for n in range(len(which)):
        j = which[n]
        nearest = 0
        for k in range(1, 3):
            if weights[j, k] > weights[j, nearest]:
                nearest = k
        f = frame[corners[j, nearest]]
        a, b, c = wo[j, 0], wo[j, 1], wo[j, 2]
        cell = cell_at(
            f[0, 0] * a + f[0, 1] * b + f[0, 2] * c, f[1, 0] * a + f[1, 1] * b + f[1, 2] * c,
            f[2, 0] * a + f[2, 1] * b + f[2, 2] * c, t,
        )  # fmt: skip
        for s in range(len(sun_power)):
            seen = np.float32(0.0)
            for k in range(3):
                if sun_bits[corners[j, k], s >> 3] >> (s & 7) & 1:
                    seen += weights[j, k]
            share[n, s], most[n, s], between[n, s] = seen, 0.0, 0.0
            d = sun_direction[s]
            y = f[1, 0] * d[0] + f[1, 1] * d[1] + f[1, 2] * d[2]
            if seen <= 0.0 or y <= 0.0:
                continue
            x = f[0, 0] * d[0] + f[0, 1] * d[1] + f[0, 2] * d[2]
            z = f[2, 0] * d[0] + f[2, 1] * d[1] + f[2, 2] * d[2]
            own = t.values[t.places[cell.symmetry, child_at(x, y, z, children) >> 2]]
            for i in range(3):
                power = seen * sun_power[s, i]
                v00, v01 = own[cell.row, cell.column, i], own[cell.row, cell.right, i]
                v10, v11 = own[cell.row + 1, cell.column, i], own[cell.row + 1, cell.right, i]
                upper = v00 + cell.across * (v01 - v00)
                between[n, s, i] = power * (upper + cell.down * (v10 + cell.across * (v11 - v10) - upper))
                most[n, s] += power * max(max(v00, v01), max(v10, v11))
