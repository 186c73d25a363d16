"""Compiled: offsets of normals by bumps (`bump_normals`); pixels at edges, and the grouping of rays through them that
share a point (`edges`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._angle_kernels import arc_tangent

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
_TINY = 1e-30
# Points further off each other's plane than the sine of 15° are not on one surface; above 1: any two points are.
SAME_PLANE, ANY_PLANE = np.float32(0.259), np.float32(2.0)


@njit(cache=True, nogil=True, error_model="numpy")
def fill_normal_offsets(
    triangle: NDArray[np.int64], u: Float64Array, v: Float64Array, slopes: Float32Array, gradients: Float64Array,
    tangents: Float64Array, handedness: Float64Array, scale: float, repeats: Float64Array, faces: Float32Array,
    wo: Float64Array,
    normals: Float64Array, out: Float64Array,
) -> None:  # fmt: skip
    """Fill out (P, 3) with −scale × slopes (P, 2) along the gradients of u and v (t, 2, 3), at points on an object's
    triangles (P,); or, if there are tangents at corners (t, 3, 3), along these and their bitangents, on the side of
    handedness (t,). Components along the normals (P, 3) are removed."""
    along = np.empty((2, 3))
    for j in range(len(triangle)):
        k = triangle[j]
        n, face = normals[j], faces[k]
        # On the back the slopes have the opposite sign.
        side = -1.0 if face[0] * wo[j, 0] + face[1] * wo[j, 1] + face[2] * wo[j, 2] < 0.0 else 1.0
        # Normal map: the interpolated tangent, and the bitangent handedness × n × t [Mikkelsen08].
        if len(tangents):
            _tangents_between(tangents[k], 1.0 - u[j] - v[j], u[j], v[j], n, along[0])
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                along[1, i] = handedness[k] * side * (n[a] * along[0, b] - n[b] * along[0, a])
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


@njit(cache=True, nogil=True, error_model="numpy")
def fill_offset_normals(
    normals: Float64Array, offsets: Float64Array, wo: Float64Array, least_cosine: float, out: Float64Array
) -> None:
    """Fill out (P, 3) with normals (P, 3) that lean by offsets (P, 3), as far as wo (P, 3) allows, see
    `bump_normals.offset_normals`."""
    for j in range(len(normals)):
        n, lean = normals[j], offsets[j]
        slope = math.sqrt(lean[0] * lean[0] + lean[1] * lean[1] + lean[2] * lean[2])
        if not slope > 0.0:
            for i in range(3):
                out[j, i] = n[i]
            continue
        scale = 1.0 / max(slope, _TINY)
        high = n[0] * wo[j, 0] + n[1] * wo[j, 1] + n[2] * wo[j, 2]
        beside = scale * (lean[0] * wo[j, 0] + lean[1] * wo[j, 1] + lean[2] * wo[j, 2])
        # The angle at which the mirror direction of wo grazes the surface.
        cosine = min(least_cosine, 0.9 * high) / max(math.sqrt(high * high + beside * beside), _TINY)
        cosine = min(max(cosine, -1.0), 1.0)
        most = 0.5 * (arc_tangent(beside, high) + arc_tangent(math.sqrt(1.0 - cosine * cosine), cosine))
        angle = min(arc_tangent(slope, 1.0), max(most, 0.0))
        c, s = math.cos(angle), scale * math.sin(angle)
        x, y, z = c * n[0] + s * lean[0], c * n[1] + s * lean[1], c * n[2] + s * lean[2]
        length = math.sqrt(x * x + y * y + z * z)
        out[j, 0], out[j, 1], out[j, 2] = x / length, y / length, z / length


@njit(cache=True, nogil=True, error_model="numpy")
def fill_tangents(axes: Float64Array, ids: NDArray[np.int64], normals: Float64Array, out: Float64Array) -> None:
    """Fill out (P, 3) with the tangents at normals (P, 3) of objects (P,), whose axes (M, 3, 3) begin with X and Y, see
    `primary_hits.object_tangents`."""
    for j in range(len(normals)):
        n, x, y = normals[j], axes[ids[j], 0], axes[ids[j], 1]
        a, b, c = y[1] * n[2] - y[2] * n[1], y[2] * n[0] - y[0] * n[2], y[0] * n[1] - y[1] * n[0]
        if not math.sqrt(a * a + b * b + c * c) > 1e-4:
            along = x[0] * n[0] + x[1] * n[1] + x[2] * n[2]
            a, b, c = x[0] - along * n[0], x[1] - along * n[1], x[2] - along * n[2]
        length = math.sqrt(a * a + b * b + c * c)
        out[j, 0], out[j, 1], out[j, 2] = a / length, b / length, c / length


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _alike(
    a: np.ndarray, b: np.ndarray, normal_a: np.ndarray, normal_b: np.ndarray, least: np.float32, plane: np.float32,
) -> np.bool_:  # fmt: skip
    """Whether two points may be merged: similar normals, and neither is off the other's plane."""
    cosine, length2, off_a, off_b = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for k in range(3):
        step = b[k] - a[k]
        cosine += normal_a[k] * normal_b[k]
        length2 += step * step
        off_a += step * normal_a[k]
        off_b += step * normal_b[k]
    far = plane * plane * length2
    return cosine >= least and off_a * off_a <= far and off_b * off_b <= far


