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

_LONGEST = 1e6  # texels: beyond, a footprint is the whole image anyway


class Levels(NamedTuple):
    """Texels (N C,) of all levels, row by row; sizes (L, 2) height and width, and where each level begins (L,)."""

    texels: Texels
    sizes: Indices
    first: Indices


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _around(i: int, n: int) -> int:
    """An index from −1 to n, of n that repeat."""
    return i + n if i < 0 else (i - n if i >= n else i)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add_level(levels: Levels, i: int, u: float, v: float, share: float, out: Texels, j: int) -> None:
    """Add a share of level i at a place to row j of out (N, C): bilinear, repeating; texels are where their middles
    are."""
    height, width = levels.sizes[i, 0], levels.sizes[i, 1]
    x, y = (u - math.floor(u)) * width - 0.5, (1.0 - (v - math.floor(v))) * height - 0.5
    left, top = math.floor(x), math.floor(y)
    fx, fy = np.float32(x - left), np.float32(y - top)
    x0, y0 = _around(int(left), width), _around(int(top), height)
    x1, y1 = _around(x0 + 1, width), _around(y0 + 1, height)
    n, t = out.shape[1], levels.texels
    upper, lower = levels.first[i] + y0 * width, levels.first[i] + y1 * width
    # Unsigned, so that no index is asked whether it counts from the end.
    a, b = np.uint64(n * (upper + x0)), np.uint64(n * (upper + x1))
    d, e = np.uint64(n * (lower + x0)), np.uint64(n * (lower + x1))
    for c in range(n):
        k = np.uint64(c)
        above = t[a + k] + fx * (t[b + k] - t[a + k])
        below = t[d + k] + fx * (t[e + k] - t[d + k])
        out[j, k] += np.float32(share) * (above + fy * (below - above))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add_depth(levels: Levels, depth: float, u: float, v: float, share: float, out: Texels, j: int) -> None:
    """Add a share of what lies between the two levels around a depth."""
    depth = min(max(depth, 0.0), len(levels.sizes) - 1.0)
    lower = min(int(depth), max(len(levels.sizes) - 2, 0))
    coarser = depth - lower
    if coarser < 1.0:
        _add_level(levels, lower, u, v, share * (1.0 - coarser), out, j)
    if coarser > 0.0:
        _add_level(levels, lower + 1, u, v, share * coarser, out, j)


@njit(cache=True, nogil=True, error_model="numpy")
def fill_at(levels: Levels, uv: Floats, depths: Floats, out: Texels) -> None:
    """Fill out (N, C): values at coordinates (N, 2), at depths (N,) into the levels."""
    out[:] = 0.0
    for j in range(len(uv)):
        _add_depth(levels, depths[j], _finite(uv[j, 0]), _finite(uv[j, 1]), 1.0, out, j)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _finite(coordinate: float) -> float:
    return coordinate if abs(coordinate) < 1e15 else 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bounded(texels: float) -> float:
    """At the horizon of a plane a pixel sees no end of it."""
    if math.isnan(texels):
        return _LONGEST
    return min(max(texels, -_LONGEST), _LONGEST)


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
        for c in range(out.shape[1]):
            out[j, c] = 0.0
        for i in range(n):
            place = (i + 0.5) / n - 0.5
            _add_depth(levels, depth, u + place * du, v + place * dv, 1.0 / n, out, j)
