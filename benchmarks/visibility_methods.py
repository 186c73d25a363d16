"""The visibility methods of the thesis and ours: rays, wrong answers and time [BenArtzi07, tables 8.1 to 8.3].

Scenes after the thesis' own, made by this project, but for the bunny, which is the reference's where it is at hand and
a carved head else. Up to 400 directions are lights cut from the scene's own sky [Agarwal03], as in the thesis; more are
the geodesic sphere's. "ours" is what the engine does, `engine.visibility.coherent_grid`. docs/visibility.md has what
came of it.

Time is the processor's, of visibility alone, on rays of one thread each.
"""

from __future__ import annotations

import csv
import io
import statistics
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from app.measure.report import save_figure, table
from app.project.project import Project, open_project
from app.system.atomic import save_file
from benchmarks.references import reference_folder
from benchmarks.thesis_visibility import VARIANTS, variant_visibility, voronoi_targets
from engine.light.triangle_lights import cut_lights
from engine.scene.primary_hits import PrimaryHits, trace_primary
from engine.scene.raycaster import Intersections, RayCaster
from engine.visibility.coherent_grid import coherent_visibility
from engine.visibility.point_visibility import (
    DOUBT_STEP,
    WEAK_STEP,
    WEAKEST_STEP,
    Targets,
    Visibility,
    empty_visibility,
    evaluate_rows,
    sphere_targets,
)

FILE, PLOT, TABLES = "visibility.csv", "visibility.png", "visibility.md"
TRUE, OPT, OURS = "TRUE", "OPT", "ours"
METHODS = (TRUE, *(name for name in VARIANTS if name != TRUE), OURS)
LEVELS = {20 * 4**level: level for level in (3, 4)}
MOST_LIGHTS = 400
# Of its own shapes, bunny, plant and dominoes: percent of rays at 50, 100, 200, 400 lights, and times as fast at 200.
THESIS_TABLE = {
    "SWB": ((40.5, 34.3, 26.3, 22.4), (52.4, 42.6, 33.6, 25.9), (63.2, 51.6, 44.3, 39.7), (54.5, 43.6, 36.0, 28.8)),
    "GWB": ((22.0, 17.9, 15.1, 12.4), (21.5, 16.6, 13.5, 11.6), (37.8, 34.5, 32.6, 30.5), (31.6, 28.2, 24.9, 21.8)),
    "GNB": ((21.7, 17.1, 13.8, 10.6), (21.2, 15.8, 12.0, 9.3), (37.7, 34.6, 32.7, 30.6), (30.3, 25.7, 21.9, 18.0)),
    "GWU": ((10.4, 10.7, 11.0, 11.3), (9.1, 9.4, 10.2, 11.5), (33.3, 32.4, 32.3, 31.1), (20.4, 22.3, 22.2, 22.6)),
    "GNU": ((9.4, 8.8, 8.3, 7.5), (8.1, 7.7, 7.2, 6.7), (35.3, 33.8, 33.4, 31.9), (17.3, 16.9, 16.3, 15.3)),
    "OPT": ((4.8, 4.6, 4.5, 4.3), (4.6, 4.4, 4.1, 3.9), (21.4, 20.9, 20.8, 20.2), (9.4, 9.2, 9.1, 8.8)),
}  # fmt: skip
THESIS_RAYS = {method: tuple(of_scene[-1] for of_scene in scenes) for method, scenes in THESIS_TABLE.items()}
THESIS_SPEED = {
    "SWB": (2.2, 1.5, 1.3, 1.9), "GWB": (3.0, 2.2, 1.3, 2.2), "GNB": (4.5, 3.5, 1.6, 3.5), "GWU": (3.8, 2.6, 1.3, 2.6),
    "GNU": (6.7, 4.8, 1.6, 5.2), "OPT": (10.5, 7.6, 2.6, 8.5),
}  # fmt: skip
COLOURS = {"SNB": "#d9b08c", "SNU": "#d98c5f", "SWB": "#a8763e", "SWU": "#7a4a1d", "GNB": "#a8c8a0", "GNU": "#3f8f4f",
           "GWB": "#b9a3cf", "GWU": "#7a5aa0", "FLO": "#7fa8c9", "OPT": "#2f6690",
           "ours": "#c0392b"}  # fmt: skip


