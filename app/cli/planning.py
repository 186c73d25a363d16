"""A project's plan with its cost: what `insitu plan` prints."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from app.project.project import Project
from app.stills.stills import chosen_bounces
from engine.core.generators import run_to_end
from engine.planner import Plan, plan_scene
from engine.precompute.direct.pipeline import Placement
from engine.render.bounce_plan import planned_bounces
from engine.render.cost_pilot import estimate_cost
from engine.render.light_pilot import with_light_budget
from engine.render.still import StillProgress, still_layers, with_maps


def plan_project(
    project: Project,
    report: Callable[[StillProgress], None],
    *,
    opening_seconds: float = 0.0,
) -> Plan:
    """The plan of the project with its cost; opening_seconds: the processor time of opening it.

    Raises InsituError for what cannot be overridden.
    """
    started = time.process_time()
    layers, sky = project.layers, project.sky
    plan = plan_scene(
        project.scene, layers, has_sky=sky.environment is not None, editable=project.editable,
        settings=project.settings, overrides=project.overrides,
    )  # fmt: skip
    placement = Placement(project.scene, n_edge_rays=plan.n_edge_rays)
    planned_layers = with_maps(placement, still_layers(layers.items(), project.object_names, plan))
    wanted = chosen_bounces(project, plan)
    bounces = planned_bounces(placement, project.indexed_layers, wanted)
    said = bounces.reason or (
        "as the session says" if wanted == project.settings.n_bounces else plan.reasons["bounces"]
    )
    reason = "; ".join(filter(None, (said, bounces.warning)))
    settings = replace(plan.settings, n_bounces=bounces.n_bounces)
    plan = replace(plan, settings=settings, reasons={**plan.reasons, "bounces": reason})
    plan = run_to_end(with_light_budget(placement, planned_layers, sky, plan))
    spent = opening_seconds + time.process_time() - started  # carrying it out runs the same trials
    return run_to_end(estimate_cost(placement, planned_layers, sky, plan, spent_seconds=spent), report)
