"""What sharp gloss mirrors: the storeroom's two metal balls, all but a mirror and gold, against paths.

They are seen from the scene's own eye through a window of a picture 256 pixels high, so that a ball has as many pixels
as it has there and the rest of that picture need not be traced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.project.project import Project, open_project
from app.stills.stills import render_picture
from benchmarks.figures import Figure, not_measured
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.picture_difference import Errors, errors

ROOM = "storeroom"
HEIGHT, WINDOW = 256, (48, 40)
BALLS: Mapping[str, tuple[float, float, float]] = {
    "mirror ball": (0.62, 0.87, -0.93),
    "gold ball": (0.99, 0.815, -0.81),
}  # where they are
N_BOUNCES = 2  # what a ball mirrors of its surroundings, which the lamp lights
NAMES = {1: "room_gloss_direct_error", N_BOUNCES: "room_gloss_error"}


@dataclass(frozen=True)
class GlossEffort:
    """Paths a pixel of the judge."""

    n_samples: int = 4096


def gloss_figures(effort: GlossEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """The error on the mirror ball by bounces, that on the gold one beside it; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES.values()]
    report(f"paths to the balls of the {ROOM}")
    return [_figure(name, n_bounces, effort) for n_bounces, name in NAMES.items()]


def _figure(name: str, n_bounces: int, effort: GlossEffort) -> Figure:
    found: dict[str, float] = {}
    for ball in BALLS:
        project, series = ball_in_view(ball), BounceSeries(n_bounces)
        truth = render_picture(project, lambda _: None, reference=True, series=series, n_samples=effort.n_samples)
        found[ball] = error_on_ball(ball, project, render_picture(project, lambda _: None, series=series), truth).rmse
    how = f"the {ROOM}'s mirror ball as in {HEIGHT} lines, {n_bounces} bounces, {effort.n_samples} paths a pixel"
    return Figure(name, (found["mirror ball"],), how, found)


def ball_in_view(ball: str, resolution: tuple[int, int] = WINDOW) -> Project:
    """The room through a window in whose middle the ball is, in so many pixels; rays pass through their centres, as
    the judges' do."""
    project = open_project(ROOM)
    camera = project.scene.description.camera
    fov_y = 2.0 * math.degrees(math.atan(math.tan(math.radians(camera.fov_y) / 2) * WINDOW[1] / HEIGHT))
    close = camera.model_copy(update={"target": BALLS[ball], "fov_y": fov_y})
    seen = replace(project, scene=project.scene.from_camera(close, resolution))
    return seen.with_settings(n_edge_rays=0)


def error_on_ball(ball: str, project: Project, ours: NDArray[np.floating], truth: NDArray[np.floating]) -> Errors:
    """The error of a picture (H, W, 3) over the pixels of a ball."""
    hits = Placement(project.scene).hits
    begin, end = hits.object_ranges[project.object_names.index(ball)]
    pixels = hits.pixel[begin:end]
    return errors(*(picture.reshape(-1, 3)[pixels] for picture in (ours, truth)))
