"""What the plan saves: stills with everything on, and as planned, and by how much more these are off.

Everything on is the most of each line that a plan takes by itself: as many lights and patches, shadows from every
direction, 128 bands a curve, four bounces, all rays of the indirect light; as planned are as many bounces as the pilot
finds, whatever the scene says. Edges are alike in both, and light of further bounces is found as finely as an editor
does. Errors are those against four bounces, by the same looks at the same points (`compare_errors`): pictures that
differ by chance alone are not taken for worse. Seconds are those of the processors, from the triangles to the picture,
the pilots included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.project.project import Project, open_project
from app.stills.stills import plan_still
from app.system.atomic import save_file
from engine.core.generators import run_to_end
from engine.planner import MOST_BANDS, Plan
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import FINE, BounceSeries
from engine.render.bounce_plan import MOST_PLANNED, planned_bounces
from engine.render.error_estimate import compare_errors
from engine.render.light_pilot import with_light_budget
from engine.render.still import (
    StillLayer,
    find_indirect,
    reflect_layers,
    reflected_light,
    still_layers,
    still_quality,
    with_maps,
)
from engine.scene.builtin import builtin_scenes

# Of pictures that are compared, and of those that only have kernels read.
N_PIXELS, KERNEL_PIXELS = 120_000, 2000
N_POINTS, N_PATHS = 1024, 1 << 20


@dataclass(frozen=True)
class SavingRow:
    """A scene, what was planned for it (n_rays: 0 where one bounce is all), seconds with everything on and as planned,
    direct light with all the rest and light of further bounces apart, and the relative RMS errors."""

    scene: str
    points: int
    lights: int
    patches: int
    keeps_sphere: bool
    edge_rays: int
    bounces: int
    n_rays: int
    everything_seconds: float
    planned_seconds: float
    everything_indirect: float
    planned_indirect: float
    everything_error: float
    planned_error: float

    @property
    def saved(self) -> float:
        """The share of the time."""
        planned, everything = self.planned_seconds + self.planned_indirect, self.all_seconds
        return 1.0 - planned / max(everything, 1e-9)

    @property
    def all_seconds(self) -> float:
        """With everything on."""
        return self.everything_seconds + self.everything_indirect


def measure_savings(sources: Sequence[str], output: Path, report: Callable[[str], None]) -> tuple[SavingRow, ...]:
    """The rows, as `savings.csv` has them; sources: names or files of scenes, none for those built in."""
    rows: list[SavingRow] = []
    for source in sources or tuple(builtin_scenes()):
        rows.append(saving(open_project(source), Path(source).stem))
        write_savings(output / "savings.csv", rows)
        row = rows[-1]
        off = f"{row.planned_error:.2%} off, {row.everything_error:.2%} with everything on"
        report(f"saving of {row.scene}: {row.saved:.0%} of {row.all_seconds:.0f} s; {off}")
    return tuple(rows)


@dataclass(frozen=True, eq=False)
class _Further:
    """Light of further bounces at the points, None of one, by how many rays a fan, and the seconds that took."""

    n_bounces: int
    n_rays: int
    radiance: NDArray[np.floating] | None
    seconds: float


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What the points reflect (P, 3), the seconds of all but further bounces, and what was drawn by."""

    radiance: NDArray[np.floating]
    seconds: float
    plan: Plan
    placement: Placement
    layers: tuple[StillLayer, ...]
    further: _Further


def saving(project: Project, name: str) -> SavingRow:
    """Draw a scene with everything on and as planned."""
    plan = plan_still(project)
    small = _of_pixels(project, KERNEL_PIXELS)  # reads kernels
    _draw_everything(small, plan)
    _draw_planned(small, plan)
    project = _of_pixels(project, N_PIXELS)
    everything, planned = _draw_everything(project, plan), _draw_planned(project, plan)
    errors = run_to_end(
        compare_errors(
            everything.placement, everything.layers, project.sky, still_quality(everything.plan), MOST_PLANNED,
            (everything.radiance, planned.radiance), N_PATHS, N_POINTS,
        )
    )  # fmt: skip
    carried, further = planned.plan, planned.further
    settings = carried.settings
    return SavingRow(
        name, len(planned.radiance), settings.n_lights, settings.n_patches, settings.keeps_sphere, carried.n_edge_rays,
        further.n_bounces, further.n_rays, everything.seconds, planned.seconds, everything.further.seconds,
        further.seconds, *errors,
    )  # fmt: skip


