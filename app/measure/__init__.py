"""`insitu measure`: speed against accuracy, measured and never assumed [docs/accuracy.md].

    subject ─► speed (against brute force) ─┐
            ─► sweep (against the oracle) ──┼─► figures.json, sweep.csv, plots
            ─► launches (window, renderer) ─┤
    teatray ─► edits in Python ─────────────┤
    cornell, room ─► indirect light ────────┤
    teatray, bunny ─► edges ────────────────┤
    stairwell, ajar, storeroom ─► rooms ────┤
    the storeroom's balls ─► gloss ─────────┤
    teatray, bunny, rings ─► orbit ─────────┤
    teatray, turned ─► relighting, turning ─┘
    subject, a relief ─► knobs ─► knobs.csv, front.json, report.md, plots
    shapes, bunny, plant, dominoes ─► visibility ─► visibility.csv, its tables and plot
    every scene ─► planning ─► planning.csv, savings.csv

`figures` names what was promised and its limits; `speed` and `accuracy` measure in this process, `launches` starts the
window and the renderer's measurements as programs of their own, because nothing here may touch GL. What cannot be
measured on a machine (no GL, no display) stands in the file with the reason, and the rest is measured all the same.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from app.measure.accuracy import REFERENCES, Errors, reference_errors, reference_folder
from app.measure.api_edits import ApiEditEffort, api_edit_figures
from app.measure.deform import DeformEffort, deform_figures
from app.measure.edges import EdgeEffort, edge_figures
from app.measure.figures import Figure, NotMeasured, not_measured, summary_lines, write_figures
from app.measure.gloss import GlossEffort, gloss_figures
from app.measure.indirect import QUICKLY as INDIRECT_QUICKLY
from app.measure.indirect import IndirectEffort, indirect_figures
from app.measure.knob_study import QUICKLY as KNOBS_QUICKLY
from app.measure.knob_study import KnobEffort, measure_knobs
from app.measure.launches import Launch, Screen, launch, measure_renderer, open_screen
from app.measure.machine import load_average, machine_facts
from app.measure.orbit import OrbitEffort, orbit_figures
from app.measure.planning import PlanEffort, measure_plans
from app.measure.plots import write_plots
from app.measure.relighting import RelightEffort, relight_figures
from app.measure.rooms import RoomEffort, room_figures
from app.measure.savings import measure_savings
from app.measure.speed import (
    RAW_RAYS,
    Precomputed,
    Ratio,
    precompute,
    precompute_ratios,
    visibility_ratios,
    wrong_answers,
)
from app.measure.subject import Subject, at_most, open_subject
from app.measure.sweep import QUICK, Grid, SweepResult, largest_on_gpu, run_sweep, write_csv
from app.measure.turning import TurningEffort, turning_errors, write_turning
from app.measure.visibility import QUICKLY as VISIBILITY_QUICKLY
from app.measure.visibility import VisibilityEffort, visibility_rows, write_visibility
from app.system.atomic import make_folder_of, require_place
from engine.core.errors import InsituError
from engine.precompute.direct.pipeline import FINAL, PREVIEW, Placement
from engine.scene.builtin import DEFAULT_SCENE

__all__ = ["FULL", "PARTS", "QUICKLY", "Effort", "Part", "run"]

Part = Literal["knobs", "figures", "visibility", "planning"]
PARTS: tuple[Part, ...] = get_args(Part)


@dataclass(frozen=True)
class Effort:
    """How much is measured: repetitions of what takes minutes, of launches and of frames; pictures' longest side.

    n_wrong: points at which visibility is checked; windows: whether windows are opened.
    """

    name: str
    repetitions: int = 3
    launches: int = 5
    cold_launches: int = 2
    frames: int = 60
    side: int = 4096
    n_rays: int = RAW_RAYS
    n_wrong: int = 3000
    references: bool = True
    timeout_s: float = 1800.0
    grid: Grid = field(default_factory=Grid)
    indirect: IndirectEffort = field(default_factory=IndirectEffort)
    edges: EdgeEffort | None = field(default_factory=EdgeEffort)
    rooms: RoomEffort | None = field(default_factory=RoomEffort)
    gloss: GlossEffort | None = field(default_factory=GlossEffort)
    orbit: OrbitEffort | None = field(default_factory=OrbitEffort)
    deform: DeformEffort | None = field(default_factory=DeformEffort)
    relight: RelightEffort | None = field(default_factory=RelightEffort)
    turning: TurningEffort | None = field(default_factory=TurningEffort)
    api_edits: ApiEditEffort | None = field(default_factory=ApiEditEffort)
    planning: PlanEffort | None = field(default_factory=PlanEffort)
    visibility: VisibilityEffort = field(default_factory=VisibilityEffort)
    knobs: KnobEffort = field(default_factory=KnobEffort)


FULL = Effort("full")
VISIBILITY_RESOLUTION = 512, 512
QUICKLY = Effort(
    "quick", 1, 1, 0, 10, 64, 200_000, 300, False, 300.0, QUICK, INDIRECT_QUICKLY, edges=None, rooms=None, gloss=None,
    orbit=None, deform=None, relight=None, turning=None, api_edits=None, visibility=VISIBILITY_QUICKLY,
    knobs=KNOBS_QUICKLY, planning=None,
)  # fmt: skip


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
    is told what is at work and, in the end, every figure. only: which of `PARTS`. Raises InsituError when the scene
    cannot be opened or there is no such part.
    """
    if unknown := [name for name in only if name not in PARTS]:
        raise InsituError(f"no part {unknown[0]!r}, expected one of {', '.join(PARTS)}")
    effort = effort or (QUICKLY if quick else FULL)
    make_folder_of(output / "figures.json")
    require_place(output / "figures.json", output / "sweep.csv")
    if "knobs" in only:
        measure_knobs(source, output, effort.knobs, report)
    if "visibility" in only:
        write_visibility(output, visibility_rows(effort.visibility, report))
    if "planning" in only and effort.planning is None:
        report("plans: not carried out where it is to be quick")
    elif "planning" in only and effort.planning is not None:
        measure_plans(effort.planning, output, report)
        measure_savings(effort.planning.scenes, output, report)
    return _measured_figures(source, output, effort, report) if "figures" in only else []


