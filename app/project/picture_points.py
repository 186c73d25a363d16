"""Some points of a project's picture: the light that reaches them, and the layers there."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from app.project.project import Project
from engine.core.generators import StillProgress, map_steps
from engine.inverse.photo_view import PhotoView, sampled, trace_view
from engine.planner import Plan, plan_scene
from engine.precompute.direct.pipeline import PREVIEW, Placement
from engine.precompute.indirect.sampling_settings import STILL
from engine.render.bounce_plan import planned_bounces
from engine.render.light_pilot import with_light_budget
from engine.render.still import StillLayer, still_layers, still_quality

# The light at points, and all layers of the scene with their images there.
SeenPoints = tuple[PhotoView, tuple[StillLayer, ...]]


def plan_points(project: Project) -> Plan:
    """The plan of a project whose curves are all to be found."""
    return plan_scene(
        project.scene, project.layers, has_sky=project.sky.environment is not None, editable=project.layers.keys(),
        overrides=project.overrides,
    )  # fmt: skip


def view_points(
    project: Project, placement: Placement, plan: Plan, rows: NDArray[np.int32], wanted_bounces: int | None = None
) -> Generator[StillProgress, None, SeenPoints]:
    """The light of a project at these points of a placement, as finely as a finished picture has it."""
    part, layers = _layers_there(project, placement, plan, rows)
    yield StillProgress(0.0, "choosing lights")
    budget = with_light_budget(part, layers, project.sky, plan)
    quality = still_quality((yield from map_steps(budget, lambda step: StillProgress(0.0, "choosing lights"))))
    wanted = wanted_bounces or project.chosen_bounces or project.scene.description.bounces
    n_bounces = planned_bounces(placement, project.indexed_layers, wanted).n_bounces
    n_rays = plan.settings.n_hemisphere_rays
    settings = STILL.with_rays(n_rays)
    view = yield from trace_view(part, layers, project.sky, quality, n_bounces, settings, not n_rays)
    return view, layers


def view_points_coarsely(
    project: Project, placement: Placement, plan: Plan, rows: NDArray[np.int32], n_bounces: int
) -> Generator[StillProgress, None, SeenPoints]:
    """The same by few lights."""
    part, layers = _layers_there(project, placement, plan, rows)
    view = yield from trace_view(part, layers, project.sky, PREVIEW, n_bounces, STILL, True)
    return view, layers


def _layers_there(
    project: Project, placement: Placement, plan: Plan, rows: NDArray[np.int32]
) -> tuple[Placement, tuple[StillLayer, ...]]:
    """The points under the lamps as they are, and all layers."""
    emission = dict(zip(project.object_names, map(tuple, project.scene.emission.tolist()), strict=True))
    part = placement.with_emission(emission).at_rows(rows)
    return part, sampled(part, still_layers(project.layers.items(), project.object_names, plan))