@njit(cache=True, nogil=True, error_model="numpy")
def mark_edges(
    seen: np.ndarray, ids: np.ndarray, position: np.ndarray, normal: np.ndarray, least: np.float32,
    edge: np.ndarray,
) -> None:  # fmt: skip
    """Set edge (H, W) where a pixel and one of its neighbours see different objects, normals that turn, or a break."""
    height, width = seen.shape
    for y in range(height):
        for x in range(width):
            for step in range(4):
                v, u = y + (step > 0), x + (1, -1, 0, 1)[step]
                if v >= height or u < 0 or u >= width:
                    continue
                differs = seen[y, x] != seen[v, u]
                if not differs and ids[y, x] >= 0:
                    differs = not _alike(position[y, x], position[v, u], normal[y, x], normal[v, u], least, SAME_PLANE)
                if differs:
                    edge[y, x] = True
                    edge[v, u] = True


@njit(cache=True, nogil=True, error_model="numpy")
def group(
    ids: np.ndarray, position: np.ndarray, normal: np.ndarray, places: np.ndarray, least: np.float32, plane: np.float32,
    leader: np.ndarray, share: np.ndarray,
) -> None:  # fmt: skip
    """Group samples (F, n) that may share a point: leader (F, n) is the most central one of each group, −1 without a
    hit; share (F, n) is the part of the pixel's rays, the centre excluded, that each leader represents."""
    n = ids.shape[1]
    for f in range(ids.shape[0]):
        for k in range(n):
            leader[f, k] = k if ids[f, k] >= 0 else -1
            # Join the first earlier leader of the same object that is alike.
            for g in range(k):
                if ids[f, k] >= 0 and leader[f, g] == g and ids[f, g] == ids[f, k]:
                    if _alike(position[f, g], position[f, k], normal[f, g], normal[f, k], least, plane):
                        leader[f, k] = g
                        break
        _lead_from_the_middle(leader[f], places)
        share[f] = np.float32(0.0)
        # Shares count the n - 1 rays, not the centre.
        for k in range(1, n):
            if leader[f, k] >= 0:
                share[f, leader[f, k]] += np.float32(1.0 / (n - 1))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _lead_from_the_middle(leader: np.ndarray, places: np.ndarray) -> None:
    """Within each group that shares a point, make the ray nearest to the group's mean the leader; the centre's group
    keeps the centre."""
    n = leader.shape[0]
    for g in range(1, n):
        if leader[g] != g:
            continue
        x, y, count = np.float32(0.0), np.float32(0.0), 0
        for k in range(g, n):
            if leader[k] == g:
                x, y, count = x + places[k, 0], y + places[k, 1], count + 1
        best, closest = g, np.float32(np.inf)
        for k in range(g, n):
            if leader[k] == g:
                dx, dy = places[k, 0] - x / count, places[k, 1] - y / count
                if dx * dx + dy * dy < closest:
                    best, closest = k, dx * dx + dy * dy
        if best != g:
            for k in range(g, n):
                if leader[k] == g:
                    leader[k] = n + best  # not visited again
    for k in range(n):
        if leader[k] >= n:
            leader[k] -= n


@njit(cache=True, nogil=True, error_model="numpy")
def find_nearest(
    rows: np.ndarray, pixel: np.ndarray, offset: np.ndarray, objects: np.ndarray, position: np.ndarray,
    normal: np.ndarray, row_image: np.ndarray, least_alike: np.ndarray, nearest: np.ndarray,
) -> None:  # fmt: skip
    """Set nearest (X,) to the closest point at a pixel centre around each of rows (X,), on the same surface."""
    height, width = row_image.shape
    for i in range(rows.shape[0]):
        r = rows[i]
        y, x = pixel[r] // width, pixel[r] % width
        closest = np.float32(np.inf)
        for v in range(max(y - 1, 0), min(y + 2, height)):
            for u in range(max(x - 1, 0), min(x + 2, width)):
                s = row_image[v, u]
                dx, dy = np.float32(u - x) - offset[r, 0], np.float32(v - y) - offset[r, 1]
                far = dx * dx + dy * dy
                if s >= 0 and objects[s] == objects[r] and far < closest:
                    if _alike(position[r], position[s], normal[r], normal[s], least_alike[objects[r]], SAME_PLANE):
                        nearest[i], closest = s, far
