"""Compiled: the product of a point's light with the BRDF slices around an outgoing direction: at shading points, and at
the points around each pixel of a picture at rest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core import lanes
from engine.core._frame_kernels import to_local
from engine.core.fast_math import FAST
from engine.realtime.triple_product._incident_kernels import StoredLight, child_at
from engine.realtime.triple_product._patch_kernels import PatchLights, remove_patches, visible_patches

Float32Array = NDArray[np.float32]
UInt16Array = NDArray[np.uint16]
NEAREST = np.float32(1e-30)  # smallest squared distance at which a camera has a direction
_TURN = 2.0 * math.pi / 5.0
_3 = np.uint64(3)
Words = NDArray[np.uint64]
_MOST_CELLS = 24


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
    column of the first slice, and the position between them, down and across, 0 to 1; n_values: numbers of a slice in
    `Tables.values`, divided once here and not for each peak."""

    symmetry: int
    row: int
    column: int
    down: np.float32
    across: np.float32
    n_values: int


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
    n_values = len(t.values) // (t.n_polar * t.n_columns)
    return Cell(symmetry, row, column, np.float32(polar - row), np.float32(place - column), n_values)


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
    row = cell.row * t.n_columns + cell.column
    first = np.uint64(row * cell.n_values + 3 * t.places[cell.symmetry, place])
    across, down = np.uint64(cell.n_values), np.uint64(cell.n_values * t.n_columns)
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
def add_peak_triangles(
    cell: Cell, place: NDArray[np.int16], power: Float32Array, t: Tables, corners: Float32Array
) -> None:
    """Add what the cell's four slices reflect of peaks, by their triangles, to corners (4, 4)."""
    for s in range(len(place)):
        if place[s] < 0:
            break
        add_corners(corners_at(cell, place[s], t), power[s, 0], power[s, 1], power[s, 2], t, corners)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shade_points(
    start: int, stop: int, points: NDArray[np.int64], camera_position: Float32Array, n_most: int,
    position: Float32Array, frame: Float32Array,
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
        a, b, c = (
            camera_position[0] - position[p, 0],
            camera_position[1] - position[p, 1],
            camera_position[2] - position[p, 2],
        )
        squared = a * a + b * b + c * c
        if not squared > NEAREST:  # the camera is at the point: take its normal
            a, b, c, squared = f[1, 0], f[1, 1], f[1, 2], np.float32(1.0)
        scale = 1.0 / math.sqrt(squared)
        x, y, z = to_local(f, a, b, c)
        cell = cell_at(x * scale, y * scale, z * scale, t)
        corners = shades.corners[slot]
        # Evaluate the cell's four slices only if the cell, the tables or the number of coefficients changed.
        key = (((t.serial * 8192 + n) * 16 + cell.symmetry) * 64 + cell.row) * 64 + cell.column
        if shades.key[slot] != key:
            shades.key[slot] = key
            unpack(stored.value[slot], n, words)
            reflect(cell, stored.number[slot], value, n, t, corners)
            add_peak_triangles(cell, stored.peak_place[slot], stored.peak_power[slot], t, corners)
        for i in range(3):
            radiance[p, i] += between(cell, corners, i)


class PeakLights(NamedTuple):
    """The peaks of a sky, at most 128: direction and power (M, 3); bits (S, ⌈M / 8⌉), the peaks that each point sees,
    as `StoredLight.peak_bits`; children, as `Hemisphere.children`; little: share of the reflected radiance by which
    neighbouring slices may disagree about a peak before it counts as sharp."""

    direction: Float32Array
    power: Float32Array
    bits: NDArray[np.uint8]
    children: NDArray[np.int16]
    little: float


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shade_corners(
    start: int, stop: int, points: NDArray[np.int64], first: NDArray[np.int64], members: NDArray[np.int64],
    mirrored: Float32Array, n_most: int, frame: Float32Array, slots: NDArray[np.int32], stored: StoredLight,
    peaks: PeakLights, patches: PatchLights, t: Tables,
    radiance: Float32Array, sharp: Words, sharp_patches: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Fill radiance (3 N, 3) at the three corners of N samples: what the corner's point reflects, of its first n_most
    coefficients and of its visible peaks, towards the direction whose mirror direction at that point is mirrored
    (N, 3). Peaks about which the slices disagree are left out; sharp (3 N, 2) receives their bits. So are all patches
    where sharp_patches (3 N,) becomes true; it and `sharp` may be empty.

    The corners members[first[j]:first[j + 1]] belong to point points[j]. They see it from about the same side, so most
    find a cell that is cached already.
    """
    n = min(n_most, stored.number.shape[1])
    words, cells = np.zeros(3 * n + 1, np.uint32), np.empty((_MOST_CELLS, 4, 4), np.float32)
    keys, differ = np.empty(_MOST_CELLS, np.int64), np.zeros((_MOST_CELLS, 2), np.uint64)
    seen, place = np.empty((2, len(peaks.power)), np.int64)
    spread = np.empty(len(peaks.power), np.float32)
    # Of patches: triangle and power of each that is seen, coefficients without them, and the cells that take those.
    patch_place, patch_power = np.empty(len(patches.flux), np.int64), np.empty((len(patches.flux), 3), np.float32)
    rest, wavelets = np.zeros(3 * n + 1, np.float32), np.zeros((2 * len(patches.triangle), 3), np.float32)
    without = np.zeros(_MOST_CELLS, np.bool_)
    value = words.view(np.float32)
    for j in range(start, stop):
        # Unpack the light of each point once for all of its corners.
        p = points[j]
        slot, f, n_cells = slots[p], frame[p], 0
        number = stored.number[slot]
        unpack(stored.value[slot], n, words)
        n_seen = _visible_peaks(peaks, p, f, seen, place)
        n_patches = visible_patches(patches, p, f, peaks.children, patch_place, patch_power)
        if n_patches:
            rest[:] = value
            remove_patches(patch_place[:n_patches], patch_power, patches.triangle, number, n, wavelets, rest)
        # Find the cell of slices around the mirror direction (−x, y, −z) in the point's frame.
        for at in range(first[j], first[j + 1]):
            r = members[at]
            x, y, z = to_local(f, mirrored[r // 3, 0], mirrored[r // 3, 1], mirrored[r // 3, 2])
            cell = cell_at(-x, y, -z, t)
            # Look the cell up among those that earlier corners evaluated; start over when the cache is full.
            key = (cell.symmetry * 64 + cell.row) * 64 + cell.column
            i = 0
            while i < n_cells and keys[i] != key:
                i += 1
            if i == n_cells:
                if n_cells == _MOST_CELLS:
                    i = n_cells = 0
                keys[i] = key
                n_cells += 1
                # Triple product [Ma06, eq. 7] at the cell's four slices: the coefficients of light × visibility, then
                # the peaks.
                reflect(cell, number, value, n, t, cells[i])
                without[i] = n_patches > 0 and _are_sharp(
                    cell, patch_place[:n_patches], patch_power, patches.little, t, cells[i]
                )
                if without[i]:
                    reflect(cell, number, rest, n, t, cells[i])
                _add_directional_peaks(cell, peaks, seen[:n_seen], place, t, spread, cells[i], differ[i])
            # Interpolate between the four slices.
            for channel in range(3):
                radiance[r, channel] = between(cell, cells[i], channel)
            if len(sharp):
                sharp[r, 0], sharp[r, 1] = differ[i, 0], differ[i, 1]
            if len(sharp_patches):
                sharp_patches[r] = without[i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _visible_peaks(
    peaks: PeakLights, p: int, frame: Float32Array, seen: NDArray[np.int64], place: NDArray[np.int64]
) -> int:
    """List the peaks that point p sees and the upper triangles of its frame that contain them; return their number."""
    n = 0
    for s in range(len(peaks.power)):
        if peaks.bits[p, s >> 3] >> (s & 7) & 1:
            d = peaks.direction[s]
            x, y, z = to_local(frame, d[0], d[1], d[2])
            seen[n], place[n] = s, child_at(x, y, z, peaks.children) >> 2
            n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _are_sharp(
    cell: Cell, place: NDArray[np.int64], power: Float32Array, little: float, t: Tables, corners: Float32Array
) -> bool:
    """Whether the four slices disagree about patches by more than little of all light that the cell's corners (4, 4)
    reflect."""
    spread, whole, quarter = lanes.zeros(), lanes.zeros(), lanes.even(np.float32(0.25))
    for m in range(len(place)):
        at, light = corners_at(cell, place[m], t), lanes.of(power[m, 0], power[m, 1], power[m, 2])
        mean, largest = _mean_and_largest(at, t)
        spread = lanes.plus_product(spread, light, lanes.minus(largest, mean))
    for k in range(0, 16, 4):
        whole = lanes.plus_product(whole, quarter, lanes.floats(corners, k))
    return bool(lanes.total(spread) > np.float32(little) * lanes.total(whole))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _mean_and_largest(at: Corners, t: Tables):  # type: ignore[no-untyped-def]
    """Mean and largest of a cell's four slices in a triangle, as lanes."""
    first, across = lanes.halves(t.values, at.first), lanes.halves(t.values, at.across)
    down, last = lanes.halves(t.values, at.down), lanes.halves(t.values, at.last)
    quarter = lanes.even(np.float32(0.25))
    mean = lanes.plus_product(lanes.zeros(), quarter, first)
    mean = lanes.plus_product(mean, quarter, across)
    mean = lanes.plus_product(mean, quarter, down)
    mean = lanes.plus_product(mean, quarter, last)
    return mean, lanes.larger(lanes.larger(first, across), lanes.larger(down, last))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _add_directional_peaks(
    cell: Cell, peaks: PeakLights, seen: NDArray[np.int64], place: NDArray[np.int64], t: Tables, spread: Float32Array,
    corners: Float32Array, differ: Words,
) -> None:  # fmt: skip
    """Add visible peaks to the radiance at the cell's corners (4, 4). A peak is sharp if the largest of the four slices
    exceeds their mean by more than peaks.little of all reflected light; sharp peaks are set as bits of differ (2,)
    instead."""
    # Mean over the four slices of what the coefficients reflect.
    quarter = lanes.even(np.float32(0.25))
    whole = lanes.plus_product(lanes.zeros(), quarter, lanes.floats(corners, 0))
    for k in range(4, 16, 4):
        whole = lanes.plus_product(whole, quarter, lanes.floats(corners, k))
    # Of each peak: the mean over the slices, added to the whole, and how far the largest exceeds it.
    for m in range(len(seen)):
        at, power = corners_at(cell, place[m], t), peaks.power[seen[m]]
        light = lanes.of(power[0], power[1], power[2])
        mean, largest = _mean_and_largest(at, t)
        spread[m] = lanes.total(lanes.plus_product(lanes.zeros(), light, lanes.minus(largest, mean)))
        whole = lanes.plus_product(whole, light, mean)
    # Compare each peak's spread with the threshold.
    most = np.float32(peaks.little) * lanes.total(whole)
    differ[:] = np.uint64(0)
    for m in range(len(seen)):
        s, power = seen[m], peaks.power[seen[m]]
        if spread[m] <= most:
            add_corners(corners_at(cell, place[m], t), power[0], power[1], power[2], t, corners)
        else:
            differ[s >> 6] |= np.uint64(1) << np.uint64(s & 63)
