"""Soft shadows of bending objects on all others while they move: a few flat ellipsoids approximate a surface.

A cluster of triangles blocks the light of a cone about the direction of its centre, as wide as its outline seen from
the point [Bunnell05]. The light from the cone is known in low bands (`BandLight`), so that a shadow is soft, has the
colour of the light that it lacks, and is darkest at contacts. Clusters of a closed mesh that face away from a point do
not count, because other clusters occlude them. These shadows exclude the object itself: its transfer contains its own
shadows. Spheres instead of ellipsoids were rejected: they turn a wing into a ball.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from engine.core.threads import even_parts, on_threads
from engine.realtime.zonal_harmonics import _blocker_kernels as kernels
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.shading import BandLight

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

N_CLUSTERS, MOST_CLUSTERS = 12, 48  # of an object, and of all
ROW = 14  # numbers of a cluster: centre, area, adjugate (xx yy zz xy xz yz), mean normal, object
_MOST_TRIANGLES = 2000  # of an object, from which its clusters are computed
_SEED = 4


class Blockers:
    """Clusters of a scene's objects, at the current positions of its points."""

    def __init__(self, points: BendingPoints) -> None:
        self._points = points
        self._clusters: dict[tuple[int, int], _Clusters] = {}

    def rows(self, objects: list[int]) -> Float32Array:
        """The clusters (K, `ROW`) of some objects at their current positions; the last number is the object's index in
        `objects`."""
        count = max(1, min(N_CLUSTERS, MOST_CLUSTERS // max(len(objects), 1)))
        found = []
        for place, i in enumerate(objects[:MOST_CLUSTERS]):
            if (i, count) not in self._clusters:
                self._clusters[i, count] = _Clusters(self._points, i, count)
            found.append(self._clusters[i, count].rows(self._points.places))
            found[-1][:, 13] = place
        return np.concatenate(found) if found else np.zeros((0, ROW), np.float32)


class _Clusters:
    """The triangles of an object, sorted by cluster."""

    def __init__(self, points: BendingPoints, i_object: int, count: int) -> None:
        surface = points.surface
        mine = np.flatnonzero(surface.i_object == i_object)
        chosen = mine[:: -(-len(mine) // _MOST_TRIANGLES) or 1]
        self._share = len(mine) / max(len(chosen), 1)
        self._is_closed = bool((surface.sides[mine, 1, 0] < 0).all())
        middles = points.corners_at_rest(chosen).astype(np.float64).mean(axis=1)
        labels = np.zeros(len(chosen), np.int64)
        if len(chosen) > count > 1:
            labels = kmeans2(middles, count, minit="++", rng=_SEED)[1]
        order = np.argsort(labels, kind="stable")
        self._corners = surface.corners[chosen[order]]
        self._firsts = np.flatnonzero(np.diff(labels[order], prepend=-1))

    def rows(self, places: Float32Array) -> Float32Array:
        """See `Blockers.rows`: areas and second moments of triangles at the corners' current positions."""
        if not len(self._firsts):
            return np.zeros((0, ROW), np.float32)
        corners = places[self._corners].astype(np.float64)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas, summed = 0.5 * np.linalg.norm(cross, axis=1), corners.sum(axis=1)
        # The integral of x x^T over a triangle is A / 12 (sum of v v^T over its corners + (sum of v)(sum of v)^T).
        squares = np.einsum("tki,tkj->tij", corners, corners) + summed[:, :, None] * summed[:, None, :]
        area = np.maximum(np.add.reduceat(areas, self._firsts), 1e-30)
        middle = np.add.reduceat(areas[:, None] * summed, self._firsts) / (3.0 * area[:, None])
        moment = np.add.reduceat((areas / 12.0)[:, None, None] * squares, self._firsts) / area[:, None, None]
        spread = 4.0 * (moment - middle[:, :, None] * middle[:, None, :])  # of a disc: its radius squared
        rows = np.zeros((len(area), ROW), np.float32)
        rows[:, :3], rows[:, 3] = middle, area * self._share
        a, b, c = spread[:, 0], spread[:, 1], spread[:, 2]
        adjugate = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        rows[:, 4:7] = np.maximum(adjugate[:, (0, 1, 2), (0, 1, 2)], 0.0)
        rows[:, 7:10] = adjugate[:, (0, 0, 1), (1, 2, 2)]
        if self._is_closed:
            rows[:, 10:13] = 0.5 * np.add.reduceat(cross, self._firsts) / area[:, None]
        return rows


def add_shadows(
    rows: Float32Array, casts: NDArray[np.bool_], points: BendingPoints, places: Float32Array, normals: Float32Array,
    light: BandLight, white: Float32Array,
) -> None:  # fmt: skip
    """Darken white (S, 3), the radiance of white Lambertian points at places (S, 3) with normals (S, 3), by clusters
    (K, `ROW`).

    casts (M, C): whether each of the C objects with clusters casts shadows on each object. Without clusters the kernel
    runs all the same, so that it is compiled before anything bends.
    """
    window = spread_of(light.table.shape[2])
    on_threads(
        lambda start, stop: kernels.shadow_range(
            start, stop, rows, casts, points.owners, places, normals, light.table, window, white
        ),
        *even_parts(len(white)),
    )


@cache
def spread_of(n: int) -> Float32Array:
    """Window for light in n bands, which turns a small bright light into a spot: Hann's, which leaves rings of 3 % of
    the peak. A shadow without any rings would be wider (`engine.sphere.harmonics`), and half as dark."""
    return np.asarray(0.5 * (1.0 + np.cos(np.pi * np.arange(n) / n)), np.float32)
