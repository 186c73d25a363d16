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

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

_NEAR = 1e-6  # depth, in units of depth 1, below which a corner has no projection


@njit(cache=True, nogil=True, error_model="numpy")
def set_up(
    start: int, stop: int, places: Float32Array, corners: Int32Array, sides: Int32Array, camera_position: Float64Array,
    plane: Float64Array, view: Float64Array,
    size: Int32Array, shares: Float32Array, boxes: Int32Array, front: Float32Array,
) -> None:  # fmt: skip
    """Fill shares[start:stop] (T, 3, 3), the edge functions of triangles (T, 3) over places (V, 3), one for each
    corner: its value at column 0 and row 0, its change to the next column and to the next row; divided by the distance,
    positive inside. Also fill boxes (T, 4), first and last column and row that a triangle may cover, empty if it faces
    away and has no points on its back; and front (T,), positive if it is seen from the front.

    plane (3, 3): the direction of the upper left corner, a column, a row; view (3, 3): rows that map a direction to
    column and row times depth, and depth; size (2,): width, height.
    """
    p = np.empty((3, 3))
    for t in range(start, stop):
        behind = 0
        least_x = least_y = math.inf
        most_x = most_y = -math.inf
        # Corners relative to the camera, and their projection.
        for k in range(3):
            for i in range(3):
                p[k, i] = places[corners[t, k], i] - camera_position[i]
            depth = view[2, 0] * p[k, 0] + view[2, 1] * p[k, 1] + view[2, 2] * p[k, 2]
            if not depth > _NEAR:
                behind += 1
                continue
            x = (view[0, 0] * p[k, 0] + view[0, 1] * p[k, 1] + view[0, 2] * p[k, 2]) / depth
            y = (view[1, 0] * p[k, 0] + view[1, 1] * p[k, 1] + view[1, 2] * p[k, 2]) / depth
            least_x, most_x = min(least_x, x), max(most_x, x)
            least_y, most_y = min(least_y, y), max(most_y, y)
        boxes[t, 0], boxes[t, 1], boxes[t, 2], boxes[t, 3] = 0, -1, 0, -1
        # Six times the signed volume of the tetrahedron with the camera: the sign tells the visible side [Olano97].
        determinant = _dot_cross(p[0], p[1], p[2])
        front[t] = -determinant
        is_hidden = determinant > 0.0 and sides[t, 1, 0] < 0 and sides[t, 0, 0] >= 0
        if behind == 3 or is_hidden or determinant == 0.0 or not math.isfinite(determinant):
            continue
        # A triangle that extends behind the camera may cover any pixel.
        if behind:
            boxes[t, 0], boxes[t, 1], boxes[t, 2], boxes[t, 3] = 0, size[0] - 1, 0, size[1] - 1
        else:
            boxes[t, 0] = int(max(math.ceil(min(least_x, 1e6) - 0.5), 0.0))
            boxes[t, 1] = int(min(math.floor(max(most_x, -1e6) - 0.5), size[0] - 1.0))
            boxes[t, 2] = int(max(math.ceil(min(least_y, 1e6) - 0.5), 0.0))
            boxes[t, 3] = int(min(math.floor(max(most_y, -1e6) - 0.5), size[1] - 1.0))
        # Edge functions: rows of the inverse of the matrix of corners, p_(k+1) × p_(k+2) / det [Olano97].
        for k in range(3):
            for i in range(3):
                shares[t, k, i] = _dot_cross(plane[i], p[(k + 1) % 3], p[(k + 2) % 3]) / determinant


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _dot_cross(a: Float64Array, b: Float64Array, c: Float64Array) -> float:
    """a · (b × c)."""
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def fill_rows(
    start: int, stop: int, shares: Float32Array, boxes: Int32Array, nearness: Float32Array, found: Int32Array
) -> None:
    """Fill rows [start, stop) of found (H, W), the nearest triangle or -1, and of nearness (H, W), 1 / distance in
    lengths of the pixel's direction."""
    half, tiny = np.float32(0.5), np.float32(-1e-6)
    nearness[start:stop], found[start:stop] = 0.0, -1
    for t in range(len(shares)):
        first, last = max(boxes[t, 2], start), min(boxes[t, 3], stop - 1)
        if first > last or boxes[t, 0] > boxes[t, 1]:
            continue
        s = shares[t]
        for row in range(first, last + 1):
            y = np.float32(row) + half
            a0, a1, a2 = s[0, 0] + y * s[0, 2], s[1, 0] + y * s[1, 2], s[2, 0] + y * s[2, 2]
            for column in range(boxes[t, 0], boxes[t, 1] + 1):
                x = np.float32(column) + half
                # The three edge functions; their sum is the interpolated 1 / distance.
                a, b, c = a0 + x * s[0, 1], a1 + x * s[1, 1], a2 + x * s[2, 1]
                total = a + b + c
                edge = tiny * total
                if total > nearness[row, column] and a >= edge and b >= edge and c >= edge:
                    nearness[row, column], found[row, column] = total, t


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def paint_rows(
    start: int, stop: int, found: Int32Array, shares: Float32Array, sides: Int32Array, front: Float32Array,
    i_object: Int32Array,
    white: Float32Array, gloss: Float32Array, albedos: Float32Array, emission: Float32Array, plane: Float64Array,
    sky: Float32Array, turn: float,
    scale: float, picture: Float32Array,
) -> None:  # fmt: skip
    """Fill rows [start, stop) of picture (H, W, 3): white (S, 3), interpolated between a triangle's points, times the
    object's albedo (M, 3), plus gloss (S, 3), emission (M, 3), and the sky (h, w, 3) in the background.

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
            # Emission is visible from the front only.
            side, m = 0 if front[t] > 0.0 else 1, i_object[t]
            for i in range(3):
                picture[row, column, i] = emission[m, i] if side == 0 else 0.0
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
