"""Compiled: look-ups in image pyramids, interpolated between texels and levels, and filtered over pixels of any shape;
painting of strokes (`engine.texture.stroke_painting`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core import lanes
from engine.core.fast_math import FAST

Float64Array = NDArray[np.float64]
Texels = NDArray[np.float32]
Int64Array = NDArray[np.int64]

_LONGEST = 1e6  # texels: beyond, a footprint covers the whole image anyway
_AT_ONCE = 64  # pixels
_ROOT_OF_2 = math.sqrt(2.0)


class Levels(NamedTuple):
    """Texels (N C + 3,) of all levels, of up to three channels, row by row, see `lanes`; sizes (L, 2), height and
    width, and the first texel of each level (L,). Coordinates are rotated, by cosine and sine, and offset before they
    are looked up; wrap_u, wrap_v: 0 repeats, 1 mirrors, 2 extends the edge."""

    texels: Texels
    sizes: Int64Array
    first: Int64Array
    cosine: float
    sine: float
    offset_u: float
    offset_v: float
    wrap_u: int
    wrap_v: int


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _within(coordinate: float, wrap: int) -> float:
    """Map a coordinate to [0, 1]."""
    if wrap == 2:
        return min(max(coordinate, 0.0), 1.0)
    if wrap == 1:
        half = 0.5 * coordinate
        return 1.0 - abs(2.0 * (half - math.floor(half)) - 1.0)
    return coordinate - math.floor(coordinate)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _around(i: int, n: int, wrap: int) -> int:
    """The index of a texel, from −1 to n, of n."""
    if wrap > 0:
        return min(max(i, 0), n - 1)
    return i + n if i < 0 else (i - n if i >= n else i)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _finite(coordinate: float) -> float:
    """Replace coordinates that are not finite, or huge, by 0."""
    return coordinate if abs(coordinate) < 1e15 else 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bounded(texels: float) -> float:
    """Clamp: at the horizon of a plane a footprint is infinite."""
    if math.isnan(texels):
        return _LONGEST
    return min(max(texels, -_LONGEST), _LONGEST)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _turned(levels: Levels, u: float, v: float):  # type: ignore[no-untyped-def]
    """Rotate a step or a position on the image counter-clockwise about (0, 0)."""
    if levels.sine == 0.0 and levels.cosine == 1.0:
        return u, v
    return levels.cosine * u - levels.sine * v, levels.sine * u + levels.cosine * v


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _texel(levels: Levels, i: int, n: int, u: float, v: float):  # type: ignore[no-untyped-def]
    """Level i at a position, in n channels, as lanes: bilinear between texels' centres."""
    t, height, width, first = levels.texels, levels.sizes[i, 0], levels.sizes[i, 1], levels.first[i]
    x, y = _within(u, levels.wrap_u) * width + 0.5, (1.0 - _within(v, levels.wrap_v)) * height + 0.5
    x1, y1 = int(x), int(y)  # rounded down, as neither is negative
    right, down = lanes.even(np.float32(x - x1)), lanes.even(np.float32(y - y1))
    x0, y0 = _around(x1 - 1, width, levels.wrap_u), _around(y1 - 1, height, levels.wrap_v)
    x1, y1 = _around(x1, width, levels.wrap_u), _around(y1, height, levels.wrap_v)
    upper, lower = first + y0 * width, first + y1 * width
    above, below = lanes.floats(t, n * (upper + x0)), lanes.floats(t, n * (lower + x0))
    above = lanes.plus_product(above, right, lanes.minus(lanes.floats(t, n * (upper + x1)), above))
    below = lanes.plus_product(below, right, lanes.minus(lanes.floats(t, n * (lower + x1)), below))
    return lanes.plus_product(above, down, lanes.minus(below, above))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _at_depth(levels: Levels, n: int, depth: float, u: float, v: float):  # type: ignore[no-untyped-def]
    """Interpolate between the two levels around a depth."""
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
def fill_at(levels: Levels, uv: Float64Array, depths: Float64Array, out: Texels) -> None:
    """Fill out (N, C) with values at coordinates (N, 2) and depths (N,) in the levels."""
    four = np.empty(4, np.float32)
    for j in range(len(uv)):
        u, v = _turned(levels, uv[j, 0], uv[j, 1])
        u, v = _finite(u + levels.offset_u), _finite(v + levels.offset_v)
        found = _at_depth(levels, out.shape[1], depths[j], u, v)
        lanes.store(four, 0, found)
        for channel in range(out.shape[1]):
            out[j, channel] = four[channel]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _find_footprints(
    start: int, count: int, levels: Levels, uv: Float64Array, across: Float64Array, down: Float64Array,
    repeats: tuple[float, float],
    most_probes: int, out: Float64Array,
) -> None:  # fmt: skip
    """Fill the first `count` columns of out (6, M) with the footprints of pixels from `start` on, see `fill_over`: u
    and v of the centre; the major axis of the footprint's ellipse along u and v; the width of a probe in texels, which
    is the minor axis or more; and the number of probes, major axis over minor axis. Without branches, so that it
    vectorizes."""
    height, width = levels.sizes[0, 0], levels.sizes[0, 1]
    cosine, sine, (times_u, times_v) = levels.cosine, levels.sine, repeats
    for k in range(count):
        j = start + k
        # The pixel's sides in texels of the finest level.
        right_u, right_v, down_u, down_v = across[j, 0], across[j, 1], down[j, 0], down[j, 1]
        right_u, right_v, down_u, down_v = right_u * times_u, right_v * times_v, down_u * times_u, down_v * times_v
        ax, ay = (cosine * right_u - sine * right_v) * width, (sine * right_u + cosine * right_v) * height
        bx, by = (cosine * down_u - sine * down_v) * width, (sine * down_u + cosine * down_v) * height
        ax, ay, bx, by = _bounded(ax), _bounded(ay), _bounded(bx), _bounded(by)
        # The ellipse with these conjugate diameters: its major axis, and the lengths of both.
        xx, yy, xy = ax * ax + bx * bx, ay * ay + by * by, ax * ay + bx * by
        half = 0.5 * (xx - yy)
        spread = math.sqrt(half * half + xy * xy)
        longer = math.sqrt(max(0.5 * (xx + yy) + spread, 0.0))
        shorter = abs(ax * by - ay * bx) / max(longer, 1e-30)
        twice = half / spread if spread > 0.0 else 1.0  # the cosine of twice the major axis' angle
        # Rotate and offset the centre; half-angle formulas give the major axis' direction.
        u, v = uv[j, 0] * times_u, uv[j, 1] * times_v
        out[0, k] = cosine * u - sine * v + levels.offset_u
        out[1, k] = sine * u + cosine * v + levels.offset_v
        out[2, k] = longer * math.sqrt(max(0.5 + 0.5 * twice, 0.0)) / width
        out[3, k] = math.copysign(longer * math.sqrt(max(0.5 - 0.5 * twice, 0.0)), xy) / height
        # As in Feline [McCormack99]: probes as wide as the minor axis, wider if there would be too many.
        out[4, k] = max(shorter, longer / most_probes)
        out[5, k] = longer / max(shorter, 1.0)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _nearest_level(wide: float, n_levels: int) -> int:
    """The level whose texels are closest to this width in texels of the finest, on a logarithmic scale."""
    level, limit = 0, _ROOT_OF_2
    while wide >= limit and level < n_levels - 1:
        level += 1
        limit *= 2.0
    return level


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def fill_over(
    start: int, stop: int, levels: Levels, uv: Float64Array, across: Float64Array, down: Float64Array,
    repeats: tuple[float, float],
    most_probes: int, is_quick: bool, out: Texels,
) -> None:  # fmt: skip
    """Fill out[start:stop] of (N, C) with means over pixels at (N, 2) whose sides are across and down (N, 2), all
    multiplied by repeats; is_quick: from one level, without interpolation between two."""
    four, found = np.empty(4, np.float32), np.empty((6, _AT_ONCE))
    for begin in range(start, stop, _AT_ONCE):
        count = min(_AT_ONCE, stop - begin)
        _find_footprints(begin, count, levels, uv, across, down, repeats, most_probes, found)
        for k in range(count):
            u, v, du, dv, wide = _finite(found[0, k]), _finite(found[1, k]), found[2, k], found[3, k], found[4, k]
            # Number of probes along the major axis, equally weighted [McCormack99].
            n = min(max(int(math.ceil(found[5, k] - 1e-3)), 1), most_probes)
            step = 1.0 / n
            share, total = lanes.even(np.float32(step)), lanes.zeros()
            if is_quick:
                level = _nearest_level(wide, len(levels.sizes))
                for i in range(n):
                    place = (i + 0.5) * step - 0.5
                    texel = _texel(levels, level, out.shape[1], u + place * du, v + place * dv)
                    total = lanes.plus_product(total, share, texel)
            else:
                # The level whose texels have the width of a probe.
                depth = math.log2(wide) if wide > 1.0 else 0.0
                for i in range(n):
                    place = (i + 0.5) * step - 0.5
                    texel = _at_depth(levels, out.shape[1], depth, u + place * du, v + place * dv)
                    total = lanes.plus_product(total, share, texel)
            lanes.store(four, 0, total)
            for channel in range(out.shape[1]):
                out[begin + k, channel] = four[channel]


