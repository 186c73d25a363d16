"""Rasterizes triangles whose corners move in every frame, in compiled code on all cores, without an acceleration
structure.

A ray tree would have to be rebuilt for every picture. Instead the triangles are rasterized, each thread into rows of
its own, and a pixel then interpolates between the three points around it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_frame
from engine.core.threads import even_parts, n_threads, on_threads
from engine.realtime.core import _raster_kernels as kernels
from engine.scene.description import CameraDescription

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

_BANDS = 2  # bands of rows for each thread, because pictures are not filled evenly


@dataclass(frozen=True, eq=False)
class RasterTriangles:
    """T triangles: corners (T, 3), indices of the positions; sides (T, 2, 3), the points on the side that the winding
    faces and on the other, -1 for none; the object (T,) of each."""

    corners: Int32Array
    sides: Int32Array
    i_object: Int32Array


@dataclass(frozen=True, eq=False)
class RasterResult:
    """The triangle that each pixel of a picture sees: found (H, W), -1 for none; shares (T, 3, 3), see `set_up`; front
    (T,), positive if the winding faces the camera; plane (3, 3): the directions of pixels."""

    found: Int32Array
    shares: Float32Array
    front: Float32Array
    plane: Float64Array

    def weights(
        self, rows: NDArray[np.integer], columns: NDArray[np.integer], right: float = 0.0, below: float = 0.0
    ) -> Float32Array:
        """Barycentric weights (N, 3) at pixels that see a triangle, or at an offset of right and below pixels in its
        plane; beyond the plane's horizon they are unbounded."""
        at = np.stack([np.ones(len(rows)), columns + 0.5 + right, rows + 0.5 + below], axis=1).astype(np.float32)
        weights = np.einsum("nki,ni->nk", self.shares[self.found[rows, columns]], at)
        return np.asarray(weights / np.maximum(weights.sum(axis=1, keepdims=True), np.float32(1e-20)), np.float32)


@dataclass(frozen=True, eq=False)
class Backdrop:
    """The background: radiance (h, w, 3) by latitude and longitude, rotated by turn radians, times scale."""

    radiance: Float32Array
    turn: float = 0.0
    scale: float = 1.0


BLACK = Backdrop(np.zeros((1, 1, 3), np.float32))


def draw(
    surface: RasterTriangles,
    places: Float32Array,
    camera: CameraDescription,
    camera_position: Float64Array,
    size: tuple[int, int],
    found: Int32Array | None = None,
) -> RasterResult:
    """Rasterize triangles over places (V, 3) for a camera; camera_position (3,): in the same coordinates; size: width,
    height. Backs without points are not drawn. found (H, W): the triangle in each pixel, -1 for none, if it is known
    already."""
    if found is None:
        has_points = surface.sides[:, :, 0] >= 0
        is_shown = np.stack([np.ones(len(has_points), bool), has_points[:, 1] | ~has_points[:, 0]], axis=1)
        found, _, _ = find_triangles(surface.corners, is_shown, places, camera, camera_position, size)
    (plane, view), n = _plane(camera, size), len(surface.corners)
    shares, front = np.empty((n, 3, 3), np.float32), np.empty(n, np.float32)
    what = places, surface.corners, camera_position, plane, view, shares, front
    on_threads(lambda start, stop: kernels.set_up(start, stop, *what), *even_parts(n))
    return RasterResult(found, shares, front, plane)


def find_triangles(
    corners: Int32Array, is_shown: NDArray[np.bool_], places: Float32Array, camera: CameraDescription,
    camera_position: Float64Array, size: tuple[int, int],
) -> tuple[Int32Array, Float32Array, Float32Array]:  # fmt: skip
    """The nearest triangle, of corners (T, 3), in each pixel (H, W), or -1, and the barycentric coordinates of its
    second and third corner there (H, W); see `draw`. is_shown (T, 2): whether a triangle is drawn where its front, and
    where its back is seen.

    Each thread draws a part of the triangles into a picture of its own.
    """
    (width, height), (starts, stops) = size, even_parts(len(corners))
    n, what = len(starts), (places, corners, is_shown, camera_position, *_plane(camera, size))
    drawn, edges = np.empty((n, height, width), np.int32), np.empty((n, 3, height, width), np.float32)
    found, weights = np.empty((height, width), np.int32), np.empty((2, height, width), np.float32)

    def part(i: int, start: int, stop: int) -> None:
        edges[i, 0] = 0.0
        kernels.fill_triangles(start, stop, *what, drawn[i], edges[i])

    on_threads(part, range(n), starts, stops)
    on_threads(lambda start, stop: kernels.merge_rows(start, stop, drawn, edges, found, weights), *even_parts(height))
    return found, weights[0], weights[1]


def paint(
    drawn: RasterResult, surface: RasterTriangles, white: Float32Array, gloss: Float32Array, albedos: Float32Array,
    emission: Float32Array, cones: Float32Array, backdrop: Backdrop = BLACK,
) -> Float32Array:  # fmt: skip
    """Radiance (H, W, 3): white and gloss (S, 3) of the points, albedos and emission (M, 3) of the objects, which these
    send into cones (M, 4)."""
    picture = np.empty((*drawn.found.shape, 3), np.float32)

    def part(start: int, stop: int) -> None:
        kernels.paint_rows(
            start, stop, drawn.found, drawn.shares, surface.sides, drawn.front, surface.i_object, white, gloss,
            albedos, emission, cones, drawn.plane, backdrop.radiance, backdrop.turn, backdrop.scale, picture,
        )  # fmt: skip

    on_threads(part, *_bands(len(picture)))
    return picture


def _bands(height: int) -> tuple[list[int], list[int]]:
    """Divide rows into bands for the threads."""
    n = n_threads() * _BANDS
    bounds = [height * i // n for i in range(n + 1)]
    return bounds[:-1], bounds[1:]


def _plane(camera: CameraDescription, size: tuple[int, int]) -> tuple[Float64Array, Float64Array]:
    """The picture's plane as `paint_rows` takes it, and rows that map a direction to column and row times depth, and
    depth."""
    (width, height), half = size, math.tan(math.radians(camera.fov_y) / 2)
    right, up, forward = camera_frame(camera)
    pixel = 2.0 * half / height
    # Not `camera_plane`: that divides the width by the height, not both by the pixel, which rounds differently.
    corner = forward - pixel * width / 2.0 * right + half * up
    plane = np.stack([corner, right * pixel, up * -pixel])
    view = np.stack([right / pixel + width / 2.0 * forward, -up / pixel + height / 2.0 * forward, forward])
    return plane, view
