"""Compiled part of `lamp_light`: a lamp as caps of light, each a zonal lobe, under the lobes of points. It does not
validate."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_world
from engine.realtime.zonal_harmonics._lamp_kernels import towards_part

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

# A lamp is one cap where the mean of its directions is at most so much shorter than 1: of 11.5 degrees at most.
NARROW = 0.01
GROUP = 8  # parts of a wider one that are one cap together
_SMALL = 1e-6  # 1 - cosine of a cap that is a point


@njit(cache=True, nogil=True, error_model="numpy")
def light_range(
    start: int, stop: int, which: NDArray[np.int64], low: Float32Array, axes: Float32Array, coefficients: Float32Array,
    frames: Float32Array, places: Float32Array, parts: Float64Array, emission: Float64Array, cosine: Float64Array,
    even: float, is_opaque: bool, light: Float32Array, share: Float32Array,
) -> None:  # fmt: skip
    """Fill the rows which[start:stop] of light (S, 3), radiance of white points, and share (S,), of the lamp's light
    that they see past what their lobes contain; see `engine.realtime.zonal_harmonics.lamp_light`.

    low (S, 4), axes (S, N, 3), coefficients (S, N, n): lobes in the points' own axes, the rows of frames (S, 3, 3);
    places (V, 3) of points first; parts (K, 14): see `engine.realtime.zonal_harmonics.scene_lamps.Lamp.rows`, of
    emission 1; emission (3,); cosine (n,): the bands of a white Lambertian surface; even: the share of the mean light
    that is added to both sides of the ratio.
    """
    n_lobes, n = axes.shape[1], coefficients.shape[2]
    lobe_axes, seen = np.empty((n_lobes, 3)), np.empty((len(parts), 4))
    window, legendre = np.empty(n), np.empty(n)
    linear, mean = np.empty(3), np.empty(3)
    exact, sums = np.empty(3), np.empty(8)  # sums: by lobes (3), by the cosine's bands (3), of all channels
    for at in range(start, stop):
        p = which[at]
        frame = frames[p]
        for i in range(n_lobes):
            x, y, z = to_world(frame, axes[p, i, 0], axes[p, i, 1], axes[p, i, 2])
            lobe_axes[i, 0], lobe_axes[i, 1], lobe_axes[i, 2] = x, y, z
        # The linear band rotates like the vector (-low_3, -low_1, low_2).
        x, y, z = to_world(frame, -low[p, 3], -low[p, 1], low[p, 2])
        linear[0], linear[1], linear[2] = x, y, z
        # What is seen of each part; exact: E / pi without shadows.
        exact[:] = 0.0
        sums[:] = 0.0
        for s in range(len(parts)):
            part = parts[s]
            x, y, z, angle = towards_part(part, places[p, 0], places[p, 1], places[p, 2])
            seen[s, 0], seen[s, 1], seen[s, 2], seen[s, 3] = x, y, z, angle
            up = max(x * frame[2, 0] + y * frame[2, 1] + z * frame[2, 2], 0.0) / math.pi
            for c in range(3):
                exact[c] += angle * up * part[11 + c]
        angles = _mean_direction(seen, 0, len(parts), mean)
        step = len(parts) if _length(mean) > (1.0 - NARROW) * angles else GROUP
        for first in range(0, len(parts) if angles > 0.0 else 0, step):
            last = min(first + step, len(parts))
            angles = _mean_direction(seen, first, last, mean)
            length = _length(mean)
            if not length > 0.0:
                continue
            # The cap with the group's power and mean direction, whose length is (1 + cosine at the rim) / 2.
            rim = max(2.0 * length / angles - 1.0, -1.0)
            x, y, z = mean[0] / length, mean[1] / length, mean[2] / length
            _window_of_cap(rim, window)
            by_lobes = low[p, 0] * math.sqrt(0.25 / math.pi)
            if n > 1:
                along = linear[0] * x + linear[1] * y + linear[2] * z
                by_lobes += math.sqrt(0.75 / math.pi) * window[1] * along
            for i in range(n_lobes):
                _legendre(lobe_axes[i, 0] * x + lobe_axes[i, 1] * y + lobe_axes[i, 2] * z, legendre)
                # Band l of the cap's light along a lobe's axis: (2l + 1) / 4 pi w_l P_l [Sloan05, eq. 10, 25].
                for l in range(n):  # noqa: E741
                    by_lobes += coefficients[p, i, l] * (2 * l + 1) * window[l] * legendre[l] / (4.0 * math.pi)
            _legendre(frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z, legendre)
            by_cosine = 0.0
            for l in range(n):  # noqa: E741
                by_cosine += cosine[l] * (2 * l + 1) * window[l] * legendre[l] / (4.0 * math.pi)
            for c in range(3):
                power = 0.0
                for s in range(first, last):
                    power += seen[s, 3] * parts[s, 11 + c]
                sums[c] += power * by_lobes
                sums[3 + c] += power * by_cosine
                sums[6] += power * emission[c]
        reached, unblocked = even * sums[6] / (4.0 * math.pi), even * sums[6] / (4.0 * math.pi)
        for c in range(3):
            reached += sums[c] * emission[c]
            unblocked += sums[3 + c] * emission[c]
            # What bands lose of the cosine is known.
            found = sums[c] - sums[3 + c] + exact[c] if is_opaque else sums[c]
            light[p, c] = max(found, 0.0) * emission[c]
        share[p] = min(max(reached / max(unblocked, 1e-30), 0.0), 1.0)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _mean_direction(seen: Float64Array, first: int, last: int, mean: Float64Array) -> float:
    """Fill mean (3,) with the sum of directions times solid angles of seen[first:last] (K, 4); returns that of the
    angles."""
    mean[:] = 0.0
    angles = 0.0
    for s in range(first, last):
        angles += seen[s, 3]
        for k in range(3):
            mean[k] += seen[s, 3] * seen[s, k]
    return angles


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _length(vector: Float64Array) -> float:
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@njit(cache=True, nogil=True, error_model="numpy")
def _window_of_cap(c: float, window: Float64Array) -> None:
    """Fill window (n,) with the means of the Legendre polynomials over a cap, c the cosine of its half-angle:
    (P_(l-1)(c) - P_(l+1)(c)) / ((2l + 1)(1 - c))."""
    before, here = 1.0, c
    window[0] = 1.0
    for l in range(1, len(window)):  # noqa: E741
        after = ((2 * l + 1) * c * here - l * before) / (l + 1)
        window[l] = (before - after) / ((2 * l + 1) * (1.0 - c)) if 1.0 - c > _SMALL else 1.0
        before, here = here, after


@njit(cache=True, nogil=True, error_model="numpy")
def _legendre(t: float, values: Float64Array) -> None:
    """Fill values (n,) with the Legendre polynomials at t."""
    values[0] = 1.0
    if len(values) > 1:
        values[1] = t
    for l in range(2, len(values)):  # noqa: E741
        values[l] = ((2 * l - 1) * t * values[l - 1] - (l - 1) * values[l - 2]) / l