@dataclass(frozen=True)
class Size:
    """So many directions seen from a picture of `side` squared pixels, as often."""

    side: int
    directions: int
    repetitions: int = 1


SIZES = (
    *(Size(513, 50), Size(513, 100), Size(513, 200, 3), Size(513, 400)),
    *(Size(129, 400), Size(129, 1280), Size(129, 5120)),
)


@dataclass(frozen=True)
class VisibilityEffort:
    """What is measured of which scenes; None: of the four."""

    sizes: tuple[Size, ...] = SIZES
    scenes: Mapping[str, str] | None = None


QUICK = VisibilityEffort((Size(33, 50), Size(33, 200)), {"shapes": "shapes", "plant": "plant"})


@dataclass(frozen=True)
class VisibilityRow:
    """One method on one scene. rays and wrong: as shares of the directions above the horizons; seconds of the
    processor, the median, least and most of all repetitions; ray_seconds of these in Embree."""

    scene: str
    side: int
    directions: int
    method: str
    rays: float
    wrong: float
    seconds: float
    least: float
    most: float
    ray_seconds: float
    n_rays: int


class TimedCaster:
    """A ray caster that adds up its processor's time, on rays of one thread each."""

    def __init__(self, caster: RayCaster) -> None:
        self._caster, self._lock = caster, threading.Lock()
        self.blends = caster.blends
        self.seconds = 0.0

    def occluded(self, *rays: Any) -> np.ndarray:
        return self._timed(self._caster.occluded, *rays)

    def intersect(self, *rays: Any) -> Intersections:
        return self._timed(self._caster.intersect, *rays)

    def _timed(self, query: Callable[..., Any], *rays: Any) -> Any:
        begun = time.thread_time()
        found = query(*rays)
        with self._lock:
            self.seconds += time.thread_time() - begun
        return found


def measured_scenes() -> dict[str, str]:
    """What is opened for the four of the thesis."""
    folder = reference_folder()
    bunny = "idol" if folder is None else str(folder / "bunny.toml")
    return {"shapes": "shapes", "bunny": bunny, "plant": "plant", "dominoes": "dominoes"}


def visibility_rows(effort: VisibilityEffort, report: Callable[[str], None]) -> list[VisibilityRow]:
    """Every method of every scene in every size."""
    scenes = measured_scenes() if effort.scenes is None else effort.scenes
    list(_measured(*next(iter(scenes.items())), Size(17, 50), lambda _: None))  # compiled before anything is timed
    return [
        row for name, source in scenes.items() for size in effort.sizes for row in _measured(name, source, size, report)
    ]


def _measured(name: str, source: str, size: Size, report: Callable[[str], None]) -> Iterator[VisibilityRow]:
    report(f"visibility of {size.directions} directions: {name} at {size.side} × {size.side}")
    project = open_project(source, (size.side, size.side))
    caster = RayCaster(project.scene.vertices, project.scene.triangles, threads=1)
    hits = trace_primary(project.scene, caster)
    targets = _targets(project, size.directions)
    truth: Visibility | None = None
    for method in METHODS:
        seconds, of_rays, seen = [], [], None
        for _ in range(size.repetitions):
            timed, begun = TimedCaster(caster), time.process_time()
            seen = _seen(hits, timed, targets, method)
            seconds.append(time.process_time() - begun)
            of_rays.append(timed.seconds)
        assert seen is not None
        truth = truth or seen
        possible = truth.rays.possible
        wrong = int(np.bitwise_count(seen.bits ^ truth.bits).sum(dtype=np.int64)) / possible
        yield VisibilityRow(
            name, size.side, len(targets.positions), method, seen.rays.traced / possible, wrong,
            statistics.median(seconds), min(seconds), max(seconds), statistics.median(of_rays), seen.rays.traced,
        )  # fmt: skip


