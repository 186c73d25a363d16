"""Indirect light between diffuse reflections, independent of the camera: irradiance by equivalent albedo.

Some thousand of the shading points gather: each traces cosine-distributed rays once, and stores for each ray a shading
point at the hit (one of the three around it, chosen with a probability that rises with nearness). For any light and any
materials afterwards

    E_(b+1)(p) = mean over p's rays of  d(q) E_b(q),       indirect irradiance = E_2 + ... + E_N,

where E_1 is the points' direct irradiance and d the equivalent albedo at the hit [BenArtzi07, 5.2.4]. Irradiance
is interpolated between gathering points as in an irradiance cache [Ward88]: weights fall with the distance over the
mean distance of the surfaces that rays meet, and with the angle between normals; they are then changed so that
irradiance may fall evenly across a surface [Lancaster81]. A point never takes irradiance from
one behind a wall, which may be a hundred times as bright. Points far from all gathering points gather as well. An
update takes some milliseconds, so it follows every change.

Back faces that only a camera requested gather by rays of their own, which may end at them; no other rays do. So the
light elsewhere does not depend on where cameras have been.

Near a door that is ajar, irradiance falls to a tenth within centimetres, although all surfaces that rays meet are far
away. So once all shadows are known, more points gather where their neighbours disagree under two probes, an even sky
and all emitters at equal radiance. The choice of gathering points thus does not depend on the actual light.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from engine.core.threads import even_parts, on_threads
from engine.precompute.indirect.direction_patterns import cosine_tables
from engine.realtime.core.shading_points import Int32Array, ShadingPoints
from engine.realtime.core.view_samples import PointMesh
from engine.realtime.triple_product import _incident_kernels as kernels

Float32Array = NDArray[np.float32]
Rows = NDArray[np.int64]
N_GATHERING = 6144
N_MORE, _ROUNDS = 2048, 2  # where no gathering point is close
N_OF_BACKS = 512  # for backs that a camera requested
N_RAYS = 512
_AT_ONCE = 64  # gathering points: 32,768 rays
_BESIDE, _CANDIDATES = 12, 16
# Ridge against slopes that few or distant gathering points would exaggerate, as a share of their mean square distance.
_STIFF = 0.1
_INTERPOLATED = 8192  # points at a time
# Distance that counts for opposite normals, as a share of the scene's size.
_TURNED = 0.25
# Largest accepted relative error of irradiance that is interpolated from one record [Ward88, eq. 3].
_CLOSE = 0.35
# The mean distance of the surfaces around a point is clamped to this range, as shares of the scene's size.
_LEAST_REACH, _MOST_REACH = 0.003, 0.1
# Relative difference between gathered values above which points in between gather as well.
_UNLIKE, _FURTHER_ROUNDS = 0.15, 2
_FAINT = 0.25  # share of the mean that is added to brightness, so that faint light needs no accuracy
# Rays from point to point start and end this share of their length off their surfaces, which they would hit otherwise.
_RAISED = 0.002
# An object's backs get points if they receive more than this share of all rays.
_BACK_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Gathering:
    """Gathering points (G,), as indices: ends (G, R), the shading points at the ends of their rays, −1 where a ray met
    none; pattern (G,), the row of `cosine_tables` that the rays follow; reach (G,), the harmonic mean distance of what
    they met, as a share of the scene's size; behind (M,), how many rays met each object from behind where it has no
    points to end at."""

    points: Rows
    ends: NDArray[np.int32]
    pattern: NDArray[np.uint8]
    reach: Float32Array
    behind: Rows

    def with_more(self, other: Gathering) -> Gathering:
        """Concatenate with another set."""
        both = ((getattr(self, name), getattr(other, name)) for name in ("points", "ends", "pattern", "reach"))
        points, ends, pattern, reach = map(np.concatenate, both)
        return Gathering(points, ends, pattern, reach, self.behind + other.behind)

    def gathered(self, sent: Float32Array) -> Float32Array:
        """Gather (G, 3) from the radiosity of all points (S, 3)."""
        found = np.empty((len(self.ends), 3), np.float32)
        sent = np.ascontiguousarray(sent)
        on_threads(
            lambda start, stop: kernels.gather_bounces(self.ends[start:stop], sent, found[start:stop]),
            *even_parts(len(found)),
        )
        return found


@dataclass(frozen=True, eq=False)
class Around:
    """Neighbours of points (N,): the gathering points beside (N, K) with weights share (N, K), some of them below 0
    where irradiance is extrapolated, and error (N,), the relative error of irradiance from the best of them; infinite
    if none is in sight."""

    beside: NDArray[np.int32]
    share: Float32Array
    error: Float32Array

    def between(self, gathered: Float32Array) -> Float32Array:
        """Interpolate gathered values (G, 3) at the points, (N, 3)."""
        found = np.empty((len(self.beside), 3), np.float32)
        kernels.spread_bounces(self.beside, self.share, gathered, found)
        return np.maximum(found, np.float32(0.0))


@dataclass(frozen=True, eq=False)
class Exchange:
    """Points (N,) that exchange light: which of them gather, and which neighbours the others interpolate; is_refined:
    whether more points gather at edges of light."""

    rows: Rows
    gathering: Gathering
    around: Around
    is_refined: bool = False

    @property
    def behind(self) -> frozenset[int]:
        """Objects that many rays meet from behind, where these have no points to end at."""
        often = self.gathering.behind > _BACK_SHARE * max(self.gathering.ends.size, 1)
        return frozenset(np.flatnonzero(often).tolist())

    def gathered(self, sent: Float32Array, found: Float32Array, more: Float32Array | None = None) -> None:
        """Write to found (S, 3) what the points gather from the radiosity of all points (S, 3); more (G, 3): is added
        to what the gathering points receive."""
        received = self.gathering.gathered(sent)
        found[self.rows] = self.around.between(received if more is None else np.maximum(received + more, 0.0))


@dataclass(frozen=True, eq=False)
class Bounces:
    """The paths of indirect light: between all points that may light others, and to backs that only a camera
    requested."""

    between: Exchange
    to_backs: tuple[Exchange, ...] = ()

    @property
    def exchanges(self) -> tuple[Exchange, ...]:
        """All of them."""
        return self.between, *self.to_backs

    def indirect(
        self, direct: Float32Array, albedo: Float32Array, n_bounces: int, glossy: Sequence[Float32Array] = ()
    ) -> tuple[Float32Array, Float32Array]:
        """Return the indirect irradiance (S, 3) of bounces 2 to n_bounces, given the direct irradiance (S, 3); and the
        sum of direct and indirect irradiance up to one bounce less, which mirrors show of other surfaces.

        albedo (S, 3): of the surface at each point; values above 1 count as 1, so that light does not grow from bounce
        to bounce. glossy: for each exchange, what gathering points (G, 3) receive more of direct light that gloss
        reflects, see `glossy_bounces.second_bounce`.
        """
        total, latest, bounded = np.zeros_like(direct), direct, np.minimum(albedo, 1.0)
        more: Sequence[Float32Array | None] = glossy or [None] * len(self.exchanges)
        for i_bounce in range(n_bounces - 1):
            sent, latest = latest * bounded, np.zeros_like(direct)
            for exchange, received in zip(self.exchanges, more, strict=True):
                exchange.gathered(sent, latest, received if i_bounce == 0 else None)
            total += latest
        return total, direct + total - (latest if n_bounces > 1 else 0.0)


def trace_bounce_rays(
    points: ShadingPoints, mesh: PointMesh, late: Int32Array | None = None, i_object: int = -1, rows: Rows | None = None
) -> Generator[None, None, Exchange]:
    """Trace the rays of the points in rows (N,), or of all if None, in pieces.

    late (S,): the object of points on backs that only a camera requested, else −1; i_object: the object whose late
    points these are, or −1.
    """
    late = np.full(len(points), -1, np.int32) if late is None else late
    rows = np.arange(len(points)) if rows is None else rows
    space, n_most = _Space.of(points, rows), N_GATHERING if i_object < 0 else N_OF_BACKS
    gathering = yield from _trace_rays(
        points, mesh, _choose_evenly(points, space, space.is_open, n_most), space, late, i_object
    )
    around = yield from _interpolate(points, mesh, space, gathering)
    for _ in range(_ROUNDS if i_object < 0 else 0):
        more = _choose_evenly(points, space, space.is_open & (around.error > _CLOSE), N_MORE)
        if not len(more):
            break
        gathering = gathering.with_more((yield from _trace_rays(points, mesh, more, space, late, i_object)))
        around = yield from _interpolate(points, mesh, space, gathering)
    return Exchange(rows, gathering, around)


def refining(
    exchange: Exchange, points: ShadingPoints, mesh: PointMesh, shone: Float32Array, late: Int32Array
) -> Generator[None, None, Exchange]:
    """Trace rays of more points where the gathering points around them disagree; shone (S, 3): irradiance under three
    probe lights, one per channel, which represent all possible light; late: see `trace_bounce_rays`."""
    rows, space = exchange.rows, _Space.of(points, exchange.rows)
    for _ in range(_FURTHER_ROUNDS if len(rows) else 0):
        unlike, around = _unlike(exchange, shone), exchange.around
        wanted = (unlike > _UNLIKE) | (around.error > _CLOSE)
        near = np.flatnonzero(wanted | (unlike > 0.5 * _UNLIKE))
        wanted &= space.is_open & ~np.isin(rows, exchange.gathering.points)
        more = _choose_evenly(points, space, wanted, N_MORE)
        yield
        if not len(more):
            break
        gathering = exchange.gathering.with_more((yield from _trace_rays(points, mesh, more, space, late)))
        around = yield from _interpolate(points, mesh, space, gathering, around, near)
        exchange = replace(exchange, gathering=gathering, around=around)
    return replace(exchange, is_refined=True)


@dataclass(frozen=True, eq=False)
class _Space:
    """Coordinates of points: where (S, 6) holds position and normal; rows (N,), the points that exchange light, lie
    within span from low (6,) on; is_open (N,): which of them are not buried; size: of the scene."""

    size: float
    where: Float32Array
    rows: Rows
    low: Float32Array
    span: float
    is_open: NDArray[np.bool_]

    @classmethod
    def of(cls, points: ShadingPoints, rows: Rows) -> _Space:
        size = float(np.ptp(points.position, axis=0).max()) if len(points) else 1.0
        where = np.concatenate([points.position, points.normal * np.float32(0.5 * _TURNED * size)], axis=1)
        own = where[rows]
        span = float(np.ptp(own, axis=0).max()) if len(own) else 1.0
        is_open = np.ones(len(rows), bool) if points.buried is None else ~points.buried[rows]
        return cls(size, where, rows, own.min(axis=0, initial=np.inf), span, is_open)


def _unlike(exchange: Exchange, shone: Float32Array) -> Float32Array:
    """Relative difference (N,) among the gathering points around each point, in light that was reflected once and twice
    with an albedo of ½."""
    gathering, around, sent = exchange.gathering, exchange.around, np.zeros_like(shone)
    once = gathering.gathered(0.5 * shone)
    sent[exchange.rows] = 0.5 * around.between(once)
    found = once + gathering.gathered(sent)
    share = np.abs(around.share)
    around = replace(around, share=share / share.sum(axis=1, keepdims=True))
    mean, square = around.between(found), around.between(found**2)
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    least = np.maximum(_FAINT * mean.sum(axis=0, keepdims=True) / max(len(mean), 1), 1e-12)  # there may be no points
    return np.asarray((spread / np.maximum(mean, least)).max(axis=1, initial=0.0), np.float32)


def _trace_rays(
    points: ShadingPoints, mesh: PointMesh, chosen: Rows, space: _Space, late: Int32Array, i_object: int = -1
) -> Generator[None, None, Gathering]:
    """Trace rays of the chosen points (G,). Late points (S,) are ends only for rays of their own object."""
    ends, tables = np.empty((len(chosen), N_RAYS), np.int32), cosine_tables(N_RAYS)
    nearness, behind = np.empty(len(chosen)), np.zeros(len(points.sides), np.int64)
    chance = np.random.default_rng(2)
    for start in range(0, len(chosen), _AT_ONCE):
        some = chosen[start : start + _AT_ONCE]
        frames = points.frames[some][:, [0, 2, 1]]  # the tables' third axis is the normal
        directions = np.einsum("nrk,nki->nri", tables[: len(some)], frames).reshape(-1, 3)
        found, distance = mesh.trace(np.repeat(points.lifted[some], N_RAYS, axis=0), np.ascontiguousarray(directions))
        corner = (chance.random(len(directions))[:, None] > found.weights.cumsum(axis=1)[:, :2]).sum(axis=1)
        is_met = found.corners[:, 0] >= 0
        at = np.where(is_met, np.take_along_axis(found.corners, corner[:, None], axis=1)[:, 0], 0)
        is_late = is_met & (late[at] >= 0) & (late[at] != i_object)
        ends[start : start + _AT_ONCE] = np.where(is_met & ~is_late, at, -1).reshape(-1, N_RAYS)
        near = 1.0 / np.maximum(distance.astype(np.float64), 1e-6 * space.size)
        nearness[start : start + _AT_ONCE] = near.reshape(-1, N_RAYS).mean(axis=1)
        behind += np.bincount(found.i_object[found.behind | is_late], minlength=len(behind))
        yield
    reach = np.clip(1.0 / np.maximum(nearness * space.size, 1e-9), _LEAST_REACH, _MOST_REACH)
    pattern = (np.arange(len(chosen)) % _AT_ONCE).astype(np.uint8)
    return Gathering(chosen, ends, pattern, reach.astype(np.float32), np.where(points.sides[:, 1], behind, 0))


def _interpolate(
    points: ShadingPoints, mesh: PointMesh, space: _Space, gathering: Gathering,
    before: Around | None = None, among: Rows | None = None,
) -> Generator[None, None, Around]:  # fmt: skip
    """Find the interpolation weights at points (N,) between the gathering points; before, among: the result with fewer
    gathering points, and which of the N points need a new one."""
    rows, n = space.rows, len(space.rows)
    tree, k = cKDTree(space.where[gathering.points]), min(_CANDIDATES, len(gathering.points))
    beside, share = np.zeros((n, _BESIDE), np.int32), np.zeros((n, _BESIDE), np.float32)
    error, most = np.full(n, np.inf, np.float32), min(_BESIDE, k)
    if before is not None:
        beside, share, error = before.beside.copy(), before.share.copy(), before.error.copy()
    requested = np.arange(n) if among is None else among
    for start in range(0, len(requested), _INTERPOLATED):
        at = requested[start : start + _INTERPOLATED]
        here = rows[at]
        _, number = tree.query(space.where[here], k, workers=-1)
        number = number.reshape(-1, k)
        there = gathering.points[number]
        apart = np.linalg.norm(points.position[there] - points.position[here, None], axis=2)
        along = np.einsum("nki,ni->nk", points.normal[there], points.normal[here])
        off = apart / (space.size * gathering.reach[number]) + np.sqrt(np.maximum(1.0 - along, 0.0))
        best = np.argsort(off, axis=1)[:, :most]
        number, there, off = (np.take_along_axis(each, best, axis=1) for each in (number, there, off))
        yield
        raised = np.float32(_RAISED) * np.take_along_axis(apart, best, axis=1)[..., None]
        origins = points.lifted[here, None] + raised * points.normal[here, None]
        ends = points.lifted[there] + raised * points.normal[there]
        seen = mesh.visibility.sees(origins.reshape(-1, 3), ends.reshape(-1, 3)).reshape(there.shape)
        inverse = 1.0 / (off + 1e-6)
        # [Shepard68], with the farthest fading out.
        weights = np.where(seen, (inverse - 0.999 * inverse[:, -1:]) ** 2, 0.0)
        alone = ~weights.any(axis=1)
        weights[alone] = inverse[alone] ** 2
        weights /= weights.sum(axis=1, keepdims=True)
        offsets = points.position[there] - points.position[here, None]
        within = np.einsum("nki,nji->nkj", offsets, points.frames[here][:, ::2])  # along tangent and bitangent
        beside[at, :most], share[at, :most] = number, _following_slopes(weights, within)
        error[at] = np.where(seen, off, np.inf).min(axis=1)
        yield
    return Around(beside, share, error)


def _following_slopes(weights: NDArray[np.floating], offsets: NDArray[np.floating]) -> NDArray[np.float64]:
    """Change weights (N, K), whose sums are 1, so that they reproduce linear functions of the neighbours' offsets
    (N, K, 2) at 0, by moving least squares [Lancaster81]; the sums stay 1. A ridge keeps them bounded where neighbours
    lie on one side."""
    # The basis p = (1, x, y), with x and y scaled to a mean square distance of 1; w' = w p·(Σ w p pᵀ)⁻¹ (1, 0, 0).
    square = np.einsum("nk,nki,nki->n", weights, offsets, offsets)
    basis = np.ones((*weights.shape, 3))
    basis[..., 1:] = offsets / np.sqrt(np.maximum(square, 1e-30))[:, None, None]
    moments = np.einsum("nk,nki,nkj->nij", weights, basis, basis) + np.diag([0.0, _STIFF, _STIFF])
    first = np.linalg.solve(moments, np.broadcast_to([[1.0], [0.0], [0.0]], (len(weights), 3, 1)))[..., 0]
    return np.asarray(weights * np.einsum("nki,ni->nk", basis, first))


def _choose_evenly(points: ShadingPoints, space: _Space, wanted: NDArray[np.bool_], n_most: int) -> Rows:
    """Choose about n_most of the wanted points (N,): one in each occupied cell of a grid over position and normal."""
    chosen, cells = np.flatnonzero(wanted), 1024.0
    while len(chosen) > n_most:
        cells *= 0.8
        rows = space.rows[chosen]
        cubes = ((space.where[rows] - space.low) * (cells / space.span)).astype(np.int64)
        keys = np.concatenate([cubes, points.i_object[rows, None]], axis=1)
        order = np.lexsort(keys.T)
        is_first = np.concatenate([[True], (np.diff(keys[order], axis=0) != 0).any(axis=1)])
        chosen = chosen[order[is_first]]
    return space.rows[np.sort(chosen)]
