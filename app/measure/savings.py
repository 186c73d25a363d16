"""What the plan saves: stills of direct light with everything on, and as planned, and by how much these differ.

Everything on is the most of each line that a plan takes by itself: as many lights and patches, shadows from every
direction, 128 bands a curve. Edges are alike in both, and so is light between surfaces: how many bounces there are is
the scene's to say, and fewer would be another picture. Seconds are those of the processors, from
the triangles to the picture, the pilot included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.machine.atomic import save_file
from app.project import Project, open_project
from app.stills import plan_still
from engine.plan import MOST_BANDS, Plan
from engine.render.light_pilot import with_needed_light
from engine.render.still import StillLayer, compose, reflected, still_layers, still_quality, with_maps
from engine.scene.builtin import builtin_scenes
from engine.steps import finish
from engine.transport.pipeline import Placement

# Of pictures that are compared, and of those that only have kernels read.
N_PIXELS, KERNEL_PIXELS = 120_000, 200
CLAMPED_AT = 99.9
"""Percentile of the picture with everything on, above which neither counts."""


@dataclass(frozen=True)
class SavingRow:
    """A scene, what was planned for it, seconds with everything on and as planned, and the relative RMS difference."""

    scene: str
    points: int
    lights: int
    patches: int
    keeps_sphere: bool
    edge_rays: int
    everything_seconds: float
    planned_seconds: float
    difference: float

    @property
    def saved(self) -> float:
        """The share of the time."""
        return 1.0 - self.planned_seconds / max(self.everything_seconds, 1e-9)


def measure_savings(sources: Sequence[str], output: Path, report: Callable[[str], None]) -> tuple[SavingRow, ...]:
    """The rows, as `savings.csv` has them; sources: names or files of scenes, none for those built in."""
    rows: list[SavingRow] = []
    for source in sources or tuple(builtin_scenes()):
        rows.append(saving(open_project(source), Path(source).stem))
        write_savings(output / "savings.csv", rows)
        row = rows[-1]
        report(f"saving of {row.scene}: {row.saved:.0%} of {row.everything_seconds:.0f} s, {row.difference:.2%} apart")
    return tuple(rows)


def saving(project: Project, name: str) -> SavingRow:
    """Draw a scene in both ways."""
    plan = plan_still(project)
    _draw(_of_pixels(project, KERNEL_PIXELS), plan)  # reads kernels
    project = _of_pixels(project, N_PIXELS)
    everything, seconds, _ = _draw(project, replace(plan, needs_sphere=True), MOST_BANDS)
    picture, planned_seconds, (carried, n_points) = _draw(project, plan)
    return SavingRow(
        name, n_points, carried.n_lights, carried.n_patches, carried.needs_sphere, carried.n_edge_rays, seconds,
        planned_seconds, difference(picture, everything),
    )  # fmt: skip


def _of_pixels(project: Project, most: int) -> Project:
    """The project in a picture of at most so many pixels, of the same shape."""
    width, height = project.scene.resolution
    smaller = min((most / (width * height)) ** 0.5, 1.0)
    size = max(round(smaller * width), 1), max(round(smaller * height), 1)
    return replace(project, scene=project.scene.seen_from(None, size))


def difference(picture: NDArray[np.floating], truth: NDArray[np.floating]) -> float:
    """Relative RMS, both clamped at the truth's percentile."""
    one, two = (np.minimum(each, np.percentile(truth, CLAMPED_AT)) for each in (picture, truth))
    return float(np.sqrt(np.mean((one - two) ** 2)) / max(float(two.mean()), 1e-12))


def _draw(
    project: Project, plan: Plan, bands: int | None = None
) -> tuple[NDArray[np.floating], float, tuple[Plan, int]]:
    """The picture, its seconds, and the plan that was carried out with the number of its points; bands: of every
    curve, with all that is planned at first; None: as the picture needs."""
    started = time.process_time()
    placement = Placement(project.scene, n_edge_rays=plan.n_edge_rays)
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    if bands is None:
        plan = finish(with_needed_light(placement, layers, project.sky, plan))
    else:
        layers = tuple(_with_bands(each, bands) for each in layers)
    radiance = finish(reflected(placement, layers, project.sky, still_quality(plan)))
    picture = compose(placement, radiance, project.sky)
    return picture, time.process_time() - started, (plan, len(placement.hits.pixel))


def _with_bands(each: StillLayer, bands: int) -> StillLayer:
    return replace(each, bands=(bands, bands if each.bands[1] > 1 else 1))


def write_savings(file: Path, rows: Sequence[SavingRow]) -> None:
    """The table as CSV."""
    lines = [",".join(field.name for field in fields(SavingRow))]
    lines += [",".join(f"{v:.4f}" if isinstance(v, float) else str(v) for v in astuple(row)) for row in rows]
    save_file(file, ("\n".join(lines) + "\n").encode())


def table(rows: Sequence[SavingRow]) -> Iterator[str]:
    """As `docs/planning.md` has it."""
    yield "| scene | points | lights, patches | shadows | edges | everything on | as planned | saved | apart |"
    yield "| --- | ---: | --- | --- | ---: | ---: | ---: | ---: | ---: |"
    for row in rows:
        shadows = "all directions" if row.keeps_sphere else "the lights' alone" if row.lights else "lamps' alone"
        yield (
            f"| *{row.scene}* | {row.points:,} | {row.lights:,}, {row.patches:,} | {shadows} | {row.edge_rays} | "
            f"{row.everything_seconds:.0f} s | {row.planned_seconds:.0f} s | {row.saved:.0%} | {row.difference:.2%} |"
        )
