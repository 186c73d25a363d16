"""Compiled: the product of a point's light with the BRDF slices around an outgoing direction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core import lanes
from engine.core.fast_math import FAST
from engine.realtime.triple_product._incident_kernels import StoredLight

Float32Array = NDArray[np.float32]
UInt16Array = NDArray[np.uint16]
NEAREST = np.float32(1e-30)  # smallest squared distance at which a camera has a direction
_TURN = 2.0 * math.pi / 5.0
_3 = np.uint64(3)


class Tables(NamedTuple):
    """The slices of a material: table (polar, columns, rows, 3), wavelet coefficients, the last row 0, and values
    (polar, columns, 10 * 4^k, 3), means over the upper triangles of level k; both bfloat16, flattened, with one number
    appended, see `engine.core.lanes`. This order keeps together what points with similar views read. images (10, 5120)
    and places (10, 2560): rows and triangles to which each symmetry maps the coefficients and upper triangles of the
    finest level, for columns over 36 degrees; (2, ...) for columns over half a turn. n_polar polar angles, the last one
    steepest, and n_columns; serial: a number that differs between all tables."""

    table: UInt16Array
    values: UInt16Array
    images: NDArray[np.int32]
    places: NDArray[np.int32]
    n_polar: int
    n_columns: int
    steepest: float
    serial: int


class Cell(NamedTuple):
    """The four slices around an outgoing direction: the symmetry that maps the direction into the stored range, row and
    column of the first slice, and the position between them, down and across, 0 to 1."""

    symmetry: int
    row: int
    column: int
    down: np.float32
    across: np.float32


class Corners(NamedTuple):
    """Offsets of a cell's four slices: of red; green and blue follow. Unsigned, see `reflect`."""

    first: np.uint64
    across: np.uint64
    down: np.uint64
    last: np.uint64


class Shades(NamedTuple):
    """A cache of what glossy points reflected to the four slices around the camera's direction: corners (G, 4, 4),
    whose last channel has no meaning, and key (G,) of those slices, −1 for none."""

    key: NDArray[np.int64]
    corners: Float32Array


def packed(values: Float32Array) -> UInt16Array:
    """Round float32 to bfloat16."""
    return ((np.ascontiguousarray(values, np.float32).view(np.uint32) + np.uint32(0x8000)) >> np.uint32(16)).astype(
        np.uint16
    )


