"""The irradiance cache: surface records where rays end, and the irradiance there.

A record covers the part of one object in one cube of a grid that faces one of six directions, lies in about one plane,
and sees one probe position of its cube. Both sides of a thin wall, the boards of a shelf, and the inside and outside of
a box therefore never share a record. A record exists once a ray has hit it, so that only surfaces on light paths cost
anything. Its irradiance is the mean over positions drawn evenly from the rays that hit it, which is the average those
rays require.

The light between the records is a polynomial in the equivalent albedo of one object. With E_0 the direct irradiance of
the records, G the mean over the records that a record's rays hit, and d the albedos,

    E_n = G d E_(n-1),      radiosity = d (E_0 + E_1 + ... + E_(N-2))      for N bounces in all,

where d of the edited object remains a variable: each product with it raises the power by one instead, which leaves N
numbers per record, whatever the number of objects [BenArtzi07, eq. 6.8, sect. 6.1.2]. Nothing is divided by d, which
may be 0.
"""

import copy
from collections.abc import Generator, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from engine.core.clamping import clamp_radiance
from engine.core.threads import OrderedSection, even_parts, on_threads, run_in_order
from engine.precompute.indirect import _cache_kernels as kernels
from engine.precompute.indirect._ray_kernels import EVEN
from engine.precompute.indirect._reflection_kernels import bounce, brighten
from engine.precompute.indirect.albedo import N_SLANTS
from engine.precompute.indirect.direction_patterns import cosine_tables
from engine.precompute.indirect.emission import ReachingLights
from engine.precompute.indirect.nearest_records import NearestRecords
from engine.precompute.indirect.record_maps import RecordMaps, RecordReflectance
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene

MAX_RECORDS = kernels.MAX_RECORDS
N_SLOTS = 1 << 18
# Rays per chunk: as many as the ray caster takes without splitting them over threads of its own.
CHUNK = 32768
NO_ORDER = nullcontext()
NO_OBJECT = -1
MOST_GENERATIONS = 4
_SAMPLES = 1 << 18  # rays to each kind of light at a time


class CacheFull(Exception):
    """The grid is too fine for 65,534 records."""


