"""Compiled: texture coordinates of a picture's samples, and the footprints of pixels on images."""

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
    """The mapping of an object's triangles (K,) to images: a corner (K, 3), its texture coordinates (K, 2), the normal
    (K, 3), of any length, and the gradients of u and v over the triangle's plane (K, 2, 3); first: index of the first
    triangle."""

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
    """Fill rows [start, stop) of uv, left and up (N, 2): the texture coordinates of samples (N,), and their differences
    to rays offset to the left and upwards by the sample's share (R,) of a pixel. The offset rays intersect the plane of
    the sample's own triangle [Igehy99]. part (R,) and source (T,): see `places`; wo (R, 3) points back to the camera at
    eye (3,); axes (3, 3): as in `fill_rays`."""
    middle = np.empty(3)
    # Rays are traced backwards through the camera: from there a step along `axes` leads to the left or upwards.
    back = np.cross(axes[2], axes[1])
    back /= math.sqrt(np.dot(back, back))
    for n in range(start, stop):
        j = which[n]
        k = source[part[j]] - charts.first
        corner, normal = charts.corner[k], charts.normal[k]
        over_u, over_v = charts.gradients[k, 0], charts.gradients[k, 1]
        # Distance from the camera to the plane along the normal, and the ray's component along the view axis.
        height = along = squared = 0.0
        for i in range(3):
            squared += normal[i] * normal[i]
            height += normal[i] * (corner[i] - eye[i])
            along -= back[i] * wo[j, i]
        # A sample that covers a share of the pixel has a footprint of that area: its side is the square root.
        least, side = 1e-9 * math.sqrt(squared), math.sqrt(share[j])
        # Scale the ray so that it ends on the picture's plane, where a step of `axes` is one pixel.
        for i in range(3):
            middle[i] = -wo[j, i] / along
        # Intersect the centre ray (0) and the two offset rays (1, 2) with the plane; evaluate u and v there.
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
    """Fill rows [start, stop) of triangle, u and v (N,), the positions of samples (N,) on the scene's triangles, and
    normals (N, 3), unit, interpolated between the points (S, 3) at the corners by weights (R, 3). part (R,): the
    triangle between points that each sample lies in; source (T,): the scene's triangle that contains it, and within
    (T, 3, 2): u and v of its corners there."""
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
