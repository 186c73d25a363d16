"""Computes the indirect light of one scene from one camera, independently of the materials.

The traced rays (hemisphere samples of the gather points and of the irradiance cache records) depend on the scene and
the camera alone. The direct irradiance of the records depends on the light as well. Curves, albedos and the choice of
the edited object enter last. A rotated light therefore requires new direct irradiance only, and an edited material
requires sums only.

The solver's parts have a module each: the size of the cache's cells (`cell_size`), tracing and its checkpoints
(`attempt`), the number of rays (`ray_budget`), the choice of gather points (`refinement`), and progress (`progress`).
"""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, repeat

import numpy as np
from numpy.typing import NDArray

from engine.core.stored_arrays import ArrayReader, Arrays
from engine.precompute.direct.pipeline import Placement, SkyState, footprint, lattice_rows
from engine.precompute.indirect._ray_kernels import NORMAL
from engine.precompute.indirect.attempt import Attempt, SampledScene
from engine.precompute.indirect.cell_size import CellSizeSearch, first_cell_size
from engine.precompute.indirect.checkpoints import (
    Checkpoints,
    CheckpointStore,
    read_cell_size,
    read_footprint,
    read_gathered,
    read_ray_budget,
    read_record_light,
    read_smoothing,
    read_table,
)
from engine.precompute.indirect.direction_patterns import lobe_axis_of
from engine.precompute.indirect.emission import scene_emission
from engine.precompute.indirect.indirect_layers import IndirectLayer, albedos_of, any_glossy
from engine.precompute.indirect.indirect_light import Footprint, IndirectLight
from engine.precompute.indirect.irradiance_cache import CacheFull, CacheLight, direct_irradiance, radiosity
from engine.precompute.indirect.progress import (
    FIRST_PASS,
    LIGHT_DONE,
    PHOTONS_DONE,
    REFINED,
    REFINEMENTS,
    ROUGH_LIGHT,
    Progress,
    Span,
    Stopwatch,
    at_fraction,
    extra_sets_span,
)
from engine.precompute.indirect.ray_budget import LEVELS, RayBudget, ray_budget_of
from engine.precompute.indirect.refinement import COARSEST, Lattice, Refinement, count_by_shape
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.precompute.indirect.sampling_settings import FINE, SamplingSettings
from engine.precompute.indirect.second_bounce import SecondBounceTracer
from engine.scene.tangents import tangent_axes

# Expected gather points, relative to those that silhouettes and creases alone require.
_BY_LIGHT = 1.25


@dataclass(frozen=True)
class Trial:
    """A run on a random part of the picture, from which the cost of the whole is estimated, see
    `engine.render.cost_pilot`.

    n_blocks: of the lattice in use; fewer: as many times fewer are photons, rays between records and samples of their
    lights, except for rough light, whose noise would count as contrast of the picture; larger: factor on the first cell
    size.
    """

    n_blocks: int
    fewer: int
    larger: float = 1.0


