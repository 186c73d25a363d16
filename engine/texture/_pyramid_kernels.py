"""Compiled: look-ups in a pyramid of images, between texels and levels, over pixels of any shape."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine import lanes
from engine.fast_math import FAST

Floats = NDArray[np.float64]
Texels = NDArray[np.float32]
Indices = NDArray[np.int64]

_LONGEST = 1e6  # texels: beyond, a footprint is the whole image anyway


class Levels(NamedTuple):
    """Texels (N C + 3,) of all levels, of up to three channels, row by row, see `lanes`; sizes (L, 2) height and width,
    and where each level begins (L,)."""

    texels: Texels
    sizes: Indices
    first: Indices


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _around(i: int, n: int) -> int:
    """An index from −1 to n, of n that repeat."""
    return i + n if i < 0 else (i - n if i >= n else i)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _finite(coordinate: float) -> float:
    return coordinate if abs(coordinate) < 1e15 else 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bounded(texels: float) -> float:
    """At the horizon of a plane a pixel sees no end of it."""
    if math.isnan(texels):
        return _LONGEST
    return min(max(texels, -_LONGEST), _LONGEST)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _texel(levels: Levels, i: int, n: int, u: float, v: float):  # type: ignore[no-untyped-def]
    """Level i at a place, in n channels, as lanes: bilinear, repeating; texels are where their middles are."""
    t, height, width, first = levels.texels, levels.sizes[i, 0], levels.sizes[i, 1], levels.first[i]
    x, y = (u - math.floor(u)) * width - 0.5, (1.0 - (v - math.floor(v))) * height - 0.5
    left, top = math.floor(x), math.floor(y)
    right, down = lanes.even(np.float32(x - left)), lanes.even(np.float32(y - top))
    x0, y0 = _around(int(left), width), _around(int(top), height)
    x1, y1 = _around(x0 + 1, width), _around(y0 + 1, height)
    upper, lower = first + y0 * width, first + y1 * width
    above, below = lanes.floats(t, n * (upper + x0)), lanes.floats(t, n * (lower + x0))
    above = lanes.plus_product(above, right, lanes.minus(lanes.floats(t, n * (upper + x1)), above))
    below = lanes.plus_product(below, right, lanes.minus(lanes.floats(t, n * (lower + x1)), below))
    return lanes.plus_product(above, down, lanes.minus(below, above))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _at_depth(levels: Levels, n: int, depth: float, u: float, v: float):  # type: ignore[no-untyped-def]
    """What lies between the two levels around a depth."""
    last = len(levels.sizes) - 1
    depth = min(max(depth, 0.0), float(last))
    lower = min(int(depth), max(last - 1, 0))
    coarser = np.float32(depth - lower)
    found = _texel(levels, lower, n, u, v)
    if coarser > 0.0:
        more = lanes.minus(_texel(levels, lower + 1, n, u, v), found)
        found = lanes.plus_product(found, lanes.even(coarser), more)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def fill_at(levels: Levels, uv: Floats, depths: Floats, out: Texels) -> None:
    """Fill out (N, C): values at coordinates (N, 2), at depths (N,) into the levels."""
    four = np.empty(4, np.float32)
    for j in range(len(uv)):
        found = _at_depth(levels, out.shape[1], depths[j], _finite(uv[j, 0]), _finite(uv[j, 1]))
        lanes.store(four, 0, found)
        out[j] = four[: out.shape[1]]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def fill_over(
    start: int, stop: int, levels: Levels, uv: Floats, across: Floats, down: Floats, repeats: tuple[float, float],
    most_probes: int, is_quick: bool, out: Texels,
) -> None:  # fmt: skip
    """Fill out[start:stop] of (N, C): means over pixels at (N, 2) whose sides are across and down (N, 2), all of them
    times repeats; is_quick: of one level, and not of what lies between two."""
    four = np.empty(4, np.float32)
    height, width = repeats[1] * levels.sizes[0, 0], repeats[0] * levels.sizes[0, 1]
    for j in range(start, stop):
        ax, ay = _bounded(across[j, 0] * width), _bounded(across[j, 1] * height)
        bx, by = _bounded(down[j, 0] * width), _bounded(down[j, 1] * height)
        # Of the ellipse with these conjugate diameters, the longer diameter and the lengths of both.
        xx, yy, xy = ax * ax + bx * bx, ay * ay + by * by, ax * ay + bx * by
        spread = math.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
        longer = math.sqrt(max(0.5 * (xx + yy) + spread, 0.0))
        shorter = abs(ax * by - ay * bx) / max(longer, 1e-30)
        n = min(max(int(math.ceil(longer / max(shorter, 1.0) - 1e-3)), 1), most_probes)
        wide = max(shorter, longer / most_probes)
        depth = math.log2(wide) if wide > 1.0 else 0.0
        if is_quick:
            depth = math.floor(depth + 0.5)
        u, v = _finite(repeats[0] * uv[j, 0]), _finite(repeats[1] * uv[j, 1])
        twice = 0.5 * (xx - yy) / spread if spread > 0.0 else 1.0  # the cosine of twice the longer one's angle
        du = longer * math.sqrt(max(0.5 + 0.5 * twice, 0.0)) / levels.sizes[0, 1]
        dv = math.copysign(longer * math.sqrt(max(0.5 - 0.5 * twice, 0.0)), xy) / levels.sizes[0, 0]
        share, total = lanes.even(np.float32(1.0 / n)), lanes.zeros()
        for i in range(n):
            place = (i + 0.5) / n - 0.5
            found = _at_depth(levels, out.shape[1], depth, u + place * du, v + place * dv)
            total = lanes.plus_product(total, share, found)
        lanes.store(four, 0, total)
        for channel in range(out.shape[1]):
            out[j, channel] = four[channel]