def _of_pixels(project: Project, most: int) -> Project:
    """The project in a picture of at most so many pixels, of the same shape."""
    width, height = project.scene.resolution
    smaller = min((most / (width * height)) ** 0.5, 1.0)
    size = max(round(smaller * width), 1), max(round(smaller * height), 1)
    return replace(project, scene=project.scene.from_camera(None, size))


def _draw_everything(project: Project, plan: Plan) -> _Drawn:
    """With the most there is of each line."""
    started = time.process_time()
    plan = replace(plan, settings=replace(plan.settings, keeps_sphere=True))
    placement, layers = _opened(project, plan)
    seconds = time.process_time() - started
    further = _further(project, placement, layers, MOST_PLANNED, as_needed=False)
    layers = tuple(_with_bands(each, MOST_BANDS) for each in layers)
    return _drawn(project, plan, placement, layers, further, seconds)


def _draw_planned(project: Project, plan: Plan) -> _Drawn:
    """With as much as the picture needs."""
    started = time.process_time()
    placement, layers = _opened(project, plan)
    plan = run_to_end(with_light_budget(placement, layers, project.sky, plan))
    n_bounces = planned_bounces(placement, project.indexed_layers).n_bounces
    seconds = time.process_time() - started
    further = _further(project, placement, layers, n_bounces, as_needed=True)
    return _drawn(project, plan, placement, layers, further, seconds)


def _opened(project: Project, plan: Plan) -> tuple[Placement, tuple[StillLayer, ...]]:
    placement = Placement(project.scene, n_edge_rays=plan.n_edge_rays)
    return placement, with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))


def _further(
    project: Project, placement: Placement, layers: Sequence[StillLayer], n_bounces: int, as_needed: bool
) -> _Further:
    if n_bounces < 2:
        return _Further(n_bounces, 0, None, 0.0)
    started = time.process_time()
    found = run_to_end(find_indirect(placement, layers, project.sky, BounceSeries(n_bounces), FINE, as_needed))
    radiance = run_to_end(reflected_light(found, layers, None, placement.hits))
    return _Further(n_bounces, found.ray_budget.n_rays, radiance, time.process_time() - started)


def _drawn(
    project: Project, plan: Plan, placement: Placement, layers: tuple[StillLayer, ...], further: _Further, before: float
) -> _Drawn:
    """The picture; before: the seconds that went by already."""
    started = time.process_time()
    radiance = run_to_end(reflect_layers(placement, layers, project.sky, still_quality(plan), further.radiance))
    return _Drawn(radiance, before + time.process_time() - started, plan, placement, layers, further)


def _with_bands(each: StillLayer, bands: int) -> StillLayer:
    return replace(each, bands=(bands, bands if each.bands[1] > 1 else 1))


def write_savings(file: Path, rows: Sequence[SavingRow]) -> None:
    """The table as CSV."""
    lines = [",".join(field.name for field in fields(SavingRow))]
    lines += [",".join(f"{v:.4f}" if isinstance(v, float) else str(v) for v in astuple(row)) for row in rows]
    save_file(file, ("\n".join(lines) + "\n").encode())


def table(rows: Sequence[SavingRow]) -> Iterator[str]:
    """As `docs/planning.md` has it."""
    yield (
        "| scene | points | lights, patches | shadows | bounces, rays | direct: everything on, as planned | further "
        "bounces: everything on, as planned | saved | off: everything on, as planned |"
    )
    yield "| --- | ---: | --- | --- | ---: | ---: | ---: | ---: | ---: |"
    for row in rows:
        shadows = "all directions" if row.keeps_sphere else "the lights' alone" if row.lights else "lamps' alone"
        yield (
            f"| *{row.scene}* | {row.points:,} | {row.lights:,}, {row.patches:,} | {shadows} | "
            f"{row.bounces}, {row.n_rays} | {row.everything_seconds:.1f} s, {row.planned_seconds:.1f} s | "
            f"{row.everything_indirect:.1f} s, {row.planned_indirect:.1f} s | {row.saved:.0%} | "
            f"{row.everything_error:.2%}, {row.planned_error:.2%} |"
        )
