"""Defects of meshes: faces that cannot be shown, or show flecks, are left out; others are counted.

trimesh's repairs were rejected. It finds winding face by face in Python, where `mesh.inconsistent_faces` is a sparse
graph; it merges vertices by an absolute distance; and it fills holes with faces that the file does not have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import Mesh, cross, face_normals, position_ids

# A face is a sliver if it is lower than this share of its longest edge.
_SLIVER = 1e-5


@dataclass(frozen=True)
class Defects:
    """sound (T,): faces with an area that repeat no other; the rest are counts of faces."""

    sound: npt.NDArray[np.bool_]
    zero_area: int
    sliver: int
    repeated: int
    flipped: int

    def notes(self) -> list[str]:
        """One line for each kind of defect that occurs."""
        lines = [
            (self.zero_area, "faces without area left out"),
            (self.sliver, "sliver faces"),
            (self.repeated, "faces that repeat another left out"),
            (self.flipped, "faces wound against a neighbour"),
        ]
        return [f"{count} {text}" for count, text in lines if count]


def find_defects(mesh: Mesh, has_two_sides: bool = True) -> Defects:
    """Zero-area, sliver, repeated and inconsistently wound faces of a placed mesh.

    A sliver is lower than 1e-5 of its longest edge. A face repeats an earlier one at the very same positions: rays
    would meet either of them. One that is wound the other way does too, unless that makes a difference: the mesh has
    normals or texture coordinates of its own, or its sides differ (`has_two_sides` is false). Two faces that share an
    edge should run along it in opposite directions; if they do not, both count as flipped (it is unknown which one is).
    A third face at an edge is not a defect of winding.
    """
    vertices, triangles = mesh.vertices, mesh.triangles
    _, solid = face_normals(vertices, triangles)
    corners = vertices[triangles]
    edges = corners[:, (1, 2, 0)] - corners
    doubled = np.linalg.norm(cross(edges[:, 0], edges[:, 1]), axis=1)
    sliver = solid & (doubled <= _SLIVER * (edges**2).sum(axis=2).max(axis=1))
    repeated = np.zeros(len(triangles), bool)
    placed = position_ids(vertices)[triangles[solid]]
    is_plain = has_two_sides and mesh.normals is None and mesh.uvs is None
    repeated[solid] = _repeats(np.sort(placed, axis=1) if is_plain else _from_least(placed), len(vertices))
    sound = solid & ~repeated
    flipped = _count_flipped(triangles[sound].astype(np.int64), len(vertices))
    return Defects(sound, int((~solid).sum()), int(sliver.sum()), int(repeated.sum()), flipped)


def describe_holes(mesh: Mesh) -> list[str]:
    """One line on the holes of a surface that should be closed, if there are any: loops of edges of a single face."""
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    corners = position_ids(mesh.vertices)[mesh.triangles]
    low, high = np.sort(np.stack([corners, corners[:, (1, 2, 0)]], axis=2).reshape(-1, 2), axis=1).T
    edges, uses = np.unique(low * (int(corners.max()) + 1) + high, return_counts=True)
    ends = np.stack(np.divmod(edges[uses == 1], int(corners.max()) + 1))
    if not ends.size:
        return []
    used, ends = np.unique(ends, return_inverse=True)
    one, two = ends.reshape(2, -1)
    graph = sparse.coo_matrix((np.ones(len(one), bool), (one, two)), (len(used), len(used)))
    n, _ = connected_components(graph, directed=False)
    return [f"the surface is not closed: {n} {'hole' if n == 1 else 'holes'}, {len(one)} open edges"]


def _from_least(triangles: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Triangles (T, 3) that begin with their least index, in the same winding."""
    order = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(triangles, order, axis=1)


def _repeats(rows: npt.NDArray[np.int64], base: int) -> npt.NDArray[np.bool_]:
    """Which rows of indices (N, 3) below `base` equal an earlier one."""
    keys = np.empty(len(rows), [("pair", np.int64), ("last", np.int64)])
    keys["pair"], keys["last"] = rows[:, 0] * base + rows[:, 1], rows[:, 2]
    _, first = np.unique(keys, return_index=True)
    repeats = np.ones(len(rows), bool)
    repeats[first] = False
    return repeats


def _count_flipped(triangles: npt.NDArray[np.int64], n_vertices: int) -> int:
    """Number of faces at edges that exactly two faces share and run along in the same direction."""
    directed = np.stack([triangles, triangles[:, (1, 2, 0)]], axis=2).reshape(-1, 2)
    low, high = np.sort(directed, axis=1).T
    _, edge, uses = np.unique(low * n_vertices + high, return_inverse=True, return_counts=True)
    forward = np.bincount(edge, directed[:, 0] < directed[:, 1], len(uses))
    against = (np.abs(2 * forward - uses) >= 2)[edge].reshape(-1, 3)
    return int(against.any(axis=1).sum())
