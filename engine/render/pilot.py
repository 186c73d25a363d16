"""What a plan will cost, measured on a few points before the work begins.

Shadows of some hundred random points are traced without any of the coherent method's savings, and transport of as many
points of every layer is projected; both are extrapolated to all points. What the coherent method saves depends on the
scene and is not known before; its usual share of the rays is taken, so that time is an estimate within about a factor
of two, that of what is stored one within a tenth.
"""

import time
from collections.abc import Generator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from engine.light.lights import cut_lights
from engine.plan import Cost, Plan
from engine.render.still import StillLayer, StillProgress, still_quality
from engine.threads import n_threads
from engine.transport.fixed import BYTES_A_POINT
from engine.transport.lighting import prepare_lighting
from engine.transport.near import near_leaves
from engine.transport.pipeline import Placement, SkyState
from engine.transport.projection import LayerShape, VisibleLight, project_points
from engine.visibility.points import Visibility, empty_visibility, evaluate_rows

N_SAMPLED = 256
MOST_SAMPLED, LEAST_SAMPLED = 2048, 32
# Of the time that tracing every direction would take; between 0.08 and 0.2 on the built-in scenes.
COHERENT_SHARE = 0.15
MIB = 2.0**20
CHANNELS, ACCUMULATOR_BYTES = 3, 16
# Main memory of precomputing, whose transport goes to disk tile by tile: of the program with its compiled kernels; of
# all light but an even sky's, be it the image of one, leaves of emitters, or cells between surfaces; of a point besides
# its hit and its bits. Peaks of 392 to 1,040 MiB, of 15,000 to 1.1 million points, are told within an eighth so.
PROGRAM_BYTES, LIGHT_BYTES, POINT_BYTES = 340 << 20, 220 << 20, 100
TRIANGLE_BYTES = 150  # with Embree's tree, measured on a million


