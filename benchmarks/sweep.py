"""Lights, bands, precision and shadows together: one row a setting, error against our brute-force oracle.

Precomputation: lights × bands × half or float, with coherent visibility; at the planned bands also with visibility by
brute force, and with the rays of the cut alone. The seconds of a row are those of shadows, light and projection, from
nothing. Half floats are what the GPU holds (`engine.precompute.direct.bandstore`), contracted here as the GPU would.

Editing: K wavelets in one frame after an edit of the whole curve. The error is that of the picture the frame shows,
against the oracle of the edited material; the seconds are those of the frame on this machine's renderer.

Times of rows are single measurements: the named figures have the repetitions.
"""

from __future__ import annotations

import csv
import io
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from app.measure.report import FRONT_COLOUR, INK, read_well, save_figure
from app.measure.settings import pareto_front
from app.measure.settings_placement import EDIT
from app.measure.subject import (
    BYTES,
    MIB,
    PRECISIONS,
    Precomputed,
    Subject,
    gpu_planes,
    largest_on_gpu,
    layer_coefficients,
    oracle,
    precompute_on,
    random_rows,
    reflected,
    seen_scale,
    visibility_seconds,
)
from app.system.atomic import save_file
from engine.curve.wavelet import forward
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.render.picture_difference import Errors, errors
from engine.settings import Precision
from engine.visibility.point_visibility import brute_force_visibility

Shadows = Literal["coherent", "brute", "cut"]


@dataclass(frozen=True)
class Grid:
    """Which settings are measured. side: the longer side of the picture in pixels; level: of the oracle's sky.

    oracle_lights: as many as the panel offers; beside the most of `lights` they show whether it is the size of the
    lights alone that keeps a picture from the oracle.
    """

    lights: tuple[int, ...] = (100, 400, 1600, 4000)
    bands: tuple[int, ...] = (16, 32, 64, 128, 256)
    wavelets: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128)
    side: int = 256
    n_points: int = 1000
    level: int = 6
    oracle_lights: int = 10_000

    def base_bands(self, subject: Subject) -> int:
        """The planned number of bands, or what in the grid is nearest to it."""
        return min(self.bands, key=lambda n: abs(math.log2(n / subject.most_bands)))

    @property
    def edit_bands(self) -> int:
        """Of the curve that is edited: as many as the most wavelets of a frame, as far as the grid has them."""
        return min(self.bands, key=lambda n: abs(math.log2(n / max(self.wavelets))))


QUICK = Grid((100, 400), (16, 128), (1, 8, 128), side=48, n_points=24, level=5, oracle_lights=1600)


@dataclass(frozen=True)
class SweepRow:
    """One setting and what it gave. wavelets: a frame's K, 0 for the whole curve; seconds may be unknown (None)."""

    study: Literal["precompute", "edit"]
    lights: int
    bands: int
    wavelets: int
    precision: Precision
    visibility: Shadows
    error: float
    seconds: float | None
    rays: int
    mib: float
    pareto: bool = False


@dataclass(frozen=True, eq=False)
class SweepResult:
    """All rows, and how far the pictures with the planned bands are from the oracle, by their number of lights."""

    rows: tuple[SweepRow, ...]
    against_oracle: dict[int, Errors]


def run_sweep(
    subject: Subject, grid: Grid, frame_seconds: Mapping[Precision, Mapping[int, float]] | None = None
) -> SweepResult:
    """Measure every setting of the grid. frame_seconds: what a frame with K terms takes, by precision."""
    placement = Placement(subject.scene)
    rows = random_rows(placement, grid.n_points)
    truth = oracle(subject, placement, rows, grid.level)
    precomputed: list[SweepRow] = []
    finest: dict[int, Precomputed] = {}
    for done, row in _precompute_rows(subject, grid, rows, truth):
        precomputed.append(row)
        if row.visibility == "coherent" and row.lights == max(grid.lights):
            finest[row.bands] = done
    planned = finest[grid.base_bands(subject)]
    finer = precompute_on(
        planned.placement, subject, replace(FINAL, n_lights=grid.oracle_lights), grid.base_bands(subject)
    )
    against = {
        n: errors(reflected(done)[rows], truth)
        for n, done in ((max(grid.lights), planned), (grid.oracle_lights, finer))
    }
    edits = list(edit_rows(subject, finest[grid.edit_bands], grid, rows, frame_seconds or {}))
    return SweepResult((*_marked(precomputed), *_marked(edits)), against)


