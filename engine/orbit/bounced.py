"""Light that is reflected on and on, as far as it does not depend on the eye: irradiance by albedo.

Some thousand of the shading points gather: each sends cosine-distributed rays, once, that end at other shading points
(one of the three around the hit, by chance as near as it is). Whatever the light and the materials are then,

    E_(b+1)(p) = mean over p's rays of  d(q) E_b(q),       indirect irradiance = E_2 + ... + E_N,

with E_1 the irradiance of the points and d the equivalent albedo of what the ray meets [BenArtzi07, sect. 5.3]. Between
gathering points it is interpolated as in an irradiance cache [Ward88]: with weights that fall with the distance over
the mean distance of what they meet, and with the angle between normals, and never from one that stands behind a wall,
where it may be a hundred times as bright. Points that none is close to gather as well. It costs some milliseconds, so
it follows every change.

Behind a door that stands ajar it falls to a tenth within a hand's breadth, though all that points meet is far away. So
when all shadows are known, more points gather where those around them do not agree on what an even sky, and all
emitters alike, would send: whatever shines, the same points gather.
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
Rows = NDArray[np.int64]
N_GATHERING = 3072
N_MORE, _ROUNDS = 1024, 2  # where none is close
N_RAYS = 512
_AT_ONCE = 64  # gathering points: 32,768 rays
_BESIDE, _CANDIDATES = 8, 12
_INTERPOLATED = 8192  # points at a time
# By how much of the scene's size two opposite normals are apart.
_TURNED = 0.25
# An irradiance is off by about this much, as a share, where it is interpolated from a point as close [Ward88, eq. 3].
_CLOSE = 0.35
# The mean distance of what a point meets is taken for more than this share of the scene's size, and for less than that.
_LEAST_REACH, _MOST_REACH = 0.003, 0.1
# Points around which gathered light differs by this share gather as well.
_UNLIKE, _FURTHER_ROUNDS = 0.15, 2
_FAINT = 0.25  # of the mean, by which faint light counts as if it were as bright
# Rays from point to point leave their surfaces by this share of their length: they lie in them, and would hit them.
_RAISED = 0.002
# Objects are worth points on their backs from this share of all rays on.
_BEHIND = 0.02


@dataclass(frozen=True, eq=False)
class Gathering:
    """Points (G,) that gather: the shading points at which their rays end (G, R), −1 where they meet none; how far they
    reach (G,), harmonic means as a share of the scene's size; and how many rays met each object (M,) from behind where
    it has no points."""

    points: Rows
    ends: NDArray[np.int32]
    reach: Floats
    behind: Rows

    def with_more(self, other: Gathering) -> Gathering:
        """These and others."""
        both = ((getattr(self, name), getattr(other, name)) for name in ("points", "ends", "reach"))
        points, ends, reach = map(np.concatenate, both)
        return Gathering(points, ends, reach, self.behind + other.behind)

    def gathered(self, sent: Floats) -> Floats:
        """Of what all points send (S, 3), (G, 3)."""
        found = np.empty((len(self.ends), 3), np.float32)
        kernels.gather(self.ends, np.ascontiguousarray(sent), found)
        return found


@dataclass(frozen=True, eq=False)
class Around:
    """Of all points: the gathering ones around each, beside (S, K), by their share (S, K), and by which share
    irradiance is off that is taken from the best of them, error (S,), infinite where none is in sight."""

    beside: NDArray[np.int32]
    share: Floats
    error: Floats

    def between(self, gathered: Floats) -> Floats:
        """What is gathered (G, 3) at all points, (S, 3)."""
        found = np.empty((len(self.beside), 3), np.float32)
        kernels.spread(self.beside, self.share, gathered, found)
        return found


@dataclass(frozen=True, eq=False)
class Bounces:
    """Who gathers, and who takes it from whom; behind: objects that many rays meet from behind, where they have no
    points; is_refined: whether more gather where light has an edge."""

    gathering: Gathering
    around: Around
    behind: frozenset[int]
    is_refined: bool = False

    def indirect(self, direct: Floats, albedo: Floats, n_bounces: int) -> tuple[Floats, Floats]:
        """Irradiance (S, 3) after the first bounce and up to n_bounces, from that of the lights (S, 3); and of the
        lights and up to one bounce less, which is what others show in a mirror.

        albedo (S, 3): of what the points lie on; above 1 it counts as 1: light must not grow from bounce to bounce.
        """
        total, latest, bounded = np.zeros_like(direct), direct, np.minimum(albedo, 1.0)
        for _ in range(n_bounces - 1):
            latest = self.around.between(self.gathering.gathered(latest * bounded))
            total += latest
        return total, direct + total - (latest if n_bounces > 1 else 0.0)


def bouncing(points: ShadingPoints, mesh: PointMesh) -> Generator[None, None, Bounces]:
    """Send the rays, in pieces."""
    size, where, open_ = _space(points)
    gathering = yield from _sent(points, mesh, _evenly(points, where, open_, N_GATHERING), size)
    around = yield from _around(points, mesh, where, gathering, size)
    for _ in range(_ROUNDS):
        more = _evenly(points, where, open_[around.error[open_] > _CLOSE], N_MORE)
        if not len(more):
            break
        gathering = gathering.with_more((yield from _sent(points, mesh, more, size)))
        around = yield from _around(points, mesh, where, gathering, size)
    often = points.sides[:, 1] & (gathering.behind > _BEHIND * max(gathering.ends.size, 1))
    return Bounces(gathering, around, frozenset(np.flatnonzero(often).tolist()))


def refining(bounces: Bounces, points: ShadingPoints, mesh: PointMesh, shone: Floats) -> Generator[None, None, Bounces]:
    """More rays, where those that gather around a point do not agree; shone (S, 3): irradiance of three lights that
    stand for all that may shine there."""
    size, where, open_ = _space(points)
    gathering, around = bounces.gathering, bounces.around
    for _ in range(_FURTHER_ROUNDS):
        unlike = _unlike(gathering, around, shone)
        wanted = (unlike > _UNLIKE) | (around.error > _CLOSE)
        near = np.flatnonzero(wanted | (unlike > 0.5 * _UNLIKE))
        wanted[gathering.points] = False
        more = _evenly(points, where, open_[wanted[open_]], N_MORE)
        yield
        if not len(more):
            break
        gathering = gathering.with_more((yield from _sent(points, mesh, more, size)))
        around = yield from _around(points, mesh, where, gathering, size, around, near)
    return Bounces(gathering, around, bounces.behind, True)


def _space(points: ShadingPoints) -> tuple[float, Floats, Rows]:
    """The scene's size, where points are in place and normal (S, 6), and those that are not buried."""
    size = float(np.ptp(points.position, axis=0).max()) if len(points) else 1.0
    where = np.concatenate([points.position, points.normal * np.float32(0.5 * _TURNED * size)], axis=1)
    return size, where, np.arange(len(points)) if points.buried is None else np.flatnonzero(~points.buried)


