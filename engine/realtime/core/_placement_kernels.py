"""Compiled: how near samples of a scene's surfaces are to the open side of triangles.

The measure is the radius of the smallest ball that touches a triangle from above, in its middle, and contains a sample.
With the offset d of a sample from there, a unit normal n and a slack s, |r n - d| < r - s where
r > (d² - s²) / (2 (d·n - s)): so a tree of boxes that bound d² from below and d·n from above finds it in one descent.
Kernels never validate: `engine.realtime.core.shading_points` does.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

_SLACK = 1e-3  # of a triangle's longest edge
_MOST_LEVELS = 40


@njit(cache=True, nogil=True, error_model="numpy")
def nearness_range(
    start: int, stop: int, places: Float64Array, normals: Float64Array, lengths: Float64Array, boxes: Float64Array,
    samples: Float64Array, halvings: int, found: Float64Array,
) -> None:  # fmt: skip
    """Fill found[start:stop] with the longest edges of triangles, lengths (N,), over the radii of balls that touch them
    at places (N, 3) with unit normals (N, 3): 1 below the length itself, halved each time it doubles, 0 after so many
    halvings.

    boxes (2 L - 1, 2, 3): minimum and maximum of the nodes of a binary tree, the children of node k in 2 k + 1 and
    2 k + 2; samples (L, K, 3): those in each leaf.
    """
    n_inner = len(samples) - 1
    stack, bounds = np.empty(_MOST_LEVELS, np.int64), np.empty(_MOST_LEVELS)
    for t in range(start, stop):
        x, y, z = places[t, 0], places[t, 1], places[t, 2]
        a, b, c = normals[t, 0], normals[t, 1], normals[t, 2]
        slack, step = _SLACK * lengths[t], 0
        # A ball of this radius is known to contain a sample, or is the largest that counts.
        radius, has_found = lengths[t] * 2.0**halvings, False
        stack[0], bounds[0], depth = 0, _least(boxes[0], x, y, z, a, b, c, slack), 1
        while depth and radius > 0.0:
            depth -= 1
            k = stack[depth]
            if not bounds[depth] < radius:
                continue
            if k < n_inner:
                # The child that may have the nearer sample comes first.
                near, far = 2 * k + 1, 2 * k + 2
                nearest, farther = (
                    _least(boxes[near], x, y, z, a, b, c, slack),
                    _least(boxes[far], x, y, z, a, b, c, slack),
                )
                if farther < nearest:
                    near, far, nearest, farther = far, near, farther, nearest
                if farther < radius:
                    stack[depth], bounds[depth] = far, farther
                    depth += 1
                if nearest < radius:
                    stack[depth], bounds[depth] = near, nearest
                    depth += 1
                continue
            for sample in samples[k - n_inner]:
                dx, dy, dz = sample[0] - x, sample[1] - y, sample[2] - z
                above = a * dx + b * dy + c * dz - slack
                if above > 0.0 and dx * dx + dy * dy + dz * dz - slack * slack < 2.0 * radius * above:
                    # Which halving the sample belongs to; only nearer ones matter from now on.
                    own = (dx * dx + dy * dy + dz * dz - slack * slack) / (2.0 * above)
                    if not has_found:
                        step, has_found = halvings, True
                    while step > 0 and own < lengths[t] * 2.0 ** (step - 1):
                        step -= 1
                    radius = lengths[t] * 2.0 ** (step - 1) if step > 0 else 0.0
        found[t] = 2.0**-step if has_found else 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _least(
    box: Float64Array, x: float, y: float, z: float, a: float, b: float, c: float, slack: float
) -> float:  # fmt: skip
    """A lower bound of the radii for the samples in a box (2, 3)."""
    # The highest corner along the normal, and the squared distance of the box.
    above = -slack
    above += a * ((box[1, 0] if a > 0.0 else box[0, 0]) - x)
    above += b * ((box[1, 1] if b > 0.0 else box[0, 1]) - y)
    above += c * ((box[1, 2] if c > 0.0 else box[0, 2]) - z)
    if above <= 0.0:
        return np.inf
    dx = max(box[0, 0] - x, x - box[1, 0], 0.0)
    dy = max(box[0, 1] - y, y - box[1, 1], 0.0)
    dz = max(box[0, 2] - z, z - box[1, 2], 0.0)
    return (dx * dx + dy * dy + dz * dz - slack * slack) / (2.0 * above)
