"""Compiled: where a picture's pixels lie on surfaces, and over which part of an image they reach."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.fast_math import FAST

Floats = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def footprints(
    start: int, stop: int, wo: NDArray[np.float32], share: NDArray[np.float32], triangle: NDArray[np.int64],
    corners: Floats, uvs: Floats, eye: Floats, axes: Floats, uv: Floats, across: Floats, down: Floats,
) -> None:  # fmt: skip
    """Fill rows [start, stop) of uv, across and down (N, 2): texture coordinates of samples, and by how much they
    change over the share (N,) of a pixel, to the right and downwards, as of rays that meet the plane of the sample's
    own triangle [Igehy99]. wo (N, 3), back to the eye (3,); triangle (N,) into corners (K, 3, 3) and uvs (K, 3, 2);
    axes (3, 3) as `fill_rays` takes them."""
    one, two, normal, middle, towards = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    forward = np.cross(axes[2], axes[1])
    forward /= math.sqrt(np.dot(forward, forward))
    for j in range(start, stop):
        k = triangle[j]
        a = corners[k, 0]
        for i in range(3):
            one[i], two[i] = corners[k, 1, i] - a[i], corners[k, 2, i] - a[i]
        for i in range(3):
            i1, i2 = (i + 1) % 3, (i + 2) % 3
            normal[i] = one[i1] * two[i2] - one[i2] * two[i1]
        squared = normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2
        least = 1e-9 * math.sqrt(squared)
        height = along = 0.0
        for i in range(3):
            height += normal[i] * (a[i] - eye[i])
            along -= forward[i] * wo[j, i]
        side = math.sqrt(share[j])
        for i in range(3):
            middle[i] = -wo[j, i] / along
        for way in range(3):
            slope = 0.0
            for i in range(3):
                towards[i] = middle[i] + (side * axes[way, i] if way else 0.0)
                slope += normal[i] * towards[i]
            slope = math.copysign(max(abs(slope), least), slope)
            u, v, far = 0.0, 0.0, height / slope
            for i in range(3):
                i1, i2 = (i + 1) % 3, (i + 2) % 3
                p1 = eye[i1] + far * towards[i1] - a[i1]
                p2 = eye[i2] + far * towards[i2] - a[i2]
                u += normal[i] * (p1 * two[i2] - p2 * two[i1])
                v += normal[i] * (one[i1] * p2 - one[i2] * p1)
            u, v = u / squared, v / squared
            for c in range(2):
                found = (1.0 - u - v) * uvs[k, 0, c] + u * uvs[k, 1, c] + v * uvs[k, 2, c]
                if way == 0:
                    uv[j, c] = found
                elif way == 1:
                    across[j, c] = found - uv[j, c]
                else:
                    down[j, c] = found - uv[j, c]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def places(
    start: int, stop: int, which: NDArray[np.int64], part: NDArray[np.int32], corners: NDArray[np.int32],
    weights: NDArray[np.float32], points: NDArray[np.float32], within: NDArray[np.float32], source: NDArray[np.int32],
    triangle: NDArray[np.int64], u: Floats, v: Floats, normals: Floats,
) -> None:  # fmt: skip
    """Fill rows [start, stop) of triangle, u and v (N,): where samples (N,) lie on the scene's triangles; and normals
    (N, 3), unit, between those of the points (S, 3) at their corners, by weights (R, 3). part (R,): the triangle
    between points that each meets; source (T,): the scene's triangle that this is a part of, within (T, 3, 2)."""
    for n in range(start, stop):
        j = which[n]
        t, squared = part[j], 0.0
        triangle[n], u[n], v[n] = source[t], 0.0, 0.0
        for i in range(3):
            normals[n, i] = 0.0
            for k in range(3):
                normals[n, i] += weights[j, k] * points[corners[j, k], i]
            squared += normals[n, i] * normals[n, i]
            u[n] += weights[j, i] * within[t, i, 0]
            v[n] += weights[j, i] * within[t, i, 1]
        scale = 1.0 / max(math.sqrt(squared), 1e-30)
        for i in range(3):
            normals[n, i] *= scale