@njit(cache=True, nogil=True, error_model="numpy")
def cover(
    points: NDArray[np.float32], low: NDArray[np.float32], high: NDArray[np.float32], block: int,
    dabs: NDArray[np.float32], radius: float, inner: float, coverage: NDArray[np.float32],
) -> None:  # fmt: skip
    """Raise coverage (N,) to the maximum over dabs (D, 6) of how they cover points (N, 6), each a position and a
    normal.

    Points come in blocks with bounds low, high (B, 3). Coverage is 1 within inner and 0 beyond radius, and 0 for
    normals more than 120 degrees away from the dab's; up to 90 degrees they count in full, so that edges are painted
    around.
    """
    for d in range(dabs.shape[0]):
        x, y, z = dabs[d, 0], dabs[d, 1], dabs[d, 2]
        # Skip blocks that the dab's ball does not touch.
        for b in range(low.shape[0]):
            if _beside(x, low[b, 0], high[b, 0], radius) or _beside(y, low[b, 1], high[b, 1], radius):
                continue
            if _beside(z, low[b, 2], high[b, 2], radius):
                continue
            for p in range(b * block, min((b + 1) * block, points.shape[0])):
                dx, dy, dz = points[p, 0] - x, points[p, 1] - y, points[p, 2] - z
                squared = dx * dx + dy * dy + dz * dz
                if squared >= radius * radius:
                    continue
                # Falloff by the normals: smooth step from cosine −1/2 to 0.
                facing = points[p, 3] * dabs[d, 3] + points[p, 4] * dabs[d, 4] + points[p, 5] * dabs[d, 5]
                share = _smooth(2.0 * facing + 1.0)
                # Falloff by distance, between the inner radius and the radius.
                if squared > inner * inner:
                    share *= _smooth((radius - math.sqrt(squared)) / (radius - inner))
                if share > coverage[p]:
                    coverage[p] = np.float32(share)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _beside(x: float, low: float, high: float, radius: float) -> bool:
    """Whether x is further than radius from the interval."""
    return x < low - radius or x > high + radius


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _smooth(x: float) -> float:
    """Smooth step from 0 to 1."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