def estimate_cost(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, plan: Plan, seed: int = 1
) -> Generator[StillProgress, None, Plan]:
    """The plan with its cost; yields its progress. The placement's own visibility is not touched."""
    n_points = len(placement.hits.pixel)
    rows_of = {each.i_object: placement.rows_of(each.i_object) for each in layers}
    rows_of = {index: rows for index, rows in rows_of.items() if len(rows)}
    n_each = int(np.clip(MOST_SAMPLED // max(len(rows_of), 1), LEAST_SAMPLED, N_SAMPLED))
    generator = np.random.default_rng(seed)
    samples = {index: _sample(rows, n_each, generator) for index, rows in rows_of.items()}
    yield StillProgress(0.0, "trying the light")
    light, per_point = _try_light(placement, samples, sky, plan)
    projection_seconds, n_bytes = 0.0, 0.0
    present = [each for each in layers if each.i_object in samples]
    for i, each in enumerate(present):
        yield StillProgress(0.3 + 0.7 * i / len(present), f"trying {each.layer.name} of object {each.i_object}")
        seconds, size = _try_layer(placement, samples[each.i_object], light, each)
        projection_seconds += seconds * len(rows_of[each.i_object]) / n_threads()
        n_bytes += size * len(rows_of[each.i_object])
    visibility_seconds = per_point * n_points / n_threads()
    cost = Cost(
        seconds=visibility_seconds + projection_seconds,
        visibility_seconds=visibility_seconds,
        memory_mib=_memory_bytes(placement, sky, plan) / MIB,
        disk_mib=(n_bytes + (placement.sphere.bits.nbytes if plan.needs_sphere else 0)) / MIB,
        gpu_mib=_gpu_bytes(present, {index: len(rows) for index, rows in rows_of.items()}, plan) / MIB,
        n_points=n_points,
        n_sampled=sum(len(sample) for sample in samples.values()),
    )
    return replace(plan, cost=cost)


def _sample(rows: np.ndarray, most: int, generator: np.random.Generator) -> np.ndarray:
    """At most so many of the rows, ascending."""
    return np.sort(generator.choice(rows, min(most, len(rows)), replace=False)).astype(np.int32)


def _try_light(
    placement: Placement, samples: Mapping[int, np.ndarray], sky: SkyState, plan: Plan
) -> tuple[VisibleLight, float]:
    """The plan's light as the samples see it, and the seconds of one thread that a point takes."""
    quality = still_quality(plan)
    cut = None
    if sky.environment is not None:
        cut = cut_lights(sky.environment, quality.n_lights, sky.rotation, quality.max_level)
    lighting = prepare_lighting(cut, placement.emitters(quality.n_patches), quality.tolerance, not plan.needs_sphere)
    sphere = empty_visibility(placement.hits, placement.sphere.targets)
    fine = empty_visibility(placement.hits, lighting.fine_targets)
    emitters = empty_visibility(placement.hits, lighting.emitter_targets)
    traced = [fine, emitters] + ([sphere] if plan.needs_sphere else [])
    rows = np.unique(np.concatenate([np.zeros(0, np.int32), *samples.values()]))
    _trace(placement, traced, rows[:1])  # compiles
    started = time.perf_counter()
    _trace(placement, traced, rows)
    per_point = COHERENT_SHARE * (time.perf_counter() - started)
    near_leaves(placement.hits, placement.caster, lighting.emitters, emitters, rows[:1])  # compiles
    started = time.perf_counter()
    near = near_leaves(placement.hits, placement.caster, lighting.emitters, emitters, rows)
    per_point += time.perf_counter() - started
    return VisibleLight(lighting, sphere, fine, emitters, near), per_point / max(len(rows), 1)


def _trace(placement: Placement, traced: Sequence[Visibility], rows: np.ndarray) -> None:
    for visibility in traced:
        if len(visibility.targets.positions):
            evaluate_rows(placement.hits, placement.caster, visibility, rows)


def _try_layer(placement: Placement, rows: np.ndarray, light: VisibleLight, each: StillLayer) -> tuple[float, float]:
    """Seconds of one thread and bytes that one point of a layer takes."""
    shape = LayerShape(each.layer.model.name, tuple(each.layer.quotient_parameters().tolist()), each.bands)
    project_points(placement.hits, rows[:1], light, shape, 0)  # compiles
    started = time.perf_counter()
    tile = project_points(placement.hits, rows, light, shape, 0)
    seconds = time.perf_counter() - started
    return seconds / len(rows), tile.n_bytes / len(rows) if each.editable else BYTES_A_POINT


def _memory_bytes(placement: Placement, sky: SkyState, plan: Plan) -> float:
    """Main memory of precomputing: the program, lights and triangles, the points' hits and, where the sphere is traced,
    their bits."""
    hits, scene, environment = placement.hits, placement.scene, sky.environment
    is_even = environment is None or environment.radiance.nbytes < MIB
    light = 0 if is_even and plan.bounces == 1 and not scene.emitters.any() else LIGHT_BYTES
    arrays = (value for name in hits.__dataclass_fields__ if isinstance(value := getattr(hits, name), np.ndarray))
    points = len(hits.pixel) * POINT_BYTES + sum(array.nbytes for array in arrays)
    bits = placement.sphere.bits.nbytes if plan.needs_sphere else 0
    return PROGRAM_BYTES + light + len(scene.triangles) * TRIANGLE_BYTES + points + bits


def _gpu_bytes(layers: Sequence[StillLayer], n_points: Mapping[int, int], plan: Plan) -> float:
    """The largest curve's transport, one plane a coefficient, and an accumulator for every layer."""
    channel_bytes = 2 if plan.precision == "half" else 4
    planes = [max(e.bands) * n_points[e.i_object] * CHANNELS * channel_bytes for e in layers if e.editable]
    return max(planes, default=0) + sum(n_points[each.i_object] * ACCUMULATOR_BYTES for each in layers)