def _targets(project: Project, n_directions: int) -> Targets:
    """Lights of the scene's sky, or the sphere's triangles."""
    if n_directions > MOST_LIGHTS:
        sphere = sphere_targets(LEVELS[n_directions])
        return replace(sphere, neighbours=voronoi_targets(sphere.positions.astype(np.float64)).neighbours)
    assert project.sky.environment is not None
    return voronoi_targets(cut_lights(project.sky.environment, n_directions, project.sky.rotation).centre)


def _seen(hits: PrimaryHits, caster: Any, targets: Targets, method: str) -> Visibility:
    if method != OURS:
        return variant_visibility(hits, caster, targets, method)  # type: ignore[arg-type]
    return ours_visibility(hits, caster, targets)


def ours_visibility(hits: PrimaryHits, caster: Any, targets: Targets) -> Visibility:
    """What the engine does: the sphere's triangles where there are as many directions, else any directions."""
    level = LEVELS.get(len(targets.positions))
    own = replace(targets, weak_step=WEAK_STEP, weakest_step=WEAKEST_STEP, doubt_step=DOUBT_STEP)
    visibility = empty_visibility(hits, own if level is None else sphere_targets(level))
    for _ in coherent_visibility(hits, caster, visibility):
        pass
    evaluate_rows(hits, caster, visibility, np.arange(len(hits.pixel)))
    return visibility


# ------------------------------------------------------------------------------------------------- tables and the plot


