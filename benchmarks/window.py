"""The figures of the window: launches until pictures are there, and edits on the renderer."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

from app.measure.subject import Subject
from benchmarks.effort import Effort, size_text
from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.launches import Launch, Screen, launch, measure_renderer, open_screen
from engine.precompute.direct.pipeline import FINAL


def window_figures(subject: Subject, effort: Effort, scratch: Path) -> list[Figure]:
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


def edit_figures(subject: Subject, effort: Effort, scratch: Path) -> tuple[list[Figure], dict[str, Any]]:
    names = ("edit_ms_30", "edit_ms_128", "exact_ms", "curve_switch_s")
    try:
        found = measure_renderer(
            subject.source, subject.scene.resolution, FINAL.n_lights, effort.frames, scratch / "whole",
            effort.timeout_s,
        )  # fmt: skip
    except NotMeasured as error:
        return [not_measured(name, str(error)) for name in names], {}
    how = f"{found['curve']}, {found['n_coefficients']} coefficients, {size_text(subject)}, {found['renderer']}"
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
