"""The figures of indirect light: in the window, against references, its memory, and against a path tracer of others."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.measure.subject import at_most, open_subject
from app.project.project import open_project
from app.stills.stills import render_picture
from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.indirect_memory import growth_figure, memory_rows, write_rows
from benchmarks.indirect_representations import CSV as REPRESENTATIONS_CSV
from benchmarks.indirect_representations import representation_rows
from benchmarks.indirect_representations import write_rows as write_representations
from benchmarks.launches import measure_indirect
from benchmarks.peer import FIGURE as PEER_FIGURE
from benchmarks.peer import peer_figure
from benchmarks.references import masked_reference, reference_folder
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import parse_series
from engine.render.picture_difference import Errors, errors

CSV = "indirect_memory.csv"
OF_CORNELL = ("gi_edit_ms", "gi_memory_mb_cornell", "gi_first_s", "gi_first_error")
REFERENCES = ("cornell", "teatray")
WARM_UP = (24, 24)
SERIES, GLOSSY_SERIES = "64,1,1,1", "64,8,8,1"
KINDS = ("error", "mean", "error_8")
LEFT_OUT = "left out of a quick run"


@dataclass(frozen=True)
class IndirectEffort:
    """repetitions of edits of each object, rounds of selecting all of them, counts of objects the room is cut into and
    the side in pixels there; pictures' longest side; settings (objects, bounces) at which the representations are
    compared, and the side there; warm_up: whether a first run, not counted, compiles what is missing; room: whether
    objects of the room are frozen, too."""

    repetitions: int = 20
    rounds: int = 3
    counts: tuple[int, ...] = (2, 3, 4, 6, 8, 10, 12)
    growth_side: int = 128
    side: int = 4096
    settings: tuple[tuple[int, int], ...] = ((2, 4), (4, 4), (7, 4), (12, 4), (7, 2), (7, 3), (7, 5))
    representation_side: int = 256
    warm_up: bool = True
    room: bool = True


QUICK = IndirectEffort(3, 1, (2, 4), 32, 64, ((2, 2), (3, 3)), 32)


def indirect_figures(
    effort: IndirectEffort, repetitions: int, references: bool, scratch: Path, output: Path, timeout_s: float,
    report: Callable[[str], None],
) -> list[Figure]:  # fmt: skip
    """All of them. repetitions: of what takes minutes; references: whether pictures are compared with path-traced ones;
    the tables of memory and of representations go to the folder `output`."""
    report("indirect light in the window")
    figures = _window_figures(effort, scratch, timeout_s)
    report("memory of indirect light")
    rows = list(memory_rows(effort.counts, effort.growth_side))
    write_rows(output / CSV, rows)
    figures.append(growth_figure(rows, effort.growth_side))
    report("indirect light against the dense tensor")
    settings = representation_rows(effort.settings, effort.representation_side)
    write_representations(output / REPRESENTATIONS_CSV, list(settings))
    if not references:
        names = [f"gi_{kind}_{scene}" for scene in REFERENCES for kind in KINDS]
        return figures + [not_measured(name, LEFT_OUT) for name in (*names, PEER_FIGURE)]
    report("indirect light against path-traced references")
    figures += [figure for name in REFERENCES for figure in _reference_figures(name)]
    report("precomputation of indirect light against a path-traced still")
    return [*figures, peer_figure(repetitions, scratch, timeout_s, report)]


# -------------------------------------------------------------------------------------------------------- in the window


def _window_figures(effort: IndirectEffort, scratch: Path, timeout_s: float) -> list[Figure]:
    def found_of(name: str, repetitions: int) -> tuple[dict[str, Any], Path]:
        resolution = at_most(open_subject(name).scene.resolution, effort.side)
        return measure_indirect(name, resolution, repetitions, effort.rounds, scratch / f"indirect {name}", timeout_s)

    try:
        if effort.warm_up:
            measure_indirect("cornell", WARM_UP, 0, 0, scratch / "indirect unmeasured", timeout_s)
        found, pictures = found_of("cornell", effort.repetitions)
        figures = [_freeze_figure("freeze_s_cornell", found), *_cornell_figures(found, pictures)]
    except NotMeasured as error:
        figures = [not_measured(name, str(error)) for name in ("freeze_s_cornell", *OF_CORNELL)]
    if not effort.room:
        return [*figures, not_measured("freeze_s_room", LEFT_OUT)]
    try:
        return [*figures, _freeze_figure("freeze_s_room", found_of("room", 0)[0])]
    except NotMeasured as error:
        return [*figures, not_measured("freeze_s_room", str(error))]


def _where(found: dict[str, Any]) -> str:
    width, height = found["resolution"]
    return f"{width} × {height}, {found['n_bounces']} bounces, {found['renderer']}"


def _freeze_figure(name: str, found: dict[str, Any]) -> Figure:
    return Figure(
        name,
        _medians(found["freeze_s"]),
        f"from selecting another object, the indirect light being fine, until its frozen light is drawn (glFinish) and "
        f"follows edits, all but what its gloss sends on: {_where(found)}; medians of each object, the slowest counts",
        {"objects": found["freeze_s"], "whole": found["freeze_whole_s"]},
    )


def _cornell_figures(found: dict[str, Any], pictures: Path) -> list[Figure]:
    edits: dict[str, list[float]] = found["edit_ms"]
    slowest = max(edits, key=lambda name: statistics.median(edits[name]))
    with np.load(pictures) as file:
        seen = file["seen"]
        first = errors(file["first"][seen], file["fine"][seen]).rmse
    where = _where(found)
    return [
        Figure(
            "gi_edit_ms",
            tuple(edits[slowest]),
            "from a curve's change to the finished frame (glFinish) with all objects' indirect light and those "
            f"increments of direct light that the frame's budget allows: {where}; the slowest object, {slowest}",
            {"objects": edits, "to_exact": found["exact_ms"]},
        ),
        Figure(
            "gi_memory_mb_cornell",
            (found["memory_mb"],),
            f"transport of all layers and all that the worker keeps of the indirect light: {where}",
        ),
        Figure(
            "gi_first_s",
            (found["first_s"],),
            "from the request for the opened scene's light, nothing known of it and compiled kernels cached, to the "
            f"first frame with indirect light (every fourth pixel direct, every eighth indirect): {where}",
        ),
        Figure(
            "gi_first_error",
            (first,),
            f"that picture against the exact one, pixels that see what reflects: {where}",
        ),
    ]


def _medians(samples: dict[str, list[float]]) -> tuple[float, ...]:
    return tuple(statistics.median(each) for each in samples.values() if each)


# ----------------------------------------------------------------------------------------------------------- references


def _reference_figures(name: str) -> Sequence[Figure]:
    folder = reference_folder()
    if folder is None:
        absent = "../shared/reference is not beside this checkout"
        return [not_measured(f"gi_{kind}_{name}", absent) for kind in KINDS]
    found, glossy = (series_errors(folder, name, series) for series in (SERIES, GLOSSY_SERIES))
    where = "within its mask, but for normals seen edge on"
    how = f"`insitu render --series {{}}` against ../shared/reference/{{}}_4.exr {where}".format
    return [
        Figure(f"gi_error_{name}", (found.rmse,), how(SERIES, name)),
        Figure(f"gi_mean_{name}", (abs(found.mean),), how(SERIES, name), {"signed": found.mean}),
        Figure(f"gi_error_8_{name}", (glossy.rmse,), how(GLOSSY_SERIES, name), {"signed_mean": glossy.mean}),
    ]


def series_errors(folder: Path, name: str, text: str) -> Errors:
    """A reference scene with four bounces against the path-traced picture of as many."""
    series = parse_series(text)
    project = open_project(str(folder / f"{name}.toml")).with_settings(
        n_edge_rays=0
    )  # rays of the references pass centres alone
    ours = render_picture(project, lambda step: None, series=series)
    truth, mask = masked_reference(folder, name, series.n_bounces, Placement(project.scene).hits)
    if ours.shape != truth.shape:
        raise ValueError(f"{name}: picture {ours.shape} and reference {truth.shape}, expected equal shapes")
    return errors(ours[mask], truth[mask])
