"""The Pareto front of each mode: which values of its settings no other beats in error and time both.

    python -m app.measure.front [FILE]        writes the table that the slider reads (`app.document.pareto_front`)

Errors are by the picture's own judgement (`engine.render.error_estimate`), by the same looks at the truth; seconds are
of the processor, from an opened scene to the picture, all bounces of the scene included. Placement: lights, patches and
gather rays of indirect light; bands and sphere levels gain nothing there, as docs/accuracy.md shows, and precision and
edges cost little time. Orbit: points beside the meshes' own, and the coefficients that each keeps. Deform: rays and
lobes a point, of a bent diffuse relief (`settings_deform`): what a gloss lacks there, and others' shadows, depend on
neither.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.document.pareto_front import FRONT_FILE, FrontPoint, format_front
from app.measure.settings_deform import BentRelief, DeformValues
from app.measure.study import machine_facts
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object, plan_still, still_quality
from engine.core.generators import run_to_end
from engine.precompute.direct.pipeline import Placement, Quality
from engine.precompute.indirect.sampling_settings import FINE, BounceSeries
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.deform_engine import N_POINTS
from engine.render.bounce_plan import planned_bounces
from engine.render.error_estimate import estimate_drawn_errors, estimate_point_errors
from engine.render.still import StillLayer, indirect_radiance, reflect_layers, still_layers, with_maps


@dataclass(frozen=True)
class FrontEffort:
    """What is measured: scenes by mode, (width, height) of their pictures, and each mode's settings."""

    placement: tuple[str, ...] = ("teatray", "stairwell")
    orbit: tuple[str, ...] = ("teatray",)
    size: tuple[int, int] = (192, 144)
    lights: tuple[tuple[int, int, int], ...] = (  # and patches, and rays of a fan, 0 for as many as are needed
        (50, 32, 128), (100, 64, 128), (200, 128, 128), (400, 256, 128), (1000, 400, 0), (4000, 768, 0),
        (10_000, 3000, 1024),
    )  # fmt: skip
    points: tuple[tuple[int, int], ...] = ((0, 40), (2000, 80), (10_000, 160), (40_000, 320))  # and coefficients
    rays: tuple[tuple[int, int], ...] = (  # and lobes
        (64, 1), (128, 2), (256, 2), (1000, 3), (1000, 4), (2500, 4), (5000, 4),
    )  # fmt: skip


def measure_front(effort: FrontEffort, report: Callable[[str], None]) -> dict[str, tuple[FrontPoint, ...]]:
    """The front of each mode, from the quickest to the truest; of several scenes geometric means."""
    found: dict[str, tuple[FrontPoint, ...]] = {}
    for mode, scenes, measured in (("placement", effort.placement, _placement), ("orbit", effort.orbit, _orbit)):
        stops = [list(_told(mode, scene, measured(_project(scene, effort.size), effort), report)) for scene in scenes]
        found[mode] = on_the_front([_mean(each) for each in zip(*stops, strict=True)])
    if effort.rays:
        found["deform"] = on_the_front(
            [*_told("deform", "relief", _deform(BentRelief(DeformValues()), effort), report)]
        )
    return found


def on_the_front(stops: Sequence[FrontPoint]) -> tuple[FrontPoint, ...]:
    """Those that no other beats in error and time both, the quickest first."""
    found: list[FrontPoint] = []
    for stop in sorted(stops, key=lambda each: (each.seconds, each.error)):
        if not found or stop.error < found[-1].error:
            found.append(stop)
    return tuple(found)


def _told(mode: str, scene: str, stops: Iterator[FrontPoint], report: Callable[[str], None]) -> Iterator[FrontPoint]:
    for stop in stops:
        report(f"{mode} {scene} {dict(stop.settings)}: {stop.error:.2%}, {stop.seconds:.2f} s")
        yield stop


def _mean(stops: Sequence[FrontPoint]) -> FrontPoint:
    error, seconds = np.exp(np.log([(each.error, each.seconds) for each in stops]).mean(axis=0)).tolist()
    return FrontPoint(stops[0].settings, error, seconds)


def _project(scene: str, size: tuple[int, int]) -> Project:
    return open_project(scene, size).with_settings(n_edge_rays=0)


