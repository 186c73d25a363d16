"""Compiled: rays through pixels, their hits as corners and weights, interpolation between corners, texture coordinates
of a picture's samples, and the footprints of pixels on images."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._latlong_kernels import between_texels, texels_around
from engine.core.fast_math import FAST
from engine.light._cone_kernels import cone_share

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

Float64Array = NDArray[np.float64]


class PointTriangles(NamedTuple):
    """The triangles between shading points: triangles (T, 2, 3), the points on either side; normal (T, 3) and i_object
    (T,); emission (M, 3), the radiance of each object, and cones (M, 4), into which it is sent."""

    triangles: Int32Array
    normal: Float32Array
    i_object: Int32Array
    emission: Float32Array
    cones: Float32Array


class Samples(NamedTuple):
    """Hits of rays (R,): corners (R, 3), −1 where nothing is reflected, and their weights (R, 3); wo (R, 3), back along
    the ray; emitted (R, 3); i_object (R,), −1 for a miss; behind (R,): the ray sees a side of an object without
    points."""

    corners: Int32Array
    weights: Float32Array
    wo: Float32Array
    emitted: Float32Array
    i_object: Int32Array
    behind: NDArray[np.bool_]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def fill_rays(
    start: int, stop: int, places: NDArray[np.float64], width: int, axes: NDArray[np.float64], directions: Float32Array
) -> None:
    """Fill unit directions [start, stop). axes (3, 3) describe the picture's plane: its upper left corner, one pixel to
    the right, one pixel down. places (R, 2): columns and rows; empty (0, 2) for the centres of all pixels in order."""
    for j in range(start, stop):
        if len(places):
            column, row = places[j, 0], places[j, 1]
        else:
            column, row = j % width + 0.5, j // width + 0.5
        x = axes[0, 0] + column * axes[1, 0] + row * axes[2, 0]
        y = axes[0, 1] + column * axes[1, 1] + row * axes[2, 1]
        z = axes[0, 2] + column * axes[1, 2] + row * axes[2, 2]
        scale = 1.0 / np.sqrt(x * x + y * y + z * z)
        directions[j, 0], directions[j, 1], directions[j, 2] = x * scale, y * scale, z * scale


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def resolve(
    start: int,
    triangle: Int32Array,
    u: Float32Array,
    v: Float32Array,
    directions: Float32Array,
    surface: PointTriangles,
    out: Samples,
) -> None:
    """Fill samples from `start` on with the hits (n,) of rays along directions (n, 3)."""
    for k in range(len(triangle)):
        j, t = start + k, triangle[k]
        # Defaults of a miss.
        for i in range(3):
            out.wo[j, i] = -directions[k, i]
            out.emitted[j, i] = 0.0
        out.corners[j, 0], out.i_object[j], out.behind[j] = -1, -1, False
        if t < 0:
            continue
        i_object = surface.i_object[t]
        out.i_object[j] = i_object
        # Which side the ray hits: 0 if it meets the face from the front. Emitters radiate from their front only.
        along = np.float32(0.0)
        for i in range(3):
            along += surface.normal[t, i] * directions[k, i]
        side = 1 if along > 0.0 else 0
        if side == 0:
            share = cone_share(surface.cones, i_object, directions[k, 0], directions[k, 1], directions[k, 2])
            for i in range(3):
                out.emitted[j, i] = share * surface.emission[i_object, i]
        corners = surface.triangles[t, side]
        # The back has no points, though the front has.
        out.behind[j] = side == 1 and corners[0] < 0 and surface.triangles[t, 0, 0] >= 0
        for i in range(3):
            out.corners[j, i] = corners[i]
        out.weights[j, 0], out.weights[j, 1], out.weights[j, 2] = np.float32(1.0) - u[k] - v[k], u[k], v[k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def mark(start: int, stop: int, corners: Int32Array, seen: NDArray[np.bool_]) -> None:
    """Mark the points that are corners of samples in seen (S,)."""
    for j in range(start, stop):
        if corners[j, 0] >= 0:
            for k in range(3):
                seen[corners[j, k]] = True


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def add_between(
    start: int, stop: int, samples: NDArray[np.int64], corners: Int32Array, weights: Float32Array, values: Float32Array,
    factor: Float32Array, radiance: Float32Array,
) -> None:  # fmt: skip
    """Add values (S, 3), interpolated between each sample's corners, times factor (N or 1, 3) to radiance (R, 3)."""
    several = len(factor) > 1
    for at in range(start, stop):
        j = samples[at]
        a, b, c = corners[j, 0], corners[j, 1], corners[j, 2]
        row = at if several else 0
        for i in range(3):
            between = weights[j, 0] * values[a, i] + weights[j, 1] * values[b, i] + weights[j, 2] * values[c, i]
            radiance[j, i] += factor[row, i] * between


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def add_at(
    start: int, stop: int, samples: NDArray[np.int64], values: Float32Array, factor: Float32Array,
    radiance: Float32Array
) -> None:  # fmt: skip
    """Add values (N, 3) times factor (N or 1, 3) to radiance (R, 3) of samples (N,)."""
    several = len(factor) > 1
    for at in range(start, stop):
        row = at if several else 0
        for i in range(3):
            radiance[samples[at], i] += factor[row, i] * values[at, i]