def _measured_figures(source: str, output: Path, effort: Effort, report: Callable[[str], None]) -> list[Figure]:
    facts = machine_facts()
    subject = _open(source, effort.side)
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
    figures += api_edit_figures(effort.api_edits, report)
    if effort.turning is not None:
        write_turning(output, turning_errors(effort.turning, report))
    figures += deform_figures(effort.deform, report)
    sweep_source = _open(source, effort.grid.side)
    report(f"sweep at {_size(sweep_source)}")
    swept = run_sweep(sweep_source, effort.grid, _frame_seconds(renderer))
    figures += _oracle_figures(swept, effort.grid, _size(sweep_source))
    write_csv(output / "sweep.csv", swept.rows)
    write_plots(output, swept.rows, f"{subject.scene.description.name} at {_size(sweep_source)}")
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
        precompute(_open(subject.source, 24), quality)
    report("precomputation against brute force")
    figures = list(_precompute_figures(subject, effort))
    report("visibility against brute force")
    figures += _visibility_figures(subject, effort)
    report("windows")
    figures += _window_figures(subject, effort, scratch)
    report("edits on the renderer")
    edits, renderer = _edit_figures(subject, effort, scratch)
    figures += edits
    if effort.references:
        report("pictures against path-traced references")
        figures += _reference_figures()
    return figures, renderer


def _open(source: str, side: int, resolution: tuple[int, int] | None = None) -> Subject:
    """A scene in this resolution or its own, scaled down to `side` pixels."""
    subject = open_subject(source, resolution)
    return replace(subject, scene=replace(subject.scene, resolution=at_most(subject.scene.resolution, side)))


def _size(subject: Subject) -> str:
    return "{} × {}".format(*subject.scene.resolution)


# ------------------------------------------------------------------------------------------------------ precomputation


