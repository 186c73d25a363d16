"""Measures all that `make measure` has, into a folder: figures.json, tables as CSV and plots."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from app.measure.study import load_average, machine_facts, measure_settings
from app.measure.subject import Subject, precompute
from app.system.atomic import make_folder_of, require_place
from benchmarks import PARTS
from benchmarks.api_edit import api_edit_figures
from benchmarks.deform import deform_figures
from benchmarks.deform_lamps import deform_lamp_figures
from benchmarks.direct import precompute_figures, reference_figures, visibility_figures
from benchmarks.dragged_light import drag_figures
from benchmarks.edges import edge_figures
from benchmarks.effort import FULL, QUICK, Effort, open_at_most, size_text
from benchmarks.figures import Figure, summary_lines, write_figures
from benchmarks.gloss import gloss_figures
from benchmarks.indirect import indirect_figures
from benchmarks.inverse import inverse_figures
from benchmarks.light_mix import mix_figures
from benchmarks.moves import move_figures
from benchmarks.orbit import orbit_figures
from benchmarks.orbit_moves import orbit_move_figures
from benchmarks.photos import photo_figures
from benchmarks.plan_costs import measure_plans
from benchmarks.plan_savings import measure_savings
from benchmarks.relighting import relight_figures
from benchmarks.rooms import room_figures
from benchmarks.sweep import Grid, SweepResult, run_sweep, write_csv, write_plots
from benchmarks.turning_sky import turning_errors, write_turning
from benchmarks.variants import variant_settings
from benchmarks.visibility_methods import visibility_rows, write_visibility
from benchmarks.visibility_textures import write_textures
from benchmarks.window import edit_figures, window_figures
from engine.core.errors import InsituError
from engine.precompute.direct.pipeline import FINAL, PREVIEW
from engine.scene.builtin import DEFAULT_SCENE


def run(
    source: str = DEFAULT_SCENE,
    output: Path = Path("out/measure"),
    quick: bool = False,
    report: Callable[[str], None] = print,
    effort: Effort | None = None,
    only: Sequence[str] = PARTS,
) -> list[Figure]:
    """Measure a scene (built-in name or file) into a folder: figures.json, tables as CSV and plots; the figures.

    The figures of indirect light are of the built-in Cornell box and room, whatever the scene, and visibility is that
    of scenes after the thesis'.

    quick: tiny pictures and single repetitions, to see that all is well; such numbers say nothing about speed. report
    gets a line for each step and, at the end, for each figure. only: which of `PARTS`. Raises InsituError when the
    scene cannot be opened or there is no such part.
    """
    if unknown := [name for name in only if name not in PARTS]:
        raise InsituError(f"no part {unknown[0]!r}, expected one of {', '.join(PARTS)}")
    effort = effort or (QUICK if quick else FULL)
    make_folder_of(output / "figures.json")
    require_place(output / "figures.json", output / "sweep.csv")
    if "settings" in only:
        study, variants = effort.settings, effort.variants
        measure_settings(
            source, output, study, report,
            others=lambda subject, project: variant_settings(subject, project, study.placement, variants),
        )  # fmt: skip
    if "visibility" in only:
        write_visibility(output, visibility_rows(effort.visibility, report))
        if effort.textures is not None:
            write_textures(output, effort.textures, report)
    if "planning" in only and effort.planning is None:
        report("plans: not carried out where it is to be quick")
    elif "planning" in only and effort.planning is not None:
        measure_plans(effort.planning, output, report)
        measure_savings(effort.planning.scenes, output, report)
    return _measured_figures(source, output, effort, report) if "figures" in only else []


def _measured_figures(source: str, output: Path, effort: Effort, report: Callable[[str], None]) -> list[Figure]:
    facts = machine_facts()
    subject = open_at_most(source, effort.side)
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as name:
        figures, renderer = _measure(subject, effort, Path(name), report)
        figures += indirect_figures(
            effort.indirect, effort.repetitions, effort.references, Path(name), output, effort.timeout_s, report
        )
    figures += edge_figures(effort.edges, report)
    figures += room_figures(effort.rooms, report)
    figures += gloss_figures(effort.gloss, report)
    figures += orbit_figures(effort.orbit, output, report)
    figures += relight_figures(effort.relight, report)
    figures += drag_figures(effort.drags, report)
    figures += mix_figures(effort.mixes, report)
    figures += move_figures(effort.moves, report)
    figures += inverse_figures(effort.inverse, report)
    figures += photo_figures(effort.photos, report)
    figures += orbit_move_figures(effort.orbit_moves, report)
    figures += api_edit_figures(effort.api_edits, report)
    if effort.turning is not None:
        write_turning(output, turning_errors(effort.turning, report))
    figures += deform_figures(effort.deform, report)
    figures += deform_lamp_figures(effort.deform_lamps, report)
    sweep_source = open_at_most(source, effort.grid.side)
    # Seconds of a frame by precision and number of coefficients.
    frames = renderer.get("frame_s", {})
    frame_seconds = {precision: {int(k): s for k, s in seconds.items()} for precision, seconds in frames.items()}
    report(f"sweep at {size_text(sweep_source)}")
    swept = run_sweep(sweep_source, effort.grid, frame_seconds)
    figures += _oracle_figures(swept, effort.grid, size_text(sweep_source))
    write_csv(output / "sweep.csv", swept.rows)
    write_plots(output, swept.rows, f"{subject.scene.description.name} at {size_text(sweep_source)}")
    machine = facts | {"renderer": renderer.get("renderer"), "load_average_after": load_average()}
    context = {"scene": source, "resolution": list(subject.scene.resolution), "effort": effort.name}
    write_figures(output / "figures.json", figures, {"run": context, "machine": machine})
    for line in summary_lines(figures):
        report(line)
    return figures


def _oracle_figures(swept: SweepResult, grid: Grid, size: str) -> list[Figure]:
    how = (
        f"transport with {grid.oracle_lights} lights and the planned bands against our brute-force integrator with "
        f"{20 * 4**grid.level} directions, at {grid.n_points} random points of {size}"
    )
    found = swept.against_oracle
    by_lights = {str(n): {"error": each.rmse, "mean": each.mean} for n, each in found.items()}
    finest = found[grid.oracle_lights]
    return [
        Figure("oracle_error", (finest.rmse,), how, {"lights": by_lights}),
        Figure("oracle_mean", (abs(finest.mean),), how),
    ]


def _measure(
    subject: Subject, effort: Effort, scratch: Path, report: Callable[[str], None]
) -> tuple[list[Figure], dict[str, Any]]:
    """All figures but the sweep's, and what the renderer's measurements found."""
    report("compiling kernels")
    for quality in (PREVIEW, FINAL):
        precompute(open_at_most(subject.source, 24), quality)
    report("precomputation against brute force")
    figures = list(precompute_figures(subject, effort))
    report("visibility against brute force")
    figures += visibility_figures(subject, effort)
    report("windows")
    figures += window_figures(subject, effort, scratch)
    report("edits on the renderer")
    edits, renderer = edit_figures(subject, effort, scratch)
    figures += edits
    if effort.references:
        report("pictures against path-traced references")
        figures += reference_figures()
    return figures, renderer
