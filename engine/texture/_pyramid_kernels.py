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
    and where each level begins (L,). Coordinates are turned, cosine and sine, and moved before they are looked up;
    wrap_u, wrap_v: 0 repeats, 1 mirrors, 2 goes on as the edge."""

    texels: Texels
    sizes: Indices
    first: Indices
    cosine: float
    sine: float
    offset_u: float
    offset_v: float
    wrap_u: int
    wrap_v: int


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _within(coordinate: float, wrap: int) -> float:
    """Where in [0, 1] a coordinate is looked up."""
    if wrap == 2:
        return min(max(coordinate, 0.0), 1.0)
    if wrap == 1:
        half = 0.5 * coordinate
        return 1.0 - abs(2.0 * (half - math.floor(half)) - 1.0)
    return coordinate - math.floor(coordinate)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _around(i: int, n: int, wrap: int) -> int:
    """A texel's index, from −1 to n, of n."""
    if wrap > 0:
        return min(max(i, 0), n - 1)
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
def _turned(levels: Levels, u: float, v: float):  # type: ignore[no-untyped-def]
    """A step or a place on the image, counter-clockwise about (0, 0)."""
    if levels.sine == 0.0 and levels.cosine == 1.0:
        return u, v
    return levels.cosine * u - levels.sine * v, levels.sine * u + levels.cosine * v


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _texel(levels: Levels, i: int, n: int, u: float, v: float):  # type: ignore[no-untyped-def]
    """Level i at a place, in n channels, as lanes: bilinear; texels are where their middles are."""
    t, height, width, first = levels.texels, levels.sizes[i, 0], levels.sizes[i, 1], levels.first[i]
    x, y = _within(u, levels.wrap_u) * width - 0.5, (1.0 - _within(v, levels.wrap_v)) * height - 0.5
    left, top = math.floor(x), math.floor(y)
    right, down = lanes.even(np.float32(x - left)), lanes.even(np.float32(y - top))
    x0, y0 = _around(int(left), width, levels.wrap_u), _around(int(top), height, levels.wrap_v)
    x1, y1 = _around(int(left) + 1, width, levels.wrap_u), _around(int(top) + 1, height, levels.wrap_v)
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
        u, v = _turned(levels, uv[j, 0], uv[j, 1])
        u, v = _finite(u + levels.offset_u), _finite(v + levels.offset_v)
        found = _at_depth(levels, out.shape[1], depths[j], u, v)
        lanes.store(four, 0, found)
        for channel in range(out.shape[1]):
            out[j, channel] = four[channel]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def fill_over(
    start: int, stop: int, levels: Levels, uv: Floats, across: Floats, down: Floats, repeats: tuple[float, float],
    most_probes: int, is_quick: bool, out: Texels,
) -> None:  # fmt: skip
    """Fill out[start:stop] of (N, C): means over pixels at (N, 2) whose sides are across and down (N, 2), all of them
    times repeats; is_quick: of one level, and not of what lies between two."""
    four = np.empty(4, np.float32)
    height, width = levels.sizes[0, 0], levels.sizes[0, 1]
    for j in range(start, stop):
        ax, ay = _turned(levels, across[j, 0] * repeats[0], across[j, 1] * repeats[1])
        bx, by = _turned(levels, down[j, 0] * repeats[0], down[j, 1] * repeats[1])
        ax, ay = _bounded(ax * width), _bounded(ay * height)
        bx, by = _bounded(bx * width), _bounded(by * height)
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
        u, v = _turned(levels, repeats[0] * uv[j, 0], repeats[1] * uv[j, 1])
        u, v = _finite(u + levels.offset_u), _finite(v + levels.offset_v)
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
