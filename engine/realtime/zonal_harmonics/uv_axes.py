"""Axes along texture coordinates, at the corners of an object's triangles as they stand now: those that detail lies in.

A point has two of them, for triangles whose coordinates are mirrored and for those whose are not, so that either side
of a seam has its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.pose import orthonormal
from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]


class SurfaceAxes:
    """Of one object's triangles. numbers (T, 3): which axes the corners of all triangles have, -1 of others'."""

    def __init__(self, scene: Scene, points: BendingPoints, i_object: int) -> None:
        surface, self._points = points.surface, points
        mine = np.flatnonzero(surface.i_object == i_object)
        self._own, corners = np.unique(surface.corners[mine], return_inverse=True)
        self._corners = corners.reshape(-1, 3).astype(np.int32)
        self._uvs = points.corner_uvs(scene, mine)
        self.numbers = np.full((len(surface.corners), 3), -1, np.int32)
        self.numbers[mine] = numbers_of(self._corners, self._uvs)

    def now(self) -> NDArray[np.float32]:
        """As the points stand now (A, 3, 3), rows: along u, along v, outwards."""
        places, frames = (each[self._own] for each in (self._points.places, self._points.frames))
        return uv_axes(places, self._corners, self._uvs, frames).astype(np.float32)


def uv_axes(positions: ArrayLike, triangles: Int32Array, uvs: ArrayLike, frames: ArrayLike) -> Float64Array:
    """Axes (2 V, 3, 3), rows: along u, along v, normal; of vertex k the first is 2 k, and the left-handed one of its
    triangles whose coordinates are mirrored 2 k + 1.

    positions (V, 3) and frames (V, 3, 3): vertices as they are now; uvs (T, 3, 2). A corner's u runs along the mean of
    its vertex's triangles that are not mirrored against its own; where coordinates say nothing, the vertex's tangent.
    """
    positions, uvs, frames = (np.asarray(each, np.float64) for each in (positions, uvs, frames))
    corners = positions[triangles]
    edges, steps = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    along = edges[:, 0] * steps[:, 1, 1, None] - edges[:, 1] * steps[:, 0, 1, None]
    along *= np.where(_is_mirrored(uvs), -1.0, 1.0)[:, None]
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    weight = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1, keepdims=True)
    along = np.where(lengths > 0.0, along / np.where(lengths > 0.0, lengths, 1.0), 0.0) * weight
    total = np.zeros((2 * len(positions), 3))
    for corner in numbers_of(triangles, uvs).T:
        for axis in range(3):
            total[:, axis] += np.bincount(corner, along[:, axis], len(total))
    at = np.repeat(frames, 2, axis=0)
    found = orthonormal(np.stack([total, at[:, 1], at[:, 2]], axis=1), at)
    found[1::2, 1] *= -1.0
    return found


def numbers_of(triangles: Int32Array, uvs: ArrayLike) -> Int32Array:
    """Which of `uv_axes` the corners of triangles have (T, 3)."""
    return 2 * triangles + _is_mirrored(np.asarray(uvs, np.float64))[:, None].astype(np.int32)


def _is_mirrored(uvs: Float64Array) -> NDArray[np.bool_]:
    """Which triangles' (T,) coordinates (T, 3, 2) run the other way round than their corners."""
    steps = uvs[:, 1:] - uvs[:, :1]
    return np.asarray(steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0] < 0.0)
