"""Light between objects that bend and objects that rest: one bounce, shadows, and the light of lamps in the scene.

An object whose transfer contains only itself is lit as if by distant light of its own: what comes from all around to
the middle of its place at rest, the sky where it is open, what neighbours reflect, and lamps. So neighbours shade it,
and send light back, at no further cost in a frame [Sloan05, 5: local lighting], however it bends. Points of the other
objects, whose transfer has their neighbours' shadows, get one bounce of what all others reflect, and the light of lamps
by rays. Rays are traced once, with all objects at rest; when the light or a material changes, what they meet is summed
anew.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.core.triangles import quarters
from engine.light.cones import cone_shares
from engine.light.emitters import Emitted, EmitterTree, emitter_tree, emitting_triangles, merge_triangles
from engine.light.environment import LUMINANCE, triangle_integrals
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics import _transfer_kernels as kernels
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.transfer import cosine_directions, ray_blocks
from engine.scene.emission_textures import emitting_triangles_of
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.sphere.geodesic import geodesic
from engine.sphere.harmonics import basis, project

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]

N_BOUNCE_RAYS = 256  # from each point at rest
N_LAMP_SAMPLES = 64  # on each lamp: a ball is then 1 % off (`engine.light.emitters`)
N_TEXTURED_SAMPLES = 128  # on a lamp with a texture
N_MOVING_SAMPLES = 32  # on a wide lamp that moving gloss mirrors
PROBE_LEVEL = 5  # of the sphere's triangles, around each object that has light of its own
SHORTENED = 1.0 - 1e-3  # of rays to lamps, which must not meet these themselves


@dataclass(frozen=True, eq=False)
class Hits:
    """Hits of rays on points' triangles: those of ray bundle b are firsts[b] to firsts[b + 1]; corners (H', 3): the
    points at the corners of the side that was hit, by `triangle` (H,); u, v (H,)."""

    firsts: NDArray[np.int64]
    triangle: Int32Array
    u: Float32Array
    v: Float32Array
    corners: Int32Array

    def gather(self, sent: Float64Array, share: float) -> Float64Array:
        """Sum what the hits of each bundle send (B, 3), of points that send (S, 3), times share."""
        result = np.zeros((len(self.firsts) - 1, sent.shape[1]))
        on_threads(
            lambda start, stop: kernels.gather_bounces(
                self.firsts, self.triangle, self.u, self.v, self.corners, share, sent, start, stop, result
            ),
            *even_parts(len(result)),
        )
        return result


@dataclass(frozen=True, eq=False)
class Probe:
    """What is around an object: hits (T bundles), one ray through each triangle of the sphere; is_open (T,): whether
    the sky is seen there; lamps (L, n^2, 3): harmonics of each lamp of emission 1, of which the shares (L,) arrive."""

    hits: Hits
    is_open: NDArray[np.bool_]
    lamps: Float64Array
    shares: Float64Array


@dataclass(frozen=True, eq=False)
class LightPaths:
    """Where light goes between objects at rest. lit (R,): the points whose transfer has their neighbours' shadows;
    bounces (R bundles): what these see of other objects; lamps (R, L, 3): radiance of white diffuse ones by each lamp
    of emission 1, of which the shares (R, L) arrive; probes: of the other objects, by index; emitters: by the indices
    of the L objects that emit, their parts, and fewer for moving pictures."""

    lit: NDArray[np.int64]
    bounces: Hits
    lamps: Float64Array
    shares: Float64Array
    probes: Mapping[int, Probe]
    emitters: Mapping[int, tuple[list[LampSample], list[LampSample]]]

    def linked(self, reach: NDArray[np.bool_], owners: NDArray[np.integer]) -> LightPaths:
        """The same where each lamp lights some objects alone, reach (M, L); owners (S,): the objects of all points."""
        of_lit = reach[owners[self.lit]]
        probes = {
            i: replace(probe, lamps=probe.lamps * reach[i, :, None, None], shares=probe.shares * reach[i])
            for i, probe in self.probes.items()
        }
        return replace(self, lamps=self.lamps * of_lit[..., None], shares=self.shares * of_lit, probes=probes)


def trace_light_paths(
    scene: Scene, points: BendingPoints, alone: Sequence[int], order: int, away: Sequence[int] = ()
) -> Generator[float, None, LightPaths]:
    """Trace them; scene: with emitters where they shine; alone: the objects whose transfer contains only themselves;
    away: those that stand elsewhere than at rest, and block no light there. Yields the share that is done."""
    n_objects = len(scene.smooth)
    lamps = {i: lamp_samples(scene, i) for i in np.flatnonzero(scene.emitters).tolist()}
    lit_objects = [i for i in range(n_objects) if scene.reflecting[i] and i not in alone]
    everything = tuple(i for i in range(n_objects) if i not in away)
    parts, lit = list[tuple[NDArray, ...]](), [np.zeros(0, np.int64)]
    of_lamps, shares = [np.zeros((0, len(lamps), 3))], [np.zeros((0, len(lamps)))]
    for done, i in enumerate(lit_objects):
        mine = points.points_of(i)
        lit.append(mine)
        for stop, hits in _bounces(points, i, everything):
            parts.append(hits)
            yield (done + stop / max(len(mine), 1)) / (len(lit_objects) + 1)
        radiance, share = _lamp_light(points, i, list(lamps.values()), everything)
        of_lamps.append(radiance)
        shares.append(share)
    hidden = {*alone, *away}
    probes = {i: _probe(scene, points, i, hidden, lamps, order) for i in alone if scene.reflecting[i]}
    yield 1.0
    emitters = {i: (samples, lamp_samples(scene, i, N_MOVING_SAMPLES)) for i, samples in lamps.items()}
    arrives = np.concatenate(of_lamps), np.concatenate(shares)
    return LightPaths(np.concatenate(lit), _joined(points, parts), *arrives, probes, emitters)


def local_light(
    paths: LightPaths, powers: Mapping[int, Float64Array], sent: Float64Array, emission: Float64Array, order: int
) -> dict[int, tuple[Float64Array, Float64Array]]:
    """Harmonics of the light around each object that has light of its own: of what is distant or reflected (n^2, 3),
    and of lamps (L, n^2, 3); powers (T, 3): of the sky of each, by triangle; sent (S, 3): radiance of all points;
    emission (M, 3)."""
    angles = geodesic(PROBE_LEVEL).solid_angles[:, None]
    found = {}
    for i, probe in paths.probes.items():
        around = np.where(probe.is_open[:, None], powers[i], angles * probe.hits.gather(sent, 1.0))
        found[i] = project(around, order), probe.lamps * emission[list(paths.emitters)][:, None]
    return found


def sky_powers(sky: SkyState) -> Float64Array:
    """Integrals (T, 3) of a sky's radiance over the sphere's triangles."""
    if sky.environment is None:
        return np.zeros((len(geodesic(PROBE_LEVEL).centres), 3))
    return triangle_integrals(sky.environment, sky.rotation, PROBE_LEVEL) * sky.scale


def added_light(paths: LightPaths, sent: Float64Array, emission: Float64Array) -> Float64Array:
    """Radiance (S, 3) of white diffuse points by one bounce of what points of other objects send (S, 3), and by lamps
    of emission (M, 3); 0 at points of objects that have light of their own."""
    added = np.zeros_like(sent)
    added[paths.lit] = paths.bounces.gather(sent, 1.0 / N_BOUNCE_RAYS) + light_of_lamps(paths, emission)
    return added


def light_of_lamps(paths: LightPaths, emission: Float64Array) -> Float64Array:
    """Radiance (R, 3) of the white diffuse points `lit` by lamps of emission (M, 3)."""
    return np.asarray(np.einsum("rlc,lc->rc", paths.lamps, emission[list(paths.emitters)]))


class LampSample(NamedTuple):
    """A part of an emitter: the centre of its light (3,) with its normal (3,) and area, the cone (4,) that it sends its
    light into, and by what its texture multiplies the emission there (3,); target (3,): where on it rays go, so that no
    straight edge of a shadow passes many at once."""

    place: Float64Array
    normal: Float64Array
    area: float
    cone: NDArray[np.float32]
    tint: Float64Array
    target: Float64Array


@dataclass(frozen=True, eq=False)
class Lamp:
    """An emitter: its parts, fewer for moving pictures, and its radiance (3,)."""

    samples: Sequence[LampSample]
    few: Sequence[LampSample]
    emission: Float64Array

    @cached_property
    def rows(self) -> Float64Array:
        """Its parts (N, 14): place, normal, area, cone, tint."""
        return np.array([np.hstack([*each[:5]]) for each in self.samples]).reshape(-1, 14)


def lamp_samples(scene: Scene, i: int, n: int = 0) -> list[LampSample]:
    """About n parts of an emitter, of equal area, or of equal power of one with a texture; n = 0: `N_LAMP_SAMPLES`, or
    `N_TEXTURED_SAMPLES` with a texture."""
    emitting = emitting_triangles_of(replace(scene, emission=np.ones_like(scene.emission)))
    mine = scene.object_of_triangle[emitting.triangle] == i
    emitting = emitting.of(mine & emitting_triangles(emitting.corners, emitting.radiance))
    is_textured = i in scene.emission_textures.objects
    n = n or (N_TEXTURED_SAMPLES if is_textured else N_LAMP_SAMPLES)
    one_kind = np.zeros(len(emitting.corners), np.intp)
    merged = merge_triangles(emitting.corners, emitting.radiance, n // 2 if is_textured else n, one_kind)
    varying = emitting.radiance_of_parts(merged)
    tree = emitter_tree(merged.corners, merged.radiance, n, _power if is_textured else None, varying=varying)
    places, of = _bright_centres(tree, varying), tree.leaves
    numbers = (each.astype(np.float64) for each in (places, of.normal, of.area, of.radiance, of.samples))
    return [
        LampSample(place, normal, area, scene.cones[i], tint, target)
        for place, normal, area, tint, target in zip(*numbers, strict=True)
    ]


def _bright_centres(tree: EmitterTree, varying: Emitted | None) -> NDArray[np.floating]:
    """The centres (N, 3) of the leaves' light, which is even unless it varies: of sixteen parts by their power. Places
    at random in each leaf are twice as far off."""
    if varying is None:
        return tree.leaves.centre
    leaf = np.flatnonzero(tree.child < 0)
    root = leaf[np.argsort(tree.first[leaf])]
    while (above := tree.parent[root]).max() >= 0:
        root = np.where(above >= 0, above, root)
    parts = tree.leaves.corners.astype(np.float64)
    for _ in range(2):
        parts = quarters(parts).reshape(-1, 3, 3)
    power = varying(parts, np.repeat(root, 16)).reshape(-1, 16, 3) @ LUMINANCE + 1e-30
    return np.einsum("ns,nsk->nk", power, parts.mean(axis=1).reshape(-1, 16, 3)) / power.sum(axis=1, keepdims=True)


def _power(corners: Float64Array, roots: NDArray[np.intp], radiance: Float64Array) -> Float64Array:
    """The power (K,) of triangles (K, 3, 3) with radiance (K, 3), twice."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(across, axis=1) * (radiance @ LUMINANCE))


