"""Computes the indirect light of one scene from one camera, independently of the materials.

The traced rays (hemisphere samples of the gather points and of the irradiance cache records) depend on the scene and
the camera alone. The direct irradiance of the records depends on the light as well. Curves, albedos and the choice of
the edited object enter last. A rotated light therefore requires new direct irradiance only, and an edited material
requires sums only.
"""

import itertools
import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import Result, map_steps, run_to_end
from engine.core.stored_arrays import ArrayReader, Arrays
from engine.precompute.direct.footprint import footprint, lattice_rows
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect._cache_kernels import NO_RECORD, CacheTable
from engine.precompute.indirect._ray_kernels import HALF, NORMAL
from engine.precompute.indirect.checkpoints import (
    Checkpoints,
    CheckpointStore,
    arrays_of_gathered,
    arrays_of_table,
    read_cell_light,
    read_cell_size,
    read_footprint,
    read_gathered,
    read_ray_budget,
    read_smoothing,
    read_table,
)
from engine.precompute.indirect.direction_patterns import SampleCounts, lobe_axis_of, sample_counts
from engine.precompute.indirect.emission import scene_emission
from engine.precompute.indirect.gather import GatherSamples, gather, join_samples, object_of_rows
from engine.precompute.indirect.indirect_layers import IndirectLayer, albedos_of, any_glossy
from engine.precompute.indirect.indirect_light import Footprint, GatherPoints, IndirectLight
from engine.precompute.indirect.irradiance_cache import (
    MAX_RECORDS,
    CacheFull,
    CacheLight,
    IrradianceCache,
    connect,
    direct_irradiance,
    radiosity,
)
from engine.precompute.indirect.lattice import COARSEST, Lattice, count_by_shape, least_alike
from engine.precompute.indirect.photons import PhotonMap, PhotonSource, no_nearby_photons, no_photons
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.precompute.indirect.sampling_settings import (
    FINE,
    LEFT_OF_DIFFUSE,
    LEFT_OF_GLOSSY,
    LEVELS,
    RayBudget,
    SamplingSettings,
    noise_of,
    required_rays,
)  # fmt: skip
from engine.precompute.indirect.second_bounce import SecondBounceTracer, diffuse_share, no_glossy_hits
from engine.precompute.indirect.smoothing import extra_sample_sets
from engine.scene.object_axes import object_axes
from engine.scene.primary_hits import PrimaryHits

# Gather points, and rays for each, of the pilot pass that chooses the cell size.
_PILOT_POINTS, _PILOT_RAYS = 1024, 64
# The least factor by which cells grow after a `CacheFull`; the number of records grows with this power of the number of
# sample sets.
_GROWTH, RECORDS_BY_SETS = 1.26, 0.4
_MOST_GROWTH, _LEAST_POWER, _MOST_POWER = 4.0, 0.5, 2.0
# The fraction of `MAX_RECORDS` that a larger cell size aims at.
FULL = 0.85
# Expected gather points, relative to those that silhouettes and creases alone require.
_BY_LIGHT = 1.25
# Gather points per checkpoint: one or two seconds of work, so that storing it costs little.
PART_POINTS = 4096
_PHOTONS_SHARE = np.float32(0.3)

Progress = tuple[float, str]
# Where the phases end, as fractions of the processor time of the whole: first pass, rough light between the records it
# found (only where refinement follows), refinement passes, final light between all records, caustics. The filter takes
# the rest. Extra sample sets share the span up to `_LIGHT_DONE`; as many extra sets as first sets take as long as all
# passes together.
_FIRST_PASS_DONE, _ROUGH_LIGHT_DONE, _REFINED_DONE, _LIGHT_DONE, _PHOTONS_DONE = (
    0.1,
    0.35,
    (0.45, 0.6, 0.75),
    0.93,
    0.96,
)
_ALL_PASSES = _FIRST_PASS_DONE + _REFINED_DONE[-1] - _ROUGH_LIGHT_DONE


class CellSizeTry(NamedTuple):
    """Cells of `size` metres gave too many records after `n_sets` sample sets."""

    size: float
    n_sets: int


