"""Compiled: triangles to pixels, and pixels to radiance.

A pixel's ray is linear in column and row. So are the barycentric coordinates of a triangle along it, divided by the
distance: homogeneous rasterization needs no division, and no clipping where a triangle extends behind the camera
[Olano97]. Kernels never validate: `engine.realtime.core.raster` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._latlong_kernels import between_texels, texel_place, texels_at
from engine.core.fast_math import FAST
from engine.light._cone_kernels import cone_share

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

_NEAR = 1e-6  # depth, in units of depth 1, below which a corner has no projection
_EDGE = -1e-6  # share of a triangle by which it reaches beyond its edges, so that none opens between two
_AT_ONCE = 64  # triangles that are set up together


@njit(cache=True, nogil=True, error_model="numpy")
def fill_triangles(
    start: int, stop: int, places: Float32Array, corners: Int32Array, is_shown: NDArray[np.bool_],
    camera_position: Float64Array, plane: Float64Array, view: Float64Array, found: Int32Array, edges: Float32Array,
) -> None:  # fmt: skip
    """Draw triangles [start, stop), of corners (T, 3) over places (V, 3), where they are nearer than what is drawn
    already: found (H, W), and edges (3, H, W), the sum of the edge functions, which is 1 / distance in lengths of the
    pixel's direction and 0 where nothing is drawn, and those of the second and third corner. is_shown (T, 2): whether a
    triangle is drawn where its front, and where its back is seen.

    plane (3, 3): the direction of the upper left corner, a column, a row; view (3, 3): rows that map a direction to
    column and row times depth, and depth.
    """
    height, width = found.shape
    p, projected = np.empty((9, _AT_ONCE)), np.empty((9, _AT_ONCE))
    e, box, determinant = np.empty((9, _AT_ONCE)), np.empty((4, _AT_ONCE)), np.empty(_AT_ONCE)
    for first in range(start, stop, _AT_ONCE):
        n = min(_AT_ONCE, stop - first)
        _set_up_some(first, n, places, corners, camera_position, plane, view, p, projected, e, box, determinant)
        for j in range(n):
            t, left, right, top, bottom = first + j, box[0, j], box[1, j], box[2, j], box[3, j]
            depths = projected[2, j], projected[5, j], projected[8, j]
            if not min(depths[0], min(depths[1], depths[2])) > _NEAR:
                if not max(depths[0], max(depths[1], depths[2])) > _NEAR:
                    continue
                left, right, top, bottom = _clipped_box(projected[:, j])
            left, right = max(left, 0.0), min(right, width - 1.0)
            top, bottom = max(top, 0.0), min(bottom, height - 1.0)
            if not (left <= right and top <= bottom):
                continue
            # Its sign tells the visible side.
            if determinant[j] == 0.0 or not is_shown[t, 1 if determinant[j] > 0.0 else 0]:
                continue
            for row in range(int(top), int(bottom) + 1):
                y = row + 0.5
                a0, b0, c0 = e[0, j] + y * e[2, j], e[3, j] + y * e[5, j], e[6, j] + y * e[8, j]
                for column in range(int(left), int(right) + 1):
                    x = column + 0.5
                    a, b, c = a0 + x * e[1, j], b0 + x * e[4, j], c0 + x * e[7, j]
                    total = a + b + c
                    edge = _EDGE * total
                    # One test of all, as each alone is hard to predict.
                    if (total > edges[0, row, column]) & (min(a, min(b, c)) >= edge):
                        found[row, column], edges[0, row, column] = t, total
                        edges[1, row, column], edges[2, row, column] = b, c


@njit(cache=True, nogil=True, error_model="numpy")
def _set_up_some(
    first: int, n: int, places: Float32Array, corners: Int32Array, camera_position: Float64Array, plane: Float64Array,
    view: Float64Array, p: Float64Array, projected: Float64Array, e: Float64Array, box: Float64Array,
    determinant: Float64Array,
) -> None:  # fmt: skip
    """Set up the n triangles from the first, of corners (T, 3) over places (V, 3); loops over them vectorize.

    Fill, for up to N triangles, p (9, N): their corners relative to the camera; projected (9, N): column and row times
    depth, and depth of each corner; box (4, N): first and last column, first and last row whose centres a triangle
    before the camera covers; determinant (N,); e (9, N): see `set_up`.
    """
    for j in range(n):
        for k in range(3):
            for i in range(3):
                p[3 * k + i, j] = places[corners[first + j, k], i] - camera_position[i]
    for k in range(0, 9, 3):
        for i in range(3):
            for j in range(n):
                projected[k + i, j] = view[i, 0] * p[k, j] + view[i, 1] * p[k + 1, j] + view[i, 2] * p[k + 2, j]
    for i in range(2):
        for j in range(n):
            a, b, c = (
                projected[i, j] / projected[2, j],
                projected[3 + i, j] / projected[5, j],
                projected[6 + i, j] / projected[8, j],
            )
            box[2 * i, j] = math.ceil(min(a, min(b, c)) - 0.5)
            box[2 * i + 1, j] = math.floor(max(a, max(b, c)) - 0.5)
    # Six times the signed volume of the tetrahedron with the camera [Olano97].
    for j in range(n):
        x = p[4, j] * p[8, j] - p[5, j] * p[7, j]
        y = p[5, j] * p[6, j] - p[3, j] * p[8, j]
        z = p[3, j] * p[7, j] - p[4, j] * p[6, j]
        determinant[j] = p[0, j] * x + p[1, j] * y + p[2, j] * z
    # Edge functions: rows of the inverse of the matrix of corners, p_(k+1) × p_(k+2) / det [Olano97].
    for k in range(0, 9, 3):
        m, o = (k + 3) % 9, (k + 6) % 9
        for j in range(n):
            x = (p[m + 1, j] * p[o + 2, j] - p[m + 2, j] * p[o + 1, j]) / determinant[j]
            y = (p[m + 2, j] * p[o, j] - p[m, j] * p[o + 2, j]) / determinant[j]
            z = (p[m, j] * p[o + 1, j] - p[m + 1, j] * p[o, j]) / determinant[j]
            e[k, j] = plane[0, 0] * x + plane[0, 1] * y + plane[0, 2] * z
            e[k + 1, j] = plane[1, 0] * x + plane[1, 1] * y + plane[1, 2] * z
            e[k + 2, j] = plane[2, 0] * x + plane[2, 1] * y + plane[2, 2] * z


@njit(cache=True, nogil=True, error_model="numpy")
def _clipped_box(projected: Float64Array) -> tuple[float, float, float, float]:
    """First and last column, first and last row whose centres a triangle covers that extends behind the camera, by the
    part of it before the nearest depth; projected (9,)."""
    left = top = math.inf
    right = bottom = -math.inf
    for k in range(0, 9, 3):
        m = (k + 3) % 9
        depth, after = projected[k + 2], projected[m + 2]
        if depth > _NEAR:
            x, y = projected[k] / depth, projected[k + 1] / depth
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
        if (depth > _NEAR) != (after > _NEAR):  # where the edge crosses that depth
            share = (_NEAR - depth) / (after - depth)
            x = (projected[k] + share * (projected[m] - projected[k])) / _NEAR
            y = (projected[k + 1] + share * (projected[m + 1] - projected[k + 1])) / _NEAR
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
    return math.ceil(left - 0.5), math.floor(right - 0.5), math.ceil(top - 0.5), math.floor(bottom - 0.5)


@njit(cache=True, nogil=True, error_model="numpy")
def merge_rows(
    start: int, stop: int, drawn: Int32Array, edges: Float32Array, found: Int32Array, weights: Float32Array
) -> None:
    """Fill rows [start, stop) of found (H, W) with the nearest of several threads' triangles drawn (N, H, W), or -1,
    and of weights (2, H, W), the barycentric coordinates of its second and third corner; edges (N, 3, H, W)."""
    for row in range(start, stop):
        for column in range(found.shape[1]):
            nearest, of = np.float32(0.0), -1
            for i in range(len(drawn)):
                if edges[i, 0, row, column] > nearest:
                    nearest, of = edges[i, 0, row, column], i
            found[row, column] = drawn[of, row, column] if of >= 0 else -1
            for k in range(2):
                weight = edges[of, 1 + k, row, column] / nearest if of >= 0 else np.float32(0.0)
                weights[k, row, column] = max(weight, np.float32(0.0))


@njit(cache=True, nogil=True, error_model="numpy")
def set_up(
    start: int, stop: int, places: Float32Array, corners: Int32Array, camera_position: Float64Array,
    plane: Float64Array, view: Float64Array, shares: Float32Array, front: Float32Array,
) -> None:  # fmt: skip
    """Fill shares[start:stop] (T, 3, 3), the edge functions of triangles (T, 3) over places (V, 3), one for each
    corner: its value at column 0 and row 0, its change to the next column and to the next row; divided by the distance,
    positive inside. Also fill front (T,), positive if a triangle is seen from the front."""
    p, projected = np.empty((9, _AT_ONCE)), np.empty((9, _AT_ONCE))
    e, box, determinant = np.empty((9, _AT_ONCE)), np.empty((4, _AT_ONCE)), np.empty(_AT_ONCE)
    for first in range(start, stop, _AT_ONCE):
        n = min(_AT_ONCE, stop - first)
        _set_up_some(first, n, places, corners, camera_position, plane, view, p, projected, e, box, determinant)
        for j in range(n):
            front[first + j] = -determinant[j]
            for k in range(3):
                for i in range(3):
                    shares[first + j, k, i] = e[3 * k + i, j]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def paint_rows(
    start: int, stop: int, found: Int32Array, shares: Float32Array, sides: Int32Array, front: Float32Array,
    i_object: Int32Array,
    white: Float32Array, gloss: Float32Array, albedos: Float32Array, emission: Float32Array, cones: Float32Array,
    plane: Float64Array, sky: Float32Array, turn: float, scale: float, picture: Float32Array,
) -> None:  # fmt: skip
    """Fill rows [start, stop) of picture (H, W, 3): white (S, 3), interpolated between a triangle's points, times the
    object's albedo (M, 3), plus gloss (S, 3), emission (M, 3) into cones (M, 4), and the sky (h, w, 3) behind all.

    sides (T, 2, 3): a triangle's points on either side, -1 for none; front (T,): positive if seen from the front.
    """
    height, width, n_columns = sky.shape[0], sky.shape[1], found.shape[1]
    sky_row, sky_column = np.empty(n_columns), np.empty(n_columns)
    for row in range(start, stop):
        # Each pixel's place in the sky: this loop vectorizes.
        dx, dy, dz = plane[0] + (row + 0.5) * plane[2]
        for column in range(n_columns):
            x = column + 0.5
            sky_row[column], sky_column[column] = texel_place(
                height, width, dx + x * plane[1, 0], dy + x * plane[1, 1], dz + x * plane[1, 2], turn
            )
        for column in range(n_columns):
            t, x, y = found[row, column], column + 0.5, row + 0.5
            if t < 0:
                # Background.
                around = texels_at(sky, sky_row[column], sky_column[column])
                for i in range(3):
                    picture[row, column, i] = np.float32(scale) * between_texels(sky, around, i)
                continue
            # Emission is visible from the front only, and within its cone.
            side, m = 0 if front[t] > 0.0 else 1, i_object[t]
            share = np.float32(0.0)
            if side == 0:
                vx, vy, vz = dx + x * plane[1, 0], dy + x * plane[1, 1], dz + x * plane[1, 2]
                inverse = 1.0 / np.sqrt(vx * vx + vy * vy + vz * vz)
                share = cone_share(cones, m, vx * inverse, vy * inverse, vz * inverse)
            for i in range(3):
                picture[row, column, i] = share * emission[m, i]
            p, q, r = sides[t, side, 0], sides[t, side, 1], sides[t, side, 2]
            if p < 0:
                continue
            s = shares[t]
            # Barycentric weights: edge functions normalized by their sum, which makes them perspective-correct.
            a = s[0, 0] + np.float32(x) * s[0, 1] + np.float32(y) * s[0, 2]
            b = s[1, 0] + np.float32(x) * s[1, 1] + np.float32(y) * s[1, 2]
            c = s[2, 0] + np.float32(x) * s[2, 1] + np.float32(y) * s[2, 2]
            whole = np.float32(1.0) / (a + b + c)
            a, b, c = a * whole, b * whole, c * whole
            for i in range(3):
                diffuse = a * white[p, i] + b * white[q, i] + c * white[r, i]
                shiny = a * gloss[p, i] + b * gloss[q, i] + c * gloss[r, i]
                picture[row, column, i] += max(diffuse * albedos[m, i] + shiny, np.float32(0.0))