def _bounces(
    points: BendingPoints, i: int, everything: tuple[int, ...]
) -> Generator[tuple[int, tuple[NDArray, ...]], None, None]:
    """Yield the ends of blocks of an object's points, with the counts of their hits on other objects, and the hits."""
    mesh = points.mesh(i, ())
    for start, stop, rays in ray_blocks(mesh, cosine_directions(N_BOUNCE_RAYS, 1)[0]):
        _, of_others, hits = _point_hits(points, everything, *rays, skipped=i)
        yield stop, (of_others.reshape(stop - start, N_BOUNCE_RAYS).sum(axis=1), *hits)


def _point_hits(
    points: BendingPoints, objects: tuple[int, ...], origins: Float32Array, directions: Float32Array, skipped: int = -1
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], tuple[NDArray, ...]]:
    """Which rays (R,) meet any of these objects, and which a side that has points, of another than `skipped`; and these
    sides (H,), numbered with the backs after all fronts, with u and v."""
    surface = points.surface
    numbers = np.flatnonzero(np.isin(surface.i_object, objects))
    found = points.caster(objects).intersect(origins, directions)
    hit = numbers[np.maximum(found.triangle, 0)]
    a, b, c = np.moveaxis(points.corners_at_rest(hit), 1, 0)
    is_back = np.einsum("rc,rc->r", directions, np.cross(b - a, c - a)) > 0.0
    has_points = surface.sides[hit, is_back.astype(int), 0] >= 0
    is_met = (found.triangle >= 0) & has_points & (surface.i_object[hit] != skipped)
    side = hit + is_back * len(surface.corners)
    return found.triangle >= 0, is_met, (side[is_met].astype(np.int32), found.u[is_met], found.v[is_met])


