"""Which shading points may be interpolated between: those that see the position.

A triangle between points may extend beneath a wall, with one corner in a bright room and another in a dark one;
interpolated light would leak through the wall. Such triangles are few. They are flat, because the corners of a bent
triangle hide each other anyway, and one of their corners is buried or does not see another. A position within such a
triangle interpolates only corners that it sees; if it sees none, it takes the nearest point that it does see.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from engine.realtime.core._sample_kernels import Samples
from engine.realtime.core.shading_points import ShadingPoints
from engine.scene.raycaster import RayCaster

Float32Array = NDArray[np.float32]
_FLAT = 0.9999  # cosine between normals
_SHORT = 1e-4  # rays to a position end this share of their length before it
_NEAREST = 16  # candidates, of which the first visible one is taken


class CornerVisibility:
    """Visibility between the points of a scene, by the triangles between them; see the module."""

    def __init__(self, points: ShadingPoints, caster: RayCaster) -> None:
        """caster: intersects the triangles between the points."""
        self._points, self._caster = points, caster

    def sees(self, origins: Float32Array, places: Float32Array) -> NDArray[np.bool_]:
        """Whether nothing is between two positions (R, 3); a position sees itself."""
        directions = places - origins
        apart = directions.any(axis=1)
        seen = np.ones(len(directions), bool)
        limit = np.full(int(apart.sum()), 1.0 - _SHORT, np.float32)
        seen[apart] = ~self._caster.occluded(origins[apart], directions[apart], limit)
        return seen

    @cached_property
    def split_triangles(self) -> NDArray[np.bool_]:
        """Find the triangles, on either side (T, 2), some of whose corners are not visible from all of the triangle."""
        points, found = self._points, np.zeros(self._points.triangles.shape[:2], bool)
        for side in range(2):
            mine = np.flatnonzero(points.triangles[:, side, 0] >= 0)
            corners = points.triangles[mine, side]
            normals, lifted = points.normal[corners], points.lifted[corners]
            flat = np.einsum("tki,tki->tk", normals, np.roll(normals, 1, axis=1)).min(axis=1, initial=1.0) > _FLAT
            some = np.zeros(len(mine), bool) if points.buried is None else points.buried[corners].any(axis=1)
            requested = np.flatnonzero(flat & ~some)
            ends = np.roll(lifted[requested], 1, axis=1)
            some[requested] = ~self.sees(lifted[requested].reshape(-1, 3), ends.reshape(-1, 3)).reshape(-1, 3).all(
                axis=1
            )
            found[mine, side] = flat & some
        return found

    def fix_corners(self, samples: Samples, triangle: NDArray[np.int32]) -> None:
        """Restrict corners and weights of samples (R,) to visible ones; triangle (R,): the triangle that each lies
        in."""
        points = self._points
        met = np.flatnonzero(samples.corners[:, 0] >= 0)
        rows = met[self._divided_somewhere[triangle[met]]]  # few: see the module
        side = (np.einsum("ri,ri->r", samples.wo[rows], self._faces[triangle[rows]]) < 0.0).astype(np.intp)
        mine = self.split_triangles[triangle[rows], side]
        rows, side = rows[mine], side[mine]
        if not len(rows):
            return
        t, corners = triangle[rows], points.triangles[triangle[rows], side]
        weights = samples.weights[rows]
        normals = points.normal[corners[:, 0]]
        places = np.einsum("rk,rki->ri", weights, points.corners[t])
        origins = self._caster.offset_origins(places, normals)
        seen = self.sees(np.repeat(origins, 3, axis=0), points.lifted[corners].reshape(-1, 3)).reshape(-1, 3)
        if points.buried is not None:
            seen &= ~points.buried[corners]
        weights = np.where(seen, np.maximum(weights, 1e-6), np.float32(0.0))
        alone = np.flatnonzero(~seen.any(axis=1))
        corners[alone], weights[alone, 0] = self._nearest(origins[alone], places[alone], normals[alone])[:, None], 1.0
        samples.corners[rows] = corners
        samples.weights[rows] = weights / weights.sum(axis=1, keepdims=True)

    @cached_property
    def _divided_somewhere(self) -> NDArray[np.bool_]:
        """Which triangles (T,) are split on one of their sides."""
        return np.asarray(self.split_triangles.any(axis=1))

    @cached_property
    def _faces(self) -> NDArray[np.float64]:
        """Face normals (T, 3) by winding, of any length."""
        a, b, c = np.moveaxis(self._points.corners, 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def _tree(self) -> tuple[cKDTree, float]:
        points = self._points
        size = float(np.ptp(points.position, axis=0).max()) if len(points) else 1.0
        return cKDTree(np.concatenate([points.position, size * points.normal], axis=1)), size

    def _nearest(self, origins: Float32Array, places: NDArray[np.float64], normals: Float32Array) -> NDArray[np.int64]:
        """Nearest points (N,) that face the same way and are visible from the places, or at least not buried."""
        tree, size = self._tree
        k = min(_NEAREST, len(self._points))
        _, near = tree.query(np.concatenate([places, size * normals], axis=1), k)
        near = near.reshape(-1, k)
        seen = self.sees(np.repeat(origins, k, axis=0), self._points.lifted[near].reshape(-1, 3)).reshape(-1, k)
        rank = seen.astype(np.int64)
        if self._points.buried is not None:
            rank = np.where(self._points.buried[near], 0, 1 + rank)
        return np.take_along_axis(near, rank.argmax(axis=1)[:, None], axis=1)[:, 0]
