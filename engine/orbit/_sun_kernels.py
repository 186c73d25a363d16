"""Compiled: the suns that each pixel sees, each in its own direction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.orbit._incident_kernels import child_at
from engine.orbit._slice_kernels import Tables, _float, cell_at, corners_at

Floats = NDArray[np.float32]


class Suns(NamedTuple):
    """Direction and power (M, 3) of a sky's suns; which of them each point sees (S, ⌈M / 8⌉), `Kept.sun_bits`;
    `Hemisphere.children`."""

    direction: Floats
    power: Floats
    bits: NDArray[np.uint8]
    children: NDArray[np.int16]


class Asked(NamedTuple):
    """What formulas are asked: sample (P,) of those that are named, power (P, 3) that comes in, wi and wo (P, 3) in
    tangent, bitangent, normal."""

    sample: NDArray[np.int32]
    power: Floats
    wi: NDArray[np.float64]
    wo: NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def find_suns(
    which: NDArray[np.int64], corners: NDArray[np.int32], weights: Floats, wo: Floats, frame: Floats, suns: Suns,
    t: Tables, little: float, least_cosine: float, others: Floats, radiance: Floats, asked: Asked,
) -> int:  # fmt: skip
    """Fill radiance (N, 3) with what slices say that samples (N,) reflect of suns that differ among the four around the
    sample by no more than this little share of all that is reflected; others (N, 3): that without suns. The others are
    to be asked; how many that are. The frame is that of the nearest point, and between points for those."""
    n_suns, n_asked = len(suns.power), 0
    share, most = np.empty(n_suns, np.float32), np.empty(n_suns, np.float32)
    between, found = np.empty((n_suns, 3), np.float32), np.empty(n_suns, np.int64)
    own, towards = np.empty((3, 3)), np.empty(3)
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
        n_found, bits = 0, np.uint8(0)
        total = others[n, 0] + others[n, 1] + others[n, 2]
        first, second, third = suns.bits[corners[j, 0]], suns.bits[corners[j, 1]], suns.bits[corners[j, 2]]
        for s in range(n_suns):
            if s & 7 == 0:
                bits = first[s >> 3] | second[s >> 3] | third[s >> 3]
            if not bits >> (s & 7) & 1:
                continue
            d = suns.direction[s]
            y = f[1, 0] * d[0] + f[1, 1] * d[1] + f[1, 2] * d[2]
            if y <= 0.0:
                continue
            x = f[0, 0] * d[0] + f[0, 1] * d[1] + f[0, 2] * d[2]
            z = f[2, 0] * d[0] + f[2, 1] * d[1] + f[2, 2] * d[2]
            seen = np.float32(0.0)
            seen += weights[j, 0] if first[s >> 3] >> (s & 7) & 1 else np.float32(0.0)
            seen += weights[j, 1] if second[s >> 3] >> (s & 7) & 1 else np.float32(0.0)
            seen += weights[j, 2] if third[s >> 3] >> (s & 7) & 1 else np.float32(0.0)
            at = corners_at(cell, child_at(x, y, z, suns.children) >> 2, t)
            largest = np.float32(0.0)
            for i in range(3):
                channel = np.uint64(i)
                v00, v01 = _float(t.values[at.first + channel]), _float(t.values[at.across + channel])
                v10, v11 = _float(t.values[at.down + channel]), _float(t.values[at.last + channel])
                upper = v00 + cell.across * (v01 - v00)
                power = seen * suns.power[s, i]
                between[n_found, i] = power * (upper + cell.down * (v10 + cell.across * (v11 - v10) - upper))
                largest += power * max(max(v00, v01), max(v10, v11))
                total += between[n_found, i]
            share[n_found], most[n_found], found[n_found] = seen, largest, s
            n_found += 1
        radiance[n] = 0.0
        has_frame = False
        for m in range(n_found):
            s = found[m]
            if most[m] - (between[m, 0] + between[m, 1] + between[m, 2]) <= little * total:
                for i in range(3):
                    radiance[n, i] += between[m, i]
                continue
            if not has_frame:
                _interpolate_frame(corners[j], weights[j], frame, own)
                _look_along(own, wo[j], least_cosine, towards)
                has_frame = True
            d = suns.direction[s]
            x = own[0, 0] * d[0] + own[0, 1] * d[1] + own[0, 2] * d[2]
            y = own[1, 0] * d[0] + own[1, 1] * d[1] + own[1, 2] * d[2]
            z = own[2, 0] * d[0] + own[2, 1] * d[1] + own[2, 2] * d[2]
            if y <= 0.0:
                continue
            asked.sample[n_asked] = n
            for i in range(3):
                asked.power[n_asked, i], asked.wo[n_asked, i] = share[m] * suns.power[s, i], towards[i]
            asked.wi[n_asked, 0], asked.wi[n_asked, 1], asked.wi[n_asked, 2] = x, -z, y
            n_asked += 1
    return n_asked


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _interpolate_frame(corners: NDArray[np.int32], weights: Floats, frame: Floats, out: NDArray[np.float64]) -> None:
    """The frame between three points into out (3, 3), orthonormal again."""
    for i in range(2):
        for k in range(3):
            out[i, k] = 0.0
            for corner in range(3):
                out[i, k] += weights[corner] * frame[corners[corner], i, k]
    t, n = out[0], out[1]
    scale = 1.0 / math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for k in range(3):
        n[k] *= scale
    along = t[0] * n[0] + t[1] * n[1] + t[2] * n[2]
    for k in range(3):
        t[k] -= along * n[k]
    scale = 1.0 / math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    for k in range(3):
        t[k] *= scale
    for k in range(3):
        out[2, k] = t[(k + 1) % 3] * n[(k + 2) % 3] - t[(k + 2) % 3] * n[(k + 1) % 3]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _look_along(frame: NDArray[np.float64], wo: Floats, least_cosine: float, out: NDArray[np.float64]) -> None:
    """wo (3,) in tangent, bitangent, normal of a frame, no less than so much above the surface, unit, into out (3,)."""
    x = frame[0, 0] * wo[0] + frame[0, 1] * wo[1] + frame[0, 2] * wo[2]
    y = frame[1, 0] * wo[0] + frame[1, 1] * wo[1] + frame[1, 2] * wo[2]
    z = frame[2, 0] * wo[0] + frame[2, 1] * wo[1] + frame[2, 2] * wo[2]
    y = max(y, least_cosine)
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    out[0], out[1], out[2] = x * scale, -z * scale, y * scale


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def add_asked(n: int, asked: Asked, value: NDArray[np.float64], radiance: Floats) -> None:
    """Add what the first n that were asked reflect, by their value (n, 3), to radiance (N, 3)."""
    for m in range(n):
        for i in range(3):
            radiance[asked.sample[m], i] += asked.power[m, i] * value[m, i]