@dataclass(frozen=True, eq=False)
class Rays:
    """R rays: origins and directions (R, 3) float32; there (R,): which of them exist."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    there: NDArray[np.bool_]


def room_for_rays(n: int) -> Rays:
    return Rays(np.empty((n, 3), np.float32), np.empty((n, 3), np.float32), np.empty(n, bool))


class IrradianceCache:
    """The records of one scene on a grid of cubes of `size` metres. Several threads may use it at once."""

    def __init__(self, scene: Scene, caster: RayCaster, size: float) -> None:
        self.size = size
        self.caster = caster
        self._scene = scene
        reflects = scene.reflecting
        self.mesh = kernels.MeshArrays(
            scene.vertices, scene.normals, scene.triangles, np.ascontiguousarray(scene.geometric_normals),
            scene.object_of_triangle, scene.smooth, reflects,
        )  # fmt: skip
        used = scene.vertices[np.unique(scene.triangles)]
        self._low = used.min(axis=0, initial=np.inf) - np.float32(0.37 * size)
        places = (MAX_RECORDS, kernels.N_PLACES)
        self._table = kernels.CacheTable(
            np.zeros(N_SLOTS, np.uint64), np.zeros(N_SLOTS, np.int32), np.zeros(1, np.int64),
            np.zeros(MAX_RECORDS, np.int32), np.zeros(MAX_RECORDS, np.uint64), np.zeros(MAX_RECORDS, np.int64),
            np.zeros(places, np.uint32), np.zeros(places, np.int32), np.zeros(places, np.float32),
            np.zeros(places, np.float32), np.zeros(places, np.uint8),
        )  # fmt: skip
        self._lock = Lock()
        self._maps: tuple[tuple[int, int], RecordMaps] | None = None
        self._nearest: NearestRecords | None = None

    def closed(self) -> "IrradianceCache":
        """The same records, to which rays add none: one that ends where there is none hits the nearest."""
        other = copy.copy(self)
        other._nearest = NearestRecords(self._scene, self.table(), self.size)
        return other

    def __len__(self) -> int:
        return int(self._table.n_cells[0])

    @property
    def n_bytes(self) -> int:
        """Memory of the records; the mesh belongs to the scene."""
        return sum(array.nbytes for array in self._table)

    def table(self) -> kernels.CacheTable:
        """The table of all records, for storing, cut to the number of records."""
        n = len(self)
        return kernels.CacheTable(*self._table[:3], *(array[:n] for array in self._table[3:]))

    def restore(self, table: kernels.CacheTable) -> None:
        """Restores the state that `table` returned."""
        for mine, stored in zip(self._table, table, strict=True):
            mine[: len(stored)] = stored

    @property
    def maps(self) -> RecordMaps:
        """Texture and weight maps at the current records; cached until records or their sample positions change."""
        state = len(self), int(self._table.n_places.sum())
        if self._maps is None or self._maps[0] != state:
            self._maps = state, RecordMaps(self._scene, self.table())
        return self._maps[1]

    @property
    def objects(self) -> NDArray[np.int32]:
        """The object (C,) that each record belongs to."""
        return self._table.objects[: len(self)]

    def records_hit(
        self, rays: Rays, first_open: int = 0, turn: AbstractContextManager[None] = NO_ORDER
    ) -> NDArray[np.uint16]:
        """The record (R,) that each ray hits, NO_RECORD where it leaves the scene or hits a surface that does not
        reflect.

        Records from `first_open` on may take a hit as a sample position. turn: context entered while records are
        numbered. Raises CacheFull.
        """
        return self.records_and_hits(rays, first_open, turn=turn)[0]

    def records_and_hits(
        self, rays: Rays, first_open: int = 0, mirrored: NDArray[np.uint8] | None = None,
        turn: AbstractContextManager[None] = NO_ORDER,
    ) -> tuple[NDArray[np.uint16], Intersections]:  # fmt: skip
        """As `records_hit`, with the intersections. mirrored (R,): DIFFUSE, GLOSSY or SHARP for rays of gather points,
        which use smaller cells near by."""
        found = self.caster.intersect(rays.origins, rays.directions)
        hits = kernels.Hits(found.triangle, found.u, found.v, found.distance)
        n = len(rays.there)
        keys, seen = np.empty(n, np.uint64), np.empty(n, np.uint16)
        sides, levels = np.zeros((2, n), np.uint8)
        in_focus = np.full(n, EVEN, np.uint8) if mirrored is None else mirrored
        kernels.find_keys(
            self.mesh, self._low, np.float32(1.0 / self.size), hits, rays.there, rays.directions, in_focus, keys, sides,
            levels,
        )  # fmt: skip
        self._split_by_probe(hits, keys, sides, levels)
        if self._nearest is not None:
            kernels.insert_hits(self._table, self.mesh, hits, keys, sides, kernels.CLOSED, seen)
            self._nearest.fill(seen, keys, found, rays.directions)
            return seen, found
        with turn, self._lock:
            if not kernels.insert_hits(self._table, self.mesh, hits, keys, sides, first_open, seen):
                raise CacheFull(f"cells of {self.size:.3g} m")
        return seen, found

    def _split_by_probe(
        self, hits: kernels.Hits, keys: NDArray[np.uint64], sides: NDArray[np.uint8], levels: NDArray[np.uint8]
    ) -> None:
        """Distinguishes keys by the first visible probe of their cube; keys that see none share one."""
        hidden = np.flatnonzero(keys)
        for probe in range(kernels.N_VISIBILITY_PROBES):
            origins, directions = np.empty((2, len(hidden), 3), np.float32)
            kernels.probe_rays(
                self.mesh, self._low, np.float32(1.0 / self.size), hits, hidden, sides, levels, probe, origins,
                directions,
            )  # fmt: skip
            hidden = hidden[self.caster.occluded(origins, directions, np.ones(len(hidden), np.float32))]
            keys[hidden] += np.uint64(1)

    def rays(self, begin: int, end: int, tables: NDArray[np.float32]) -> Rays:
        """Cosine-distributed rays from the sample positions of records [begin, end), (end - begin) · R of them; tables
        (64, R, 3)."""
        rays = room_for_rays((end - begin) * tables.shape[1])
        kernels.record_rays(
            self._table, self.mesh, begin, end, np.float32(self.caster.offset), tables, rays.origins, rays.directions,
            rays.there,
        )  # fmt: skip
        return rays

    def irradiance(
        self, lights: kernels.Lights, n_samples: int, seed: int = 0, begin: int = 0, end: int | None = None
    ) -> NDArray[np.float32]:
        """Direct irradiance (end - begin, N_SLANTS, 3) of the records [begin, end) by S light samples each, divided
        among bins of the angle of incidence; end: None for all."""
        n = (len(self) if end is None else min(end, len(self))) - begin
        irradiance = np.zeros((n, N_SLANTS, 3), np.float32)
        if len(lights.cumulative):
            step = max(1, CHUNK // n_samples)
            parts = [(i, min(i + step, n)) for i in range(0, n, step)]
            on_threads(lambda part: self._add_light(lights, n_samples, seed, begin, part, irradiance), parts)
        return irradiance

    def _add_light(
        self, lights: kernels.Lights, n_samples: int, seed: int, first: int, part: tuple[int, int],
        irradiance: NDArray[np.float32],
    ) -> None:  # fmt: skip
        """Adds the light of one part of the records to `irradiance`; first: the record at which `irradiance` begins."""
        begin, end = part
        rays = room_for_rays((end - begin) * n_samples)
        (distances, cosines), powers = (
            np.empty((2, len(rays.there)), np.float32),
            np.empty((len(rays.there), 3), np.float32),
        )
        kernels.light_rays(
            self._table, self.mesh, first + begin, first + end, np.float32(self.caster.offset), lights, n_samples, seed,
            rays.origins, rays.directions, distances, cosines, powers,
        )  # fmt: skip
        # Shadow rays, only where a sample carries power.
        blocked = powers.max(axis=1) <= 0.0
        requested = np.flatnonzero(~blocked)
        limits = None if lights.is_sky else distances[requested]
        blocked[requested] = self.caster.occluded(rays.origins[requested], rays.directions[requested], limits)
        kernels.add_unoccluded(blocked, cosines, powers, n_samples, irradiance[begin:end])


@dataclass(frozen=True, eq=False)
class CacheLight:
    """Light between C records. records_hit (C_seen, R) uint16: what the rays of those records hit that light reaches
    the camera from in more than two bounces; objects (C,); direct (C, N_SLANTS, 3): irradiance from the lights,
    distributed by hat functions over the square root of the cosine of its angle of incidence, see
    `albedo.slant_roots`."""

    objects: NDArray[np.int32]
    records_hit: NDArray[np.uint16]
    direct: NDArray[np.float32]

    @property
    def irradiance(self) -> NDArray[np.float32]:
        """Direct irradiance over all angles, (C, 3)."""
        return self.direct.sum(axis=1)

    @property
    def n_bytes(self) -> int:
        return self.objects.nbytes + self.records_hit.nbytes + self.direct.nbytes

    def extended_to(self, objects: NDArray[np.int32]) -> "CacheLight":
        """The same for all records that there are now, (C,), of which its own are the first. The others are dark."""
        n_new = len(objects) - len(self.objects)
        none = np.zeros((n_new, *self.direct.shape[1:]), self.direct.dtype)
        return CacheLight(objects, self.records_hit, np.concatenate([self.direct, none]))


def connect(cache: IrradianceCache, n_bounces: int, n_rays: int) -> Iterator[tuple[float, NDArray[np.uint16]]]:
    """Traces the rays of all records, generation by generation; new records appear on the way. Yields (fraction,
    records hit (c, R)).

    Light of N bounces in all reaches the records of the gather points over N - 2 others: the last generation needs no
    rays.
    """
    tables = cosine_tables(n_rays)
    begin, step = 0, max(1, CHUNK // n_rays)
    generations = min(n_bounces - 2, MOST_GENERATIONS)
    for generation in range(generations):
        end = len(cache)

        def trace(part: tuple[int, int], turn: OrderedSection, first_open: int = end) -> NDArray[np.uint16]:
            return cache.records_hit(cache.rays(*part, tables), first_open, turn).reshape(part[1] - part[0], -1)

        parts = [(i, min(i + step, end)) for i in range(begin, end, step)]
        for k, seen in enumerate(run_in_order(trace, parts, 1)):
            yield (generation + (k + 1) / len(parts)) / generations, seen
        begin = end


def direct_irradiance(
    cache: IrradianceCache, lights: tuple[ReachingLights, ...], n_samples: int
) -> Generator[float, None, NDArray[np.float32]]:
    """Irradiance (C, N_SLANTS, 3) of the records from all lights that reach them, see `CacheLight`, with `n_samples`
    samples of each kind; yields the fraction done."""
    total = np.zeros((len(cache), N_SLANTS, 3), np.float32)
    step = max(_SAMPLES // n_samples, 1)
    for begin in range(0, len(cache), step):
        for seed, (each, objects) in enumerate(lights):
            found = cache.irradiance(each, n_samples, seed, begin, begin + step)
            if objects is not None:
                found[~objects[cache.objects[begin : begin + step]]] = 0.0
            total[begin : begin + step] += found
        yield min((begin + step) / len(cache), 1.0)
    return total


def radiosity(
    light: CacheLight, albedos: NDArray[np.floating], n_bounces: int, reflectance: RecordReflectance,
    edited: int = NO_OBJECT, lit_apart: bool = False, thrice: bool = True,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:  # fmt: skip
    """Radiosity (C, D, 3) of the records in a picture of N bounces, a polynomial in the albedo of the object `edited`;
    and the same for N - 1 bounces, for light that is reflected once more on its way.

    albedos (M, 3), scaled per record by `reflectance`; D = N powers, from 0 to N - 1, or 1 if no object is edited;
    N ≥ 2.
    lit_apart: whether the reflection of the lights by glossy layers is computed elsewhere. The second result then omits
    it if that is so behind another glossy layer (thrice), and the first includes it as if it were diffuse.
    """
    n_powers = n_bounces if edited != NO_OBJECT else 1
    albedos = np.ascontiguousarray(albedos, np.float32)
    latest = np.zeros((len(light.objects), n_powers, 3), np.float32)
    latest[:, 0] = (
        light.irradiance if reflectance.slant is None else np.einsum("cbk,cbk->ck", light.direct, reflectance.slant)
    )
    total, sent = latest.copy(), np.empty((*latest.shape[:2], 4), np.float32)
    once_less, before = total.copy(), np.zeros_like(total)
    if lit_apart:
        total[:, 0] = light.irradiance
        if thrice:
            once_less[:, 0] = reflectance.diffuse * light.irradiance
    # E_n = G d E_(n-1), accumulated.
    for i_bounce in range(n_bounces - 2):
        brighten(latest, light.objects, albedos, reflectance.relative, edited, sent)
        latest = bounce_radiosity(light.records_hit, sent, min(i_bounce + 2, n_powers))
        before[:] = once_less
        total += latest
        once_less += latest
    bright = np.empty_like(latest)
    brighten(before, light.objects, albedos, reflectance.relative, edited, bright)
    brighten(total, light.objects, albedos, reflectance.relative, edited, before)
    return clamp_radiance(before), clamp_radiance(bright)


def bounce_radiosity(seen: NDArray[np.uint16], bright: NDArray[np.float32], n_powers: int) -> NDArray[np.float32]:
    """Irradiance (C, D, 3) from radiosity (C, D, 4) that is 0 beyond its first n_powers; 0 where a record has no
    rays."""
    out = np.zeros((*bright.shape[:2], 3), np.float32)
    on_threads(lambda begin, end: bounce(begin, end, seen, bright, n_powers, out), *even_parts(len(seen)))
    return out