def write_visibility(folder: Path, rows: Sequence[VisibilityRow]) -> None:
    """visibility.csv, the tables in Markdown and the plot."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    names = list(VisibilityRow.__dataclass_fields__)
    writer.writerow(names)
    for row in rows:
        cells = [getattr(row, name) for name in names]
        writer.writerow([f"{cell:.6g}" if isinstance(cell, float) else cell for cell in cells])
    save_file(folder / FILE, text.getvalue().encode())
    save_file(folder / TABLES, visibility_tables(rows).encode())
    _plot(folder / PLOT, rows)


def visibility_tables(rows: Sequence[VisibilityRow]) -> str:
    """Tables 8.1 to 8.3 of the thesis with our figures, in Markdown."""
    scenes, sizes = scenes_of(rows), list(dict.fromkeys((row.side, row.directions) for row in rows))
    parts = []
    for scene in scenes:
        heads = [f"{directions} at {side}²" for side, directions in sizes]
        found = {method: [row_of(rows, scene, *size, method) for size in sizes] for method in METHODS}
        lines = [
            [method, *(f"{100 * of.rays:.1f} / {_percent(of.wrong)}" for of in own)] for method, own in found.items()
        ]
        parts.append(f"*{scene}*: rays traced / wrong answers, both in % of the directions above the horizon\n")
        parts.append(table(["", *heads], lines))
    side, directions = max(size for size in sizes if size[1] <= MOST_LIGHTS)
    parts.append(f"{directions} lights at {side}²: rays in %, ours and in brackets the thesis' of its own scenes\n")
    parts.append(_beside(rows, (side, directions), THESIS_RAYS, lambda row, _: f"{100 * row.rays:.1f}") + "\n")
    timed = min(sizes, key=lambda size: (abs(size[1] - MOST_LIGHTS / 2), -size[0]))
    parts.append(f"{timed[1]} lights at {timed[0]}²: processor s, and how many times as fast as TRUE (the thesis')\n")
    parts.append(_beside(rows, timed, THESIS_SPEED, _speed))
    parts.append(f"{directions} lights at {side}²: what a ray costs\n\n" + _ray_costs(rows, (side, directions)))
    return "\n".join(parts)


def _percent(share: float) -> str:
    return "0" if share == 0.0 else f"{100 * share:.2g}"


def _speed(row: VisibilityRow, truth: VisibilityRow) -> str:
    return f"{row.seconds:.2f} s, {truth.seconds / row.seconds:.1f} ×"


def _beside(
    rows: Sequence[VisibilityRow], size: tuple[int, int], thesis: Mapping[str, tuple[float, ...]],
    cell_text: Callable[[VisibilityRow, VisibilityRow], str],
) -> str:  # fmt: skip
    scenes, lines = scenes_of(rows), []
    for method in METHODS:
        cells = [cell_text(row_of(rows, scene, *size, method), row_of(rows, scene, *size, TRUE)) for scene in scenes]
        known = thesis.get(method, ())
        known = known if len(known) == len(scenes) else ()
        cells = [f"{cell} ({known[i]:g})" if known else cell for i, cell in enumerate(cells)]
        lines.append([method, *cells])
    return table(["", *scenes], lines)


def _ray_costs(rows: Sequence[VisibilityRow], size: tuple[int, int]) -> str:
    scenes = scenes_of(rows)
    lines = []
    for method in (TRUE, OPT, OURS):
        found = [row_of(rows, scene, *size, method) for scene in scenes]
        lines.append([f"µs a ray in {method}", *(f"{1e6 * each.ray_seconds / each.n_rays:.3f}" for each in found)])
        truths = [row_of(rows, scene, *size, TRUE) for scene in scenes]
        if method != TRUE:
            faster = [(true.seconds / each.seconds, 1.0 / each.rays) for each, true in zip(found, truths, strict=True)]
            lines.append(
                [f"{method}: as fast, by its rays", *(f"{real:.1f} ×, {ideal:.1f} ×" for real, ideal in faster)]
            )
            lines.append(
                [f"{method}: of its time in rays", *(f"{each.ray_seconds / each.seconds:.0%}" for each in found)]
            )
    return table(["", *scenes], lines)


def scenes_of(rows: Sequence[VisibilityRow]) -> list[str]:
    return list(dict.fromkeys(row.scene for row in rows))


def row_of(rows: Sequence[VisibilityRow], scene: str, side: int, directions: int, method: str) -> VisibilityRow:
    """Cut lights may be one or two more or fewer from sky to sky."""
    own = [row for row in rows if (row.scene, row.side, row.method) == (scene, side, method)]
    return min(own, key=lambda row: abs(row.directions - directions))


def _plot(file: Path, rows: Sequence[VisibilityRow]) -> None:
    """Wrong answers against rays at 400 lights, or the most there are; hollow: the thesis' share of rays."""
    scenes = scenes_of(rows)
    side, directions = max((row.side, row.directions) for row in rows if row.directions <= MOST_LIGHTS + 1)
    figure, all_axes = plt.subplots(
        1, len(scenes), figsize=(3.6 * len(scenes), 4.0), layout="constrained", sharey=True, squeeze=False
    )
    for i, (axes, scene) in enumerate(zip(all_axes[0], scenes, strict=True)):
        _draw(axes, [row_of(rows, scene, side, directions, method) for method in METHODS[1:]], i)
    all_axes[0][0].set_ylabel("wrong answers, %")
    save_figure(file, figure)


def _draw(axes: Axes, found: Sequence[VisibilityRow], i_scene: int) -> None:
    least = 1e-4
    for row in found:
        x, y, colour = 100 * row.rays, max(100 * row.wrong, least), COLOURS[row.method]
        axes.plot(x, y, "o", color=colour, markersize=7)
        axes.annotate(row.method, (x, y), (5, 4), textcoords="offset points", fontsize=8, color=colour)
        if row.method in THESIS_RAYS:
            axes.plot(THESIS_RAYS[row.method][i_scene % 4], least, "|", color=colour, markersize=10)
    axes.set(
        title=f"{found[0].scene}, {found[0].directions} lights", xscale="log", yscale="log", xlabel="rays traced, %"
    )
    axes.set_xticks((2, 5, 10, 20, 50, 100), ("2", "5", "10", "20", "50", "100"))
    axes.minorticks_off()
    axes.grid(True, color="#e4e4e4", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