def unpacked(values: UInt16Array) -> Float32Array:
    """Convert bfloat16 to float32."""
    return (values.astype(np.uint32) << np.uint32(16)).view(np.float32)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def cell_at(x: float, y: float, z: float, t: Tables) -> Cell:
    """Find the cell of a unit direction in a point's frame."""
    # Polar angle in units of rows, and azimuth from 0 to 2π.
    polar = min(math.acos(min(max(y, 0.0), 1.0)), t.steepest) / t.steepest * (t.n_polar - 1)
    azimuth = math.atan2(x, z)
    if azimuth < 0.0:
        azimuth += 2.0 * math.pi
    row, symmetry, whole = min(int(polar), t.n_polar - 2), 0, math.pi
    # Isotropic: five turns by 72°, each with a mirror image, fold the azimuth into 36°.
    if len(t.images) > 2:
        turn, whole = int(azimuth / _TURN), 0.5 * _TURN
        azimuth -= turn * _TURN
        symmetry = turn % 5
        if azimuth > whole:
            azimuth = _TURN - azimuth
            symmetry = 5 + (turn + 1) % 5
    # Anisotropic: one mirror folds it into 180°.
    elif azimuth > whole:
        azimuth = 2.0 * math.pi - azimuth
        symmetry = 1
    # The position between columns.
    place = azimuth / whole * (t.n_columns - 1)
    column = min(int(place), t.n_columns - 2)
    return Cell(symmetry, row, column, np.float32(polar - row), np.float32(place - column))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def unpack(value: UInt16Array, n: int, words: NDArray[np.uint32]) -> None:
    """Convert the first n bfloat16 values (n, 3) to the bits of float32 (3 n + 1,)."""
    for k in range(n):
        for i in range(3):
            words[3 * k + i] = np.uint32(value[k, i]) << np.uint32(16)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def reflect(cell: Cell, number: NDArray[np.int16], value: Float32Array, n: int, t: Tables, out: Float32Array) -> None:
    """Fill out (4, 4) with Σ_k light_k × slice_k for the cell's four slices: [Ma06, eq. 7] after light × visibility has
    been multiplied out."""
    images, across = t.images[cell.symmetry], np.uint64(len(t.table) // (t.n_polar * t.n_columns))
    down = np.uint64(t.n_columns) * across
    first = np.uint64(cell.row) * down + np.uint64(cell.column) * across
    s0 = s1 = s2 = s3 = lanes.zeros()
    for k in range(n):
        # Unsigned, so that the compiler adds no test for negative indices.
        a = first + _3 * np.uint64(images[np.uint64(number[k])])
        b, c = a + across, a + down
        light = lanes.floats(value, _3 * np.uint64(k))
        s0 = lanes.plus_product(s0, light, lanes.halves(t.table, a))
        s1 = lanes.plus_product(s1, light, lanes.halves(t.table, b))
        s2 = lanes.plus_product(s2, light, lanes.halves(t.table, c))
        s3 = lanes.plus_product(s3, light, lanes.halves(t.table, c + across))
    lanes.store(out, 0, s0)
    lanes.store(out, 4, s1)
    lanes.store(out, 8, s2)
    lanes.store(out, 12, s3)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def corners_at(cell: Cell, place: int, t: Tables) -> Corners:
    """Offsets of a cell's slices in `Tables.values` for an upper triangle."""
    size = len(t.values) // (t.n_polar * t.n_columns) // 3
    first = np.uint64(((cell.row * t.n_columns + cell.column) * size + t.places[cell.symmetry, place]) * 3)
    across, down = np.uint64(3 * size), np.uint64(3 * size * t.n_columns)
    return Corners(first, first + across, first + down, first + across + down)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def between(cell: Cell, corners: Float32Array, i: int) -> float:
    """Bilinear interpolation of channel i between a cell's corners (4, 4)."""
    upper = corners[0, i] + cell.across * (corners[1, i] - corners[0, i])
    lower = corners[2, i] + cell.across * (corners[3, i] - corners[2, i])
    return float(upper + cell.down * (lower - upper))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def reflected_between(cell: Cell, place: int, t: Tables):  # type: ignore[no-untyped-def]
    """Interpolate the slices' values for an upper triangle at the cell's position, as lanes."""
    at = corners_at(cell, place, t)
    across, down = lanes.even(cell.across), lanes.even(cell.down)
    upper, lower = lanes.halves(t.values, at.first), lanes.halves(t.values, at.down)
    upper = lanes.plus_product(upper, across, lanes.minus(lanes.halves(t.values, at.across), upper))
    lower = lanes.plus_product(lower, across, lanes.minus(lanes.halves(t.values, at.last), lower))
    return lanes.plus_product(upper, down, lanes.minus(lower, upper))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def add_corners(at: Corners, red: float, green: float, blue: float, t: Tables, corners: Float32Array) -> None:
    """Add power in an upper triangle times the four slices' values there to corners (4, 4)."""
    light = lanes.of(red, green, blue)
    lanes.store(corners, 0, lanes.plus_product(lanes.floats(corners, 0), light, lanes.halves(t.values, at.first)))
    lanes.store(corners, 4, lanes.plus_product(lanes.floats(corners, 4), light, lanes.halves(t.values, at.across)))
    lanes.store(corners, 8, lanes.plus_product(lanes.floats(corners, 8), light, lanes.halves(t.values, at.down)))
    lanes.store(corners, 12, lanes.plus_product(lanes.floats(corners, 12), light, lanes.halves(t.values, at.last)))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _add_peaks(cell: Cell, place: NDArray[np.int16], power: Float32Array, t: Tables, corners: Float32Array) -> None:
    """Add what the cell's four slices reflect of peaks, by their triangles, to corners (4, 4)."""
    for s in range(len(place)):
        if place[s] < 0:
            break
        add_corners(corners_at(cell, place[s], t), power[s, 0], power[s, 1], power[s, 2], t, corners)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shade_points(
    start: int, stop: int, points: NDArray[np.int64], eye: Float32Array, n_most: int, position: Float32Array,
    frame: Float32Array,
    slots: NDArray[np.int32], stored: StoredLight, t: Tables, shades: Shades, radiance: Float32Array,
) -> None:  # fmt: skip
    """Add to the rows points[start:stop] of radiance (S, 3) what each point sends to the camera, by its first n_most
    coefficients and by its peaks' triangles. Sums are reused while the camera stays in the same cell."""
    n = min(n_most, stored.number.shape[1])
    words = np.zeros(3 * n + 1, np.uint32)
    value = words.view(np.float32)
    for j in range(start, stop):
        p = points[j]
        slot, f = slots[p], frame[p]
        # The direction to the camera in the point's frame.
        a, b, c = eye[0] - position[p, 0], eye[1] - position[p, 1], eye[2] - position[p, 2]
        squared = a * a + b * b + c * c
        if not squared > NEAREST:  # the camera is at the point: take its normal
            a, b, c, squared = f[1, 0], f[1, 1], f[1, 2], np.float32(1.0)
        scale = 1.0 / math.sqrt(squared)
        x = (f[0, 0] * a + f[0, 1] * b + f[0, 2] * c) * scale
        y = (f[1, 0] * a + f[1, 1] * b + f[1, 2] * c) * scale
        z = (f[2, 0] * a + f[2, 1] * b + f[2, 2] * c) * scale
        cell = cell_at(x, y, z, t)
        corners = shades.corners[slot]
        # Evaluate the cell's four slices only if the cell, the tables or the number of coefficients changed.
        key = (((t.serial * 8192 + n) * 16 + cell.symmetry) * 64 + cell.row) * 64 + cell.column
        if shades.key[slot] != key:
            shades.key[slot] = key
            unpack(stored.value[slot], n, words)
            reflect(cell, stored.number[slot], value, n, t, corners)
            _add_peaks(cell, stored.peak_place[slot], stored.peak_power[slot], t, corners)
        for i in range(3):
            radiance[p, i] += between(cell, corners, i)