def write_csv(file: Path, rows: Sequence[SweepRow]) -> None:
    """One line a setting under a line of names; unknown seconds are empty."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(SweepRow))
    writer.writerows([_cell(value) for value in astuple(row)] for row in rows)
    save_file(file, text.getvalue().encode())


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _marked(rows: Sequence[SweepRow]) -> list[SweepRow]:
    """The rows with the Pareto front of error against time marked."""
    seconds = [math.nan if row.seconds is None else row.seconds for row in rows]
    front = pareto_front(seconds, [row.error for row in rows])
    return [replace(row, pareto=on_front) for row, on_front in zip(rows, front, strict=True)]


# ----------------------------------------------------------------------------------------------------- precomputation


def _precompute_rows(
    subject: Subject, grid: Grid, rows: NDArray[np.integer], truth: NDArray[np.float64]
) -> Iterator[tuple[Precomputed, SweepRow]]:
    for shadows in ("coherent", "brute", "cut"):
        sphere = _sphere(subject, shadows)
        for n_lights in grid.lights:
            for most_bands in grid.bands if shadows == "coherent" else (grid.base_bands(subject),):
                yield from _setting(subject, shadows, sphere, n_lights, most_bands, rows, truth)


@dataclass(frozen=True, eq=False)
class _Sphere:
    """A placement whose level-4 visibility is known by one of the variants, and what that took."""

    placement: Placement
    seconds: float
    rays: int


def _sphere(subject: Subject, shadows: Shadows) -> _Sphere:
    placement = Placement(subject.scene)
    if shadows == "cut":
        return _Sphere(placement, 0.0, 0)
    if shadows == "coherent":
        seconds = visibility_seconds(placement)
    else:
        started = time.perf_counter()
        everything = np.arange(len(placement.hits.pixel))
        placement.sphere = brute_force_visibility(
            placement.hits, placement.caster, placement.sphere.targets, everything
        )
        seconds = time.perf_counter() - started
    return _Sphere(placement, seconds, placement.sphere.rays.traced)


def _setting(
    subject: Subject, shadows: Shadows, sphere: _Sphere, n_lights: int, most_bands: int, rows: NDArray[np.integer],
    truth: NDArray[np.float64],
) -> Iterator[tuple[Precomputed, SweepRow]]:  # fmt: skip
    """The rows of one setting, in half and in float precision."""
    quality = replace(FINAL, n_lights=n_lights, own_rays=shadows == "cut")
    done = precompute_on(sphere.placement, subject, quality, most_bands)
    for precision in PRECISIONS if shadows == "coherent" else PRECISIONS[:1]:
        picture = precision_picture(done, precision, rows)
        row = SweepRow(
            "precompute",
            n_lights,
            most_bands,
            0,
            precision,
            shadows,
            errors(picture, truth).rmse,
            sphere.seconds + done.seconds,
            done.rays,
            (done.store_bytes + largest_on_gpu(done, precision)) / MIB,
        )
        yield done, row


def precision_picture(done: Precomputed, precision: Precision, rows: NDArray[np.integer]) -> NDArray[np.float64]:
    """Radiance (p, 3) at rows when each layer is contracted on the GPU along its first curve."""
    total = np.zeros((len(done.placement.hits.pixel), 3))
    for transport in done.transports:
        own = done.placement.rows_of(transport.i_object)
        chosen = np.isin(own, rows)
        planes = gpu_planes(done, transport, precision)[:, chosen]
        first, _ = layer_coefficients(transport)
        picture = np.einsum("jc,jpc->pc", forward(first), planes, dtype=np.float64)
        total[own[chosen]] += picture * seen_scale(done.placement, own[chosen], transport.layer)
    return total[rows]


# -------------------------------------------------------------------------------------------------------------- edits


def edit_rows(
    subject: Subject,
    done: Precomputed,
    grid: Grid,
    rows: NDArray[np.integer],
    frame_seconds: Mapping[Precision, Mapping[int, float]],
) -> Iterator[SweepRow]:
    """What one frame shows after an edit of a whole curve, for every K [BenArtzi07, ch. 7].

    B = B_before + Σ_K Δc_k T_k over the K terms with the largest |Δc_k|·‖T_k‖.
    """
    sizes = [(next(iter(t.bands.values())), t.store.n_points) for t in done.transports]
    index = sizes.index(max(sizes))  # of the curves with the most bands the one whose layer has the most points
    transport = done.transports[index]
    name = next(iter(transport.bands))
    edited = transport.layer.with_operators(name, EDIT)
    layers: list[Layer] = [layer for _, layer in subject.layers]
    layers[index] = edited
    truth = oracle(subject, done.placement, rows, grid.level, layers)
    before = reflected(done)[rows]
    own = done.placement.rows_of(transport.i_object)
    scale = seen_scale(done.placement, own, transport.layer)
    delta = forward(layer_coefficients(transport, edited)[0]) - forward(layer_coefficients(transport)[0])
    for precision in PRECISIONS:
        planes = gpu_planes(done, transport, precision)
        order = terms_by_effect(delta, planes)
        for k in (k for k in grid.wavelets if k <= len(delta)):
            picked = order[:k]
            change = np.zeros((len(done.placement.hits.pixel), 3))
            change[own] = np.einsum("kc,kpc->pc", delta[picked], planes[picked], dtype=np.float64) * scale
            yield SweepRow(
                "edit",
                max(grid.lights),
                len(delta),
                k,
                precision,
                "coherent",
                errors(before + change[rows], truth).rmse,
                frame_seconds.get(precision, {}).get(k),
                done.rays,
                planes.size * BYTES[precision] / MIB,
            )


def terms_by_effect(delta: NDArray[np.float64], planes: NDArray[np.float32]) -> NDArray[np.intp]:
    """Indices of coefficients by what they change in the picture, |Δc_k|·‖T_k‖, the largest first."""
    norms = np.sqrt(np.einsum("jpc,jpc->jc", planes, planes, dtype=np.float64))
    effect = np.sqrt(np.sum((delta * norms) ** 2, axis=1))
    return np.argsort(-effect, kind="stable")


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
