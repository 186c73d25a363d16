"""Compiled painting: see `stroke_painting`."""

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True, error_model="numpy")
def cover(points, low, high, block, dabs, radius, inner, coverage):
    """Raise coverage (N,) to the most of what dabs (D, 6) cover of points (N, 6), places and normals.

    Points stand in blocks, whose bounds are low, high (B, 3). Covered is all within inner, nothing beyond radius, nor
    what faces away from a dab by 120 degrees; what faces it within 90 counts in full, so that edges are painted around.
    """
    for d in range(dabs.shape[0]):
        x, y, z = dabs[d, 0], dabs[d, 1], dabs[d, 2]
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
                facing = points[p, 3] * dabs[d, 3] + points[p, 4] * dabs[d, 4] + points[p, 5] * dabs[d, 5]
                share = _smooth(2.0 * facing + 1.0)
                if squared > inner * inner:
                    share *= _smooth((radius - math.sqrt(squared)) / (radius - inner))
                if share > coverage[p]:
                    coverage[p] = np.float32(share)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _beside(x, low, high, radius):
    return x < low - radius or x > high + radius


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _smooth(x):
    """From 0 to 1 without a corner."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