class Solver:
    """Solves for the indirect light of a scene. Its steps are generators that yield (fraction of the whole, text).

    stopwatch: processor seconds of the kinds of work "size", "photons", "samples", "rough" (light) and "records";
    lattice: of the last attempt, None where the settings refine none; n_rays_traced: of all sample sets, in all
    attempts.
    """

    def __init__(
        self, placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
        settings: SamplingSettings = FINE, glossy: bool = True, other_light: float | None = None,
        trial: Trial | None = None, thrice: bool = True,
    ) -> None:  # fmt: skip
        """models: names of the models of every object's layers, by the object's index; n_bounces ≥ 2.

        glossy: whether the second bounce off glossy surfaces depends on direction; otherwise it uses the equivalent
        albedo, as all further bounces do. other_light: mean radiance of the rest of the picture, relative to which
        noise is visible. With it the solver takes no more rays than required; with None it takes all. trial: None to
        solve for the whole picture. thrice: whether light that three glossy surfaces reflect in turn does, too.
        """
        self._most, self._other_light, self._trial = settings, other_light, trial
        if trial is not None:
            self._most = replace(
                settings, n_record_rays=settings.n_record_rays // trial.fewer,
                n_samples=settings.n_samples // trial.fewer, n_photons=settings.n_photons // trial.fewer,
            )  # fmt: skip
        # Rough light between the records steers refinement.
        self._rough = replace(
            self._most, n_record_rays=settings.n_record_rays // 4, n_samples=settings.n_samples // 4
        )  # fmt: skip
        self._ray_budget = RayBudget(settings.n_rays, settings.n_rays)
        self._scene = _sampled_scene(placement, models, sky, n_bounces, self._most, glossy, thrice)
        self.stopwatch = Stopwatch()
        self.lattice: Lattice | None = None
        self.n_rays_traced = 0

    def solve(
        self, layers: Sequence[IndirectLayer], storage: CheckpointStore | None = None
    ) -> Generator[Progress, None, IndirectLight]:
        """The indirect light. The layers only determine where the picture of it is not smooth.

        storage: keeps finished parts and finds those that another run stored.
        """
        scene, checkpoints = self._scene, Checkpoints(storage)
        size = self.stopwatch.time(
            "size", first_cell_size, scene.placement, scene.lobe_axes, self._most.n_cache_records
        )
        search = CellSizeSearch(size * (self._trial.larger if self._trial else 1.0), lambda: self._n_expected)
        while True:
            attempt = Attempt(scene, search, self._settings, checkpoints, self.stopwatch)
            try:
                return (yield from self._solve(attempt, search, layers))
            except CacheFull:
                checkpoints.mark_too_fine()
                search.enlarge()
            finally:
                self.n_rays_traced += attempt.n_rays_traced

    def _solve(
        self, attempt: Attempt, search: CellSizeSearch, layers: Sequence[IndirectLayer]
    ) -> Generator[Progress, None, IndirectLight]:
        """One attempt with a given cell size. Raises CacheFull if there are too many records."""
        yield 0.0, "tracing gather points"
        attempt.emit_photons()
        if self._most.adaptive:
            found, done = yield from self._refine(attempt, search, layers)
        else:
            found, done = yield from self._trace_even_grid(attempt)
        light = yield from attempt.light(attempt.settings, Span(done, LIGHT_DONE), "records")
        yield PHOTONS_DONE, "taking out noise"
        smoothing = attempt.assemble(light, found, self._ray_budget).smoothed(layers)
        return (yield from at_fraction(smoothing, PHOTONS_DONE, "taking out noise"))

    def _trace_even_grid(self, attempt: Attempt) -> Generator[Progress, None, tuple[Footprint, float]]:
        """Traces gather points at every eighth pixel; returns their footprint, and the fraction done."""
        hits = self._scene.placement.hits
        rows = lattice_rows(hits, COARSEST)
        yield from attempt.trace(rows, None, FIRST_PASS)
        numbers, weights = footprint(hits, rows, COARSEST)
        # They count within each point's own object; number the gather points of all.
        firsts = np.searchsorted(rows, hits.object_ranges[:, 0])
        counts = hits.object_ranges[:, 1] - hits.object_ranges[:, 0]
        numbers = np.asarray(numbers + np.repeat(firsts, counts)[:, None], np.int32)
        return (numbers, weights), FIRST_PASS.end

    def _refine(
        self, attempt: Attempt, search: CellSizeSearch, layers: Sequence[IndirectLayer]
    ) -> Generator[Progress, None, tuple[Footprint, float]]:
        """Traces as many gather points as the picture of these layers requires, judged by rough light between the
        records; returns their footprint, and the fraction done."""
        lattice = self.lattice = self._new_lattice()
        # First pass: the coarsest lattice, and rough light between the records that it finds.
        rows = lattice.missing_rows()
        yield from attempt.trace(rows, None, FIRST_PASS)
        rough = yield from attempt.light(self._rough, ROUGH_LIGHT, "rough")
        radiosities = self._rough_radiosity(attempt, rough, layers)
        # Its noise determines the ray budget. If it requires more rays, trace the first pass anew.
        if self._needs_ray_budget:
            yield from self._find_ray_budget(attempt, rough, layers)
            if self._settings.n_rays > attempt.settings.n_rays:
                attempt.begin_anew(self._settings)
                yield from attempt.trace(rows, None, Span(ROUGH_LIGHT.end, ROUGH_LIGHT.end))
        if self._trial is None:  # a part of the picture never has too many records
            search.check_forecast(len(attempt.cache), len(rows))
        # Refinement passes: split blocks until light at their corners differs by no more than its noise.
        refinement = Refinement(lattice, layers, radiosities)
        for span in chain(REFINEMENTS, repeat(Span(REFINED, REFINED))):
            measured = refinement.measure(attempt.newest_points, len(attempt.cache))
            yield from at_fraction(measured, span.begin, "tracing gather points")
            if not refinement.split_blocks():
                break
            yield from attempt.trace(lattice.missing_rows(), None, span)
        # Extra sample sets, by the noise with the directional reflection of glossy surfaces.
        found, scale = lattice.footprint(), 1.0
        if attempt.has_glossy_hits and self._most.max_extra_sets:
            light = self._rough_radiance(attempt, rough, layers)
            measured, scale = refinement.measure_under(light, attempt.points), self._most.gloss_noise
            yield from at_fraction(measured, REFINED, "tracing gather points")
        # Records keep their sample positions: the extra rays come from noisy points, and would bias them towards
        # bright ones.
        rows, nth = refinement.extra_sets(attempt.samples.rows, found, self._most.max_extra_sets, scale)
        if not len(rows):
            return found, REFINED
        span = extra_sets_span(len(rows) / len(attempt.samples.rows))
        yield from attempt.trace(rows, nth, span, first_open=len(attempt.cache))
        return found, span.end

    def _rough_radiosity(
        self, attempt: Attempt, rough: CacheLight, layers: Sequence[IndirectLayer]
    ) -> NDArray[np.float32]:
        """Radiosity (C, 1, 3) of the records under these layers, from rough light between them."""
        n_objects = self._scene.n_objects
        reflectance = attempt.cache.maps.reflectance(layers, n_objects)
        return radiosity(rough, albedos_of(layers, n_objects), self._scene.n_bounces, reflectance)[0]

    def _rough_radiance(self, attempt: Attempt, rough: CacheLight, layers: Sequence[IndirectLayer]) -> OutgoingRadiance:
        """Directional radiance of all records so far under these layers, from rough light between the first ones."""
        nowhere = np.zeros((0, 4), np.int32), np.zeros((0, 4), np.float32)
        light = rough.extended_to(attempt.cache.objects)
        return attempt.assemble(light, nowhere, self._ray_budget).outgoing_radiance(layers)

    def _find_ray_budget(
        self, attempt: Attempt, rough: CacheLight, layers: Sequence[IndirectLayer]
    ) -> Generator[Progress, None, None]:
        """Finds the ray budget by the noise of the first pass: in everything that depends on the number of rays, with
        the directional reflection of glossy surfaces, without photons."""
        outgoing = self._rough_radiance(attempt, rough, layers)
        steps = attempt.points.halves(layers, replace(outgoing, caustics=None))
        halves = yield from at_fraction(steps, ROUGH_LIGHT.end, "tracing gather points")
        other = (self._other_light or 0.0) / self._scene.emission.unit
        hits, rows = self._scene.placement.hits, attempt.samples.rows
        self._ray_budget = ray_budget_of(halves, layers, hits, rows, other, self._most.n_rays)

    @property
    def _needs_ray_budget(self) -> bool:
        """Whether the required number of rays is still unknown."""
        return self._other_light is not None and self._most.adaptive and self._ray_budget.noise is None

    @property
    def _settings(self) -> SamplingSettings:
        """The settings with the ray budget; with the fewest rays while it is unknown."""
        n_rays = self._most.n_rays // LEVELS[0] if self._needs_ray_budget else self._ray_budget.n_rays
        return self._most.with_rays(n_rays, keeps_photons=True)

    def _new_lattice(self) -> Lattice:
        """The lattice that is refined."""
        lattice = self._whole_lattice()
        if self._trial is not None:
            lattice.thin(self._trial.n_blocks, np.random.default_rng(1))
        return lattice

    def _whole_lattice(self) -> Lattice:
        return Lattice(self._scene.placement.hits, self._scene.lobe_axes != NORMAL, self._most.close)

    @property
    def n_first_sets(self) -> int:
        """The number of sample sets in the first pass over the whole picture."""
        return len(self._whole_lattice().missing_rows())

    @cached_property
    def _n_expected(self) -> float:
        """The expected number of sample sets of the whole picture."""
        return _BY_LIGHT * count_by_shape(self._whole_lattice()) if self._most.adaptive else 0.0

    def restored(self, arrays: Arrays) -> IndirectLight:
        """Restores the result of `solve` from the arrays of `checkpoints.arrays_of`. Raises UnsoundArrays for anything
        else."""
        ray_budget = read_ray_budget(ArrayReader(arrays), self._most.n_rays)
        settings = self._most.with_rays(ray_budget.n_rays, keeps_photons=True)
        reader = self._scene.reader(arrays, settings.n_rays)
        search = CellSizeSearch(read_cell_size(reader), lambda: self._n_expected)
        attempt = Attempt(self._scene, search, settings, Checkpoints(), self.stopwatch)
        attempt.restore(read_table(reader), read_gathered(reader))
        found, smoothing = read_footprint(reader), read_smoothing(reader)
        light = read_record_light(reader, settings.n_record_rays, attempt.cache.objects.copy())
        attempt.emit_photons()
        return attempt.assemble(light, found, ray_budget).with_smoothing(smoothing)