def _precompute_figures(subject: Subject, effort: Effort) -> Iterator[Figure]:
    ratios: list[Ratio] = []
    for name, quality in (("precompute_ratio_400", PREVIEW), ("precompute_ratio_4000", FINAL)):
        runs = [(ratio, _times(done)) for ratio, done in precompute_ratios(
            subject, quality, effort.repetitions, effort.n_rays
        )]  # fmt: skip
        ratios += [ratio for ratio, _ in runs]
        yield Figure(
            name,
            tuple(ratio.value for ratio, _ in runs),
            f"stage {quality.name!r} at {_size(subject)}: visibility, light and projection of all layers from an "
            "opened scene and an empty cache ÷ brute-force shadow rays at the raw rate, mean of before and after",
            {"seconds": [ratio.seconds for ratio, _ in runs], "runs": [times for _, times in runs]},
        )
    yield Figure("brute_force_s", tuple(ratio.brute_force for ratio in ratios), "rays of 5,120 directions ÷ raw rate")
    yield Figure("rays_per_s", tuple(ratio.rate for ratio in ratios), "raw Embree rate, all cores, prepared rays")
    yield Figure(
        "transport_mb",
        (runs[-1][1]["store_bytes"] / 1e6,),
        f"all layers as the worker keeps them, {FINAL.n_lights} lights; the GPU holds one curve's transport beside it",
        {"largest_curve_on_gpu_mb": runs[-1][1]["gpu_bytes"] / 1e6},
    )


def _times(done: Precomputed) -> dict[str, float]:
    return {
        "light_and_visibility_s": done.light_seconds,
        "projection_s": done.projection_seconds,
        "rays": done.rays,
        "store_bytes": done.store_bytes,
        "gpu_bytes": largest_on_gpu(done, "half"),
    }


def _visibility_figures(subject: Subject, effort: Effort) -> list[Figure]:
    """On the built-in shapes and the reference bunny, at the resolution of the built-in scenes: what neighbours share
    grows with it, the bunny's own is half as fine. The scene itself is told beside them."""
    ratios: dict[str, list[Ratio]] = {}
    wrong: dict[str, float] = {}
    folder = reference_folder()
    scenes = {"shapes": "shapes"} | ({} if folder is None else {"bunny": str(folder / "bunny.toml")})
    for name, source in (scenes | {"this scene": subject.source}).items():
        resolution = VISIBILITY_RESOLUTION if name in scenes else None
        placement = Placement(_open(source, effort.side, resolution).scene)
        ratios[name] = visibility_ratios(placement, effort.repetitions, effort.n_rays)
        wrong[name] = wrong_answers(placement, effort.n_wrong)
    parts = {name: [ratio.value for ratio in found] for name, found in ratios.items()}
    medians = tuple(statistics.median(parts[name]) for name in scenes)
    where = " and ".join(scenes)
    return [
        Figure(
            "visibility_ratio",
            medians,
            f"coherent level-4 visibility of every pixel ÷ brute force, {where}: the larger median counts",
            {"ratios": parts, "seconds": {name: [r.seconds for r in found] for name, found in ratios.items()}},
        ),
        Figure(
            "visibility_wrong",
            tuple(wrong[name] for name in scenes),
            f"answers that differ from brute force at {effort.n_wrong} random points, {where}: the larger counts",
            {"wrong": wrong},
        ),
    ]


# ------------------------------------------------------------------------------------------------- window and renderer


def _window_figures(subject: Subject, effort: Effort, scratch: Path) -> list[Figure]:
    names = ("window_s", "first_picture_s", "worst_stall_ms", "exact_picture_s")
    try:
        with open_screen() as screen:
            warm, whole = _warm_launches(screen, subject.source, effort, scratch)
            cold = [
                launch(
                    screen, subject.source, scratch / f"cold{i}", "first_picture", effort.timeout_s,
                    scratch / f"cold{i}" / "kernels",
                )
                for i in range(effort.cold_launches)
            ]  # fmt: skip
    except (NotMeasured, OSError) as error:
        return [not_measured(name, str(error)) for name in (*names, "first_picture_cold_s")]
    return _start_figures(screen, warm, whole, cold)


def _warm_launches(screen: Screen, source: str, effort: Effort, scratch: Path) -> tuple[list[Launch], Launch]:
    """Launches with compiled kernels: some to the first picture, the last of them on to the exact one.

    The first is not counted: it may have to compile what only the worker needs.
    """
    launch(screen, source, scratch / "unmeasured", "first_picture", effort.timeout_s)
    warm = [
        launch(screen, source, scratch / f"warm{i}", "first_picture", effort.timeout_s)
        for i in range(effort.launches - 1)
    ]
    whole = launch(screen, source, scratch / "whole", "exact", effort.timeout_s)
    return [*warm, whole], whole