def _joined(points: BendingPoints, parts: Sequence[tuple[NDArray, ...]]) -> Hits:
    sides = points.surface.sides
    corners = np.concatenate([sides[:, 0], sides[:, 1]]).astype(np.int32)
    empty = np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0, np.float32), np.zeros(0, np.float32)
    counts, triangle, u, v = (np.concatenate(each) for each in zip(empty, *parts, strict=True))
    return Hits(np.concatenate([[0], np.cumsum(counts)]), triangle, u, v, corners)


def _lamp_light(
    points: BendingPoints, i: int, lamps: Sequence[list[LampSample]], everything: tuple[int, ...]
) -> tuple[Float64Array, Float64Array]:
    """Radiance (P, L, 3) of an object's white diffuse points by each lamp of emission 1; the share (P, L) of its light
    that arrives."""
    mesh = points.mesh(i, ())
    places, normals = mesh.points.offset_position.astype(np.float64), mesh.frames[:, 2]
    found, unblocked = np.zeros((len(places), len(lamps), 3)), np.zeros((len(places), len(lamps)))
    for k, lamp in enumerate(lamps):
        for sample in lamp:
            directions, factor = towards_lamp(places, sample)
            cosine = np.einsum("pc,pc->p", directions, normals)
            factor *= np.maximum(cosine, 0.0) / np.pi
            lit = np.flatnonzero(factor > 0.0)
            arrives = factor[lit] * ~_blocked(points.caster(everything), places[lit], sample.target)
            found[lit, k] += arrives[:, None] * sample.tint
            unblocked[:, k] += factor * sample.tint.sum()
    return found, found.sum(axis=2) / np.maximum(unblocked, 1e-30)


