"""Estimates what a plan will cost, from measurements on part of the picture before the work begins.

The pilot traces shadows of a few windows of the picture by the method that traces all of them, projects transport of
some hundred random points of every layer, computes indirect light for a few blocks, and extrapolates. It measures
processor time, so that the machine's other work hardly matters. Rejected: to trace every ray of random points and
assume the coherent method's usual share of them, which is 0.08 to 0.2 on the built-in scenes, but 0.5 for small
pictures.

For indirect light the solver itself runs on a few blocks of the picture, with few rays between cache records. The
number of gather points of a picture is known only once it is lit: from silhouettes and creases alone the estimate would
be between 0.6 and 0.95 of it. So a trial lights the scene roughly and refines some hundred random blocks of the lattice
as the solver refines all. The work at its points is scaled to the number of points, and the work between irradiance
cache records to the number of these and of their rays.

If there would be more records than allowed, the solver restarts with larger cells, several times if the number hardly
falls; its first pass over the picture detects most such cases. A second trial measures how many records larger cells
have; the solver's tries are then simulated.
"""

from __future__ import annotations

import math
import time
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from engine.core.generators import StillProgress, map_steps, run_to_end
from engine.core.threads import n_threads, on_threads
from engine.light.triangle_lights import cut_lights
from engine.planner import Cost, Plan
from engine.precompute.direct.bandstore import BYTES_A_POINT
from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.near_leaves import near_leaves
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_points
from engine.precompute.indirect.attempt import PART_POINTS
from engine.precompute.indirect.cell_size import FULL, RECORDS_BY_SETS, CellSizeTry, growth
from engine.precompute.indirect.checkpoints import arrays_of
from engine.precompute.indirect.frozen_light import SelectedCurve
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.irradiance_cache import MAX_RECORDS
from engine.precompute.indirect.progress import Progress
from engine.precompute.indirect.ray_budget import LEVELS, RayBudget
from engine.precompute.indirect.sampling_settings import FINE, SamplingSettings
from engine.precompute.indirect.solver import Solver, Trial
from engine.render.editing_pilot import TrialScale, indirect_bytes, mix_bytes, sky_row_bytes
from engine.render.still import StillLayer, by_object, direct_mean, indirect_layers, models_of, still_quality
from engine.visibility.coherent_grid import COARSEST_STEP
from engine.visibility.point_visibility import empty_visibility, evaluate_rows

N_SAMPLED = 256
MOST_SAMPLED, LEAST_SAMPLED = 1024, 32
N_WINDOWS, WINDOW = 16, 2 * COARSEST_STEP
MIB = 2.0**20
CHANNELS, ACCUMULATOR_BYTES = 3, 16
# Main memory of precomputing, whose transport goes to disk tile by tile: of the program with its compiled kernels; of
# any light except a uniform sky (an image, the tree of emitters, or irradiance cache records); of a point besides its
# hit and its bits. This predicts peaks of 392 to 1,040 MiB, for 15,000 to 1.1 million points, within an eighth.
PROGRAM_BYTES, LIGHT_BYTES, POINT_BYTES = 340 << 20, 220 << 20, 100
TRIANGLE_BYTES = 150  # with Embree's tree, measured on a million
# Peak memory of indirect light relative to its arrays: their parts exist as well while they are joined and sorted.
JOINING = 2.7
# Blocks of the picture in a trial of indirect light; and how many times fewer are its rays between cache records, those
# of the last bounce, and its photons.
N_BLOCKS, FEWER = 192, 8
# Size of cells in the second trial, relative to the first; the largest number of the solver's tries that are simulated.
COARSER, MOST_TRIES = 1.5, 8
RECORDS_BY_SMALL_SETS = 0.55  # with sets of the fewest rays, records grow with the sets to this power


