"""Compiled: look-ups in a pyramid of images, between texels and levels, over pixels of any shape."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Texels = NDArray[np.float32]
Indices = NDArray[np.int64]

_1, _2 = np.uint64(1), np.uint64(2)
_LONGEST = 1e6  # texels: beyond, a footprint is the whole image anyway


class Levels(NamedTuple):
    """Texels (N C,) of all levels, of up to three channels, row by row; sizes (L, 2) height and width, and where each
    level begins (L,)."""

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
def _texel(levels: Levels, i: int, n: int, u: float, v: float) -> tuple[np.float32, np.float32, np.float32]:
    """Level i at a place, in n channels: bilinear, repeating; texels are where their middles are. Not through memory,
    which takes a third of the time more."""
    t, height, width, first = levels.texels, levels.sizes[i, 0], levels.sizes[i, 1], levels.first[i]
    x, y = (u - math.floor(u)) * width - 0.5, (1.0 - (v - math.floor(v))) * height - 0.5
    left, top = math.floor(x), math.floor(y)
    fx, fy = np.float32(x - left), np.float32(y - top)
    x0, y0 = _around(int(left), width), _around(int(top), height)
    x1, y1 = _around(x0 + 1, width), _around(y0 + 1, height)
    upper, lower = first + y0 * width, first + y1 * width
    # Unsigned, so that no index is asked whether it counts from the end.
    a, b = np.uint64(n * (upper + x0)), np.uint64(n * (upper + x1))
    d, e = np.uint64(n * (lower + x0)), np.uint64(n * (lower + x1))
    red = _between(t[a], t[b], t[d], t[e], fx, fy)
    green = blue = np.float32(0.0)
    if n > 1:
        green = _between(t[a + _1], t[b + _1], t[d + _1], t[e + _1], fx, fy)
    if n > 2:
        blue = _between(t[a + _2], t[b + _2], t[d + _2], t[e + _2], fx, fy)
    return red, green, blue


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _between(a: np.float32, b: np.float32, d: np.float32, e: np.float32, fx: np.float32, fy: np.float32) -> np.float32:
    above, below = a + fx * (b - a), d + fx * (e - d)
    return above + fy * (below - above)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _at_depth(levels: Levels, n: int, depth: float, u: float, v: float) -> tuple[np.float32, np.float32, np.float32]:
    """What lies between the two levels around a depth."""
    last = len(levels.sizes) - 1
    depth = min(max(depth, 0.0), float(last))
    lower = min(int(depth), max(last - 1, 0))
    coarser = np.float32(depth - lower)
    red, green, blue = _texel(levels, lower, n, u, v)
    if coarser > 0.0:
        a, b, c = _texel(levels, lower + 1, n, u, v)
        finer = np.float32(1.0) - coarser
        red, green, blue = finer * red + coarser * a, finer * green + coarser * b, finer * blue + coarser * c
    return red, green, blue


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _store(red: np.float32, green: np.float32, blue: np.float32, out: Texels, j: int) -> None:
    out[j, 0] = red
    if out.shape[1] > 1:
        out[j, 1] = green
    if out.shape[1] > 2:
        out[j, 2] = blue


@njit(cache=True, nogil=True, error_model="numpy")
def fill_at(levels: Levels, uv: Floats, depths: Floats, out: Texels) -> None:
    """Fill out (N, C): values at coordinates (N, 2), at depths (N,) into the levels."""
    for j in range(len(uv)):
        red, green, blue = _at_depth(levels, out.shape[1], depths[j], _finite(uv[j, 0]), _finite(uv[j, 1]))
        _store(red, green, blue, out, j)


@njit(cache=True, nogil=True, error_model="numpy")
def fill_over(
    start: int, stop: int, levels: Levels, uv: Floats, across: Floats, down: Floats, most_probes: int, out: Texels
) -> None:
    """Fill out[start:stop] of (N, C): means over pixels at (N, 2) whose sides are across and down (N, 2)."""
    height, width = levels.sizes[0, 0], levels.sizes[0, 1]
    for j in range(start, stop):
        ax, ay = _bounded(across[j, 0] * width), _bounded(across[j, 1] * height)
        bx, by = _bounded(down[j, 0] * width), _bounded(down[j, 1] * height)
        # Of the ellipse with these conjugate diameters, the longer diameter and the lengths of both.
        xx, yy, xy = ax * ax + bx * bx, ay * ay + by * by, ax * ay + bx * by
        spread = math.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
        longer = math.sqrt(max(0.5 * (xx + yy) + spread, 0.0))
        shorter = abs(ax * by - ay * bx) / max(longer, 1e-30)
        twice = 0.5 * (xx - yy) / spread if spread > 0.0 else 1.0  # the cosine of twice the longer one's angle
        du = longer * math.sqrt(max(0.5 + 0.5 * twice, 0.0)) / width
        dv = math.copysign(longer * math.sqrt(max(0.5 - 0.5 * twice, 0.0)), xy) / height
        n = min(max(int(math.ceil(longer / max(shorter, 1.0) - 1e-3)), 1), most_probes)
        wide = max(shorter, longer / most_probes)
        depth = math.log2(wide) if wide > 1.0 else 0.0
        u, v = _finite(uv[j, 0]), _finite(uv[j, 1])
        share, red, green, blue = np.float32(1.0 / n), np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for i in range(n):
            place = (i + 0.5) / n - 0.5
            a, b, c = _at_depth(levels, out.shape[1], depth, u + place * du, v + place * dv)
            red, green, blue = red + share * a, green + share * b, blue + share * c
        _store(red, green, blue, out, j)
