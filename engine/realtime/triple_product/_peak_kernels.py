"""Compiled: the peaks that a pixel reflects sharply, each in its own direction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST
from engine.realtime.triple_product._corner_kernels import PeakLights

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
    peaks: PeakLights,
    sharp: NDArray[np.uint64], least_cosine: float, requested: BrdfQueries,
) -> int:  # fmt: skip
    """Fill `requested` with the peaks that are sharp at the corners (3 N, 2) of samples (N,), as `shade_corners` finds
    them; return their number. A peak's power is scaled by the interpolation weights of the corners that see it;
    directions refer to the interpolated frame."""
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
                    _interpolate_frame(corners[j], weights[j], frame, own)
                    _view_direction(own, wo[j], least_cosine, towards)
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
def _interpolate_frame(
    corners: NDArray[np.int32], weights: Float32Array, frame: Float32Array, out: NDArray[np.float64]
) -> None:
    """Interpolate the frame between three points into out (3, 3) and orthonormalize it."""
    for i in range(2):
        for k in range(3):
            out[i, k] = 0.0
            for corner in range(3):
                out[i, k] += weights[corner] * frame[corners[corner], i, k]
    t, n = out[0], out[1]
    scale = 1.0 / max(math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), 1e-30)
    for k in range(3):
        n[k] *= scale
    along = t[0] * n[0] + t[1] * n[1] + t[2] * n[2]
    for k in range(3):
        t[k] -= along * n[k]
    scale = 1.0 / max(math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]), 1e-30)
    for k in range(3):
        t[k] *= scale
    for k in range(3):
        out[2, k] = t[(k + 1) % 3] * n[(k + 2) % 3] - t[(k + 2) % 3] * n[(k + 1) % 3]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _view_direction(
    frame: NDArray[np.float64], wo: Float32Array, least_cosine: float, out: NDArray[np.float64]
) -> None:
    """Write wo (3,) to out (3,) in tangent, bitangent, normal of a frame, raised to at least least_cosine, unit."""
    x = frame[0, 0] * wo[0] + frame[0, 1] * wo[1] + frame[0, 2] * wo[2]
    y = frame[1, 0] * wo[0] + frame[1, 1] * wo[1] + frame[1, 2] * wo[2]
    z = frame[2, 0] * wo[0] + frame[2, 1] * wo[1] + frame[2, 2] * wo[2]
    y = max(y, least_cosine)
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    out[0], out[1], out[2] = x * scale, -z * scale, y * scale


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def add_answers(n: int, requested: BrdfQueries, value: NDArray[np.float64], radiance: Float32Array) -> None:
    """Add to radiance (N, 3) what the first n evaluations reflect: power times value (n, 3)."""
    for m in range(n):
        for i in range(3):
            radiance[requested.sample[m], i] += requested.power[m, i] * value[m, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def uncertain_peaks(
    samples: NDArray[np.int64], corners: NDArray[np.int32], weights: Float32Array, frame: Float32Array,
    peaks: PeakLights, n_peaks: int,
    everywhere: bool, row: NDArray[np.int32], peak: NDArray[np.int32], share: Float32Array, cosine: Float32Array,
) -> int:  # fmt: skip
    """List the peaks, of the first n_peaks (at most 8), whose visibility at samples (N,) may differ from that at their
    points: peaks that one of the three points sees and another does not, or, if everywhere, all above the horizon.
    Fills row (ascending) and peak (N · n_peaks,), and by the points' weights (R, 3) share, how much of the peak they
    see, and cosine, the same times their cosines. Returns the number."""
    n_found, first_peaks = 0, (1 << n_peaks) - 1
    for n in range(len(samples)):
        j = samples[n]
        # Bits that are set at some corner but not at all of them.
        a, b, c = peaks.bits[corners[j, 0], 0], peaks.bits[corners[j, 1], 0], peaks.bits[corners[j, 2], 0]
        in_question = ((a | b | c) ^ (a & b & c)) & first_peaks
        if in_question == 0 and not everywhere:
            continue
        for s in range(n_peaks):
            d, seen, known, above = peaks.direction[s], np.float32(0.0), np.float32(0.0), np.float32(0.0)
            if not (everywhere or in_question >> s & 1):
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