def estimate_cost(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, plan: Plan, seed: int = 1,
    spent_seconds: float = 0.0, n_lights: int = 0,
) -> Generator[StillProgress, None, Plan]:  # fmt: skip
    """Return the plan with its cost; yields the progress. Does not change the placement's own visibility.

    spent_seconds: the time it took to read the scene, trace its primary hits and plan; n_lights: how many an editor
    mixes, by pictures of each.
    """
    rows_of = {each.i_object: placement.rows_of(each.i_object) for each in layers}
    rows_of = {index: rows for index, rows in rows_of.items() if len(rows)}
    n_each = int(np.clip(MOST_SAMPLED // max(len(rows_of), 1), LEAST_SAMPLED, N_SAMPLED))
    generator = np.random.default_rng(seed)
    samples = {
        index: np.sort(generator.choice(rows, min(n_each, len(rows)), replace=False)).astype(np.int32)
        for index, rows in rows_of.items()
    }
    yield StillProgress(0.0, "sampling shadows")
    visibility_seconds, reading_seconds = _measure_shadows(placement, sky, plan)
    yield StillProgress(0.2, "sampling the light")
    light = _light_of(placement, samples, sky, plan)
    projection_seconds, n_bytes = 0.0, 0.0
    present = [each for each in layers if each.i_object in samples]
    for i, each in enumerate(present):
        yield StillProgress(0.3 + 0.2 * i / len(present), f"sampling {each.layer.name} of object {each.i_object}")
        seconds, size, reading = _measure_layer(placement, samples[each.i_object], light, each)
        reading_seconds += reading
        projection_seconds += seconds * len(rows_of[each.i_object])
        n_bytes += size * len(rows_of[each.i_object])
    indirect = yield from _measure_indirect(placement, layers, sky, plan)
    held = n_bytes + indirect.editing_bytes + mix_bytes(placement, (each.i_object for each in present), n_lights)
    if plan.settings.keeps_sphere:
        held += sky_row_bytes(placement, sky, [(each.i_object, each.layer) for each in present])
    n_bytes += indirect.n_bytes + (placement.sphere.bits.nbytes if plan.settings.keeps_sphere else 0)
    cost = Cost(
        seconds=spent_seconds + reading_seconds + visibility_seconds + projection_seconds + indirect.seconds,
        visibility_seconds=visibility_seconds,
        indirect_seconds=indirect.seconds,
        memory_mib=_memory_bytes(placement, sky, plan, JOINING * indirect.n_bytes) / MIB,
        disk_mib=n_bytes / MIB,
        editing_mib=held / MIB,
        gpu_mib=_gpu_bytes(present, {index: len(rows) for index, rows in rows_of.items()}, plan) / MIB,
        n_points=len(placement.hits.pixel),
        n_sampled=sum(len(sample) for sample in samples.values()),
        n_cores=n_threads(),
    )
    plan = replace(plan, cost=cost)
    budget = indirect.ray_budget
    if budget is None or plan.settings.n_hemisphere_rays:
        return plan
    settings = replace(plan.settings, n_hemisphere_rays=budget.n_rays)
    return replace(plan, settings=settings, reasons={**plan.reasons, "rays": budget.reason})


def _light_of(placement: Placement, samples: Mapping[int, np.ndarray], sky: SkyState, plan: Plan) -> VisibleLight:
    """The plan's light as the samples see it."""
    quality, cut = still_quality(plan), None
    if sky.environment is not None:
        cut = cut_lights(
            sky.environment, quality.n_lights, sky.rotation, quality.max_level, peak_level=quality.sun_level
        )
    own_rays = not plan.settings.keeps_sphere
    lighting = prepare_lighting(cut, placement.emitters(quality.n_patches), quality.tolerance, own_rays)
    sphere = empty_visibility(placement.hits, placement.sphere.targets)
    fine = empty_visibility(placement.hits, lighting.fine_targets)
    emitters = empty_visibility(placement.hits, lighting.emitter_targets)
    rows = np.unique(np.concatenate([np.zeros(0, np.int32), *samples.values()]))
    for visibility in [fine, emitters] + ([] if own_rays else [sphere]):
        if len(visibility.targets.positions):
            evaluate_rows(placement.hits, placement.caster, visibility, rows)
    near = near_leaves(placement.hits, placement.caster, lighting.emitters, emitters, rows)
    return VisibleLight(lighting, sphere, fine, emitters, near)


def _measure_shadows(placement: Placement, sky: SkyState, plan: Plan) -> tuple[float, float]:
    """Measure the seconds for cutting the light and tracing its visibility, in one window of the picture and in
    several, which separates the part that does not grow with the points; and the seconds for loading kernels."""
    windows = _windows(placement)
    if not windows:
        return 0.0, 0.0
    few, many = windows[0], np.sort(np.concatenate(windows))
    quality = still_quality(plan)
    first, least, seconds = (_seconds_of_light(placement.at_rows(rows), sky, quality) for rows in (few, few, many))
    reading = max(first - least, 0.0)
    if len(windows) == 1:
        return seconds, reading
    by_point = max(seconds - least, 0.0) / (len(many) - len(few))
    return seconds + by_point * (len(placement.hits.pixel) - len(many)), reading


def _seconds_of_light(placement: Placement, sky: SkyState, quality: Quality) -> float:
    started = time.process_time()
    run_to_end(placement.light(sky, quality))
    return time.process_time() - started


def _windows(placement: Placement) -> list[np.ndarray]:
    """Rows of the points in some windows of the picture, evenly chosen among those that are not empty."""
    hits = placement.hits
    width, _ = hits.resolution
    line, column = np.divmod(hits.pixel, width)
    number = line // WINDOW * -(-width // WINDOW) + column // WINDOW
    there = np.unique(number)
    chosen = there[np.unique(np.linspace(0, len(there) - 1, min(N_WINDOWS, len(there))).astype(int))]
    return [np.flatnonzero(number == each).astype(np.int32) for each in chosen] if len(there) else []


def _measure_layer(
    placement: Placement, rows: np.ndarray, light: VisibleLight, each: StillLayer
) -> tuple[float, float, float]:
    """Measure seconds and bytes for one point of a layer, and seconds for loading kernels."""
    shape = LayerShape(each.layer.model.name, tuple(each.layer.quotient_parameters().tolist()), each.bands)
    started = time.process_time()
    project_points(placement.hits, rows[:1], light, shape, 0)
    reading = time.process_time() - started
    parts = np.array_split(rows, n_threads())  # divided as the work is: cores slow each other down
    started = time.process_time()
    tiles = on_threads(lambda part: project_points(placement.hits, part, light, shape, 0), parts)
    seconds = time.process_time() - started
    n_bytes = sum(tile.n_bytes for tile in tiles)
    return seconds / len(rows), n_bytes / len(rows) if each.editable else BYTES_A_POINT, reading


def _measure_indirect(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, plan: Plan
) -> Generator[StillProgress, None, IndirectCost]:
    settings = plan.settings
    if settings.n_bounces < 2 or not len(placement.hits.pixel):
        return NO_INDIRECT
    overridden, other_light = settings.n_hemisphere_rays, None
    if not overridden:
        sampling = StillProgress(0.5, "sampling: direct light")
        other_light = yield from map_steps(direct_mean(placement, by_object(layers), sky), lambda step: sampling)
    trying = indirect_cost(
        placement, models_of(layers), sky, settings.n_bounces, indirect_layers(layers),
        FINE.with_rays(overridden), other_light, edited_curves(layers),
    )  # fmt: skip
    return (yield from map_steps(trying, lambda step: StillProgress(0.5 + 0.5 * step[0], f"sampling: {step[1]}")))


def edited_curves(layers: Sequence[StillLayer]) -> list[SelectedCurve]:
    """The curve of each editable layer that has the most bands."""
    return [SelectedCurve(i, int(np.argmax(each.bands))) for i, each in enumerate(layers) if each.editable]


def _memory_bytes(placement: Placement, sky: SkyState, plan: Plan, indirect: float) -> float:
    """Main memory of precomputing: the program, then the larger of lights and indirect light, which follow each other,
    triangles, the points' hits and, if the sphere is traced, their bits."""
    hits, scene, environment = placement.hits, placement.scene, sky.environment
    is_even = environment is None or environment.radiance.nbytes < MIB
    light = 0 if is_even and plan.settings.n_bounces == 1 and not scene.emitters.any() else LIGHT_BYTES
    arrays = (value for name in hits.__dataclass_fields__ if isinstance(value := getattr(hits, name), np.ndarray))
    points = len(hits.pixel) * POINT_BYTES + sum(array.nbytes for array in arrays)
    bits = placement.sphere.bits.nbytes if plan.settings.keeps_sphere else 0
    return PROGRAM_BYTES + max(light, indirect) + len(scene.triangles) * TRIANGLE_BYTES + points + bits


def _gpu_bytes(layers: Sequence[StillLayer], n_points: Mapping[int, int], plan: Plan) -> float:
    """The largest curve's transport, one plane for each coefficient, and an accumulator for every layer."""
    channel_bytes = 2 if plan.settings.precision == "half" else 4
    planes = [max(e.bands) * n_points[e.i_object] * CHANNELS * channel_bytes for e in layers if e.editable]
    return max(planes, default=0) + sum(n_points[each.i_object] * ACCUMULATOR_BYTES for each in layers)


class WastedTries(NamedTuple):
    """Tries that are abandoned, and the number of sample sets that are traced in them, relative to the number of
    points."""

    n_tries: int
    sets: float


NO_WASTE = WastedTries(0, 0.0)


@dataclass(frozen=True)
class IndirectCost:
    """Processor seconds, bytes on disk and in the memory of an editor, numbers of gather points and records, and rays
    of a sample set."""

    seconds: float
    n_bytes: float
    editing_bytes: float
    n_points: int
    n_records: int
    ray_budget: RayBudget | None = None


NO_INDIRECT = IndirectCost(0.0, 0.0, 0.0, 0, 0)


def indirect_cost(
    placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
    layers: Sequence[IndirectLayer], settings: SamplingSettings = FINE, other_light: float | None = None,
    curves: Sequence[SelectedCurve] = (),
) -> Generator[Progress, None, IndirectCost]:  # fmt: skip
    """Estimate the cost of the solver with these arguments for these layers; yields its progress. curves: those that
    may be edited."""

    def solver(n_blocks: int, larger: float = 1.0) -> Solver:
        trial = Trial(n_blocks, FEWER, larger)
        return Solver(placement, models, sky, n_bounces, settings, other_light=other_light, trial=trial)

    seconds = first = 0.0
    for n_blocks in (2, N_BLOCKS):  # the first loads kernels
        tried = solver(n_blocks)
        started, first = time.process_time(), seconds
        found = yield from tried.solve(layers)
        seconds = time.process_time() - started
    if tried.lattice is None:
        raise ValueError(f"sampling settings {settings.name!r}: expected some that refine a lattice")
    spent = tried.stopwatch.seconds
    n_points, n_tried_records = tried.lattice.n_expected, max(len(found.cache), 1)
    by_point = n_points / max(len(found.points.samples.points), 1)
    is_small = found.ray_budget.n_rays <= found.ray_budget.max_rays // LEVELS[0]
    wanted = n_tried_records * max(by_point, 1.0) ** (RECORDS_BY_SMALL_SETS if is_small else RECORDS_BY_SETS)
    lost = NO_WASTE
    if wanted > MAX_RECORDS:
        n_coarser = len((yield from solver(N_BLOCKS, COARSER).solve(layers)).cache)
        power = math.log(n_tried_records / max(n_coarser, 1)) / math.log(COARSER)
        lost = expected_waste(wanted, n_points, tried.n_first_sets, power)
    n_records = min(wanted, FULL * MAX_RECORDS) if lost.n_tries else wanted
    by_record = n_records / n_tried_records
    rest = seconds - sum(spent.values())
    # An abandoned try ends with its first pass, and most know by then how many rays are needed.
    by_sample_set = spent["samples"] * found.ray_budget.n_rays / max(tried.n_rays_traced, 1)
    reading = max(first - spent["size"] - spent["photons"], 0.0)
    total = (
        reading
        + spent["size"]
        + (1 + lost.n_tries) * (FEWER * spent["photons"] + by_record * spent["rough"])
        + by_point * (spent["samples"] + rest)
        + lost.sets * n_points * by_sample_set
        + by_record * FEWER * spent["records"]
    )
    arrays = arrays_of(found).items()
    n_bytes = sum(
        array.nbytes * _times(name, len(array), n_tried_records, by_point, by_record) for name, array in arrays
    )
    scale = TrialScale(by_point, by_record, FEWER, FEWER)
    editing = indirect_bytes(placement, sky, found, layers, curves, scale)
    held = yield from map_steps(editing, lambda step: (1.0, "what an edit holds"))
    return IndirectCost(total, n_bytes, held, round(n_points), round(n_records), found.ray_budget)


def expected_waste(wanted: float, n_sample_sets: float, n_first: int, power: float) -> WastedTries:
    """The tries before cells are large enough. wanted: records of the first cell size after all sample sets, which the
    first pass, of n_first sets, detects; with cells s times larger their number is s^-power times that."""
    size, n_lost, tries = 1.0, 0.0, list[CellSizeTry]()
    while (n_records := wanted * size**-power) > MAX_RECORDS and len(tries) < MOST_TRIES:
        done = n_sample_sets * (MAX_RECORDS / n_records) ** (1.0 / RECORDS_BY_SETS)
        n_lost += min(done, n_first)
        tries.append(CellSizeTry(size, round(done) + PART_POINTS // 2))
        size *= growth(tries, n_sample_sets)
    return WastedTries(len(tries), n_lost / max(n_sample_sets, 1.0))


def _times(name: str, length: int, n_records: int, by_point: float, by_record: float) -> float:
    """Factor between the length of an array of the light and that of the trial's."""
    if name == "cell_seen":
        return FEWER * by_record
    if name == "direct" or name.startswith("cells."):
        return by_record if length == n_records else 1.0
    return 1.0 if name.startswith("footprint") else by_point
