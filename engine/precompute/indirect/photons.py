"""Caustics: light that glossy surfaces reflect onto others, traced from the light sources.

A small light in a curved mirror draws a bright line that rays from the lit surface hardly ever find. Photons are
therefore emitted from the glossy surfaces (`_photon_kernels`), and each gather point takes the ones nearest to it.
Their positions do not depend on any curve and are computed once; their flux and its reflection are summed at each
freezing.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_frame, project
from engine.core.threads import even_parts, n_threads, on_threads
from engine.precompute.indirect import _photon_kernels as kernels
from engine.precompute.indirect._gloss_kernels import GlossyLayers
from engine.precompute.indirect._light_choice_kernels import SampledLights
from engine.precompute.indirect._reflection_kernels import SampleArrays
from engine.precompute.indirect.direction_patterns import lobe_vectors
from engine.precompute.indirect.irradiance_cache import CHUNK, IrradianceCache
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene

_SEED = 20260812
_N_NEAREST = 128
_BATCH = 8192  # points, whose nearest photons take 30 MB; allocating those of all points took most of a search
# The search radius of a gather point, relative to the picture's height.
_FARTHEST = 1.0 / 24.0
_PILOT, _LEAST_SHARE = 2048, 0.125
# Beyond this fraction of a point's clearance, a wall may separate it from a photon's origin.
_NEAR = 0.1
_VISIBILITY_MARGIN = 0.999


class Photons(NamedTuple):
    """n photons: positions (n, 3) and objects (n,) where they land, directions (n, 3) of flight; at their origins:
    starts (n, 3), off the surface, sources (n,), the objects, normals (n, 3), turns (n,), codes of the tangents' maps,
    and to_light (n, 3); lights (n,), by their numbers; power (n, 3) without the material; ahead (n,), see
    `_photon_kernels.emit`. per_area (M,): photons emitted per square metre of each object."""

    positions: NDArray[np.float32]
    objects: NDArray[np.int32]
    directions: NDArray[np.float32]
    starts: NDArray[np.float32]
    sources: NDArray[np.int32]
    normals: NDArray[np.float32]
    turns: NDArray[np.uint8]
    to_light: NDArray[np.float32]
    lights: NDArray[np.int32]
    power: NDArray[np.float32]
    ahead: NDArray[np.float32]
    per_area: NDArray[np.float32]


class NearbyPhotons(NamedTuple):
    """Photons near p gather points: start (p + 1,) of each point's range, photon (n,), weight (n,), and area (p,) of
    half the search disc."""

    start: NDArray[np.int64]
    photon: NDArray[np.int32]
    weight: NDArray[np.float32]
    area: NDArray[np.float32]


class PhotonFlux(NamedTuple):
    """Flux of the photons under certain curves: light (n, 3), its power (n,) in the edited object's albedo, and
    directions (n, 3) of flight."""

    light: NDArray[np.float32]
    powers: NDArray[np.uint8]
    directions: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PhotonSource:
    """Emits photons. scene, and the mesh of its records; glossy (M,): which objects are; lobe_axes (M,) and axes (M, 3,
    3); all_lights: sky and emitters."""

    scene: Scene
    cache: IrradianceCache
    glossy: NDArray[np.bool_]
    lobe_axes: NDArray[np.int64]
    axes: NDArray[np.float32]
    all_lights: SampledLights

    def send(self, hits: PrimaryHits, n_photons: int) -> Generator[None, None, Photons]:
        """Those of n photons that land where the picture shows them. More start on objects from which more do. A
        generator of steps."""
        area = _areas(self.scene)
        mine = np.array([area[begin:end].sum() for begin, end in self.scene.triangle_ranges])
        mine[~self.glossy | ~self.scene.reflecting] = 0.0
        able = np.flatnonzero(mine > 0.0)
        if not len(able) or not len(self.all_lights.cumulative) or n_photons == 0:
            return _joined([], np.zeros(len(mine), np.float32))
        # A pilot pass estimates the share of visible photons per object.
        n_pilot = min(_PILOT, n_photons)
        useful = np.zeros(len(able))
        for i, o in enumerate(able):
            pilot = yield from self._photons_from_object(hits, area, int(o), n_pilot, mine)
            useful[i] = len(pilot.power) / n_pilot
        if not useful.any():
            return _joined([], np.zeros(len(mine), np.float32))
        share = np.maximum(useful / useful.max(), _LEAST_SHARE)
        counts = np.ceil(n_photons * share / share.sum()).astype(int)
        per_area = np.zeros(len(mine), np.float32)
        per_area[able] = counts / mine[able]
        parts = list[Photons]()
        for o, n in zip(able, counts, strict=True):
            parts.append((yield from self._photons_from_object(hits, area, int(o), n, mine)))
        return _joined(parts, per_area)

    def _photons_from_object(
        self, hits: PrimaryHits, area: NDArray[np.float64], o: int, n_photons: int, mine: NDArray[np.float64]
    ) -> Generator[None, None, Photons]:
        """Emits n_photons from one object and returns the visible ones. A generator of steps."""
        begin, end = self.scene.triangle_ranges[o]
        cumulative = np.cumsum(area[begin:end])
        per_area = np.zeros(len(mine), np.float32)
        per_area[o] = n_photons / mine[o]

        def chunk(first: int) -> Photons:
            nth = np.arange(first, min(first + CHUNK, n_photons))
            # Stratified positions by area.
            places = (nth + 0.5) / n_photons * cumulative[-1]
            triangles = (begin + np.minimum(np.searchsorted(cumulative, places), end - begin - 1)).astype(np.int32)
            return self._chunk(hits, triangles, _numbers(nth, o), per_area)

        parts, step = list[Photons](), n_threads() * CHUNK
        for first in range(0, n_photons, step):
            parts += on_threads(chunk, range(first, min(first + step, n_photons), CHUNK))
            yield
        return _joined(parts, per_area)

    def _chunk(
        self, hits: PrimaryHits, triangles: NDArray[np.int32], numbers: NDArray[np.float64],
        per_area: NDArray[np.float32],
    ) -> Photons:  # fmt: skip
        """Emits photons from triangles (n,) with random numbers (n, 7), and returns the visible ones."""
        n, caster, mesh = len(triangles), self.cache.caster, self.cache.mesh
        starts, to_light, onward, normals, power = np.empty((5, n, 3), np.float32)
        (limits, ahead), lights = np.empty((2, n), np.float32), np.empty(n, np.int32)
        # The position on the triangle, as `emit` finds it, where a map may rotate the tangent.
        random = numbers[:, :5].astype(np.float32)
        u, v = np.where(random[:, :2].sum(axis=1, keepdims=True) > 1.0, 1.0 - random[:, :2], random[:, :2]).T
        turns = self.scene.tangent_rotations.codes(Intersections(triangles, u, v, np.zeros(n, np.float32)))
        kernels.emit(
            random, lobe_vectors(numbers[:, 5], numbers[:, 6]), triangles, turns, per_area, mesh, self.lobe_axes,
            self.axes, self.all_lights, np.float32(caster.offset), starts, to_light, limits, onward, normals, lights,
            power, ahead,
        )  # fmt: skip
        # Drop photons without power, then those whose path to the light is blocked.
        lit = np.flatnonzero(power.max(axis=1) > 0.0)
        lit = lit[~caster.occluded(starts[lit], to_light[lit], limits[lit])]
        # Trace the others to where they land, and retain those that the picture shows.
        found = caster.intersect(starts[lit], onward[lit])
        ends = np.where(found.triangle >= 0, mesh.objects[found.triangle], -1)
        far = np.where(ends >= 0, found.distance, np.float32(0.0))
        positions = np.asarray(starts[lit] + far[:, None] * onward[lit], np.float32)
        faces = mesh.face_normals[found.triangle]
        seen = (ends >= 0) & self._is_visible(hits, ends, positions, faces, onward[lit])
        rows = lit[seen]
        return Photons(
            positions[seen], ends[seen].astype(np.int32), onward[rows], starts[rows],
            mesh.objects[triangles[rows]].astype(np.int32), normals[rows], turns[rows], to_light[rows], lights[rows],
            power[rows], ahead[rows], per_area,
        )  # fmt: skip

    def _is_visible(
        self, hits: PrimaryHits, objects: NDArray[np.int32], positions: NDArray[np.float32],
        faces: NDArray[np.float32], directions: NDArray[np.float32],
    ) -> NDArray[np.bool_]:  # fmt: skip
        """Whether photons land on the visible side of an object, near a pixel that shows it."""
        to_place = positions - self.scene.camera_position.astype(np.float32)
        facing = np.einsum("ni,ni->n", to_place, faces) * np.einsum("ni,ni->n", directions, faces) > 0.0
        camera, (width, height) = self.scene.description.camera, hits.resolution
        before = to_place @ camera_frame(camera)[2] > 0.0
        x, y = project(camera, hits.resolution, to_place).T
        near = np.zeros(len(x), bool)
        far = _FARTHEST * height
        for dx in (-far, 0.0, far):
            for dy in (-far, 0.0, far):
                column, row = np.floor(np.clip([x + dx, y + dy], -1, max(width, height))).astype(np.int64)
                inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
                shown = hits.object_image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
                near |= inside & (shown == objects)
        return near & facing & before


def _areas(scene: Scene) -> NDArray[np.float64]:
    """The area (T,) of every triangle."""
    a, b, c = scene.vertices[scene.triangles].astype(np.float64).transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)


def _numbers(nth: NDArray[np.integer], seed: int) -> NDArray[np.float64]:
    """The nth (n,) of low-discrepancy points in seven dimensions, (n, 7): multiples of the powers of a root, modulo 1
    [Roberts18]."""
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / 8.0)  # x⁸ = x + 1
    shift = np.random.default_rng((_SEED, seed)).random(7)
    return np.asarray((shift + nth[:, None] * root ** -np.arange(1.0, 8.0)) % 1.0)


def _joined(parts: Sequence[Photons], per_area: NDArray[np.float32]) -> Photons:
    """All photons as one set."""
    vectors, numbers, integers = np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32)
    codes = np.zeros(0, np.uint8)
    none = Photons(
        vectors, integers, vectors, vectors, integers, vectors, codes, vectors, integers, vectors, numbers, per_area
    )
    fields = zip(none, *parts, strict=True)
    return Photons(*(np.concatenate(arrays) for arrays in fields))._replace(per_area=per_area)


def photons_emitted(scene: Scene, photons: Photons) -> float:
    """The number of photons that were emitted, of which these are those that the picture shows."""
    area = _areas(scene)
    return float(
        sum(n * area[begin:end].sum() for n, (begin, end) in zip(photons.per_area, scene.triangle_ranges, strict=True))
    )


def no_photons(n_objects: int) -> Photons:
    """The photons of a scene without lit glossy surfaces: none."""
    return _joined([], np.zeros(n_objects, np.float32))


class PhotonMap:
    """Photons grouped by the object they land on, with a k-d tree each. times: as many times the usual number of
    nearest photons are found: where that many times the photons are emitted, they lie within the usual radius."""

    def __init__(self, photons: Photons, times: int = 1) -> None:
        self.photons, self.n_nearest = photons, _N_NEAREST * times
        self._order = np.argsort(photons.objects, kind="stable").astype(np.int32)
        self._ends = np.searchsorted(photons.objects[self._order], np.arange(len(photons.per_area) + 1))
        self._trees = {} if not len(self._order) else self._build_trees()

    def _build_trees(self) -> dict[int, Any]:
        """A k-d tree of the photons on each object."""
        from scipy.spatial import cKDTree  # imported late: scenes without photons do not need it

        return {
            o: cKDTree(self.photons.positions[self._order[begin:end]], balanced_tree=False, compact_nodes=False)
            for o, (begin, end) in enumerate(pairwise(self._ends)) if end > begin
        }  # fmt: skip

    def nearest(
        self, i_object: int, positions: NDArray[np.float32], farthest: NDArray[np.float32]
    ) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]:
        """For positions (p, 3) on an object: the nearest photons (p, k), −1 for none, squared distances (p, k) and
        squared radii (p,)."""
        begin, end = self._ends[i_object : i_object + 2]
        if begin == end or not len(positions):
            none = np.zeros((len(positions), 0), np.float32)
            return none.astype(np.int32), none, farthest**2
        distance, index = self._trees[i_object].query(positions, k=self.n_nearest, workers=n_threads())
        found = np.where(index < end - begin, self._order[begin + np.minimum(index, end - begin - 1)], -1)
        radius = np.minimum(distance[:, -1], farthest)
        return found.astype(np.int32), (distance**2).astype(np.float32), (radius**2).astype(np.float32)


def farthest_of(scene: Scene, hits: PrimaryHits, rows: NDArray[np.integer]) -> NDArray[np.float32]:
    """The search radius (p,) at each point, in metres on a surface that faces the camera."""
    height = 2.0 * math.tan(math.radians(scene.description.camera.fov_y) / 2)
    return np.asarray(
        _FARTHEST * height * np.linalg.norm(hits.position[rows] - scene.camera_position, axis=1), np.float32
    )


def find_nearby_photons(
    photon_map: PhotonMap, i_object: int, hits: PrimaryHits, samples: SampleArrays, times: NDArray[np.float32],
    farthest: NDArray[np.float32], clearance: NDArray[np.float32], caster: RayCaster,
) -> Generator[None, None, NearbyPhotons]:  # fmt: skip
    """The photons near the gather points of one object, one batch of points at a time. times (p,): the number of rays
    that each stored one represents; clearance (p,): harmonic mean distance of the surroundings. A generator of
    steps."""
    parts, step = list[NearbyPhotons](), _BATCH * _N_NEAREST // photon_map.n_nearest
    for begin in range(0, max(len(samples.rows), 1), step):
        part = slice(begin, begin + step)
        some = samples._replace(
            rows=samples.rows[part],
            nth=samples.nth[part],
            lobe_axes=samples.lobe_axes[part],
            records=samples.records[part],
        )
        parts.append(
            _find_nearby(photon_map, i_object, hits, some, times[part], farthest[part], clearance[part], caster)
        )
        yield
    return join_nearby(parts)


def _find_nearby(
    photon_map: PhotonMap, i_object: int, hits: PrimaryHits, samples: SampleArrays, times: NDArray[np.float32],
    farthest: NDArray[np.float32], clearance: NDArray[np.float32], caster: RayCaster,
) -> NearbyPhotons:  # fmt: skip
    """The photons near the points of one batch, with weights; see `find_nearby_photons`."""
    found, distances2, radii2 = photon_map.nearest(i_object, hits.position[samples.rows], farthest)
    weights = np.empty(found.shape, np.float32)

    def weigh(begin: int, end: int) -> None:
        kernels.weigh_photons(
            samples, begin, end, times, hits.geometric_normal, hits.position, photon_map.photons, found, distances2,
            radii2, weights,
        )  # fmt: skip

    on_threads(weigh, *even_parts(len(found)))
    is_near = weights > 0.0
    # Test the path to a photon's origin only where the radius is large relative to the clearance.
    doubted = is_near & (radii2 > (_NEAR * clearance) ** 2)[:, None]
    origins = hits.offset_position[samples.rows[np.nonzero(doubted)[0]]]
    is_near[doubted] = ~caster.occluded(
        origins, photon_map.photons.starts[found[doubted]] - origins,
        np.full(len(origins), _VISIBILITY_MARGIN, np.float32),
    )  # fmt: skip
    start = np.concatenate([[0], np.cumsum(is_near.sum(axis=1))])
    return NearbyPhotons(start, found[is_near], weights[is_near], np.asarray(np.pi / 2 * radii2, np.float32))


def no_nearby_photons(n_points: int) -> NearbyPhotons:
    """No photons near any of the points."""
    none = np.zeros(0, np.float32)
    return NearbyPhotons(np.zeros(n_points + 1, np.int64), none.astype(np.int32), none, np.zeros(n_points, np.float32))


def join_nearby(parts: Sequence[NearbyPhotons]) -> NearbyPhotons:
    """The photons near several sets of points, concatenated."""
    parts = parts or [no_nearby_photons(0)]
    start = np.concatenate([[0], np.cumsum(np.concatenate([np.diff(part.start) for part in parts]))])
    return NearbyPhotons(start, *(np.concatenate(arrays) for arrays in list(zip(*parts, strict=True))[1:]))


def ordered_nearby(landed: NearbyPhotons, order: NDArray[np.integer]) -> NearbyPhotons:
    """The photons near points in this order."""
    counts = np.diff(landed.start)[order]
    start = np.concatenate([[0], np.cumsum(counts)])
    taken = np.repeat(landed.start[order] - start[:-1], counts) + np.arange(start[-1])
    return NearbyPhotons(start, landed.photon[taken], landed.weight[taken], landed.area[order])


def slice_nearby(landed: NearbyPhotons, begin: int, end: int) -> NearbyPhotons:
    """Those near points [begin, end)."""
    first, last = landed.start[begin], landed.start[end]
    return NearbyPhotons(
        landed.start[begin : end + 1] - first, landed.photon[first:last], landed.weight[first:last],
        landed.area[begin:end],
    )  # fmt: skip


def slice_photons(photons: Photons, begin: int, end: int) -> Photons:
    """Photons [begin, end)."""
    return Photons._make([*(each[begin:end] for each in photons[:-1]), photons.per_area])


def photon_flux(photons: Photons, layers: GlossyLayers, edited: int, inverse: NDArray[np.float32]) -> PhotonFlux:
    """The flux of the photons. Photons from the object `edited` count as proportional to its albedo, whose reciprocal
    is `inverse`."""
    light = np.zeros((len(photons.objects), 3), np.float32)

    def power(begin: int, end: int) -> None:
        kernels.photon_power(slice_photons(photons, begin, end), layers, light[begin:end])

    on_threads(power, *even_parts(len(light)))
    own = photons.sources == edited
    light[own] *= inverse
    return PhotonFlux(light, own.astype(np.uint8), photons.directions)
