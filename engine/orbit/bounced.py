"""Light that is reflected on and on, as far as it does not depend on the eye: irradiance by albedo.

Some thousand of the shading points gather: each sends cosine-distributed rays, once, that end at other shading points
(one of the three around the hit, by chance as near as it is). Whatever the light and the materials are then,

    E_(b+1)(p) = mean over p's rays of  d(q) E_b(q),       indirect irradiance = E_2 + ... + E_N,

with E_1 the irradiance of the points and d the equivalent albedo of what the ray meets [BenArtzi07, sect. 5.3]; between
gathering points it is interpolated in place and normal. It costs some milliseconds, so it follows every change.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from engine.indirect.rays import cosine_tables
from engine.orbit import _picture_kernels as kernels
from engine.orbit.picture import PointMesh
from engine.orbit.shading_points import ShadingPoints

Floats = NDArray[np.float32]
N_GATHERING = 4096
N_RAYS = 512
_AT_ONCE = 64  # gathering points: 32,768 rays
_BESIDE = 8
_INTERPOLATED = 8192  # points at a time
# By how much of the scene's size two opposite normals are apart.
_TURNED = 0.25
_INWARDS = 0.1  # of the way to the triangle's middle
# Objects are worth points on their backs from this share of all rays on.
_BEHIND = 0.02


@dataclass(frozen=True, eq=False)
class Bounces:
    """ends (G, R): the shading point at which each ray ends, −1 where it meets none; beside (S, K) and share (S, K):
    the gathering points around each of the shading points, and their weights. behind: objects that many rays meet from
    behind, where they have no points."""

    ends: NDArray[np.int32]
    beside: NDArray[np.int32]
    share: Floats
    behind: frozenset[int]

    def indirect(self, direct: Floats, albedo: Floats, n_bounces: int) -> Floats:
        """Irradiance (S, 3) after the first bounce and up to n_bounces, from that of the lights (S, 3).

        albedo (S, 3): of what the points lie on; above 1 it counts as 1: light must not grow from bounce to bounce.
        """
        total, latest, bounded = np.zeros_like(direct), direct, np.minimum(albedo, 1.0)
        for _ in range(n_bounces - 1):
            gathered = np.empty((len(self.ends), 3), np.float32)
            kernels.gather(self.ends, np.ascontiguousarray(latest * bounded), gathered)
            latest = np.empty_like(direct)
            kernels.spread(self.beside, self.share, gathered, latest)
            total += latest
        return total


def bouncing(points: ShadingPoints, mesh: PointMesh) -> Generator[float, None, Bounces]:
    """Send the rays, yielding how much is done."""
    n, size = len(points), float(np.ptp(points.position, axis=0).max()) if len(points) else 1.0
    where = np.concatenate([points.position, points.normal * np.float32(0.5 * _TURNED * size)], axis=1)
    chosen = _evenly(points, where)
    origins = _inwards(points)
    ends, tables = np.empty((len(chosen), N_RAYS), np.int32), cosine_tables(N_RAYS)
    chance, behind = np.random.default_rng(2), np.zeros(0, np.int64)
    for start in range(0, len(chosen), _AT_ONCE):
        some = chosen[start : start + _AT_ONCE]
        frames = points.frames[some][:, [0, 2, 1]]  # the tables' third axis is the normal
        ways = np.einsum("nrk,nki->nri", tables[: len(some)], frames).reshape(-1, 3)
        found = mesh.trace(np.repeat(origins[some], N_RAYS, axis=0), np.ascontiguousarray(ways))
        corner = (chance.random(len(ways))[:, None] > found.weights.cumsum(axis=1)[:, :2]).sum(axis=1)
        at = np.take_along_axis(found.corners, corner[:, None], axis=1)[:, 0]
        ends[start : start + _AT_ONCE] = np.where(found.corners[:, 0] >= 0, at, -1).reshape(-1, N_RAYS)
        behind = np.concatenate([behind, found.i_object[found.behind]])
        yield 0.5 * (start + len(some)) / len(chosen)
    beside, share = np.zeros((n, _BESIDE), np.int32), np.zeros((n, _BESIDE), np.float32)
    tree, k = cKDTree(where[chosen]), min(_BESIDE, len(chosen))
    for start in range(0, n, _INTERPOLATED):
        distance, number = tree.query(where[start : start + _INTERPOLATED], k, workers=-1)
        distance, number = distance.reshape(-1, k), number.reshape(-1, k)
        inverse = 1.0 / (distance + 1e-6 * size)
        weights = (inverse - 0.999 * inverse[:, -1:]) ** 2  # [Shepard68], the farthest fading out
        beside[start : start + _INTERPOLATED, :k] = number
        share[start : start + _INTERPOLATED, :k] = weights / weights.sum(axis=1, keepdims=True)
        yield 0.5 + 0.5 * start / n
    counts = np.bincount(behind, minlength=1)
    return Bounces(ends, beside, share, frozenset(np.flatnonzero(counts > _BEHIND * max(ends.size, 1)).tolist()))


def _inwards(points: ShadingPoints) -> Floats:
    """Where rays of points start (S, 3): a little way into a triangle, as where two walls meet a ray may miss both."""
    origins = points.lifted.copy()
    middles = points.corners.mean(axis=1)
    for side in range(2):
        mine = np.flatnonzero(points.triangles[:, side, 0] >= 0)
        for corner in range(3):
            p = points.triangles[mine, side, corner]
            origins[p] = points.lifted[p] + _INWARDS * (middles[mine] - points.position[p])
    return origins


def _evenly(points: ShadingPoints, where: Floats) -> NDArray[np.int64]:
    """About N_GATHERING of the points (S,), in cubes over place and normal (S, 6), one of each."""
    low, span = where.min(axis=0, initial=np.inf), np.ptp(where, axis=0).max() if len(where) else 1.0
    chosen, cells = np.arange(len(points)), 1024.0
    while len(chosen) > N_GATHERING:
        cells *= 0.8
        cubes = np.concatenate([((where - low) * (cells / span)).astype(np.int64), points.i_object[:, None]], axis=1)
        order = np.lexsort(cubes.T)
        is_first = np.concatenate([[True], (np.diff(cubes[order], axis=0) != 0).any(axis=1)])
        chosen = order[is_first]
    return np.sort(chosen)