def towards_lamp(places: Float64Array, sample: LampSample) -> tuple[Float64Array, Float64Array]:
    """Directions (P, 3) from places (P, 3) to a part of a lamp, and the solid angle of its front there (P,) times the
    share of its light that its cone sends there."""
    to = sample.place - places
    distance = np.maximum(np.linalg.norm(to, axis=1), 1e-12)
    directions = to / distance[:, None]
    facing = np.maximum(-(directions @ sample.normal), 0.0) * sample.area
    # As of a disc, at most half of all directions.
    angle = 2.0 * np.pi * facing / (2.0 * np.pi * distance**2 + facing)
    return directions, angle * cone_shares(sample.cone, directions)


def _blocked(caster: RayCaster, places: Float64Array, place: Float64Array) -> NDArray[np.bool_]:
    """Whether something lies between places (P, 3) and one of a lamp."""
    to = (place - places).astype(np.float32)
    return caster.occluded(places.astype(np.float32), to, np.full(len(to), SHORTENED, np.float32))


def _probe(
    scene: Scene, points: BendingPoints, i: int, hidden: Collection[int], lamps: Mapping[int, list[LampSample]],
    order: int,
) -> Probe:  # fmt: skip
    """What is around the middle of an object, without those whose shadows move, and without its own emission."""
    first, last = scene.vertex_ranges[i]
    vertices = scene.vertices[first:last].astype(np.float64)
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    shown = set(np.unique(points.surface.i_object).tolist())
    others = tuple(sorted(shown.difference((i, *hidden))))
    directions = geodesic(PROBE_LEVEL).centres.astype(np.float32)
    if not others:
        none = np.zeros(0, np.float32)
        nothing: tuple[NDArray, ...] = (np.zeros(len(directions), np.int64), np.zeros(0, np.int32), none, none)
        of_lamps = np.zeros((len(lamps), order * order, 3))
        return Probe(_joined(points, [nothing]), np.ones(len(directions), bool), of_lamps, np.zeros(len(lamps)))
    is_hit, is_met, hits = _point_hits(points, others, np.tile(np.float32(middle), (len(directions), 1)), directions)
    of_lamps, arrives, unblocked = np.zeros((len(lamps), order * order, 3)), np.zeros(len(lamps)), np.zeros(len(lamps))
    for k, (emitter, lamp) in enumerate(lamps.items()):
        for sample in () if emitter == i else lamp:
            towards, angle = towards_lamp(middle[None], sample)
            unblocked[k] += angle[0] * sample.tint.sum()
            if angle[0] > 0.0 and not _blocked(points.caster(others), middle[None], sample.target)[0]:
                of_lamps[k] += np.outer(angle[0] * basis(towards[0], order), sample.tint)
                arrives[k] += angle[0] * sample.tint.sum()
    shares = arrives / np.maximum(unblocked, 1e-30)
    return Probe(_joined(points, [(is_met.astype(np.int64), *hits)]), ~is_hit, of_lamps, shares)
