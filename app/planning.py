"""A project's plan with its cost: what `insitu plan` prints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from app.project import Project
from engine.plan import N_LIGHTS, Plan, plan_scene
from engine.render.bounces import planned_bounces
from engine.render.indirect import still_albedos
from engine.render.pilot import estimate_cost
from engine.render.still import StillLayer, StillProgress, finish, still_layers, with_maps
from engine.transport.pipeline import Placement


def plan_project(
    project: Project,
    report: Callable[[StillProgress], None],
    *,
    n_lights: int = N_LIGHTS,
    overrides: Mapping[str, Any] | None = None,
) -> Plan:
    """What the project requires and what that will cost. Raises InsituError for what cannot be overruled."""
    layers, sky = project.layers, project.sky
    plan = plan_scene(
        project.scene, layers, has_sky=sky.environment is not None, editable=project.editable, n_lights=n_lights,
        overrides=overrides,
    )  # fmt: skip
    placement = Placement(project.scene)
    planned_layers = with_maps(placement, still_layers(layers.items(), project.object_names, plan))
    if plan.bounces is None:
        plan = _with_planned_bounces(plan, placement, planned_layers)
    return finish(estimate_cost(placement, planned_layers, sky, plan), report)


def _with_planned_bounces(plan: Plan, placement: Placement, layers: Sequence[StillLayer]) -> Plan:
    bounces, reason = planned_bounces(placement, still_albedos(layers, len(placement.hits.object_ranges)))
    return replace(plan, bounces=bounces, reasons={**plan.reasons, "bounces": reason})
