"""Compiled painting: see `stroke_painting`."""

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True, error_model="numpy")
def cover(points, low, high, block, dabs, radius, inner, coverage):
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


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _beside(x, low, high, radius):
    """Whether x is further than radius from the interval."""
    return x < low - radius or x > high + radius


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _smooth(x):
    """Smooth step from 0 to 1."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
