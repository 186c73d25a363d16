"""Jacobians of a map of a surface that is known only at its vertices, by differences over its triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

_FLAT = 1e-12


def gradients(before: Float64Array, after: Float64Array, triangles: NDArray[np.int32]) -> Float64Array:
    """Jacobians (V, 3, 3) at the vertices of a mesh that moves from `before` (V, 3) to `after`: the mean over adjacent
    triangles, weighted by area. A triangle's Jacobian maps its edges to its edges and its normal to its normal. A
    vertex without triangles of nonzero area gets the identity."""
    edges, there = _edges(before, triangles), _edges(after, triangles)
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    has_area = areas > _FLAT * (edges**2).sum(axis=2).max(axis=1)
    triangles, areas = triangles[has_area], areas[has_area]
    maps = _with_normals(there[has_area]) @ np.linalg.inv(_with_normals(edges[has_area]))
    total = np.zeros((len(before), 9))
    weight = np.zeros(len(before))
    for corner in triangles.T:
        weight += np.bincount(corner, areas, len(before))
        for k in range(9):
            total[:, k] += np.bincount(corner, areas * maps.reshape(-1, 9)[:, k], len(before))
    has_any = weight > 0.0
    total = total / np.where(has_any, weight, 1.0)[:, None]
    return np.where(has_any[:, None, None], total.reshape(-1, 3, 3), np.eye(3))


def _edges(places: Float64Array, triangles: NDArray[np.int32]) -> Float64Array:
    """Two edges of each triangle (T, 2, 3)."""
    corners = places[triangles]
    return corners[:, 1:] - corners[:, :1]


def _with_normals(edges: Float64Array) -> Float64Array:
    """Two edges and a normal of comparable length, as columns (T, 3, 3)."""
    normal = np.cross(edges[:, 0], edges[:, 1])
    doubled = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.sqrt(np.where(doubled > 0.0, doubled, 1.0))
    return np.stack([edges[:, 0], edges[:, 1], normal], axis=2)
