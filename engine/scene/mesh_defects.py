"""Counts the defects of a mesh for the user; only faces without area are left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import Mesh, cross, face_normals

_SLIVER = 1e-5


@dataclass(frozen=True)
class Defects:
    """solid (T,) marks faces with an area; the others are counts of faces."""

    solid: npt.NDArray[np.bool_]
    zero_area: int
    sliver: int
    duplicate: int
    flipped: int

    def notes(self) -> list[str]:
        """One line for each kind of defect that occurs."""
        lines = [
            (self.zero_area, "faces without area left out"),
            (self.sliver, "sliver faces"),
            (self.duplicate, "faces that repeat another"),
            (self.flipped, "faces wound against a neighbour"),
        ]
        return [f"{count} {text}" for count, text in lines if count]


def count_defects(mesh: Mesh) -> Defects:
    """Count zero-area, sliver, duplicate and inconsistently wound faces of a placed mesh.

    A sliver is lower than 1e-5 of its longest edge. Two faces that share an edge should run along it in opposite
    directions; if they do not, both count as flipped (it is unknown which one is). A third face at an edge is not a
    defect of winding.
    """
    vertices, triangles = mesh.vertices, mesh.triangles
    _, solid = face_normals(vertices, triangles)
    corners = vertices[triangles]
    edges = corners[:, (1, 2, 0)] - corners
    doubled = np.linalg.norm(cross(edges[:, 0], edges[:, 1]), axis=1)
    sliver = solid & (doubled <= _SLIVER * (edges**2).sum(axis=2).max(axis=1))
    kept = triangles[solid].astype(np.int64)
    repeats = _repeats(_keys(np.sort(kept, axis=1), len(vertices)))
    return Defects(
        solid, int((~solid).sum()), int(sliver.sum()), int(repeats.sum()), _count_flipped(kept[~repeats], len(vertices))
    )


def _keys(rows: npt.NDArray[np.int64], base: int) -> npt.NDArray:
    """A sortable scalar for each row of indices: one integer for pairs, a compound of two for triples."""
    pair = rows[:, 0] * base + rows[:, 1]
    if rows.shape[1] == 2:
        return pair
    keys = np.empty(len(rows), [("pair", np.int64), ("last", np.int64)])
    keys["pair"], keys["last"] = pair, rows[:, 2]
    return keys


def _repeats(keys: npt.NDArray) -> npt.NDArray[np.bool_]:
    """Which entries equal an earlier one."""
    _, first = np.unique(keys, return_index=True)
    repeats = np.ones(len(keys), bool)
    repeats[first] = False
    return repeats


def _count_flipped(triangles: npt.NDArray[np.int64], n_vertices: int) -> int:
    """Number of faces at edges that exactly two faces share and run along in the same direction."""
    directed = np.stack([triangles, triangles[:, (1, 2, 0)]], axis=2).reshape(-1, 2)
    edges = _keys(np.sort(directed, axis=1), n_vertices)
    _, edge, uses = np.unique(edges, return_inverse=True, return_counts=True)
    forward = np.bincount(edge, directed[:, 0] < directed[:, 1], len(uses))
    against = (np.abs(2 * forward - uses) >= 2)[edge].reshape(-1, 3)
    return int(against.any(axis=1).sum())