def _start_figures(screen: Screen, warm: list[Launch], whole: Launch, cold: list[Launch]) -> list[Figure]:
    how = f"`python -m app SCENE` on {screen.name}, from before its launch, empty transport cache"
    parts = {name: [each.milestones[name] for each in warm] for name in ("scene", "first_layer")}
    figures = [
        Figure(
            "window_s",
            tuple(each.milestones["first_frame"] for each in (*warm, *cold)),
            f"{how}, to the first frame; the worst of all launches, with and without compiled kernels",
        ),
        Figure(
            "first_picture_s",
            tuple(each.milestones["first_picture"] for each in warm),
            f"{how}, compiled kernels cached, to the first frame in which every layer is shaded",
            parts,
        ),
        Figure(
            "worst_stall_ms",
            tuple(1e3 * each.longest_block_s for each in warm if each.longest_block_s is not None),
            f"{how}: longest time the window's thread was busy without a look at its events, from the frame that "
            "takes the opened scene; one launch until the picture is exact, others until the first; the worst counts",
        ),
        Figure("exact_picture_s", (whole.milestones["exact"],), f"{how}, to the exact picture with all lights"),
    ]
    if cold:
        how = f"{how}, no compiled kernels, to the first frame in which every layer is shaded"
        figures.append(Figure("first_picture_cold_s", tuple(each.milestones["first_picture"] for each in cold), how))
    return figures


def _edit_figures(subject: Subject, effort: Effort, scratch: Path) -> tuple[list[Figure], dict[str, Any]]:
    names = ("edit_ms_30", "edit_ms_128", "exact_ms", "curve_switch_s")
    try:
        found = measure_renderer(
            subject.source, subject.scene.resolution, FINAL.n_lights, effort.frames, scratch / "whole",
            effort.timeout_s,
        )  # fmt: skip
    except NotMeasured as error:
        return [not_measured(name, str(error)) for name in names], {}
    how = f"{found['curve']}, {found['n_coefficients']} coefficients, {_size(subject)}, {found['renderer']}"
    to_exact = "from an edit of the whole curve to the exact picture, K = 30 a frame, all frames drawn"
    switches: dict[str, list[float]] = found["curve_switch_s"]
    frame = "curve change to finished frame (glFinish)"
    wide = f"all {found['n_wide']} at once, that curve with so many bands"
    figures = [
        Figure("edit_ms_30", tuple(found["edit_ms_30"]), f"{frame}, K = 30: {how}"),
        Figure("edit_ms_128", tuple(found["edit_ms_128"]), f"{frame}, {wide}: {how}"),
        Figure("exact_ms", tuple(found["exact_ms"]), f"{to_exact}: {how}", {"wide": found["exact_wide_ms"]}),
        Figure(
            "curve_switch_s",
            tuple(statistics.median(seconds) for seconds in switches.values()),
            "from the request to the worker until the transport is uploaded and the picture drawn from it; medians of "
            f"{len(switches)} curves, the slowest counts",
            {"curves": switches},
        )
        if switches
        else not_measured("curve_switch_s", "the scene has one curve only"),
    ]
    return figures, found


def _frame_seconds(renderer: dict[str, Any]) -> dict[Any, dict[int, float]]:
    """Seconds of a frame by precision and number of coefficients."""
    frames = renderer.get("frame_s", {})
    return {precision: {int(k): s for k, s in seconds.items()} for precision, seconds in frames.items()}


# ---------------------------------------------------------------------------------------------------------- references


def _reference_figures() -> list[Figure]:
    folder = reference_folder()
    if folder is None:
        absent = "../shared/reference is not beside this checkout"
        return [not_measured(name, absent) for name in ("reference_error", "reference_mean")]
    found: dict[str, Errors] = {}
    for name in REFERENCES:
        subject = open_subject(str(folder / f"{name}.toml"))
        found[name] = reference_errors(subject, precompute(subject, FINAL), folder, name)
    how = f"stage {FINAL.name!r} against path-traced pictures within their masks, {', '.join(found)}: the worst counts"
    return [
        Figure("reference_error", tuple(e.rmse for e in found.values()), how, {n: e.rmse for n, e in found.items()}),
        Figure("reference_mean", tuple(np.abs([e.mean for e in found.values()]).tolist()), how,
               {n: e.mean for n, e in found.items()}),
    ]  # fmt: skip
