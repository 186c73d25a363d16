"""Light between objects that bend and objects that rest: one bounce, and shadows.

An object whose transfer contains only itself is lit as if by distant light of its own: what comes from all around to
the middle of its place at rest, the sky where it is open, and what neighbours reflect. So neighbours shade it,
and send light back, at no further cost in a frame [Sloan05, 5: local lighting], however it bends. Of an object that was
moved, which may be a ground, it comes to places close to its surface, one for each direction: a ball on the middle of a
ground would darken all of it. What bends keeps the middle: joints are within their neighbours, and the face of *mime*
was 6.1 of 255 off for 4.4. Points of the other objects, whose transfer has their neighbours' shadows, get one bounce of
what all others reflect. Rays are traced once, with all objects at rest; when the light or a material changes, what they
meet is summed anew. Lamps, which light each point from where they are, are apart
(`engine.realtime.zonal_harmonics.lamp_light`).
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.light.environment import triangle_integrals
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics import _transfer_kernels as kernels
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.transfer import cosine_directions, ray_blocks
from engine.scene.map_sampler import even_points
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import positions_at
from engine.sphere.geodesic import geodesic
from engine.sphere.harmonics import project

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]

N_BOUNCE_RAYS = 256  # from each point at rest
CLOSE = 0.9  # of the way from an object's middle to its surface
PROBE_LEVEL = 5  # of the sphere's triangles, around each object that has light of its own


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
    the sky is seen there."""

    hits: Hits
    is_open: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class LightPaths:
    """Where light goes between objects at rest. lit (R,): the points whose transfer has their neighbours' shadows;
    bounces (R bundles): what these see of other objects; probes: of the other objects, by index."""

    lit: NDArray[np.int64]
    bounces: Hits
    probes: Mapping[int, Probe]


def trace_light_paths(
    scene: Scene, points: BendingPoints, alone: Sequence[int], away: Sequence[int] = ()
) -> Generator[float, None, LightPaths]:
    """Trace them; alone: the objects whose transfer contains only themselves; away: those that block no light where
    they are at rest: they stand elsewhere, or are lamps. Yields the share that is done."""
    lit_objects = objects_lit_at_rest(scene, alone)
    everything = tuple(i for i in range(len(scene.smooth)) if i not in away)
    parts, lit = list[tuple[NDArray, ...]](), [np.zeros(0, np.int64)]
    for done, i in enumerate(lit_objects):
        mine = points.points_of(i)
        lit.append(mine)
        for stop, hits in _bounces(points, i, everything):
            parts.append(hits)
            yield (done + stop / max(len(mine), 1)) / (len(lit_objects) + 1)
    probes = {
        i: _probe(scene, points, i, neighbours_of(points, i, alone, away), i in away)
        for i in alone
        if scene.reflecting[i]
    }
    yield 1.0
    return LightPaths(np.concatenate(lit), _joined(points, parts), probes)


def objects_lit_at_rest(scene: Scene, alone: Sequence[int]) -> list[int]:
    """The objects whose transfer has their neighbours' shadows."""
    return [i for i in range(len(scene.smooth)) if scene.reflecting[i] and i not in alone]


def neighbours_of(points: BendingPoints, i: int, alone: Collection[int], away: Collection[int]) -> tuple[int, ...]:
    """The objects at rest around one that is alone."""
    return tuple(sorted(points.objects.difference((i, *alone, *away))))


def local_light(
    paths: LightPaths, powers: Mapping[int, Float64Array], sent: Float64Array, order: int
) -> dict[int, Float64Array]:
    """Harmonics (n^2, 3) of the light around each object that has light of its own, without lamps: of what is distant
    or reflected; powers (T, 3): of the sky of each, by triangle; sent (S, 3): radiance of all points."""
    angles = geodesic(PROBE_LEVEL).solid_angles[:, None]
    return {
        i: project(np.where(probe.is_open[:, None], powers[i], angles * probe.hits.gather(sent, 1.0)), order)
        for i, probe in paths.probes.items()
    }


def sky_powers(sky: SkyState) -> Float64Array:
    """Integrals (T, 3) of a sky's radiance over the sphere's triangles."""
    if sky.environment is None:
        return np.zeros((len(geodesic(PROBE_LEVEL).centres), 3))
    return triangle_integrals(sky.environment, sky.rotation, PROBE_LEVEL) * sky.scale


def added_light(paths: LightPaths, sent: Float64Array) -> Float64Array:
    """Radiance (S, 3) of white diffuse points by one bounce of what points of other objects send (S, 3); 0 at points of
    objects that have light of their own."""
    added = np.zeros_like(sent)
    added[paths.lit] = paths.bounces.gather(sent, 1.0 / N_BOUNCE_RAYS)
    return added


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


def _probe(scene: Scene, points: BendingPoints, i: int, others: tuple[int, ...], is_moved: bool) -> Probe:
    """What of other objects is around the middle of an object; of one that was moved, around places in it."""
    directions = geodesic(PROBE_LEVEL).centres.astype(np.float32)
    if not others:
        none = np.zeros(0, np.float32)
        nothing: tuple[NDArray, ...] = (np.zeros(len(directions), np.int64), np.zeros(0, np.int32), none, none)
        return Probe(_joined(points, [nothing]), np.ones(len(directions), bool))
    places = np.tile(middle_of(scene, i), (len(directions), 1))
    if is_moved:  # not on the surface: there they would lie in what touches it
        places += CLOSE * (surface_places(scene, i, len(directions)) - places)
    is_hit, is_met, hits = _point_hits(points, others, places.astype(np.float32), directions)
    return Probe(_joined(points, [(is_met.astype(np.int64), *hits)]), ~is_hit)


def middle_of(scene: Scene, i: int) -> Float64Array:
    """The middle (3,) of an object at rest."""
    first, last = scene.vertex_ranges[i]
    vertices = scene.vertices[first:last].astype(np.float64)
    return 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))


def surface_places(scene: Scene, i: int, n: int) -> Float64Array:
    """Places (n, 3) on the surface of an object at rest, evenly over it, in any order."""
    places = positions_at(scene, *even_points(scene, i, n))
    return np.asarray(np.random.default_rng(i).permutation(places), np.float64)
