"""Subdivision surfaces after Catmull and Clark [CatmullClark78], with semi-sharp creases and corners [DeRose98].

One step makes a quad of each corner of each polygon, between the corner's vertex, the points of the two edges there and
the point of the face. An edge of sharpness s follows the rule of a crease for s steps, the last of them in part; the
boundary is a crease without end. Values at corners, such as texture coordinates, are refined linearly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]

ENDLESS = 10.0  # sharpness from which an edge stays sharp, as other programs have it


@dataclass(frozen=True)
class ControlMesh:
    """Points (V, 3); polygons by their lengths (N,) and the points of all corners (C,), one polygon after the other;
    sharp edges by their two points (K, 2) and their sharpness (K,), and the sharpness of points (V,)."""

    points: Float64Array
    lengths: Int64Array
    corners: Int64Array
    edges: Int64Array
    sharpness: Float64Array
    point_sharpness: Float64Array


def subdivide(mesh: ControlMesh) -> ControlMesh:
    """One step. The quad of corner c has the corners 4 c to 4 c + 3 in the result, beginning at c's own point."""
    points, corners, n_points = mesh.points, mesh.corners, len(mesh.points)
    after, before = _neighbours(mesh.lengths)
    polygon = np.repeat(np.arange(len(mesh.lengths)), mesh.lengths)
    pairs = np.sort(np.stack([corners, corners[after]], axis=1), axis=1)
    keys, edge = np.unique(pairs[:, 0] * n_points + pairs[:, 1], return_inverse=True)
    a, b = keys // n_points, keys % n_points
    n_edges = len(keys)
    faces = _means(points[corners], polygon, len(mesh.lengths))
    n_faces = np.bincount(edge, minlength=n_edges)
    sharp = _edge_sharpness(mesh, keys)
    sharp[n_faces != 2] = np.inf
    middles = 0.5 * (points[a] + points[b])
    # The point of a smooth edge is the mean of its ends and of its faces.
    share = np.minimum(sharp, 1.0)[:, None]
    edges = (1.0 - share) * 0.5 * (middles + _means(faces[polygon], edge, n_edges)) + share * middles
    moved = _moved_points(mesh, (a, b), sharp, middles, faces[polygon])
    quads = np.stack(
        [corners, n_points + edge, n_points + n_edges + polygon, n_points + edge[before]], axis=1
    )  # fmt: skip
    is_left = np.isfinite(sharp) & (sharp > 1.0)
    halves = np.stack([np.stack([end[is_left], n_points + np.flatnonzero(is_left)], axis=1) for end in (a, b)])
    left = np.where(sharp[is_left] >= ENDLESS, ENDLESS, sharp[is_left] - 1.0)
    own = np.where(mesh.point_sharpness >= ENDLESS, ENDLESS, np.maximum(mesh.point_sharpness - 1.0, 0.0))
    return ControlMesh(
        np.concatenate([moved, edges, faces]), np.full(len(corners), 4), quads.ravel(), halves.reshape(-1, 2),
        np.tile(left, 2), np.concatenate([own, np.zeros(n_edges + len(faces))]),
    )  # fmt: skip


def subdivide_values(lengths: Int64Array, values: Float64Array) -> Float64Array:
    """Values at the corners (C, W) of polygons, at the corners (4 C, W) of the quads of one step."""
    after, before = _neighbours(lengths)
    polygon = np.repeat(np.arange(len(lengths)), lengths)
    centres = _means(values, polygon, len(lengths))[polygon]
    rows = [values, 0.5 * (values + values[after]), centres, 0.5 * (values + values[before])]
    return np.stack(rows, axis=1).reshape(-1, values.shape[1])


def _neighbours(lengths: Int64Array) -> tuple[Int64Array, Int64Array]:
    """The corner after each in its polygon (C,), and the one before."""
    n, starts = int(lengths.sum()), np.cumsum(lengths) - lengths
    after, before = np.arange(1, n + 1), np.arange(-1, n - 1)
    after[starts + lengths - 1] = starts
    before[starts] = starts + lengths - 1
    return after, before


def _means(values: Float64Array, of: Int64Array, count: int) -> Float64Array:
    """Mean of the values (N, W) of each of so many groups, 0 where there is none."""
    n = np.maximum(np.bincount(of, minlength=count), 1)
    return np.stack([np.bincount(of, column, count) / n for column in values.T], axis=1)


def _edge_sharpness(mesh: ControlMesh, keys: Int64Array) -> Float64Array:
    """The sharpness of edges by their keys (E,)."""
    sharp = np.zeros(len(keys))
    if len(mesh.edges):
        pairs = np.sort(mesh.edges, axis=1)
        wanted = pairs[:, 0] * len(mesh.points) + pairs[:, 1]
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        is_edge = keys[place] == wanted
        np.maximum.at(sharp, place[is_edge], mesh.sharpness[is_edge])
    return sharp


def _moved_points(
    mesh: ControlMesh, ends: tuple[Int64Array, Int64Array], sharp: Float64Array, middles: Float64Array,
    faces: Float64Array,
) -> Float64Array:  # fmt: skip
    """The points (V, 3) themselves: (F + 2 R + (n - 3) P) / n with n edges, the mean F of the faces around and R of the
    edges' middles; with two sharp edges 3/4 P and 1/4 the mean of their other ends; with more, P."""
    points, n_points = mesh.points, len(mesh.points)
    at = np.concatenate(ends)
    n = np.bincount(at, minlength=n_points)[:, None]
    around = _means(faces, mesh.corners, n_points)
    smooth = (around + 2.0 * _means(np.tile(middles, (2, 1)), at, n_points) + (n - 3.0) * points) / np.maximum(n, 1)
    both = np.tile(sharp, 2)
    is_sharp = both > 0.0
    n_sharp = np.bincount(at[is_sharp], minlength=n_points)
    along = _means(points[np.concatenate(ends[::-1])][is_sharp], at[is_sharp], n_points)
    crease = 0.75 * points + 0.25 * along
    strength = np.bincount(at[is_sharp], np.minimum(both[is_sharp], 1.0), n_points) / np.maximum(n_sharp, 1)
    share = np.where(n_sharp == 2, strength, 0.0)[:, None]
    moved = (1.0 - share) * smooth + share * crease
    corner = np.maximum(np.where(n_sharp > 2, strength, 0.0), np.minimum(mesh.point_sharpness, 1.0))[:, None]
    moved = (1.0 - corner) * moved + corner * points
    return np.where(n > 0, moved, points)
