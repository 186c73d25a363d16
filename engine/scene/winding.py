"""Finds the faces of a mesh that are wound against the rest of their shell.

Normals averaged over faces of opposite orientation cancel, and leave patches without a direction. So each shell is
oriented consistently before they are averaged. Every face is in a graph twice, as it is and reversed; two faces that
share an edge are joined in the states that agree, and the components of that graph are the shells, each of them twice,
in linear time [HopcroftTarjan73]. A shell keeps the orientation of the larger part of its area. Edges of three or more
faces join none, and a Möbius strip, both of whose states are one component, is left unchanged.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import connected_components

Float64Array = npt.NDArray[np.float64]
_STEPS = 2**21 - 1  # share of the mesh's size within which positions are equal: three such numbers fit into 63 bits


def inconsistent_faces(vertices: Float64Array, triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
    """Which triangles (T, 3) must be reversed, (T,), so that each shell is oriented consistently. Vertices (V, 3) at
    equal positions count as one, as along the seams of textures."""
    n, corners = len(triangles), _weld_vertices(vertices)[triangles]
    start, end = corners, corners[:, (1, 2, 0)]
    low, high = np.minimum(start, end).ravel(), np.maximum(start, end).ravel()
    key = np.where(low == high, -1, low * (int(corners.max(initial=0)) + 1) + high)  # −1: an edge without length
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1) != 0)
    pairs = first[(np.diff(first, append=len(order)) == 2) & (key[order[first]] >= 0)]
    one, two = order[pairs], order[pairs + 1]
    agree = (start < end).ravel()[one] != (start < end).ravel()[two]  # they run along the edge in opposite directions
    a, b = one // 3, two // 3
    at, other = np.concatenate([a, a + n]), np.concatenate([np.where(agree, b, b + n), np.where(agree, b + n, b)])
    graph = sparse.coo_matrix((np.ones(len(at), bool), (at, other)), (2 * n, 2 * n))
    _, shell = connected_components(graph, directed=False)
    places = vertices[triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]), axis=1)
    kept = np.bincount(shell[:n], area, int(shell.max(initial=0)) + 1)
    return np.asarray(kept[shell[:n]] < kept[shell[n:]])


def _weld_vertices(vertices: Float64Array) -> npt.NDArray[np.int64]:
    """Indices (V,), equal for vertices at equal positions."""
    low = vertices.min(axis=0)
    size = float((vertices - low).max()) or 1.0
    x, y, z = np.rint((vertices - low) / size * _STEPS).astype(np.int64).T
    return np.unique((x << 42) + (y << 21) + z, return_inverse=True)[1].ravel()
