"""Compiled: the visibility rays of shading points and the bits that result, and which patches and peaks pixels test
with rays of their own."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST
from engine.light._cone_kernels import cone_share
from engine.realtime.triple_product._slice_kernels import PeakLights

Float32Array = NDArray[np.float32]
Flags = NDArray[np.bool_]
Int32Array = NDArray[np.int32]

ONLY_THOSE, WHERE_ANY, EVERYTHING = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _begin_ray(
    point: Float32Array, direction: Float32Array, frame: Float32Array, origin: Float32Array, ray_direction: Float32Array
) -> None:
    """Write a ray from a point along a direction of its frame, element by element: for whole rows the compiler
    generates error messages, which takes longer than everything else."""
    for i in range(3):
        origin[i] = point[i]
        ray_direction[i] = direction[0] * frame[0, i] + direction[1] * frame[1, i] + direction[2] * frame[2, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def first_rays(points: NDArray[np.int64], lifted: Float32Array, frames: Float32Array, directions: Float32Array,
    origins: Float32Array,
               ray_directions: Float32Array) -> None:  # fmt: skip
    """Fill rays (N · U / 4, 3) of points (N,) through the middle child of each parent: direction 4 j + 3 of (U, 3)."""
    at = 0
    for p in points:
        for j in range(len(directions) // 4):
            _begin_ray(lifted[p], directions[4 * j + 3], frames[p], origins[at], ray_directions[at])
            at += 1


@njit(cache=True, nogil=True, error_model="numpy")
def differing(free: Flags, around: Int32Array, found: Flags) -> int:
    """Set found (N, T) where a triangle's flag (N, T) differs from one of its neighbours' around (T, A), −1 for none;
    return their number."""
    total = 0
    for n in range(free.shape[0]):
        for t in range(free.shape[1]):
            found[n, t] = False
            for other in around[t]:
                if other >= 0 and free[n, other] != free[n, t]:
                    found[n, t] = True
                    total += 1
                    break
    return total


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def more_rays(
    points: NDArray[np.int64], queried: Flags, lifted: Float32Array, frames: Float32Array, directions: Float32Array,
    n_children: int,
    origins: Float32Array, ray_directions: Float32Array,
) -> None:  # fmt: skip
    """Fill rays through the first n_children of the four children of each queried triangle (N, T); directions (4 T,
    3)."""
    at = 0
    for n in range(queried.shape[0]):
        p = points[n]
        for t in range(queried.shape[1]):
            if queried[n, t]:
                for c in range(n_children):
                    _begin_ray(lifted[p], directions[4 * t + c], frames[p], origins[at], ray_directions[at])
                    at += 1


@njit(cache=True, nogil=True, error_model="numpy")
def spread(middle: Flags, queried: Flags, blocked: Flags, free: Flags) -> None:
    """Fill free (N, 4 T): children inherit the middle child's flag (N, T), except for the other three of queried
    parents."""
    at = 0
    for n in range(middle.shape[0]):
        for t in range(middle.shape[1]):
            free[n, 4 * t + 3] = middle[n, t]
            for c in range(3):
                free[n, 4 * t + c] = middle[n, t]
                if queried[n, t]:
                    free[n, 4 * t + c] = not blocked[at]
                    at += 1


@njit(cache=True, nogil=True, error_model="numpy")
def pack(free: Flags, queried: Flags, blocked: Flags, points: NDArray[np.int64], bits: NDArray[np.uint8]) -> None:
    """Write bits (S, U / 2) of points (N,): four bits a triangle, all equal where its children were not queried (N,
    U)."""
    at = 0
    for n in range(free.shape[0]):
        row = bits[points[n]]
        for k in range(0, free.shape[1], 2):
            byte = 0
            for half in range(2):
                if queried[n, k + half]:
                    for c in range(4):
                        byte |= (0 if blocked[at] else 1) << (4 * half + c)
                        at += 1
                elif free[n, k + half]:
                    byte |= 15 << (4 * half)
            row[k >> 1] = byte


class PointVisibility(NamedTuple):
    """Visibility that points know: position and normal (S, 3), bits (S, ⌈L / 8⌉) of the patches that each sees; the
    patches' centre and patch_normal (L, 3), and their cones (L, 4)."""

    position: Float32Array
    normal: Float32Array
    bits: NDArray[np.uint8]
    centre: Float32Array
    patch_normal: Float32Array
    cones: Float32Array


