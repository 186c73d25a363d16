"""Compiled: offsets of normals by bumps."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
_TINY = 1e-30


@njit(cache=True, nogil=True, error_model="numpy")
def fill_normal_offsets(
    triangle: NDArray[np.int64], u: Float64Array, v: Float64Array, slopes: NDArray[np.float32], gradients: Float64Array,
    tangents: Float64Array, hands: Float64Array, scale: float, repeats: Float64Array, faces: NDArray[np.float32],
    wo: Float64Array,
    normals: Float64Array, out: Float64Array,
) -> None:  # fmt: skip
    """Fill out (P, 3) with −scale × slopes (P, 2) along the gradients of u and v (t, 2, 3), at points on an object's
    triangles (P,); or, if there are tangents at corners (t, 3, 3), along these and their bitangents, on the side of
    hands (t,). Components along the normals (P, 3) are removed."""
    along = np.empty((2, 3))
    for j in range(len(triangle)):
        k = triangle[j]
        n, face = normals[j], faces[k]
        # On the back the slopes have the opposite sign.
        side = -1.0 if face[0] * wo[j, 0] + face[1] * wo[j, 1] + face[2] * wo[j, 2] < 0.0 else 1.0
        # Normal map: the interpolated tangent, and the bitangent hand × n × t [Mikkelsen08].
        if len(tangents):
            _tangents_between(tangents[k], 1.0 - u[j] - v[j], u[j], v[j], n, along[0])
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                along[1, i] = hands[k] * side * (n[a] * along[0, b] - n[b] * along[0, a])
        # Negative gradient of the heights; a normal map's slopes do not grow with the repeats, but mirrored images turn
        # their sign.
        p, q = -scale * side * slopes[j, 0], -scale * side * slopes[j, 1]
        if len(tangents):
            p, q = math.copysign(1.0, repeats[0]) * p, math.copysign(1.0, repeats[1]) * q
        else:
            p, q = repeats[0] * p, repeats[1] * q
            for i in range(3):  # by component: for whole rows the compiler generates error messages
                along[0, i], along[1, i] = gradients[k, 0, i], gradients[k, 1, i]
        x, y, z = (p * along[0, 0] + q * along[1, 0], p * along[0, 1] + q * along[1, 1],
                   p * along[0, 2] + q * along[1, 2])  # fmt: skip
        # Project onto the plane perpendicular to the normal.
        upwards = x * n[0] + y * n[1] + z * n[2]
        out[j, 0], out[j, 1], out[j, 2] = x - upwards * n[0], y - upwards * n[1], z - upwards * n[2]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _tangents_between(
    corners: Float64Array, first: float, second: float, third: float, normal: Float64Array, out: Float64Array
) -> None:
    """Interpolate the tangents of three corners, perpendicular to a normal, unit."""
    along = 0.0
    for i in range(3):
        out[i] = first * corners[0, i] + second * corners[1, i] + third * corners[2, i]
        along += out[i] * normal[i]
    for i in range(3):
        out[i] -= along * normal[i]
    length = max(math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2), _TINY)
    for i in range(3):
        out[i] /= length
