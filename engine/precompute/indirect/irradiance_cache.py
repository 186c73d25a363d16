"""The irradiance cache: surface records where rays end, and the irradiance there.

A record covers the part of one object in one cube of a grid that faces one of six directions, lies in about one plane,
and sees one probe position of its cube. Both sides of a thin wall, the boards of a shelf, and the inside and outside of
a box therefore never share a record. A record exists once a ray has hit it, so that only surfaces on light paths cost
anything. Its irradiance is the mean over positions drawn evenly from the rays that hit it, which is the average those
rays require.
"""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import on_threads
from engine.light.emitters import EmitterPatches
from engine.light.triangle_lights import TriangleLights
from engine.precompute.indirect import _cache_kernels as kernels
from engine.precompute.indirect._ray_kernels import EVEN
from engine.precompute.indirect.albedo_from_curves import N_SLANTS
from engine.precompute.indirect.record_maps import RecordMaps
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene

MAX_RECORDS = kernels.MAX_RECORDS
N_SLOTS = 1 << 18
# Rays per chunk: as many as the ray caster takes without splitting them over threads of its own.
CHUNK = 32768
NO_ORDER = nullcontext()


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
        self._low = scene.vertices[np.unique(scene.triangles)].min(axis=0) - np.float32(0.37 * size)
        places = (MAX_RECORDS, kernels.N_PLACES)
        self._table = kernels.CacheTable(
            np.zeros(N_SLOTS, np.uint64), np.zeros(N_SLOTS, np.int32), np.zeros(1, np.int64),
            np.zeros(MAX_RECORDS, np.int32), np.zeros(MAX_RECORDS, np.uint64), np.zeros(MAX_RECORDS, np.int64),
            np.zeros(places, np.uint32), np.zeros(places, np.int32), np.zeros(places, np.float32),
            np.zeros(places, np.float32), np.zeros(places, np.uint8),
        )  # fmt: skip
        self._lock = Lock()
        self._maps: tuple[tuple[int, int], RecordMaps] | None = None

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


def sky_lights(cut: TriangleLights) -> kernels.Lights:
    """The triangle lights of a sky, sampled by power."""
    return _lights(cut.vertices[cut.corners], cut.power, np.zeros((len(cut), 3), np.float32), True)


def patch_lights(patches: EmitterPatches) -> kernels.Lights:
    """Patches of emitters, sampled by power."""
    return _lights(patches.corners, patches.radiance * patches.area[:, None], patches.normal, False)


def _lights(
    corners: NDArray[np.floating], power: NDArray[np.floating], normals: NDArray[np.floating], is_sky: bool
) -> kernels.Lights:
    """Lights with power, with cumulative shares and powers divided by the share."""
    strength = power.max(axis=1).astype(np.float64)
    lit = strength > 0.0
    share = strength[lit] / max(strength.sum(), 1e-300)
    return kernels.Lights(
        np.ascontiguousarray(corners[lit], np.float32), np.cumsum(share).astype(np.float32),
        np.ascontiguousarray(power[lit] / np.maximum(share, 1e-30)[:, None], np.float32),
        np.ascontiguousarray(normals[lit], np.float32), is_sky,
    )  # fmt: skip