def growth(tries: Sequence[CellSizeTry], expected: float) -> float:
    """The factor by which cells grow after the last try, so that the records of the `expected` number of sample sets
    fit. One large step costs less than several restarts.

    n sample sets find C n^0.4 s^-p records in cells of size s. On a plain surface p = 2. Beside polished metal, which
    shows small cells of the whole scene, the number hardly falls with s. Two tries determine p.
    """
    last, power = tries[-1], _MOST_POWER
    if len(tries) > 1:
        first = tries[-2]
        measured_power = RECORDS_BY_SETS * math.log(last.n_sets / first.n_sets) / math.log(last.size / first.size)
        power = min(max(measured_power, _LEAST_POWER), _MOST_POWER)
    too_many = max((expected / last.n_sets) ** RECORDS_BY_SETS, 1.0) / FULL
    return min(max(too_many ** (1.0 / power), _GROWTH), _MOST_GROWTH)


class Solver:
    """Solves for the indirect light of a scene. Its steps are generators that yield (fraction of the whole, text)."""

    def __init__(
        self, placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
        settings: SamplingSettings = FINE, glossy: bool = True, other_light: float | None = None,
    ) -> None:  # fmt: skip
        """models: names of the models of every object's layers, by the object's index; n_bounces ≥ 2.

        glossy: whether the second bounce off glossy surfaces depends on direction; otherwise it uses the equivalent
        albedo, as all further bounces do. other_light: mean radiance of the rest of the picture, relative to which
        noise is visible. With it the solver takes no more rays than required; with None it takes all.
        """
        self._placement, self._most, self._n_bounces = placement, settings, n_bounces
        self._settings, self._ray_budget, self._other_light = (
            settings,
            RayBudget(settings.n_rays, settings.n_rays),
            other_light,
        )
        n_objects = len(placement.hits.object_ranges)
        self._lobe_axes = np.array([lobe_axis_of(models.get(i, ())) for i in range(n_objects)], np.int64)
        self._emission = scene_emission(placement, sky)
        glossy_objects = np.array([any_glossy(models.get(i, ())) for i in range(n_objects)], bool)
        self._axes = np.ascontiguousarray(object_axes(placement.scene)[:, [1, 0]], np.float32)
        second = SecondBounceTracer(
            glossy_objects, self._lobe_axes, self._axes, self._emission.lamps, settings.n_glossy_hits, n_bounces > 2
        )
        self._second = second if glossy else None
        self._n_traced = 0

    def solve(
        self, layers: Sequence[IndirectLayer], keeper: CheckpointStore | None = None
    ) -> Generator[Progress, None, IndirectLight]:
        """The indirect light. The layers only determine where the picture of it is not smooth.

        keeper: stores finished parts and finds those that another run stored.
        """
        size, parts, tries = self._cell_size(), Checkpoints(keeper), list[CellSizeTry]()
        while True:
            self._n_traced = PART_POINTS // 2  # an estimate for the part that is abandoned
            cells = IrradianceCache(self._placement.scene, self._placement.caster, size)
            if self._needs_ray_budget:
                self._settings = self._most.with_rays(self._most.n_rays // LEVELS[0])
            try:
                return (yield from self._solve(cells, layers, parts))
            except CacheFull:
                parts.mark_too_fine()
                tries.append(CellSizeTry(size, self._n_traced))
                size *= growth(tries, self._expected)

    def restored(self, arrays: Arrays) -> IndirectLight:
        """Restores the result of `solve` from the arrays of `checkpoints.arrays_of`. Raises UnsoundArrays for anything
        else."""
        self._settings, self._ray_budget = self._restored_ray_budget(arrays)
        reader = self._reader(arrays)
        cells = IrradianceCache(self._placement.scene, self._placement.caster, read_cell_size(reader))
        cells.restore(read_table(reader))
        gathered, found, smoothing = read_gathered(reader), read_footprint(reader), read_smoothing(reader)
        light = read_cell_light(reader, self._settings.n_record_rays, cells.objects.copy())
        points = replace(self._points(gathered, self._photons(cells)), smoothing=smoothing)
        return self._assemble(points, found, cells, light)

    def _restored_ray_budget(self, arrays: Arrays) -> tuple[SamplingSettings, RayBudget]:
        need = read_ray_budget(ArrayReader(arrays), self._most.n_rays)
        return self._most.with_rays(need.n_rays), need

    def _reader(self, arrays: Arrays) -> ArrayReader:
        """A reader of arrays that belong to this scene, light and sampling settings."""
        scene, n_lights = self._placement.scene, len(self._emission.lamps.cumulative)
        sizes = {"P": len(self._placement.hits.pixel), "M": len(self._lobe_axes), "T": len(scene.triangles)}
        return ArrayReader(arrays, **sizes, R=self._settings.n_rays, L=n_lights)

    def _cell_size(self) -> float:
        """The cell size in metres at which the hits of a pilot pass fall into about as many records as the settings
        allow."""
        hits, scene = self._placement.hits, self._placement.scene
        rows = np.arange(0, len(hits.pixel), max(1, -(-len(hits.pixel) // _PILOT_POINTS)), dtype=np.int32)
        extent = float(np.linalg.norm(np.ptp(scene.vertices[np.unique(scene.triangles)], axis=0)))
        # Bisect the logarithm of the size.
        low, high = extent / 4096.0, extent
        while high / low > 1.1:
            size = (low * high) ** 0.5
            cells = IrradianceCache(scene, self._placement.caster, size)
            try:
                pilot = gather(
                    hits,
                    cells,
                    rows,
                    _first_sets(rows),
                    self._lobe_axes,
                    sample_counts(_PILOT_RAYS, HALF),
                    focused=False,
                )
                n_hits = sum(int((part.records != NO_RECORD).sum()) for part in pilot)
                too_fine = len(cells) > min(self._settings.n_cache_records / 2, max(n_hits / 2, 1.0))
            except CacheFull:
                too_fine = True
            low, high = (size, high) if too_fine else (low, size)
        return high

    def _solve(
        self, cells: IrradianceCache, layers: Sequence[IndirectLayer], parts: Checkpoints
    ) -> Generator[Progress, None, IndirectLight]:
        """One attempt with a given cell size. Raises CacheFull if there are too many records."""
        yield 0.0, "tracing gather points"
        photons = self._photons(cells)
        if self._settings.adaptive:
            points, found, begin = yield from self._refine(cells, layers, photons, parts)
        else:
            points, found, begin = yield from self._trace_even_grid(cells, photons, parts)
        light = yield from self._light(cells, self._settings, parts, (begin, _LIGHT_DONE))
        yield _PHOTONS_DONE, "taking out noise"
        smoothing = self._assemble(points, found, cells, light).smoothed(layers)
        return (yield from _with_overall_progress(smoothing, _PHOTONS_DONE, "taking out noise"))

    def _assemble(
        self, points: GatherPoints, found: Footprint, cells: IrradianceCache, light: CacheLight
    ) -> IndirectLight:
        lamps, unit = self._emission.lamps, self._emission.unit
        return IndirectLight(points, found, cells, light, lamps, self._n_bounces, unit, self._ray_budget)

    def _photons(self, cells: IrradianceCache) -> PhotonMap:
        """Photons that glossy surfaces reflect: caustics."""
        if self._second is None:
            return PhotonMap(no_photons(len(self._lobe_axes)))
        source = PhotonSource(
            self._placement.scene, cells, self._second.glossy, self._lobe_axes, self._axes, self._emission.lamps
        )
        return PhotonMap(source.send(self._placement.hits, self._settings.n_photons))

    def _trace_even_grid(
        self, cells: IrradianceCache, photons: PhotonMap, parts: Checkpoints
    ) -> Generator[Progress, None, tuple[GatherPoints, Footprint, float]]:
        """Gather points at every eighth pixel, their footprint, and the fraction done."""
        hits = self._placement.hits
        rows = lattice_rows(hits, COARSEST)
        gathered = yield from self._gather(
            cells, self._no_samples(), rows, _first_sets(rows), parts, (0.0, _FIRST_PASS_DONE)
        )
        points = self._points(gathered, photons)
        numbers, weights = footprint(hits, rows, COARSEST)
        return points, (_among_all(hits, rows, numbers), weights), _FIRST_PASS_DONE

    def _no_samples(self) -> GatherSamples:
        """No sample sets."""
        rows, seen = np.zeros(0, np.int32), np.zeros((0, self._settings.n_rays), np.uint16)
        return GatherSamples(rows, _first_sets(rows), seen, no_glossy_hits(0), np.zeros(0, np.float32))

    def _refine(
        self, cells: IrradianceCache, layers: Sequence[IndirectLayer], photons: PhotonMap, parts: Checkpoints
    ) -> Generator[Progress, None, tuple[GatherPoints, Footprint, float]]:
        """As many gather points as the picture of these layers requires, judged by rough light between the records (a
        quarter of the rays); their footprint; and the fraction done."""
        lattice, gathered = self._lattice(), self._no_samples()
        values, noise = np.zeros((2, len(self._placement.hits.pixel), 3), np.float32)
        clearance = np.zeros(len(self._placement.hits.pixel), np.float32)
        bright = None
        looks = iter(itertools.pairwise((_ROUGH_LIGHT_DONE, *_REFINED_DONE)))
        span = 0.0, _FIRST_PASS_DONE
        while True:
            # Trace the lattice points that refinement added.
            rows = lattice.missing_rows()
            gathered = yield from self._gather(cells, gathered, rows, _first_sets(rows), parts, span)
            span = next(looks, (_REFINED_DONE[-1],) * 2)
            if bright is None:
                light = yield from self._light(
                    cells, self._rough_settings(), parts, (_FIRST_PASS_DONE, _ROUGH_LIGHT_DONE)
                )
                albedos, mapped = (
                    albedos_of(layers, len(self._lobe_axes)),
                    cells.maps.reflectance(layers, len(self._lobe_axes)),
                )
                bright, _ = radiosity(light, albedos, self._n_bounces, mapped)
                # The noise of the first pass determines the ray budget. If it requires more rays, trace it anew.
                if self._needs_ray_budget:
                    halves = self._halves_of_samples(self._points(gathered, photons), layers, cells, light)
                    if self._is_noisy(
                        layers,
                        gathered.rows,
                        (yield from _with_overall_progress(halves, span[0], "tracing gather points")),
                    ):
                        none, at = self._no_samples(), span[:1] * 2
                        gathered = yield from self._gather(cells, none, rows, _first_sets(rows), parts, at)
                self._forecast(cells, len(rows))
            points = self._points(gathered, photons)
            # Compare two independent halves of the rays: their mean is the value, their difference the noise.
            halves = self._halves(points, layers, bright, len(cells))
            first, second = yield from _with_overall_progress(halves, span[0], "tracing gather points")
            values[gathered.rows], noise[gathered.rows] = 0.5 * (first + second), 0.5 * abs(first - second)
            clearance[gathered.rows] = gathered.clearance
            if not lattice.refine(values, noise, clearance):
                found = lattice.footprint()
                rows, nth = self._extra_sets(gathered.rows, values, noise, found)
                if not len(rows):
                    return points, found, _REFINED_DONE[-1]
                done = _extra_sets_done(len(rows) / len(gathered.rows))
                # Records keep their sample positions: the extra rays come from noisy points, and would bias them
                # towards bright ones.
                gathered = yield from self._gather(
                    cells, gathered, rows, nth, parts, (_REFINED_DONE[-1], done), len(cells)
                )
                return self._points(gathered, photons), found, done

    def _forecast(self, cells: IrradianceCache, n_sets: int) -> None:
        """Raises CacheFull if the records found by these sample sets predict more than `MAX_RECORDS` for all of them.
        Otherwise this would only become known when nearly all rays are traced."""
        wanted = len(cells) * (max(self._expected, n_sets) / max(n_sets, 1)) ** RECORDS_BY_SETS
        if wanted > MAX_RECORDS:
            self._n_traced = round(n_sets * (MAX_RECORDS / len(cells)) ** (1.0 / RECORDS_BY_SETS))
            raise CacheFull(f"{wanted:.0f} to come")

    def _rough_settings(self) -> SamplingSettings:
        """Settings for the rough light between records that steers refinement."""
        return replace(self._most, n_record_rays=self._most.n_record_rays // 4, n_samples=self._most.n_samples // 4)

    def _halves(
        self, points: GatherPoints, layers: Sequence[IndirectLayer], bright: NDArray[np.float32], n_cells: int
    ) -> Generator[None, None, NDArray[np.float32]]:
        """The radiance (2, p, 3) that each half of the rays gathers from radiosities `bright` (C, D, 3) of the first C
        records. Glossy surfaces reflect by albedo, with a share of the photons, because their directional reflection is
        noisier."""
        new_cells = np.zeros((n_cells - len(bright), *bright.shape[1:]), np.float32)  # not known yet: dark
        reflected_onward = points.caustic_flux(layers)
        reflected_onward = reflected_onward._replace(light=_PHOTONS_SHARE * reflected_onward.light)
        sent = OutgoingRadiance(np.concatenate([bright, new_cells]), None, reflected_onward)
        return (yield from points.halves(layers, sent))

    def _halves_of_samples(
        self, points: GatherPoints, layers: Sequence[IndirectLayer], cells: IrradianceCache, light: CacheLight
    ) -> Generator[None, None, NDArray[np.float32]]:
        """The same for everything that depends on the number of rays: with the directional reflection of glossy
        surfaces, without photons."""
        nowhere = np.zeros((0, 4), np.int32), np.zeros((0, 4), np.float32)
        sent = self._assemble(points, nowhere, cells, light).outgoing_radiance(layers)
        return (yield from points.halves(layers, replace(sent, caustics=None)))

    @property
    def _needs_ray_budget(self) -> bool:
        """Whether the required number of rays is still unknown."""
        return self._other_light is not None and self._most.adaptive and self._ray_budget.noise is None

    def _is_noisy(self, layers: Sequence[IndirectLayer], rows: NDArray[np.int32], halves: NDArray[np.float32]) -> bool:
        """Whether the first pass, traced with the fewest rays, requires more of them. halves (2, p, 3): radiance of
        each half."""
        other = (self._other_light or 0.0) / self._emission.unit
        diffuse = diffuse_share(layers, len(self._lobe_axes)).mean(axis=1) > 0.5
        left = np.where(diffuse, LEFT_OF_DIFFUSE, LEFT_OF_GLOSSY)[object_of_rows(self._placement.hits, rows)]
        noise = noise_of(halves, left, self._placement.hits.share[rows], other)
        self._ray_budget = required_rays(self._most.n_rays, noise)
        before, self._settings = self._settings, self._most.with_rays(self._ray_budget.n_rays)
        return self._settings.n_rays > before.n_rays

    @property
    def _expected(self) -> float:
        """The expected number of sample sets."""
        return _BY_LIGHT * count_by_shape(self._whole_lattice()) if self._settings.adaptive else 0.0

    def _lattice(self) -> Lattice:
        """The lattice that is refined."""
        return self._whole_lattice()

    def _whole_lattice(self) -> Lattice:
        return Lattice(self._placement.hits, self._lobe_axes != NORMAL, self._settings.close)

    def _extra_sets(
        self, rows: NDArray[np.int32], values: NDArray[np.float32], noise: NDArray[np.float32], found: Footprint
    ) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
        """The extra sample sets (q,) of the gather points at `rows` (p,), chosen by values and noise (P, 3): the row of
        each, and its number at that row."""
        numbers, weights = found
        # The squared weight with which each gather point contributes to the picture: its share of the variance.
        shown = np.bincount(numbers.ravel(), weights.ravel() ** 2, len(rows)).astype(np.float64)
        alike = least_alike(self._lobe_axes != NORMAL)
        n = extra_sample_sets(
            self._placement.hits, rows, alike, values[rows], noise[rows], shown, self._settings.max_extra_sets
        )
        nth = np.arange(1, n.sum() + 1) - np.repeat(np.cumsum(n) - n, n)
        return np.repeat(rows, n), nth.astype(np.uint8)

    def _points(self, gathered: GatherSamples, photons: PhotonMap) -> GatherPoints:
        points = GatherPoints(
            self._placement.hits, gathered, self._lobe_axes, self._sample_counts(), self._axes,
            self._second is not None,
            photons.photons, no_nearby_photons(len(gathered.rows)),
        )  # fmt: skip
        return points.with_photons(photons, self._placement.scene, self._placement.caster)

    def _sample_counts(self) -> tuple[SampleCounts, ...]:
        """The sample counts of each object."""
        return tuple(sample_counts(self._settings.n_rays, int(lobe_axis)) for lobe_axis in self._lobe_axes)

    def _gather(
        self, cells: IrradianceCache, before: GatherSamples, rows: NDArray[np.int32], nth: NDArray[np.uint8],
        parts: Checkpoints,
        span: tuple[float, float], first_open: int = 0,
    ) -> Generator[Progress, None, GatherSamples]:  # fmt: skip
        """The given sample sets and more: the nth (q,) of rows (q,). span: the fractions of the whole where this begins
        and ends; first_open: see `gather`."""
        found = [before]
        n_lobe = np.array([size.n_lobe for size in self._sample_counts()])[object_of_rows(self._placement.hits, rows)]
        done = 0
        for n in np.unique(n_lobe):
            own, size = np.flatnonzero(n_lobe == n), SampleCounts(self._settings.n_rays - int(n), int(n))
            for begin in range(0, len(own), PART_POINTS):
                part = own[begin : begin + PART_POINTS]
                for gathered in self._gathered(cells, rows[part], nth[part], size, parts, first_open):
                    found.append(gathered)
                    done += len(gathered.rows)
                    yield span[0] + (span[1] - span[0]) * done / len(rows), "tracing gather points"
        return join_samples(found)

    def _gathered(
        self, cells: IrradianceCache, rows: NDArray[np.int32], nth: NDArray[np.uint8], size: SampleCounts,
        parts: Checkpoints,
        first_open: int,
    ) -> Iterator[GatherSamples]:  # fmt: skip
        """One part of the sample sets: restored from a checkpoint, or traced and stored."""
        kept = parts.begin(
            self._checkpointed_samples, b"fans", rows.tobytes(), nth.tobytes(), repr((size, cells.size)).encode()
        )
        if kept is not None:
            cells.restore(kept[0])
            yield kept[1]
            self._n_traced += len(rows)
            return
        found = []
        for each in gather(
            self._placement.hits, cells, rows, nth, self._lobe_axes, size, self._second, True, first_open
        ):
            found.append(each)
            yield each
        parts.store_part({**arrays_of_gathered(join_samples(found)), **arrays_of_table(cells.table())})
        self._n_traced += len(rows)

    def _light(
        self, cells: IrradianceCache, settings: SamplingSettings, parts: Checkpoints, span: tuple[float, float]
    ) -> Generator[Progress, None, CacheLight]:
        """The light between the records, restored from a checkpoint or computed and stored."""
        kept = parts.begin(partial(self._checkpointed_light, settings), b"light", repr(settings).encode())
        if kept is not None:
            cells.restore(kept[0])
            return kept[1]
        found = [np.zeros((0, settings.n_record_rays), np.uint16)]
        for fraction, seen in connect(cells, self._n_bounces, settings.n_record_rays):
            found.append(seen)
            yield span[0] + (span[1] - span[0]) * fraction, "light between surfaces"
        emitting = direct_irradiance(cells, self._emission.lights, settings.n_samples)
        direct = yield from _with_overall_progress(emitting, span[1], "light between surfaces")
        light = CacheLight(cells.objects.copy(), np.concatenate(found), direct)
        parts.store_part({"cell_seen": light.records_hit, "direct": direct, **arrays_of_table(cells.table())})
        return light

    def _checkpointed_samples(self, arrays: Arrays) -> tuple[CacheTable, GatherSamples]:
        reader = self._reader(arrays)
        return read_table(reader), read_gathered(reader)

    def _checkpointed_light(self, settings: SamplingSettings, arrays: Arrays) -> tuple[CacheTable, CacheLight]:
        reader = self._reader(arrays)
        table = read_table(reader)
        return table, read_cell_light(reader, settings.n_record_rays, table.objects.copy())


def relit(
    found: IndirectLight, placement: Placement, sky: SkyState, settings: SamplingSettings, n_bounces: int
) -> IndirectLight:
    """The same rays under another light. n_bounces: at most the number they were traced for.

    Glossy hits store the old light, so glossy surfaces reflect by albedo until the rays are traced anew.
    """
    emitting = scene_emission(placement, sky)
    light = replace(found.light, direct=run_to_end(direct_irradiance(found.cells, emitting.lights, settings.n_samples)))
    return replace(found.without_glossy_hits(), light=light, n_bounces=n_bounces, unit=emitting.unit)


def _with_overall_progress(
    steps: Generator[object, None, Result], fraction: float, text: str
) -> Generator[Progress, None, Result]:
    """The same steps, each of which yields the fraction of the whole."""
    return map_steps(steps, lambda step: (fraction, text))


def _first_sets(rows: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Number 0 for each row: the first sample set of its point."""
    return np.zeros(len(rows), np.uint8)


def _extra_sets_done(times: float) -> float:
    """The fraction done after extra sample sets, `times` as many as first sets."""
    work, left = times * _ALL_PASSES, _LIGHT_DONE - _REFINED_DONE[-1]
    return _REFINED_DONE[-1] + left * work / (work + left)


def _among_all(hits: PrimaryHits, rows: NDArray[np.int32], within: NDArray[np.int32]) -> NDArray[np.int32]:
    """Converts indices (P, 4) that count within each point's own object to indices among all gather points `rows`."""
    firsts = np.searchsorted(rows, hits.object_ranges[:, 0])
    counts = hits.object_ranges[:, 1] - hits.object_ranges[:, 0]
    return np.asarray(within + np.repeat(firsts, counts)[:, None], np.int32)
