"""Compiled: the directions towards lamps in which a sample of a picture asks the formulas of sharp gloss."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_local
from engine.core.fast_math import FAST
from engine.realtime.triple_product._incident_kernels import towards_patch
from engine.realtime.triple_product._patch_kernels import PatchLights
from engine.realtime.triple_product._pixel_kernels import BrdfQueries, interpolate_frame, view_direction

Float32Array = NDArray[np.float32]
# How wide a part may be: so much of the lobe's width, and of its angle to the mirror direction, the more the farther
# from the lobe; and how many times a patch is divided into four.
_OF_LOBE, _OF_ANGLE, _MOST_CUTS = 0.03, 0.09, 6


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def query_patches(
    start: int, which: NDArray[np.int64], corners: NDArray[np.int32], weights: Float32Array, wo: Float32Array,
    frame: Float32Array, places: Float32Array, offsets: Float32Array, patches: PatchLights, sharp: NDArray[np.bool_],
    width: float, least_cosine: float, requested: BrdfQueries,
) -> tuple[int, int]:  # fmt: skip
    """Fill `requested` with parts of the patches that were left out at the corners (3 N,) of samples (N,) at places
    (N, 3), from sample `start` on, each in its direction from there, with its power scaled by the interpolation
    weights of the corners that see the patch and left it out; return their number and the first sample for which there
    was no room. width: of the lobe, in radians; offsets (N, 3): see `query_peaks`."""
    n_requested, room = 0, len(requested.sample) - len(patches.flux) - 3 * _MOST_CUTS
    own, towards, mirrored = np.empty((3, 3)), np.empty(3), np.empty(3)
    parts, cuts = np.empty((3 * _MOST_CUTS + 1, 3, 3)), np.empty(3 * _MOST_CUTS + 1, np.int64)
    for n in range(start, len(which)):
        if n_requested > room // 2:
            return n_requested, n
        if not (sharp[3 * n] or sharp[3 * n + 1] or sharp[3 * n + 2]):
            continue
        j, at = which[n], places[n]
        interpolate_frame(corners[j], weights[j], frame, offsets[n : n + 1], own)
        view_direction(own, wo[j], least_cosine, towards)
        mirrored[0], mirrored[1], mirrored[2] = -towards[0], -towards[1], towards[2]
        # Lobes are narrower the more obliquely they are seen.
        lobe = width * max(towards[2], 0.25)
        for s in range(len(patches.flux)):
            share = np.float32(0.0)
            for k in range(3):
                if sharp[3 * n + k] and patches.bits[corners[j, k], s >> 3] >> (s & 7) & 1:
                    share += weights[j, k]
            if share <= 0.0:
                continue
            parts[0], cuts[0], n_parts = patches.corners[s], 0, 1
            while n_parts:
                n_parts -= 1
                part, depth = parts[n_parts], cuts[n_parts]
                a, b = (part[0, 0] + part[1, 0] + part[2, 0]) / 3.0, (part[0, 1] + part[1, 1] + part[2, 1]) / 3.0
                c = (part[0, 2] + part[1, 2] + part[2, 2]) / 3.0
                a, b, c, solid = towards_patch(s, a - at[0], b - at[1], c - at[2], patches.normal, patches.cones)
                if solid <= 0.0:
                    continue
                x, y, z = to_local(own, a, b, c)
                solid *= np.float32(0.25**depth)
                # The frame's third axis is minus the bitangent.
                away = (x - mirrored[0]) ** 2 + (z + mirrored[1]) ** 2 + (y - mirrored[2]) ** 2
                away = math.sqrt(away)
                most = _OF_LOBE * lobe + _OF_ANGLE * away * (1.0 + away / lobe)
                if depth < _MOST_CUTS and n_requested < room and solid * patches.area[s] > most * most:
                    _divide(parts, n_parts)
                    cuts[n_parts : n_parts + 4] = depth + 1
                    n_parts += 4
                elif y > 0.0:
                    requested.sample[n_requested] = n
                    for i in range(3):
                        requested.power[n_requested, i] = share * solid * patches.flux[s, i]
                        requested.wo[n_requested, i] = towards[i]
                    wi = requested.wi[n_requested]
                    wi[0], wi[1], wi[2] = x, -z, y
                    n_requested += 1
    return n_requested, len(which)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _divide(parts: NDArray[np.float64], at: int) -> None:
    """Replace triangle `at` of parts (P, 3, 3) by the four between its corners and the middles of its edges."""
    for i in range(3):
        a, b, c = parts[at, 0, i], parts[at, 1, i], parts[at, 2, i]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts[at, 0, i], parts[at, 1, i], parts[at, 2, i] = a, ab, ca
        parts[at + 1, 0, i], parts[at + 1, 1, i], parts[at + 1, 2, i] = ab, b, bc
        parts[at + 2, 0, i], parts[at + 2, 1, i], parts[at + 2, 2, i] = ca, bc, c
        parts[at + 3, 0, i], parts[at + 3, 1, i], parts[at + 3, 2, i] = ab, bc, ca