def _unlike(gathering: Gathering, around: Around, shone: Floats) -> Floats:
    """By which share (S,) those that gather around each point differ in light that was reflected once and twice, by
    half each time."""
    once = gathering.gathered(0.5 * shone)
    found = once + gathering.gathered(0.5 * around.between(once))
    mean, square = around.between(found), around.between(found**2)
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    least = np.maximum(_FAINT * mean.mean(axis=0, keepdims=True), 1e-12)
    return np.asarray((spread / np.maximum(mean, least)).max(axis=1, initial=0.0), np.float32)


def _sent(points: ShadingPoints, mesh: PointMesh, chosen: Rows, size: float) -> Generator[None, None, Gathering]:
    """Rays of some points (G,); size: of the scene."""
    ends, tables = np.empty((len(chosen), N_RAYS), np.int32), cosine_tables(N_RAYS)
    nearness, behind = np.empty(len(chosen)), np.zeros(len(points.sides), np.int64)
    chance = np.random.default_rng(2)
    for start in range(0, len(chosen), _AT_ONCE):
        some = chosen[start : start + _AT_ONCE]
        frames = points.frames[some][:, [0, 2, 1]]  # the tables' third axis is the normal
        ways = np.einsum("nrk,nki->nri", tables[: len(some)], frames).reshape(-1, 3)
        found, distance = mesh.trace(np.repeat(points.lifted[some], N_RAYS, axis=0), np.ascontiguousarray(ways))
        corner = (chance.random(len(ways))[:, None] > found.weights.cumsum(axis=1)[:, :2]).sum(axis=1)
        at = np.take_along_axis(found.corners, corner[:, None], axis=1)[:, 0]
        ends[start : start + _AT_ONCE] = np.where(found.corners[:, 0] >= 0, at, -1).reshape(-1, N_RAYS)
        near = 1.0 / np.maximum(distance.astype(np.float64), 1e-6 * size)
        nearness[start : start + _AT_ONCE] = near.reshape(-1, N_RAYS).mean(axis=1)
        behind += np.bincount(found.i_object[found.behind], minlength=len(behind))
        yield
    reach = np.clip(1.0 / np.maximum(nearness * size, 1e-9), _LEAST_REACH, _MOST_REACH)
    return Gathering(chosen, ends, reach.astype(np.float32), behind)