def _placement(project: Project, effort: FrontEffort) -> Iterator[FrontPoint]:
    judging = Placement(project.scene)
    layers, quality = _layers(judging, project), still_quality(plan_still(project))
    n_bounces = planned_bounces(judging, project.indexed_layers, project.scene.description.bounces).n_bounces
    series = BounceSeries(n_bounces)
    _placement_picture(project, layers, replace(quality, n_lights=20, n_patches=20), series, 128)  # reads kernels
    for n_lights, n_patches, n_fan_rays in effort.lights:
        began = time.process_time()
        wanted = replace(quality, n_lights=n_lights, n_patches=n_patches)
        radiance, indirect = _placement_picture(project, layers, wanted, series, n_fan_rays)
        seconds = time.process_time() - began
        judged = run_to_end(estimate_point_errors(judging, layers, project.sky, quality, n_bounces, radiance, indirect))
        settings = _settings(n_lights=n_lights, n_patches=n_patches, n_hemisphere_rays=n_fan_rays)
        yield FrontPoint(settings, judged.estimate.overall, seconds)


def _placement_picture(
    project: Project, layers: tuple[StillLayer, ...], quality: Quality, series: BounceSeries, n_fan_rays: int
) -> tuple[NDArray[np.floating], NDArray[np.floating] | None]:
    """What the points reflect of all light (P, 3), and of that which was reflected before, None of one bounce."""
    placement, indirect = Placement(project.scene), None
    if series.n_bounces > 1:
        fineness, as_needed = FINE.with_rays(n_fan_rays), not n_fan_rays
        indirect = run_to_end(indirect_radiance(placement, layers, project.sky, series, fineness, as_needed))
    return run_to_end(reflect_layers(placement, layers, project.sky, quality, indirect)), indirect


def _orbit(project: Project, effort: FrontEffort) -> Iterator[FrontPoint]:
    for n_points, n_coefficients in effort.points:
        began = time.process_time()
        orbit = Orbit(project.scene, n_points=n_points, n_coefficients=n_coefficients)
        orbit.set_light(project.sky)
        orbit.set_layers(layers_by_object(project))
        orbit.set_bounces(1)
        for _ in orbit.work():
            pass
        picture = _drawn(project, orbit)
        seconds = time.process_time() - began
        yield FrontPoint(
            _settings(n_points=n_points, n_coefficients=n_coefficients), _judged(project, picture), seconds
        )


def _deform(mesh: BentRelief, effort: FrontEffort) -> Iterator[FrontPoint]:
    mesh.shaded(*effort.rays[0])  # reads kernels
    for n_rays, n_lobes in effort.rays:
        began = time.process_time()
        shaded = mesh.shaded(n_rays, n_lobes)
        seconds = (time.process_time() - began) * N_POINTS / len(shaded)
        yield FrontPoint(_settings(n_rays=n_rays, n_lobes=n_lobes), mesh.error(shaded), seconds)


def _drawn(project: Project, engine: Orbit) -> NDArray[np.float32]:
    return engine.draw(project.scene.description.camera, project.scene.resolution)


def _judged(project: Project, picture: NDArray[np.float32]) -> float:
    placement = Placement(project.scene)
    layers = _layers(placement, project)
    (judged,) = run_to_end(estimate_drawn_errors(placement, layers, project.sky, 1, [picture]))
    return judged.estimate.overall


def _layers(placement: Placement, project: Project) -> tuple[StillLayer, ...]:
    plan = plan_still(project)
    return with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))


def _settings(**settings: int) -> tuple[tuple[str, int], ...]:
    return tuple(settings.items())


def main() -> None:
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else FRONT_FILE
    effort = FrontEffort()
    found = measure_front(effort, lambda line: print(line, flush=True))
    facts = machine_facts()
    scenes = f"{', '.join(effort.placement)} (Placement), {effort.orbit[0]} (Orbit)"
    origin = (
        f"`python -m app.measure.front` of {datetime.now(UTC):%Y-%m-%d} on {facts['cpu']}: {scenes} at "
        "{} × {}, 12,000 points of a relief (Deform); processor seconds".format(*effort.size)
    )
    file.write_text(format_front(origin, effort.size[0] * effort.size[1], found))


if __name__ == "__main__":
    main()