def _sampled_scene(
    placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
    settings: SamplingSettings, glossy: bool, thrice: bool,
) -> SampledScene:  # fmt: skip
    """How the scene is sampled, see `Solver`."""
    n_objects = len(placement.hits.object_ranges)
    lobe_axes = np.array([lobe_axis_of(models.get(i, ())) for i in range(n_objects)], np.int64)
    glossy_objects = np.array([any_glossy(models.get(i, ())) for i in range(n_objects)], bool)
    axes = tangent_axes(placement.scene)
    emission = scene_emission(placement, sky)
    second = None
    if glossy:
        second = SecondBounceTracer(
            glossy_objects, lobe_axes, axes, placement.scene.tangent_rotations, emission.all_lights,
            settings.n_glossy_hits, thrice and n_bounces > 2,
        )  # fmt: skip
    return SampledScene(placement, lobe_axes, axes, emission, second, n_bounces)


def relit(
    found: IndirectLight, placement: Placement, sky: SkyState, settings: SamplingSettings, n_bounces: int
) -> Generator[float, None, IndirectLight]:
    """The same rays under another light; yields the fraction done. n_bounces: at most the number they were traced for.

    Glossy hits store the old light, so glossy surfaces reflect by albedo until the rays are traced anew.
    """
    emitting = scene_emission(placement, sky)
    direct = yield from direct_irradiance(found.cache, emitting.lights, settings.n_samples)
    light = replace(found.light, direct=direct)
    return replace(found.without_glossy_hits(), light=light, n_bounces=n_bounces, unit=emitting.unit)
