"""Compiled: reflection at pixels in frames of their own: of peaks that a pixel reflects sharply, each in its own
direction, and by perturbed normals of the light that points store for unperturbed ones."""

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
from engine.realtime.triple_product._slice_kernels import PeakLights, Tables, cell_at, reflected_between

Float32Array = NDArray[np.float32]


class BrdfQueries(NamedTuple):
    """BRDF evaluations (P,): sample, index among the given samples; power (P, 3) that arrives; wi and wo (P, 3) in
    tangent, bitangent, normal."""

    sample: NDArray[np.int32]
    power: Float32Array
    wi: NDArray[np.float64]
    wo: NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def query_peaks(
    which: NDArray[np.int64], corners: NDArray[np.int32], weights: Float32Array, wo: Float32Array, frame: Float32Array,
    offsets: Float32Array, peaks: PeakLights,
    sharp: NDArray[np.uint64], least_cosine: float, requested: BrdfQueries,
) -> int:  # fmt: skip
    """Fill `requested` with the peaks that are sharp at the corners (3 N, 2) of samples (N,), as `shade_corners` finds
    them; return their number. A peak's power is scaled by the interpolation weights of the corners that see it;
    directions refer to the interpolated frame, whose normal bumps offset by offsets (N, 3), none for (0, 3)."""
    n_requested = 0
    own, towards = np.empty((3, 3)), np.empty(3)
    for n in range(len(which)):
        j, has_frame = which[n], False
        # Walk through the set bits of both 64-bit words.
        for word in range(2):
            first, second, third = sharp[3 * n, word], sharp[3 * n + 1, word], sharp[3 * n + 2, word]
            left, s = first | second | third, 64 * word - 1
            while left:
                s += 1
                found = left & np.uint64(1)
                left >>= np.uint64(1)
                if not found:
                    continue
                # Frame and wo are needed only by samples with sharp peaks.
                if not has_frame:
                    interpolate_frame(corners[j], weights[j], frame, offsets[n : n + 1], own)
                    view_direction(own, wo[j], least_cosine, towards)
                    has_frame = True
                # The peak's direction in the sample's frame.
                d = peaks.direction[s]
                y = own[1, 0] * d[0] + own[1, 1] * d[1] + own[1, 2] * d[2]
                if y <= 0.0:
                    continue
                x = own[0, 0] * d[0] + own[0, 1] * d[1] + own[0, 2] * d[2]
                z = own[2, 0] * d[0] + own[2, 1] * d[1] + own[2, 2] * d[2]
                # Power times the weights of those corners that see the peak.
                bit = np.uint64(s & 63)
                share = weights[j, 0] * np.float32(first >> bit & np.uint64(1))
                share += weights[j, 1] * np.float32(second >> bit & np.uint64(1))
                share += weights[j, 2] * np.float32(third >> bit & np.uint64(1))
                requested.sample[n_requested] = n
                for i in range(3):
                    requested.power[n_requested, i], requested.wo[n_requested, i] = (
                        share * peaks.power[s, i],
                        towards[i],
                    )
                # The frame's third axis is minus the bitangent.
                requested.wi[n_requested, 0], requested.wi[n_requested, 1], requested.wi[n_requested, 2] = x, -z, y
                n_requested += 1
    return n_requested


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def interpolate_frame(
    corners: NDArray[np.int32], weights: Float32Array, frame: Float32Array, offset: Float32Array,
    out: NDArray[np.float64],
) -> None:  # fmt: skip
    """Interpolate the frame between three points into out (3, 3) and orthonormalize it; offset (1 or 0, 3): of the unit
    normal, perpendicular to it."""
    for i in range(2):
        for k in range(3):
            out[i, k] = 0.0
            for corner in range(3):
                out[i, k] += weights[corner] * frame[corners[corner], i, k]
    t, n = out[0], out[1]
    scale = 1.0 / max(math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), 1e-30)
    for k in range(3):
        n[k] *= scale
    for m in range(len(offset)):
        scale = 1.0 / math.sqrt(1.0 + offset[m, 0] ** 2 + offset[m, 1] ** 2 + offset[m, 2] ** 2)
        for k in range(3):
            n[k] = scale * (n[k] + offset[m, k])
    along = t[0] * n[0] + t[1] * n[1] + t[2] * n[2]
    for k in range(3):
        t[k] -= along * n[k]
    scale = 1.0 / max(math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]), 1e-30)
    for k in range(3):
        t[k] *= scale
    for k in range(3):
        out[2, k] = t[(k + 1) % 3] * n[(k + 2) % 3] - t[(k + 2) % 3] * n[(k + 1) % 3]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def view_direction(frame: NDArray[np.float64], wo: Float32Array, least_cosine: float, out: NDArray[np.float64]) -> None:
    """Write wo (3,) to out (3,) in tangent, bitangent, normal of a frame, raised to at least least_cosine, unit."""
    x, y, z = to_local(frame, wo[0], wo[1], wo[2])
    y = max(y, least_cosine)
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    out[0], out[1], out[2] = x * scale, -z * scale, y * scale


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def add_answers(n: int, requested: BrdfQueries, value: NDArray[np.float64], radiance: Float32Array) -> None:
    """Add to radiance (N, 3) what the first n evaluations reflect: power times value (n, 3)."""
    for m in range(n):
        for i in range(3):
            radiance[requested.sample[m], i] += requested.power[m, i] * value[m, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _powers(number: NDArray[np.int16], value: NDArray[np.uint16], level: int, words: NDArray[np.uint32]) -> None:
    """Reconstruct powers from the coefficients of `_incident_kernels.compress`, on the triangles of a level: words
    (20·4^level, 3) become the bits of float32 powers."""
    count = 20 << (2 * level)
    words[:count] = np.uint32(0)
    # Scatter the coefficients that this level resolves; bfloat16 is the upper half of float32.
    for k in range(len(number)):
        if 0 <= number[k] < count:
            for i in range(3):
                if value[k, i]:
                    words[number[k], i] = np.uint32(value[k, i]) << np.uint32(16)
    means, parents = words.view(np.float32), 20
    quarters = np.empty((count, 3), np.float32)
    # Inverse Haar transform, level by level: each parent's mean and three wavelets become the four children [Ma06,
    # 3.1].
    while parents < count:
        for t in range(parents):
            for i in range(3):
                m, at = means[t, i], parents + 3 * t
                u, v, w = means[at, i], means[at + 1, i], means[at + 2, i]
                d = np.float32(0.25) * (m + u + v + w)
                quarters[4 * t, i] = np.float32(4.0) * (d - np.float32(0.5) * (v + w))
                quarters[4 * t + 1, i] = np.float32(4.0) * (d - np.float32(0.5) * (u + w))
                quarters[4 * t + 2, i] = np.float32(4.0) * (d - np.float32(0.5) * (u + v))
                quarters[4 * t + 3, i] = np.float32(4.0) * d
        parents *= 4
        for t in range(parents):
            for i in range(3):
                means[t, i] = quarters[t, i]
    # Coefficients hold means over triangles of the finest level: convert them to power in the larger triangles.
    times = np.float32(5120.0 / count)
    for t in range(count):
        for i in range(3):
            means[t, i] *= times


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def irradiance(
    start: int, stop: int, points: NDArray[np.int64], first: NDArray[np.int64], members: NDArray[np.int64],
    normals: Float32Array, frame: Float32Array, slots: NDArray[np.int32], stored: StoredLight, level: int,
    directions: Float32Array, out: Float32Array,
) -> None:  # fmt: skip
    """Fill out (3 N, 3) with irradiance, without peaks, of a surface with normal (N, 3) under the light of each
    corner's point.

    directions (20·4^level, 3): the level's triangles in a point's frame. The corners members[first[j]:first[j + 1]]
    belong to point points[j]. The result for an unperturbed normal is the irradiance that the point stores: the
    truncated coefficients give only the change relative to it.
    """
    words = np.empty((len(directions), 3), np.uint32)
    powers = words.view(np.float32)
    above = np.flatnonzero(directions[:, 1] > 0.0)
    # One row for each coordinate and channel, so that the loops over triangles vectorize.
    direction, light = np.empty((3, len(above)), np.float32), np.empty((3, len(above)), np.float32)
    for k in range(len(above)):
        for i in range(3):
            direction[i, k] = directions[above[k], i]
    own = np.empty(3, np.float32)
    for j in range(start, stop):
        p = points[j]
        f = frame[p]
        # The point's powers, and the irradiance that they give with its own normal.
        _powers(stored.number[slots[p]], stored.value[slots[p]], level, words)
        own[:] = 0.0
        for i in range(3):
            for k in range(len(above)):
                light[i, k] = powers[above[k], i]
                own[i] += light[i, k] * direction[1, k]
        for at in range(first[j], first[j + 1]):
            r = members[at]
            # The perturbed normal in the point's frame.
            n = normals[r // 3]
            x, y, z = to_local(f, n[0], n[1], n[2])
            # Irradiance by Σ power × max(cos, 0).
            red = green = blue = np.float32(0.0)
            for k in range(len(above)):
                cosine = max(x * direction[0, k] + y * direction[1, k] + z * direction[2, k], np.float32(0.0))
                red += light[0, k] * cosine
                green += light[1, k] * cosine
                blue += light[2, k] * cosine
            out[r, 0], out[r, 1], out[r, 2] = red, green, blue
            # Stored irradiance plus the change due to the normal.
            for i in range(3):
                there = max(stored.irradiance[p, i], np.float32(0.0))
                out[r, i] = max(there + out[r, i] - own[i], np.float32(0.0))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def quick_irradiance(
    start: int, stop: int, which: NDArray[np.int64], corners: NDArray[np.int32], weights: Float32Array,
    offsets: Float32Array,
    frame: Float32Array, slots: NDArray[np.int32], stored: StoredLight, out: Float32Array,
) -> None:  # fmt: skip
    """Fill out (N, 3) with irradiance at samples (N,) whose unit normals are offset by offsets (N, 3), perpendicular to
    them.

    The estimate takes all light to come from above both horizons: E (1 + cos) / 2, which is exact for a uniform sky,
    plus the cosines of the lateral light with the offset.
    """
    for n in range(start, stop):
        j, offset = which[n], offsets[n]
        # Cosine between the perturbed and the interpolated normal.
        cosine = np.float32(1.0) / np.float32(math.sqrt(1.0 + offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2))
        out[n] = 0.0
        for k in range(3):
            p, weight = corners[j, k], weights[j, k]
            f, slot = frame[p], slots[p]
            # The offset in the point's frame, along x and z.
            x = cosine * (f[0, 0] * offset[0] + f[0, 1] * offset[1] + f[0, 2] * offset[2])
            z = cosine * (f[2, 0] * offset[0] + f[2, 1] * offset[1] + f[2, 2] * offset[2])
            half = np.float32(0.5) + np.float32(0.5) * cosine
            for i in range(3):
                from_side = x * stored.irradiance_gradient[slot, 0, i] + z * stored.irradiance_gradient[slot, 1, i]
                out[n, i] += weight * (half * stored.irradiance[p, i] + from_side)
        for i in range(3):
            out[n, i] = max(out[n, i], np.float32(0.0))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shade_broad(
    start: int, stop: int, points: NDArray[np.int64], first: NDArray[np.int64], members: NDArray[np.int64],
    wo: Float32Array,
    perturbed: Float32Array, frame: Float32Array, slots: NDArray[np.int32], stored: StoredLight, level: int,
    directions: Float32Array,
    children: NDArray[np.int16], t: Tables, out: Float32Array,
) -> None:  # fmt: skip
    """As `irradiance`, but radiance along wo (N, 3) by the slices in perturbed frames perturbed (N, 3, 3), triangle by
    triangle."""
    words = np.empty((len(directions), 3), np.uint32)
    powers = words.view(np.float32)
    listed, between = np.empty(len(directions), np.int64), np.empty((3, 3), np.float32)
    colour = np.empty(4, np.float32)
    for j in range(start, stop):
        p = points[j]
        f = frame[p]
        _powers(stored.number[slots[p]], stored.value[slots[p]], level, words)
        # Triangles that hold power.
        n_listed = 0
        for m in range(len(directions)):
            if directions[m, 1] > 0.0 and (powers[m, 0] != 0.0 or powers[m, 1] != 0.0 or powers[m, 2] != 0.0):
                listed[n_listed] = m
                n_listed += 1
        for at in range(first[j], first[j + 1]):
            r = members[at]
            g, o = perturbed[r // 3], wo[r // 3]
            # Rotation from the point's frame to the perturbed frame.
            for a in range(3):
                for b in range(3):
                    between[a, b] = g[a, 0] * f[b, 0] + g[a, 1] * f[b, 1] + g[a, 2] * f[b, 2]
            # The slices around wo in the perturbed frame.
            x, y, z = to_local(g, o[0], o[1], o[2])
            cell = cell_at(x, y, z, t)
            # Σ power × slice over the triangles above the perturbed horizon: [Ma06, eq. 7] in the triangles' basis.
            total = lanes.zeros()
            for k in range(n_listed):
                d, power = directions[listed[k]], powers[listed[k]]
                y = between[1, 0] * d[0] + between[1, 1] * d[1] + between[1, 2] * d[2]
                if y <= 0.0:
                    continue
                x = between[0, 0] * d[0] + between[0, 1] * d[1] + between[0, 2] * d[2]
                z = between[2, 0] * d[0] + between[2, 1] * d[1] + between[2, 2] * d[2]
                reflected = reflected_between(cell, child_at(x, y, z, children) >> 2, t)
                total = lanes.plus_product(total, lanes.of(power[0], power[1], power[2]), reflected)
            lanes.store(colour, 0, total)
            for i in range(3):
                out[r, i] = max(colour[i], np.float32(0.0))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _shares(
    bits: NDArray[np.uint8],
    corners: NDArray[np.int32],
    weights: Float32Array,
    of_bits: Float32Array,
    share: Float32Array,
) -> None:
    """Fill share (8 B,) with the interpolated visibility of each peak; of_bits: `of_bytes`."""
    for byte in range(len(share) // 8):
        first, second = of_bits[bits[corners[0], byte]], of_bits[bits[corners[1], byte]]
        third = of_bits[bits[corners[2], byte]]
        for bit in range(8):  # vectorizes
            share[8 * byte + bit] = weights[0] * first[bit] + weights[1] * second[bit] + weights[2] * third[bit]


def of_bytes() -> Float32Array:
    """The bits of each byte as floats, lowest first (256, 8)."""
    return np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little").astype(np.float32)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def peak_irradiance(
    start: int, stop: int, which: NDArray[np.int64], corners: NDArray[np.int32], weights: Float32Array,
    perturbed: Float32Array,
    frame: Float32Array, peak_bits: NDArray[np.uint8], peak_direction: Float32Array, peak_power: Float32Array,
    of_bits: Float32Array, out: Float32Array,
) -> None:  # fmt: skip
    """Fill out (N, 3) with the difference that perturbing the normal makes to the peaks' irradiance at samples (N,).

    peak_direction, peak_power (3, M): one row for each coordinate and channel, so that the loop over peaks vectorizes;
    M is a multiple of 8, padded with peaks without power. of_bits: `of_bytes`.
    """
    share, before = np.empty(peak_power.shape[1], np.float32), np.empty(3, np.float32)
    for n in range(start, stop):
        j, normal = which[n], perturbed[n, 1]
        # The unperturbed normal: interpolated between the points, as their irradiance is.
        for i in range(3):
            before[i] = np.float32(0.0)
            for k in range(3):
                before[i] += weights[j, k] * frame[corners[j, k], 1, i]
        _shares(peak_bits, corners[j], weights[j], of_bits, share)
        x, y, z, a, b, c = normal[0], normal[1], normal[2], before[0], before[1], before[2]
        red = green = blue = np.float32(0.0)
        # share × (perturbed cosine − unperturbed cosine) × power.
        for s in range(len(share)):
            d, e, f = peak_direction[0, s], peak_direction[1, s], peak_direction[2, s]
            cosine = max(x * d + y * e + z * f, np.float32(0.0))
            more = share[s] * (cosine - (a * d + b * e + c * f))
            red += more * peak_power[0, s]
            green += more * peak_power[1, s]
            blue += more * peak_power[2, s]
        out[n, 0], out[n, 1], out[n, 2] = red, green, blue


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def peak_radiance(
    start: int, stop: int, which: NDArray[np.int64], corners: NDArray[np.int32], weights: Float32Array,
    wo: Float32Array,
    perturbed: Float32Array, peak_bits: NDArray[np.uint8], peak_direction: Float32Array, peak_power: Float32Array,
    children: NDArray[np.int16], of_bits: Float32Array, t: Tables, out: Float32Array,
) -> None:  # fmt: skip
    """Fill out (N, 3) with the radiance of peaks that slices reflect on perturbed surfaces, at samples (N,); peaks as
    in `peak_irradiance`."""
    n_peaks, side = peak_power.shape[1], children.shape[0]
    share, height, colour = np.empty(n_peaks, np.float32), np.empty(n_peaks, np.float32), np.empty(4, np.float32)
    row, column = np.empty(n_peaks, np.int32), np.empty(n_peaks, np.int32)
    half, last = 0.5 * side, np.int32(side - 1)
    for n in range(start, stop):
        j, g = which[n], perturbed[n]
        x, y, z = to_local(g, wo[n, 0], wo[n, 1], wo[n, 2])
        cell = cell_at(x, y, z, t)
        _shares(peak_bits, corners[j], weights[j], of_bits, share)
        # Each peak's place in the perturbed frame and in `children`, as `child_at`: this loop vectorizes.
        for s in range(n_peaks):
            d, e, f = peak_direction[0, s], peak_direction[1, s], peak_direction[2, s]
            x, y, z = to_local(g, d, e, f)
            scale = half / (abs(x) + max(y, np.float32(1e-6)) + abs(z))
            height[s] = y
            column[s] = min(np.int32((x + z) * scale + half), last)
            row[s] = min(np.int32((x - z) * scale + half), last)
        # Σ visible power × slice over the peaks above the perturbed horizon.
        total = lanes.zeros()
        for s in range(n_peaks):
            if share[s] > 0.0 and height[s] > 0.0:
                place = children[max(row[s], 0), max(column[s], 0)] >> 2
                light = lanes.of(share[s] * peak_power[0, s], share[s] * peak_power[1, s], share[s] * peak_power[2, s])
                total = lanes.plus_product(total, light, reflected_between(cell, place, t))
        lanes.store(colour, 0, total)
        out[n, 0], out[n, 1], out[n, 2] = colour[0], colour[1], colour[2]
