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
) -> RasterResult:
    """Rasterize triangles over places (V, 3) for a camera; camera_position (3,): in the same coordinates; size: width,
    height."""
    width, height = size
    plane, view = _plane(camera, size)
    n = len(surface.corners)
    shares, boxes = np.empty((n, 3, 3), np.float32), np.empty((n, 4), np.int32)
    front = np.empty(n, np.float32)
    found, nearness = np.empty((height, width), np.int32), np.empty((height, width), np.float32)
    limits = np.array(size, np.int32)

    def set_up(start: int, stop: int) -> None:
        kernels.set_up(
            start,
            stop,
            places,
            surface.corners,
            surface.sides,
            camera_position,
            plane,
            view,
            limits,
            shares,
            boxes,
            front,
        )

    on_threads(set_up, *even_parts(n))
    on_threads(lambda start, stop: kernels.fill_rows(start, stop, shares, boxes, nearness, found), *_bands(height))
    return RasterResult(found, shares, front, plane)


def paint(
    drawn: RasterResult, surface: RasterTriangles, white: Float32Array, gloss: Float32Array, albedos: Float32Array,
    emission: Float32Array,
    backdrop: Backdrop = BLACK,
) -> Float32Array:  # fmt: skip
    """Radiance (H, W, 3): white and gloss (S, 3) of the points, albedos and emission (M, 3) of the objects."""
    picture = np.empty((*drawn.found.shape, 3), np.float32)

    def part(start: int, stop: int) -> None:
        kernels.paint_rows(
            start, stop, drawn.found, drawn.shares, surface.sides, drawn.front, surface.i_object, white, gloss,
            albedos, emission, drawn.plane, backdrop.radiance, backdrop.turn, backdrop.scale, picture,
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
