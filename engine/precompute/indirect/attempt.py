"""One attempt of the solver, with cells of one size: traces sample sets and the light between records, part by part.

Each part is restored from a checkpoint if an earlier run stored it, else computed and stored.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import run_to_end
from engine.core.stored_arrays import ArrayReader, Arrays
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect._cache_kernels import CacheTable
from engine.precompute.indirect.cell_size import CellSizeSearch
from engine.precompute.indirect.checkpoints import (
    Checkpoints,
    arrays_of_gathered,
    arrays_of_table,
    read_gathered,
    read_record_light,
    read_table,
)
from engine.precompute.indirect.direction_patterns import SampleCounts, sample_counts
from engine.precompute.indirect.emission import Emission
from engine.precompute.indirect.gather import GatherSamples, gather, join_samples, no_samples, sets_alike
from engine.precompute.indirect.indirect_light import Footprint, GatherPoints, IndirectLight
from engine.precompute.indirect.irradiance_cache import CacheLight, IrradianceCache, connect, direct_irradiance
from engine.precompute.indirect.photons import PhotonMap, PhotonSource, no_nearby_photons, no_photons
from engine.precompute.indirect.progress import Progress, Span, Stopwatch, at_fraction
from engine.precompute.indirect.ray_budget import RayBudget
from engine.precompute.indirect.sampling_settings import SamplingSettings
from engine.precompute.indirect.second_bounce import SecondBounceTracer

# Gather points per checkpoint: one or two seconds of work, so that storing it costs little.
PART_POINTS = 4096


@dataclass(frozen=True, eq=False)
class SampledScene:
    """A scene seen from a camera, and how it is sampled. lobe_axes (M,) and axes (M, 3, 3) of the objects; emission:
    all lights; second: traces the glossy second bounce, None where it counts as diffuse."""

    placement: Placement
    lobe_axes: NDArray[np.int64]
    axes: NDArray[np.float32]
    emission: Emission
    second: SecondBounceTracer | None
    n_bounces: int

    @property
    def n_objects(self) -> int:
        return len(self.lobe_axes)

    def reader(self, arrays: Arrays, n_rays: int) -> ArrayReader:
        """A reader of arrays that belong to this scene and light, with n_rays per sample set."""
        sizes = {"P": len(self.placement.hits.pixel), "M": self.n_objects, "T": len(self.placement.scene.triangles)}
        return ArrayReader(arrays, **sizes, R=n_rays, L=len(self.emission.all_lights.cumulative))


class Attempt:
    """The cache records, photons and sample sets of one attempt. settings: the present ones; samples: the sample sets
    so far; n_rays_traced: rays of all sample sets, those that were dropped included."""

    def __init__(
        self, scene: SampledScene, search: CellSizeSearch, settings: SamplingSettings, checkpoints: Checkpoints,
        stopwatch: Stopwatch,
    ) -> None:  # fmt: skip
        placement = scene.placement
        self._scene, self._search, self._checkpoints, self._stopwatch = scene, search, checkpoints, stopwatch
        self.cache = IrradianceCache(placement.scene, placement.caster, search.size)
        self.settings = settings
        self.samples = no_samples(settings.n_rays)
        self.n_rays_traced = 0
        self._photons = PhotonMap(no_photons(scene.n_objects))
        self._newest = self.samples
        self._points: GatherPoints | None = None
        search.n_sets = PART_POINTS // 2  # an estimate for the part that is abandoned

    def emit_photons(self) -> None:
        """Emits the photons that glossy surfaces reflect: caustics."""
        self._photons = self._stopwatch.time("photons", self._emitted_photons)
        self._points = None

    def _emitted_photons(self) -> PhotonMap:
        scene, second = self._scene, self._scene.second
        if second is None:
            return self._photons
        source = PhotonSource(
            scene.placement.scene, self.cache, second.glossy, scene.lobe_axes, scene.axes, scene.emission.all_lights
        )
        return PhotonMap(run_to_end(source.send(scene.placement.hits, self.settings.n_photons)))

    @property
    def has_glossy_hits(self) -> bool:
        """Whether any ray so far ends on a glossy surface."""
        return len(self.samples.glossy_hits.ray) > 0

    @property
    def points(self) -> GatherPoints:
        """The gather points of all sample sets so far, with the photons near them."""
        if self._points is None:
            self._points = self._points_of(self.samples)
        return self._points

    @property
    def newest_points(self) -> GatherPoints:
        """The gather points of the sample sets that were traced last, with the photons near them."""
        return self.points if self._newest is self.samples else self._points_of(self._newest)

    def _points_of(self, samples: GatherSamples) -> GatherPoints:
        scene, placement = self._scene, self._scene.placement
        points = GatherPoints(
            placement.hits, samples, scene.lobe_axes, self._sample_counts(), scene.axes, scene.second is not None,
            self._photons.photons, no_nearby_photons(len(samples.rows)),
            thrice=scene.second is None or scene.second.thrice,
        )  # fmt: skip
        return points.with_photons(self._photons, placement.scene, placement.caster)

    def restore(self, table: CacheTable, samples: GatherSamples) -> None:
        """Restores records and sample sets of an attempt that ended."""
        self.cache.restore(table)
        self.samples, self._newest, self._points = samples, samples, None

    def begin_anew(self, settings: SamplingSettings) -> None:
        """Drops all sample sets; the next ones have the rays of these settings. Records stay."""
        self.settings, self.samples, self._points = settings, no_samples(settings.n_rays), None

    def assemble(self, light: CacheLight, footprint: Footprint, ray_budget: RayBudget) -> IndirectLight:
        """The indirect light of these gather points with the light between the records."""
        emission, n_bounces = self._scene.emission, self._scene.n_bounces
        return IndirectLight(
            self.points, footprint, self.cache, light, emission.all_lights, n_bounces, emission.unit, ray_budget
        )

    def trace(
        self, rows: NDArray[np.int32], nth: NDArray[np.uint8] | None, span: Span, first_open: int = 0
    ) -> Generator[Progress, None, None]:
        """Adds sample sets: the nth (q,) of the points `rows` (q,), None for their first ones. first_open: the first
        record that takes sample positions from them."""
        nth = np.zeros(len(rows), np.uint8) if nth is None else nth
        self.n_rays_traced += len(rows) * self.settings.n_rays
        yield from self._stopwatch.steps("samples", self._traced(rows, nth, span, first_open))

    def _traced(
        self, rows: NDArray[np.int32], nth: NDArray[np.uint8], span: Span, first_open: int
    ) -> Generator[Progress, None, None]:
        found, done = [no_samples(self.settings.n_rays)], 0
        for own, size in sets_alike(self._scene.placement.hits, rows, self._sample_counts()):
            for begin in range(0, len(own), PART_POINTS):
                part = own[begin : begin + PART_POINTS]
                for samples in self._part(rows[part], nth[part], size, first_open):
                    found.append(samples)
                    done += len(samples.rows)
                    yield span.at(done / len(rows)), "tracing gather points"
        self._newest = join_samples(found)
        is_first = not len(self.samples.rows)
        self.samples = self._newest if is_first else join_samples([self.samples, self._newest])
        self._points = None

    def _part(
        self, rows: NDArray[np.int32], nth: NDArray[np.uint8], size: SampleCounts, first_open: int
    ) -> Iterator[GatherSamples]:
        """One part of the sample sets: restored from a checkpoint, or traced and stored."""
        inputs = b"fans", rows.tobytes(), nth.tobytes(), repr((size, self.cache.size)).encode()
        stored = self._checkpoints.begin(self._read_samples, *inputs)
        if stored is not None:
            self.cache.restore(stored[0])
            yield stored[1]
        else:
            found = []
            hits, scene = self._scene.placement.hits, self._scene
            for samples in gather(hits, self.cache, rows, nth, scene.lobe_axes, size, scene.second, True, first_open):
                found.append(samples)
                yield samples
            self._checkpoints.store_part(
                {**arrays_of_gathered(join_samples(found)), **arrays_of_table(self.cache.table())}
            )
        self._search.n_sets += len(rows)

    def light(self, settings: SamplingSettings, span: Span, kind: str) -> Generator[Progress, None, CacheLight]:
        """The light between the records: restored from a checkpoint, or computed and stored. kind: of work, for the
        stopwatch."""
        return (yield from self._stopwatch.steps(kind, self._light(settings, span)))

    def _light(self, settings: SamplingSettings, span: Span) -> Generator[Progress, None, CacheLight]:
        stored = self._checkpoints.begin(partial(self._read_light, settings), b"light", repr(settings).encode())
        if stored is not None:
            self.cache.restore(stored[0])
            return stored[1]
        found = [np.zeros((0, settings.n_record_rays), np.uint16)]
        for fraction, records_hit in connect(self.cache, self._scene.n_bounces, settings.n_record_rays):
            found.append(records_hit)
            yield span.at(fraction), "light between surfaces"
        steps = direct_irradiance(self.cache, self._scene.emission.lights, settings.n_samples)
        direct = yield from at_fraction(steps, span.end, "light between surfaces")
        light = CacheLight(self.cache.objects.copy(), np.concatenate(found), direct)
        self._checkpoints.store_part(
            {"cell_seen": light.records_hit, "direct": direct, **arrays_of_table(self.cache.table())}
        )
        return light

    def _sample_counts(self) -> tuple[SampleCounts, ...]:
        """The sample counts of each object."""
        return tuple(sample_counts(self.settings.n_rays, int(lobe_axis)) for lobe_axis in self._scene.lobe_axes)

    def _read_samples(self, arrays: Arrays) -> tuple[CacheTable, GatherSamples]:
        reader = self._scene.reader(arrays, self.settings.n_rays)
        return read_table(reader), read_gathered(reader)

    def _read_light(self, settings: SamplingSettings, arrays: Arrays) -> tuple[CacheTable, CacheLight]:
        reader = self._scene.reader(arrays, self.settings.n_rays)
        table = read_table(reader)
        return table, read_record_light(reader, settings.n_record_rays, table.objects.copy())