class PatchRays(NamedTuple):
    """Shadow rays (N,): row of the sample, patch; solid, the factor from flux to power, times the number of patches
    that the ray represents; cosine to the sample's normal; known, the share of the patch that the sample's points see,
    and known_cosine, that share with the points' own powers and cosines; agreed: whether all points see it, or none
    does."""

    row: NDArray[np.int32]
    patch: NDArray[np.int32]
    solid: Float32Array
    cosine: Float32Array
    known: Float32Array
    known_cosine: Float32Array
    agreed: NDArray[np.bool_]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _towards_patch(j: int, at: Float32Array, normal: Float32Array, points: PointVisibility) -> tuple[float, float]:
    """Return the factor from flux of patch j to power at a position (3,), its cone included, and the cosine there; 0
    where the patch faces away."""
    x, y, z = points.centre[j, 0] - at[0], points.centre[j, 1] - at[1], points.centre[j, 2] - at[2]
    n = points.patch_normal[j]
    facing, above = -(x * n[0] + y * n[1] + z * n[2]), x * normal[0] + y * normal[1] + z * normal[2]
    if facing <= 0.0 or above <= 0.0:
        return 0.0, 0.0
    squared = x * x + y * y + z * z
    distance = math.sqrt(squared)
    share = cone_share(points.cones, j, x / distance, y / distance, z / distance)
    return share * facing / (squared * distance), above / distance


@njit(cache=True, nogil=True, error_model="numpy")
def patches_disagree(
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
def _n_seeing(j: int, corners: NDArray[np.int32], points: PointVisibility) -> int:
    """How many of three points see patch j."""
    n = 0
    for k in range(3):
        n += points.bits[corners[k], j >> 3] >> (j & 7) & 1
    return n


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def patches_in_question(
    corners: NDArray[np.int32], weights: Float32Array, places: Float32Array, normals: Float32Array,
    how: NDArray[np.uint8], phase: NDArray[np.int64], most: NDArray[np.int64], points: PointVisibility, out: PatchRays,
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
                if _towards_patch(j, places[n], normals[n], points)[0] > 0.0 or _n_seeing(j, corners[n], points) > 0:
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
            solid, cosine = _towards_patch(j, places[n], normals[n], points)
            # What the three points know of this patch: share, and share × cosine by their own geometry.
            n_seen, seen, known, around = 0, 0.0, 0.0, 0.0
            for k in range(3):
                p = corners[n, k]
                of_corner, above = _towards_patch(j, points.position[p], points.normal[p], points)
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


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def uncertain_peaks(
    samples: NDArray[np.int64], corners: NDArray[np.int32], weights: Float32Array, frame: Float32Array,
    peaks: PeakLights, n_peaks: int, strong: int,
    everywhere: bool, row: NDArray[np.int32], peak: NDArray[np.int32], share: Float32Array, cosine: Float32Array,
) -> int:  # fmt: skip
    """List the peaks, of the first n_peaks (at most 8), whose visibility at samples (N,) may differ from that at their
    points: peaks that one of the three points sees and another does not, and those in the bits of strong; or, if
    everywhere, all above the horizon.
    Fills row (ascending) and peak (N · n_peaks,), and by the points' weights (R, 3) share, how much of the peak they
    see, and cosine, the same times their cosines. Returns the number."""
    n_found, first_peaks = 0, (1 << n_peaks) - 1
    for n in range(len(samples)):
        j = samples[n]
        # Bits that are set at some corner but not at all of them.
        a, b, c = peaks.bits[corners[j, 0], 0], peaks.bits[corners[j, 1], 0], peaks.bits[corners[j, 2], 0]
        in_question = ((a | b | c) ^ (a & b & c)) & first_peaks
        tested = first_peaks if everywhere else in_question | strong
        if tested == 0:
            continue
        for s in range(n_peaks):
            d, seen, known, above = peaks.direction[s], np.float32(0.0), np.float32(0.0), np.float32(0.0)
            if not tested >> s & 1:
                continue
            # Interpolate share and cosine from the points.
            for k in range(3):
                p = corners[j, k]
                f = frame[p]
                there = weights[j, k] * (f[1, 0] * d[0] + f[1, 1] * d[1] + f[1, 2] * d[2])
                above += there
                if peaks.bits[p, 0] >> s & 1:
                    seen += weights[j, k]
                    known += there
            if above > 0.0 or in_question >> s & 1:
                row[n_found], peak[n_found], share[n_found], cosine[n_found] = n, s, seen, known
                n_found += 1
    return n_found
