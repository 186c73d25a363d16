"""Compiled: radiance that the shading points around each pixel of a picture at rest send to the camera."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core import lanes
from engine.core.fast_math import FAST
from engine.realtime.triple_product._incident_kernels import StoredLight, child_at
from engine.realtime.triple_product._slice_kernels import (
    Cell,
    Tables,
    add_corners,
    between,
    cell_at,
    corners_at,
    reflect,
    unpack,
)

Float32Array = NDArray[np.float32]
Words = NDArray[np.uint64]
_MOST_CELLS = 24


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
    peaks: PeakLights, t: Tables,
    radiance: Float32Array, sharp: Words,
) -> None:  # fmt: skip
    """Fill radiance (3 N, 3) at the three corners of N samples: what the corner's point reflects, of its first n_most
    coefficients and of its visible peaks, towards the direction whose mirror direction at that point is mirrored
    (N, 3). Peaks about which the slices disagree are left out; sharp (3 N, 2) receives their bits.

    The corners members[first[j]:first[j + 1]] belong to point points[j]. They see it from about the same side, so most
    find a cell that is cached already.
    """
    n = min(n_most, stored.number.shape[1])
    words, cells = np.zeros(3 * n + 1, np.uint32), np.empty((_MOST_CELLS, 4, 4), np.float32)
    keys, differ = np.empty(_MOST_CELLS, np.int64), np.zeros((_MOST_CELLS, 2), np.uint64)
    seen, place = np.empty((2, len(peaks.power)), np.int64)
    spread = np.empty(len(peaks.power), np.float32)
    value = words.view(np.float32)
    for j in range(start, stop):
        # Unpack the light of each point once for all of its corners.
        p = points[j]
        slot, f, n_cells = slots[p], frame[p], 0
        number = stored.number[slot]
        unpack(stored.value[slot], n, words)
        n_seen = _visible_peaks(peaks, p, f, seen, place)
        # Find the cell of slices around the mirror direction (−x, y, −z) in the point's frame.
        for at in range(first[j], first[j + 1]):
            r = members[at]
            a, b, c = mirrored[r // 3, 0], mirrored[r // 3, 1], mirrored[r // 3, 2]
            x = f[0, 0] * a + f[0, 1] * b + f[0, 2] * c
            y = f[1, 0] * a + f[1, 1] * b + f[1, 2] * c
            z = f[2, 0] * a + f[2, 1] * b + f[2, 2] * c
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
                _add_peaks(cell, peaks, seen[:n_seen], place, t, spread, cells[i], differ[i])
            # Interpolate between the four slices.
            for channel in range(3):
                radiance[r, channel] = between(cell, cells[i], channel)
            if len(sharp):
                sharp[r, 0], sharp[r, 1] = differ[i, 0], differ[i, 1]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _visible_peaks(
    peaks: PeakLights, p: int, frame: Float32Array, seen: NDArray[np.int64], place: NDArray[np.int64]
) -> int:
    """List the peaks that point p sees and the upper triangles of its frame that contain them; return their number."""
    n = 0
    for s in range(len(peaks.power)):
        if peaks.bits[p, s >> 3] >> (s & 7) & 1:
            d = peaks.direction[s]
            x = frame[0, 0] * d[0] + frame[0, 1] * d[1] + frame[0, 2] * d[2]
            y = frame[1, 0] * d[0] + frame[1, 1] * d[1] + frame[1, 2] * d[2]
            z = frame[2, 0] * d[0] + frame[2, 1] * d[1] + frame[2, 2] * d[2]
            seen[n], place[n] = s, child_at(x, y, z, peaks.children) >> 2
            n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _add_peaks(
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
        first, across = lanes.halves(t.values, at.first), lanes.halves(t.values, at.across)
        down, last = lanes.halves(t.values, at.down), lanes.halves(t.values, at.last)
        light = lanes.of(power[0], power[1], power[2])
        mean = lanes.plus_product(lanes.zeros(), quarter, first)
        mean = lanes.plus_product(mean, quarter, across)
        mean = lanes.plus_product(mean, quarter, down)
        mean = lanes.plus_product(mean, quarter, last)
        largest = lanes.larger(lanes.larger(first, across), lanes.larger(down, last))
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
