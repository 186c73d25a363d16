"""Pictures with several shading points at edges, against a path tracer's that are averaged over whole pixels.

The judge is `engine.reference.path_tracer` in a picture so many times as wide and high, whose pixels are averaged. Its
noise is not taken for an error: its two halves a and b are independent, and of a picture v and the truth t

    E (v - a) (v - b) = (v - t)^2.

All pixels count, silhouettes, lamps and background as well.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.measure.subject import Subject, box_averaged, direct_picture, precompute_on
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object, plan_still
from benchmarks.figures import Figure, not_measured
from benchmarks.references import reference_folder
from engine.core.generators import run_to_end
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.reference.path_tracer import trace_halves
from engine.render.picture_difference import CLAMP_PERCENTILE
from engine.render.still import compose

SCENES = ("teatray", "bunny")
_SEED = 7

Radiance = NDArray[np.floating]


@dataclass(frozen=True)
class EdgeEffort:
    """n_times as wide and high is the judge's picture, of n_samples paths a pixel of its own."""

    n_times: int = 4
    n_samples: int = 32
    repetitions: int = 3


def edge_figures(effort: EdgeEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """The error of each scene's direct light over all pixels, and what its edges cost; None: left out."""
    names = [f"edge_{kind}_{name}" for name in SCENES for kind in ("error", "cost")]
    folder = reference_folder()
    if effort is None or folder is None:
        why = "left out of a quick run" if effort is None else "../shared/reference is not beside this checkout"
        return [not_measured(name, why) for name in names]
    figures = []
    for name in SCENES:
        report(f"edges of {name}")
        project = open_project(str(folder / f"{name}.toml"))
        figures += [_error_figure(name, project, effort), _cost_figure(name, project, effort)]
    return figures


def _error_figure(name: str, project: Project, effort: EdgeEffort) -> Figure:
    halves = averaged_paths(project, effort)
    parts = {str(n): box_error(direct_picture(project, n), halves) for n in (0, 4, 8, 16)}
    planned = plan_still(project).n_edge_rays
    how = (
        f"`insitu render {name} --bounces 1` with {planned} rays through pixels at edges, as planned, over all pixels "
        f"against paths, {effort.n_times}² pixels of {effort.n_samples} paths each averaged; parts: with so many rays"
    )
    return Figure(f"edge_error_{name}", (parts[str(planned)],), how, parts)


def _cost_figure(name: str, project: Project, effort: EdgeEffort) -> Figure:
    subject = Subject(name, project.scene, project.document, project.sky)
    planned = plan_still(project).n_edge_rays
    seconds, n_bytes, n_points = np.zeros((3, effort.repetitions, 2))
    for i in range(effort.repetitions):
        for k, n_edge_rays in enumerate((0, planned)):
            started = time.process_time()
            done = precompute_on(Placement(subject.scene, n_edge_rays=n_edge_rays), subject, FINAL)
            seconds[i, k] = time.process_time() - started
            n_bytes[i, k], n_points[i, k] = done.store_bytes, len(done.placement.hits.pixel)
    time_ratio, memory, points = (float(np.median(each[:, 1] / each[:, 0])) for each in (seconds, n_bytes, n_points))
    how = f"processor time of stage {FINAL.name!r}, tracing the view included, with edges as planned ÷ without them"
    return Figure(f"edge_cost_{name}", (max(time_ratio, memory),), f"{how}, or bytes of transport, whichever is more",
                  {"time": time_ratio, "memory": memory, "points": points})  # fmt: skip


def averaged_paths(project: Project, effort: EdgeEffort) -> Radiance:
    """Direct light (2, H, W, 3) by the two halves of the judge's paths, averaged over pixels."""
    (width, height), n = project.scene.resolution, effort.n_times
    placement = Placement(replace(project.scene, resolution=(n * width, n * height)))
    rows = np.arange(len(placement.hits.pixel))
    halves = run_to_end(
        trace_halves(placement, layers_by_object(project), project.sky, 1, effort.n_samples, _SEED, rows)
    )
    pictures = [compose(placement, half, project.sky) for half in halves[:, :, 1]]
    return np.stack([box_averaged(picture, n) for picture in pictures])


def box_error(ours: Radiance, halves: Radiance) -> float:
    """relRMSE of a picture (H, W, 3) by two independent looks at the truth (2, H, W, 3); all are clamped at their
    99.9 percentile."""
    top = np.percentile(halves.mean(axis=0), CLAMP_PERCENTILE)
    mine, (a, b) = np.minimum(ours, top), np.minimum(halves, top)
    square = float(np.mean((mine - a) * (mine - b)))
    return math.sqrt(max(square, 0.0)) / float(0.5 * (a + b).mean())