@njit(cache=True, nogil=True, error_model="numpy")
def by_object(
    i_object: Int32Array, reflects: NDArray[np.bool_], n_objects: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sort the reflecting samples (R,) by object, stably; also return where each object's range begins (M + 1,)."""
    bounds = np.zeros(n_objects + 1, np.int64)
    for j in range(len(i_object)):
        if reflects[j]:
            bounds[i_object[j] + 1] += 1
    bounds = np.cumsum(bounds)
    at, order = bounds.copy(), np.empty(bounds[-1], np.int64)
    for j in range(len(i_object)):
        if reflects[j]:
            order[at[i_object[j]]] = j
            at[i_object[j]] += 1
    return order, bounds


@njit(cache=True, nogil=True, error_model="numpy")
def by_point(
    samples: NDArray[np.int64], corners: Int32Array, n_points: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Group the corners of samples (N,) by point: return the points, where each one's members begin, and the members, 3
    × index within `samples` + corner."""
    counts = np.zeros(n_points + 1, np.int64)
    for at in range(len(samples)):
        for k in range(3):
            counts[corners[samples[at], k]] += 1
    points = np.flatnonzero(counts[:n_points])
    first = np.zeros(len(points) + 1, np.int64)
    for j in range(len(points)):
        first[j + 1] = first[j] + counts[points[j]]
        counts[points[j]] = first[j]
    members = np.empty(3 * len(samples), np.int64)
    for at in range(len(samples)):
        for k in range(3):
            p = corners[samples[at], k]
            members[counts[p]] = 3 * at + k
            counts[p] += 1
    return points, first, members


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def silhouettes(i_object: Int32Array, edges: NDArray[np.bool_]) -> None:
    """Set edges (H, W) where one of the four neighbours shows another object (H, W)."""
    height, width = i_object.shape
    for row in range(height):
        for column in range(width):
            own = i_object[row, column]
            edges[row, column] = (
                (row > 0 and i_object[row - 1, column] != own)
                or (row < height - 1 and i_object[row + 1, column] != own)
                or (column > 0 and i_object[row, column - 1] != own)
                or (column < width - 1 and i_object[row, column + 1] != own)
            )


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def add_background(
    start: int,
    stop: int,
    i_object: Int32Array,
    wo: Float32Array,
    image: Float32Array,
    turn: float,
    scale: float,
    radiance: Float32Array,
) -> None:
    """Add the environment's radiance to samples that miss, as `Environment.evaluate` does."""
    for j in range(start, stop):
        if i_object[j] < 0:
            at = texels_around(image, -wo[j, 0], -wo[j, 1], -wo[j, 2], turn)
            for i in range(3):
                radiance[j, i] += np.float32(scale) * between_texels(image, at, i)


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
    start: int, stop: int, which: NDArray[np.int64], part: NDArray[np.int32], source: NDArray[np.int32],
    wo: Float32Array, share: Float32Array, charts: Charts, camera_position: Float64Array, axes: Float64Array,
    uv: Float64Array, left: Float64Array, up: Float64Array,
) -> None:  # fmt: skip
    """Fill rows [start, stop) of uv, left and up (N, 2): the texture coordinates of samples (N,), and their differences
    to rays offset to the left and upwards by the sample's share (R,) of a pixel. The offset rays intersect the plane of
    the sample's own triangle [Igehy99]. part (R,) and source (T,): see `places`; wo (R, 3) points back to the camera at
    camera_position (3,); axes (3, 3): as in `fill_rays`."""
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
            height += normal[i] * (corner[i] - camera_position[i])
            along -= back[i] * wo[j, i]
        # A sample that covers a share of the pixel has a footprint of that area: its side is the square root.
        least, side = 1e-9 * math.sqrt(squared), math.sqrt(share[j])
        # Scale the ray so that it ends on the picture's plane, where a step of `axes` is one pixel.
        for i in range(3):
            middle[i] = -wo[j, i] / along
        # Intersect the centre ray (0) and the two offset rays (1, 2) with the plane; evaluate u and v there.
        for ray in range(3):
            slope = 0.0
            for i in range(3):
                slope += normal[i] * (middle[i] + (side * axes[ray, i] if ray else 0.0))
            far = height / math.copysign(max(abs(slope), least), slope)
            u, v = charts.uv[k, 0], charts.uv[k, 1]
            for i in range(3):
                place = camera_position[i] + far * (middle[i] + (side * axes[ray, i] if ray else 0.0)) - corner[i]
                u += over_u[i] * place
                v += over_v[i] * place
            if ray == 0:
                uv[n, 0], uv[n, 1] = u, v
            elif ray == 1:
                left[n, 0], left[n, 1] = u - uv[n, 0], v - uv[n, 1]
            else:
                up[n, 0], up[n, 1] = u - uv[n, 0], v - uv[n, 1]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def normals_between(
    start: int, stop: int, which: NDArray[np.int64], corners: Int32Array, weights: Float32Array, normals: Float32Array,
    out: Float32Array,
) -> None:  # fmt: skip
    """Fill out[start:stop] of (N, 3) with the unit normals of samples (N,), between those of points (S, 3)."""
    for n in range(start, stop):
        j = which[n]
        a, b, c = corners[j, 0], corners[j, 1], corners[j, 2]
        squared = np.float32(0.0)
        for i in range(3):
            between = weights[j, 0] * normals[a, i] + weights[j, 1] * normals[b, i] + weights[j, 2] * normals[c, i]
            out[n, i] = between
            squared += between * between
        scale = np.float32(1.0) / max(np.float32(math.sqrt(squared)), np.float32(1e-30))
        for i in range(3):
            out[n, i] *= scale


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
