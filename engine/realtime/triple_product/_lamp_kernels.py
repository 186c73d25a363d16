"""Compiled: selects the emitters' patches that pixels test with shadow rays of their own."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST

Floats = NDArray[np.float32]

ONLY_THOSE, WHERE_ANY, EVERYTHING = 0, 1, 2


class Known(NamedTuple):
    """Visibility that points know: position and normal (S, 3), bits (S, ⌈L / 8⌉) of the patches that each sees; the
    patches' centre and patch_normal (L, 3)."""

    position: Floats
    normal: Floats
    bits: NDArray[np.uint8]
    centre: Floats
    patch_normal: Floats


class PatchRays(NamedTuple):
    """Shadow rays (N,): row of the sample, patch; solid, the factor from flux to power, times the number of patches
    that the ray represents; cosine to the sample's normal; known, the share of the patch that the sample's points see,
    and known_cosine, that share with the points' own powers and cosines; agreed: whether all points see it, or none
    does."""

    row: NDArray[np.int32]
    patch: NDArray[np.int32]
    solid: Floats
    cosine: Floats
    known: Floats
    known_cosine: Floats
    agreed: NDArray[np.bool_]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _towards(j: int, at: Floats, normal: Floats, points: Known) -> tuple[float, float]:
    """Return the factor from flux of patch j to power at a position (3,), and the cosine there; 0 where the patch faces
    away."""
    x, y, z = points.centre[j, 0] - at[0], points.centre[j, 1] - at[1], points.centre[j, 2] - at[2]
    n = points.patch_normal[j]
    facing, above = -(x * n[0] + y * n[1] + z * n[2]), x * normal[0] + y * normal[1] + z * normal[2]
    if facing <= 0.0 or above <= 0.0:
        return 0.0, 0.0
    squared = x * x + y * y + z * z
    distance = math.sqrt(squared)
    return facing / (squared * distance), above / distance


@njit(cache=True, nogil=True, error_model="numpy")
def disagree(
    start: int, stop: int, samples: NDArray[np.int64], corners: NDArray[np.int32], bits: NDArray[np.uint8],
    out: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Write to out (N,) whether the corners (R, 3) of samples[start:stop] see different patches."""
    for n in range(start, stop):
        a, b, c = corners[samples[n], 0], corners[samples[n], 1], corners[samples[n], 2]
        out[n] = False
        for word in range(bits.shape[1]):
            if bits[a, word] != bits[b, word] or bits[a, word] != bits[c, word]:
                out[n] = True
                break


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _n_seeing(j: int, corners: NDArray[np.int32], points: Known) -> int:
    """How many of three points see patch j."""
    n = 0
    for k in range(3):
        n += points.bits[corners[k], j >> 3] >> (j & 7) & 1
    return n


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def patches_in_question(
    corners: NDArray[np.int32], weights: Floats, places: Floats, normals: Floats, how: NDArray[np.uint8],
    phase: NDArray[np.int64], most: NDArray[np.int64], points: Known, out: PatchRays,
) -> int:  # fmt: skip
    """Fill `out` with shadow rays of samples (N,), at places (N, 3) with normals (N, 3), between corners (N, 3) with
    weights (N, 3); return their number.

    how (N,) selects the patches to test: ONLY_THOSE that some corners see and others do not, EVERYTHING that faces the
    sample, or everything WHERE_ANY corners disagree. Of more than `most` (N,) patches every second, third, ... is
    tested, starting by the sample's phase (N,), 0 to 15, and represents the others.
    """
    n_found = 0
    in_question = np.empty(len(points.centre), np.int32)
    for n in range(len(corners)):
        if most[n] == 0:
            continue
        # Collect the patches to test.
        m = 0
        if how[n] != EVERYTHING:
            for j in range(len(points.centre)):
                if 0 < _n_seeing(j, corners[n], points) < 3:
                    in_question[m] = j
                    m += 1
        if how[n] == EVERYTHING or (how[n] == WHERE_ANY and m > 0):
            m = 0
            for j in range(len(points.centre)):
                if _towards(j, places[n], normals[n], points)[0] > 0.0 or _n_seeing(j, corners[n], points) > 0:
                    in_question[m] = j
                    m += 1
        if m == 0:
            continue
        # Thin them out to a regular subset; each tested patch represents m / n of them.
        step = (m + most[n] - 1) // most[n]
        first = phase[n] * step // 16
        stands_for = np.float32(m / ((m - first + step - 1) // step))
        for at in range(first, m, step):
            j = in_question[at]
            solid, cosine = _towards(j, places[n], normals[n], points)
            # What the three points know of this patch: share, and share × cosine by their own geometry.
            n_seen, seen, known, around = 0, 0.0, 0.0, 0.0
            for k in range(3):
                p = corners[n, k]
                of_corner, above = _towards(j, points.position[p], points.normal[p], points)
                around += weights[n, k] * of_corner
                if points.bits[p, j >> 3] >> (j & 7) & 1:
                    n_seen += 1
                    seen += weights[n, k]
                    known += weights[n, k] * of_corner * above
            # The sample faces away from a patch that its points see: normalize by the points' factor instead.
            if solid == 0.0:
                solid = max(around, 1e-30)
            out.row[n_found], out.patch[n_found] = n, j
            out.solid[n_found], out.cosine[n_found] = solid * stands_for, cosine
            out.known[n_found], out.known_cosine[n_found] = seen, known / solid
            out.agreed[n_found] = n_seen == 0 or n_seen == 3
            n_found += 1
    return n_found
