"""Axes along texture coordinates, at the corners of an object's triangles in their current pose: the axes of detail.

A vertex has two sets, for triangles with mirrored and with unmirrored coordinates, so that each side of a seam has its
own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.frames import orthonormal
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]


class SurfaceAxes:
    """Axes of one object's triangles. numbers (T, 3): indices of the corners' axes, of all triangles, -1 for other
    objects."""

    def __init__(self, scene: Scene, points: BendingPoints, i_object: int) -> None:
        surface, self._points = points.surface, points
        mine = np.flatnonzero(surface.i_object == i_object)
        self._own, corners = np.unique(surface.corners[mine], return_inverse=True)
        self._corners = corners.reshape(-1, 3).astype(np.int32)
        self._uvs = points.corner_uvs(scene, mine)
        self.numbers = np.full((len(surface.corners), 3), -1, np.int32)
        self.numbers[mine] = numbers_of(self._corners, self._uvs)

    def now(self) -> NDArray[np.float32]:
        """The current axes (A, 3, 3), rows: along u, along v, outwards."""
        places, frames = (each[self._own] for each in (self._points.places, self._points.frames))
        return uv_axes(places, self._corners, self._uvs, frames).astype(np.float32)


def uv_axes(positions: ArrayLike, triangles: Int32Array, uvs: ArrayLike, frames: ArrayLike) -> Float64Array:
    """Axes (2 V, 3, 3), rows: along u, along v, normal; vertex k has the axes 2 k, and 2 k + 1, left-handed, for
    triangles with mirrored coordinates.

    positions (V, 3) and frames (V, 3, 3): current vertices; uvs (T, 3, 2). A corner's u is the mean over the triangles
    of its vertex with the same handedness; where coordinates are degenerate, the vertex's tangent.
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
    """Indices into `uv_axes` of the triangles' corners (T, 3)."""
    return 2 * triangles + _is_mirrored(np.asarray(uvs, np.float64))[:, None].astype(np.int32)


def _is_mirrored(uvs: Float64Array) -> NDArray[np.bool_]:
    """Which triangles (T,) have coordinates (T, 3, 2) of opposite orientation."""
    steps = uvs[:, 1:] - uvs[:, :1]
    return np.asarray(steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0] < 0.0)