def _around(
    points: ShadingPoints, mesh: PointMesh, where: Floats, gathering: Gathering, size: float,
    before: Around | None = None, among: Rows | None = None,
) -> Generator[None, None, Around]:  # fmt: skip
    """What is gathered between points that gather, where (S, 6) all are in place and normal; before, among: as it was
    with fewer of these, and the points (N,) that others are to be found for."""
    n, tree, k = len(points), cKDTree(where[gathering.points]), min(_CANDIDATES, len(gathering.points))
    beside, share = np.zeros((n, _BESIDE), np.int32), np.zeros((n, _BESIDE), np.float32)
    error, most = np.full(n, np.inf, np.float32), min(_BESIDE, k)
    if before is not None:
        beside, share, error = before.beside.copy(), before.share.copy(), before.error.copy()
    asked = np.arange(n) if among is None else among
    for start in range(0, len(asked), _INTERPOLATED):
        here = asked[start : start + _INTERPOLATED]
        _, number = tree.query(where[here], k, workers=-1)
        number = number.reshape(-1, k)
        there = gathering.points[number]
        apart = np.linalg.norm(points.position[there] - points.position[here, None], axis=2)
        along = np.einsum("nki,ni->nk", points.normal[there], points.normal[here])
        off = apart / (size * gathering.reach[number]) + np.sqrt(np.maximum(1.0 - along, 0.0))
        best = np.argsort(off, axis=1)[:, :most]
        number, there, off = (np.take_along_axis(each, best, axis=1) for each in (number, there, off))
        yield
        raised = np.float32(_RAISED) * np.take_along_axis(apart, best, axis=1)[..., None]
        origins = points.lifted[here, None] + raised * points.normal[here, None]
        ends = points.lifted[there] + raised * points.normal[there]
        seen = mesh.sight.sees(origins.reshape(-1, 3), ends.reshape(-1, 3)).reshape(there.shape)
        inverse = 1.0 / (off + 1e-6)
        weights = np.where(seen, (inverse - 0.999 * inverse[:, -1:]) ** 2, 0.0)  # [Shepard68], the farthest fading out
        alone = ~weights.any(axis=1)
        weights[alone] = inverse[alone] ** 2
        beside[here, :most], share[here, :most] = number, weights / weights.sum(axis=1, keepdims=True)
        error[here] = np.where(seen, off, np.inf).min(axis=1)
        yield
    return Around(beside, share, error)


def _evenly(points: ShadingPoints, where: Floats, among: Rows, n_most: int) -> Rows:
    """About n_most of some points (N,), in cubes over place and normal (S, 6), one of each."""
    chosen, cells = among, 1024.0
    low, span = where.min(axis=0, initial=np.inf), np.ptp(where, axis=0).max() if len(where) else 1.0
    while len(chosen) > n_most:
        cells *= 0.8
        cubes = ((where[chosen] - low) * (cells / span)).astype(np.int64)
        keys = np.concatenate([cubes, points.i_object[chosen, None]], axis=1)
        order = np.lexsort(keys.T)
        is_first = np.concatenate([[True], (np.diff(keys[order], axis=0) != 0).any(axis=1)])
        chosen = chosen[order[is_first]]
    return np.sort(chosen)
