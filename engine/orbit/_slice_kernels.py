"""Compiled: the product of a point's light with the slices around an outgoing direction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.orbit._incident_kernels import Kept

Floats = NDArray[np.float32]
Halves = NDArray[np.uint16]
_TURN = 2.0 * math.pi / 5.0
_MOST_CELLS = 24
_1, _2, _3 = np.arange(1, 4, dtype=np.uint64)


class Tables(NamedTuple):
    """Slices by coefficient (polar, columns, rows, 3) and by upper triangle (polar, columns, 2560, 3), bfloat16, flat:
    what points that look alike ask for stands together. Where symmetries carry coefficients (10, 5120) and upper
    triangles (10, 2560), of columns over 36 degrees, or (1, ...) of columns all around; polar angles, the last the
    steepest, columns; serial: another of other tables."""

    table: Halves
    values: Halves
    images: NDArray[np.int32]
    places: NDArray[np.int32]
    n_polar: int
    n_columns: int
    steepest: float
    serial: int


class Cell(NamedTuple):
    """Four slices around an outgoing direction: the symmetry that brings it there, polar angle and column of the first,
    and where between them it lies."""

    symmetry: int
    row: int
    column: int
    down: np.float32
    across: np.float32


class Corners(NamedTuple):
    """Where the slices of a cell stand: red; green and blue follow. Unsigned, see `_reflect`."""

    first: np.uint64
    across: np.uint64
    down: np.uint64
    last: np.uint64


class Shades(NamedTuple):
    """What glossy points sent to the four slices around the eye (G, 4, 3) when it was asked last, and the key (G,) of
    those slices, −1 for none."""

    key: NDArray[np.int64]
    corners: Floats


def packed(values: Floats) -> Halves:
    """float32 as bfloat16, rounded."""
    return ((np.ascontiguousarray(values, np.float32).view(np.uint32) + np.uint32(0x8000)) >> np.uint32(16)).astype(
        np.uint16
    )


def unpacked(values: Halves) -> Floats:
    """bfloat16 as float32."""
    return (values.astype(np.uint32) << np.uint32(16)).view(np.float32)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True, inline="always")
def _float(half: np.uint16) -> np.float32:
    return np.uint32(np.uint32(half) << np.uint32(16)).view(np.float32)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def cell_at(x: float, y: float, z: float, t: Tables) -> Cell:
    """The cell of a unit direction in a point's frame."""
    polar = min(math.acos(min(max(y, 0.0), 1.0)), t.steepest) / t.steepest * (t.n_polar - 1)
    azimuth = math.atan2(x, z)
    if azimuth < 0.0:
        azimuth += 2.0 * math.pi
    row, symmetry, whole = min(int(polar), t.n_polar - 2), 0, 2.0 * math.pi
    if len(t.images) > 1:
        turn, whole = int(azimuth / _TURN), 0.5 * _TURN
        azimuth -= turn * _TURN
        symmetry = turn % 5
        if azimuth > whole:
            azimuth = _TURN - azimuth
            symmetry = 5 + (turn + 1) % 5
    place = azimuth / whole * (t.n_columns - 1)
    column = min(int(place), t.n_columns - 2)
    return Cell(symmetry, row, column, np.float32(polar - row), np.float32(place - column))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _unpack(value: NDArray[np.uint16], n: int, words: NDArray[np.uint32]) -> None:
    """bfloat16 values (n, 3) as the bits of float32."""
    for k in range(n):
        for i in range(3):
            words[k, i] = np.uint32(value[k, i]) << np.uint32(16)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _reflect(cell: Cell, number: NDArray[np.int16], value: Floats, n: int, t: Tables, out: Floats) -> None:
    """Σ coefficients × those of the cell's four slices, into out (4, 3)."""
    # Unsigned, so that no index is asked whether it counts from the end: twice as fast.
    table, images, across = t.table, t.images[cell.symmetry], np.uint64(len(t.table) // (t.n_polar * t.n_columns))
    down = np.uint64(t.n_columns) * across
    first = np.uint64(cell.row) * down + np.uint64(cell.column) * across
    s00 = s01 = s02 = s10 = s11 = s12 = np.float32(0.0)
    s20 = s21 = s22 = s30 = s31 = s32 = np.float32(0.0)
    for k in range(n):
        a = first + _3 * np.uint64(images[number[k]])
        b, c = a + across, a + down
        d = c + across
        red, green, blue = value[k, 0], value[k, 1], value[k, 2]
        s00 += red * _float(table[a])
        s01 += green * _float(table[a + _1])
        s02 += blue * _float(table[a + _2])
        s10 += red * _float(table[b])
        s11 += green * _float(table[b + _1])
        s12 += blue * _float(table[b + _2])
        s20 += red * _float(table[c])
        s21 += green * _float(table[c + _1])
        s22 += blue * _float(table[c + _2])
        s30 += red * _float(table[d])
        s31 += green * _float(table[d + _1])
        s32 += blue * _float(table[d + _2])
    out[0, 0], out[0, 1], out[0, 2] = s00, s01, s02
    out[1, 0], out[1, 1], out[1, 2] = s10, s11, s12
    out[2, 0], out[2, 1], out[2, 2] = s20, s21, s22
    out[3, 0], out[3, 1], out[3, 2] = s30, s31, s32


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True, inline="always")
def corners_at(cell: Cell, place: int, t: Tables) -> Corners:
    """Where a cell's slices stand in `Tables.values` for an upper triangle."""
    size = t.places.shape[1]
    first = np.uint64(((cell.row * t.n_columns + cell.column) * size + t.places[cell.symmetry, place]) * 3)
    across, down = np.uint64(3 * size), np.uint64(3 * size * t.n_columns)
    return Corners(first, first + across, first + down, first + across + down)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _between(cell: Cell, corners: Floats, i: int) -> float:
    """Channel i of what stands at a cell's corners (4, 3), at its place."""
    upper = corners[0, i] + cell.across * (corners[1, i] - corners[0, i])
    lower = corners[2, i] + cell.across * (corners[3, i] - corners[2, i])
    return float(upper + cell.down * (lower - upper))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _add_suns(cell: Cell, place: NDArray[np.int16], power: Floats, t: Tables, corners: Floats) -> None:
    """Add what the cell's four slices reflect of suns, by their triangles, to corners (4, 3)."""
    for s in range(len(place)):
        if place[s] < 0:
            break
        at = corners_at(cell, place[s], t)
        for i in range(3):
            k = np.uint64(i)
            corners[0, i] += power[s, i] * _float(t.values[at.first + k])
            corners[1, i] += power[s, i] * _float(t.values[at.across + k])
            corners[2, i] += power[s, i] * _float(t.values[at.down + k])
            corners[3, i] += power[s, i] * _float(t.values[at.last + k])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def shade_points(
    start: int, stop: int, points: NDArray[np.int64], eye: Floats, n_most: int, position: Floats, frame: Floats,
    slots: NDArray[np.int32], kept: Kept, t: Tables, shades: Shades, radiance: Floats,
) -> None:  # fmt: skip
    """Add to rows `points[start:stop]` of radiance (S, 3) what each sends to the eye by its first n_most coefficients
    and the suns, these by their triangles. Where the eye is still in the cell in which it was, it asks for no sums."""
    n = min(n_most, kept.number.shape[1])
    words = np.empty((n, 3), np.uint32)
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
        corners = shades.corners[slot]
        key = (((t.serial * 8192 + n) * 16 + cell.symmetry) * 64 + cell.row) * 64 + cell.column
        if shades.key[slot] != key:
            shades.key[slot] = key
            _unpack(kept.value[slot], n, words)
            _reflect(cell, kept.number[slot], value, n, t, corners)
            _add_suns(cell, kept.sun_place[slot], kept.sun_power[slot], t, corners)
        for i in range(3):
            radiance[p, i] += _between(cell, corners, i)


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
