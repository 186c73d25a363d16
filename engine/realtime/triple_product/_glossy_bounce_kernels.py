"""Compiled: light that gathering points receive from gloss, and light that their rays met which gloss reflects to the
camera."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_local
from engine.core.fast_math import FAST
from engine.realtime.triple_product._incident_kernels import StoredLight
from engine.realtime.triple_product._slice_kernels import (
    NEAREST,
    Tables,
    add_corners,
    add_peak_triangles,
    between,
    cell_at,
    corners_at,
    reflect,
    unpack,
)

Float32Array = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def gather_gloss(
    start: int, stop: int, gathering: NDArray[np.int64], ends: NDArray[np.int32], n_parts: int,
    i_object: NDArray[np.int32], own: int, albedo: Float32Array, factor: Float32Array, n_most: int,
    position: Float32Array, frame: Float32Array, slots: NDArray[np.int32], stored: StoredLight, t: Tables,
    found: Float32Array,
) -> None:  # fmt: skip
    """Fill the rows start to stop of found (G, 3) with the change of the irradiance that gathering points (G,) receive
    from object `own`, by their rays that end (G, R) there, if its gloss reflects direct light towards them by slices,
    by n_most coefficients, times factor (3,), instead of evenly by albedo (3,). Of the n_parts parts of a gathering
    point's rays one is evaluated: each part is stratified, and neighbours take others."""
    n = min(n_most, stored.number.shape[1])
    words, corners = np.zeros(3 * n + 1, np.uint32), np.empty((4, 4), np.float32)
    value, sums, n_rays = words.view(np.float32), np.empty(3), ends.shape[1] // n_parts
    for g in range(start, stop):
        p, first = gathering[g], g % n_parts * n_rays
        sums[:] = 0.0
        for r in range(first, first + n_rays):
            q = ends[g, r]
            if q < 0 or i_object[q] != own or slots[q] < 0:
                continue
            # The direction from the ray's end to the gathering point, in the frame of the former.
            f, slot = frame[q], slots[q]
            a, b, c = position[p, 0] - position[q, 0], position[p, 1] - position[q, 1], position[p, 2] - position[q, 2]
            squared = a * a + b * b + c * c
            if not squared > NEAREST:
                continue
            scale = 1.0 / math.sqrt(squared)
            x, y, z = to_local(f, a, b, c)
            cell = cell_at(x * scale, y * scale, z * scale, t)
            # Triple product [Ma06, eq. 7] towards the gathering point, less what an even reflection sends.
            unpack(stored.value[slot], n, words)
            reflect(cell, stored.number[slot], value, n, t, corners)
            add_peak_triangles(cell, stored.peak_place[slot], stored.peak_power[slot], t, corners)
            for i in range(3):
                sums[i] += factor[i] * math.pi * between(cell, corners, i) - albedo[i] * stored.irradiance[q, i]
        for i in range(3):
            found[g, i] = sums[i] / n_rays


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def reflect_gathered(
    start: int, stop: int, rows: NDArray[np.int64], gathering: NDArray[np.int64], ends: NDArray[np.int32],
    pattern: NDArray[np.uint8], places: NDArray[np.int16], solid_angle: Float32Array, camera_position: Float32Array,
    position: Float32Array, frame: Float32Array, sent: Float32Array, t: Tables, out: Float32Array,
) -> None:  # fmt: skip
    """Fill the rows start to stop of out (V, 3): what gathering points, the given rows (V,) of all (G,), reflect to the
    camera by slices of the radiance sent (S, 3) that the ends of their rays (G, R) send.

    pattern (G,): the row of places (64, R) that holds the upper triangles of a gathering point's rays; solid_angle
    (2560,): what a ray in an upper triangle represents.
    """
    corners = np.empty((4, 4), np.float32)
    for v in range(start, stop):
        g = rows[v]
        p = gathering[g]
        f = frame[p]
        a, b, c = (
            camera_position[0] - position[p, 0],
            camera_position[1] - position[p, 1],
            camera_position[2] - position[p, 2],
        )
        scale = 1.0 / math.sqrt(max(a * a + b * b + c * c, NEAREST))
        x, y, z = to_local(f, a, b, c)
        cell = cell_at(x * scale, y * scale, z * scale, t)
        corners[:] = 0.0
        for r in range(ends.shape[1]):
            q = ends[g, r]
            if q >= 0:
                place = places[pattern[g], r]
                share = solid_angle[place]
                add_corners(
                    corners_at(cell, place, t), share * sent[q, 0], share * sent[q, 1], share * sent[q, 2], t, corners
                )
        for i in range(3):
            out[v, i] = between(cell, corners, i)
