"""Plots of a sweep: error against time and against memory, the Pareto front marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.measure.report import FRONT_COLOUR, INK, read_well, save_figure
from app.measure.settings import pareto_front
from benchmarks.sweep import SweepRow

SIZE = (8.0, 5.0)
COLOURS = ("#8aa7bf", "#5f8fb4", "#2f6690", "#123a5c", "#0b2239")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def write_plots(folder: Path, rows: Sequence[SweepRow], title: str) -> list[Path]:
    """Write the plots as PNG; the files."""
    precomputed = [row for row in rows if row.study == "precompute" and row.precision == "half"]
    coherent = [row for row in precomputed if row.visibility == "coherent"]
    edits = [row for row in rows if row.study == "edit" and row.seconds is not None]
    files = [folder / "error_against_time.png", folder / "error_against_memory.png"]
    save_figure(files[0], _precompute_figure(precomputed, "time", f"{title}: precomputation"))
    save_figure(files[1], _precompute_figure(coherent, "memory", f"{title}: precomputation"))
    if edits:
        files.append(folder / "error_against_frame_time.png")
        save_figure(files[2], _edit_figure(edits, f"{title}: one frame after an edit"))
    return files


def _precompute_figure(rows: Sequence[SweepRow], cost: str, title: str) -> Figure:
    """Colour says lights, the marker bands; hollow: shadows by brute force or of the cut alone."""
    figure, axes = _axes(title, "seconds" if cost == "time" else "transport, MiB")
    lights, bands = sorted({row.lights for row in rows}), sorted({row.bands for row in rows})
    costs = [(row.seconds or 0.0) if cost == "time" else row.mib for row in rows]
    for row, x in zip(rows, costs, strict=True):
        colour = COLOURS[lights.index(row.lights) % len(COLOURS)]
        marker = MARKERS[bands.index(row.bands) % len(MARKERS)]
        face = colour if row.visibility == "coherent" else "white"
        axes.plot(x, 100 * row.error, marker, color=colour, markerfacecolor=face, markersize=7, zorder=3)
        if row.visibility != "coherent":
            axes.annotate(row.visibility, (x, 100 * row.error), (6, 4), textcoords="offset points", fontsize=7)
    _draw_front(axes, costs, [row.error for row in rows])
    for i, n_lights in enumerate(lights):
        axes.plot([], [], "o", color=COLOURS[i % len(COLOURS)], label=f"{n_lights} lights")
    for i, n_bands in enumerate(bands):
        axes.plot([], [], MARKERS[i % len(MARKERS)], color="#888888", label=f"{n_bands} bands")
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _edit_figure(rows: Sequence[SweepRow], title: str) -> Figure:
    """K coefficients a frame, half and float."""
    figure, axes = _axes(title, "milliseconds a frame")
    for precision, marker, colour, shift in (("half", "o", COLOURS[2], 6), ("float", "s", COLOURS[0], -11)):
        own = sorted((row for row in rows if row.precision == precision), key=lambda row: row.wavelets)
        x = [1e3 * (row.seconds or 0.0) for row in own]
        y = [100 * row.error for row in own]
        axes.plot(x, y, marker, color=colour, markersize=7, linestyle="none", label=precision, zorder=3)
        for row, at in zip(own, zip(x, y, strict=True), strict=True):
            axes.annotate(f"K = {row.wavelets}", at, (5, shift), textcoords="offset points", fontsize=7, color=colour)
    _draw_front(axes, [1e3 * (row.seconds or 0.0) for row in rows], [row.error for row in rows])
    axes.legend(frameon=False, fontsize=8)
    return figure


def _axes(title: str, cost: str) -> tuple[Figure, Axes]:
    figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    axes.set_xlabel(cost, color=INK)
    axes.set_ylabel("error against brute force, relRMSE in %", color=INK)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        read_well(axis)
    axes.grid(True, which="major", color="#e4e4e4", linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes


def _draw_front(axes: Axes, costs: Sequence[float], wrongs: Sequence[float]) -> None:
    front = pareto_front(costs, wrongs)
    points = sorted((c, 100 * w) for c, w, best in zip(costs, wrongs, front, strict=True) if best)
    axes.plot(*zip(*points, strict=True), color=FRONT_COLOUR, linewidth=1.4, zorder=2, label="Pareto front")
