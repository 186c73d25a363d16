"""A project's plan with its cost, and as lines of text: what `insitu plan` prints."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from app.cli.precompute import ActualCost
from app.document.node_layers import node_counts, nodes_reason
from app.document.scene_state import scene_state
from app.document.single_lights import light_weights
from app.project.project import Project
from app.stills.look_pictures import looks_memory
from app.stills.stills import chosen_bounces
from app.system.memory import gib
from engine.core.generators import StillProgress, run_to_end
from engine.planner import Plan, plan_lines, plan_scene
from engine.precompute.direct.pipeline import Placement
from engine.render.bounce_plan import planned_bounces
from engine.render.cost_pilot import MIB, estimate_cost
from engine.render.light_pilot import with_light_budget
from engine.render.still import still_layers, with_maps


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
    if nodes := node_counts(project.document, project.statistics, project.n_map_nodes):
        text = ", ".join(f"{each.n_nodes}" for each in nodes)
        plan = replace(plan, nodes=text, reasons={"nodes": nodes_reason(nodes), **plan.reasons})
    lit_by = scene_state(project.document)
    n_lights = len(light_weights(lit_by.light, lit_by.emission))
    costing = estimate_cost(placement, planned_layers, sky, plan, spent_seconds=spent, n_lights=n_lights)
    plan = run_to_end(costing, report)
    return _with_looks(plan, project)


def _with_looks(plan: Plan, project: Project) -> Plan:
    """The plan with what looks side by side take at most, where the project has some."""
    if plan.cost is None or len(project.document.looks) < 2:
        return plan
    memory, on_gpu = looks_memory(plan.cost.memory_mib * MIB, len(project.scene.triangles), project.scene.resolution)
    return replace(plan, cost=replace(plan.cost, looks_mib=memory / MIB, looks_gpu_mib=on_gpu / MIB))


def describe_plan(plan: Plan) -> Iterator[str]:
    """A plan as aligned lines of text."""
    lines = list(plan_lines(plan))
    first, second = (max(len(line[i]) for line in lines) for i in (0, 1))
    for name, value, reason in lines:
        yield f"{name:<{first}}  {value:<{second}}  {reason}"
    if plan.cost is not None:
        cost = plan.cost
        yield (
            f"about {cost.seconds / cost.n_cores:.0f} s on {cost.n_cores} cores "
            f"({cost.seconds:.0f} s of processor time, "
            f"{cost.visibility_seconds:.0f} s of them shadows, {cost.indirect_seconds:.0f} s indirect light), "
            f"{cost.memory_mib:.0f} MiB of main memory, {cost.disk_mib:.0f} MiB on disk, "
            f"{cost.editing_mib:.0f} MiB held while it is edited, "
            f"{cost.gpu_mib:.0f} MiB on the GPU (largest layer selected)"
        )
        if cost.looks_mib:
            yield (
                f"looks side by side take up to {cost.looks_mib:.0f} MiB of main memory more, with the process that "
                f"draws them, and {cost.looks_gpu_mib:.0f} MiB on the GPU"
            )
        yield f"measured on {cost.n_sampled:,} of {cost.n_points:,} points and a few windows: within about 30 %"


def memory_note(plan: Plan, free: int) -> str:
    """A warning where a plan needs more main memory than so many bytes, else "".

    An editor also holds transport and indirect light.
    """
    if plan.cost is None:
        return ""
    precomputing, editing = plan.cost.memory_mib * 2**20, (plan.cost.memory_mib + plan.cost.editing_mib) * 2**20
    if editing <= free:
        return ""
    who = "to precompute it" if precomputing > free else "to edit it"
    needed = precomputing if precomputing > free else editing
    return f"{who} takes {gib(round(needed))} of main memory, {gib(free)} are free; give a smaller --resolution"


def describe_check(plan: Plan, was: ActualCost) -> str:
    """The actual cost of a plan that was carried out, as one line."""
    cost = plan.cost
    if cost is None:
        raise ValueError("expected a plan with its cost")
    pairs = (
        (was.seconds, cost.seconds, "s of processor time"),
        (was.memory_mib, cost.memory_mib, "MiB of main memory"),
        (was.disk_mib, cost.disk_mib, "MiB on disk"),
        (was.editing_mib, cost.editing_mib, "MiB held by an editor"),
    )
    said = (f"{is_:.0f} {unit} (planned {100 * (planned / max(is_, 1e-9) - 1):+.0f} %)" for is_, planned, unit in pairs)
    return "carried out: " + ", ".join(said)
