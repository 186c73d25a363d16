"""Compiled: where a picture's pixels lie on surfaces, and over which part of an image they reach."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST

Float64Array = NDArray[np.float64]
Wides = NDArray[np.float32]


class Charts(NamedTuple):
    """How an object's triangles (K,) lie on images: a corner (K, 3), its texture coordinates (K, 2), the normal (K, 3),
    of any length, and over the triangle's plane the gradients of u and v (K, 2, 3); first: the first one's number."""

    corner: Float64Array
    uv: Float64Array
    normal: Float64Array
    gradients: Float64Array
    first: int


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def footprints(
    start: int, stop: int, which: NDArray[np.int64], part: NDArray[np.int32], source: NDArray[np.int32], wo: Wides,
    share: Wides, charts: Charts, eye: Float64Array, axes: Float64Array, uv: Float64Array, left: Float64Array,
    up: Float64Array,
) -> None:  # fmt: skip
    """Fill rows [start, stop) of uv, left and up (N, 2): texture coordinates of samples (N,), and by how much they
    change over the share (R,) of a pixel, to the left and upwards, as of rays that meet the plane of the sample's own
    triangle [Igehy99]. part (R,) and source (T,): see `places`; wo (R, 3), back to the eye (3,); axes (3, 3) as
    `fill_rays` takes them."""
    middle = np.empty(3)
    # Rays are taken backwards through the eye: from there a step of `axes` leads to the left or upwards.
    back = np.cross(axes[2], axes[1])
    back /= math.sqrt(np.dot(back, back))
    for n in range(start, stop):
        j = which[n]
        k = source[part[j]] - charts.first
        corner, normal = charts.corner[k], charts.normal[k]
        over_u, over_v = charts.gradients[k, 0], charts.gradients[k, 1]
        height = along = squared = 0.0
        for i in range(3):
            squared += normal[i] * normal[i]
            height += normal[i] * (corner[i] - eye[i])
            along -= back[i] * wo[j, i]
        least, side = 1e-9 * math.sqrt(squared), math.sqrt(share[j])
        for i in range(3):
            middle[i] = -wo[j, i] / along
        for way in range(3):
            slope = 0.0
            for i in range(3):
                slope += normal[i] * (middle[i] + (side * axes[way, i] if way else 0.0))
            far = height / math.copysign(max(abs(slope), least), slope)
            u, v = charts.uv[k, 0], charts.uv[k, 1]
            for i in range(3):
                place = eye[i] + far * (middle[i] + (side * axes[way, i] if way else 0.0)) - corner[i]
                u += over_u[i] * place
                v += over_v[i] * place
            if way == 0:
                uv[n, 0], uv[n, 1] = u, v
            elif way == 1:
                left[n, 0], left[n, 1] = u - uv[n, 0], v - uv[n, 1]
            else:
                up[n, 0], up[n, 1] = u - uv[n, 0], v - uv[n, 1]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def places(
    start: int, stop: int, which: NDArray[np.int64], part: NDArray[np.int32], corners: NDArray[np.int32],
    weights: NDArray[np.float32], points: NDArray[np.float32], within: NDArray[np.float32], source: NDArray[np.int32],
    triangle: NDArray[np.int64], u: Float64Array, v: Float64Array, normals: Float64Array,
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
