"""The report of the settings: a page of tables in Markdown and a plot a mode, drawn as PNG without a display.

Ticks of a logarithmic axis are made to be read: a few, apart from each other, and without exponents.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter, Locator, MaxNLocator, NullLocator

from app.measure.settings import CSV, FRONT, SettingRow, rows_by_setting
from app.system.atomic import save_file

matplotlib.use("Agg")
DPI = 150
INK, FRONT_COLOUR = "#333333", "#c0392b"


def save_figure(file: Path, figure: Figure) -> None:
    """As PNG, whole or not at all; the figure is closed."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI)
    plt.close(figure)
    save_file(file, buffer.getvalue())


def table(head: Sequence[str], lines: Sequence[Sequence[object]]) -> str:
    """A table under a line of names, the first column to the left and all others to the right."""
    marks = ["---", *["---:"] * (len(head) - 1)]
    return "".join(_line(cells) for cells in (head, marks, *lines))


def _line(cells: Sequence[object]) -> str:
    escaped = (str(cell).replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |\n"


MOST_TICKS = 6
# Of a decade, from coarse to fine.
_PARTS = ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
_MOST_DIGITS = 8


def read_well(axis: Axis) -> None:
    """Give a logarithmic axis such ticks."""
    axis.set_major_locator(_LogPlaces())
    axis.set_major_formatter(_LogNames())
    axis.set_minor_locator(NullLocator())


def log_places(low: float, high: float) -> list[float]:
    """A few round numbers between two above 0: parts of decades, and where these lie too close together for two,
    numbers at equal distances."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    found: list[float] = []
    for parts in _PARTS:
        places = [10.0**k * part for k in decades for part in parts if low <= 10.0**k * part <= high]
        if len(places) > MOST_TICKS:
            break
        found = places
    if not found:
        tens = [10.0**k for k in decades if low <= 10.0**k <= high]
        found = tens[:: -(-len(tens) // MOST_TICKS)] if tens else []
    if len(found) < 2:
        found = [float(x) for x in MaxNLocator(4).tick_values(low, high) if low <= x <= high]
    return found


def log_name(place: float) -> str:
    """With as many digits as it needs."""
    for digits in range(1, _MOST_DIGITS):
        name = np.format_float_positional(place, precision=digits, fractional=False, trim="-")
        if math.isclose(float(name), place, rel_tol=1e-6):
            break
    return name


class _LogPlaces(Locator):
    def __call__(self) -> list[float]:
        assert self.axis is not None
        low, high = self.axis.get_view_interval()
        return self.tick_values(low, high)

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        return log_places(*sorted((vmin, vmax)))


class _LogNames(Formatter):
    def __call__(self, x: float, pos: int | None = None) -> str:
        return log_name(x)


REPORT = "report.md"
TITLES = {"placement": "Placement", "orbit": "Orbit", "deform": "Deform"}
POINT, PRESENT = "#2f6690", "#e08a1e"
COLUMNS, AXES_SIZE = 3, (4.2, 3.2)
LEAST_SECONDS, SHORT_SECONDS, LEAST_ERROR = 1e-6, 0.1, 1e-4
# Points that lie closer together than these parts of the axes have their names in one line.
CLOSE = (0.08, 0.05)


def plot_name(mode: str) -> str:
    return f"settings_{mode}.png"


def write_report(folder: Path, rows: Sequence[SettingRow], facts: Mapping[str, Any]) -> None:
    """report.md and its plots. facts: scene, resolution, repetitions and machine as `write_settings` takes them."""
    for mode, settings in rows_by_setting(rows).items():
        _plot(folder / plot_name(mode), settings)
    save_file(folder / REPORT, report_text(rows, facts).encode())


def report_text(rows: Sequence[SettingRow], facts: Mapping[str, Any]) -> str:
    """The page in Markdown."""
    machine, (width, height) = facts["machine"], facts["resolution"]
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    load = " and ".join(_load(each) for each in (machine["load_average"], facts["load_average_after"]))
    parts = [
        f"# Speed against accuracy: {facts['scene']}\n",
        f"By `insitu measure` at {width} × {height}: each setting alone, all others as they are at present (**bold**). "
        "Errors are relRMSE against brute force, and the relative difference of means, in %. Seconds are the "
        f"processor's, the median of {_runs(facts['repetitions'])}, of more where they are quick and of fewer where "
        "they are slow, with the least and the most of them. A star: no other value of the setting is as quick and as "
        "right.\n",
        f"Machine: {machine['cpu']}, {machine['cores']} cores, {machine['ram_gib']} GiB, {machine['system']}, "
        f"Python {machine['python']}, {versions}; {machine['date']}; load {load}. "
        f"All numbers: {CSV}; the starred ones by mode and setting: {FRONT}.\n",
    ]
    for mode, settings in rows_by_setting(rows).items():
        parts.append(f"## {TITLES[mode]}\n\n![{TITLES[mode]}: error over time]({plot_name(mode)})\n")
        parts += [_setting_text(name, own) for name, own in settings.items()]
    return "\n".join(parts)


def _runs(count: int) -> str:
    return "one run" if count == 1 else f"{count} runs"


def _load(load: Sequence[float] | None) -> str:
    return "unknown" if load is None else f"{load[0]:.1f}"


def _setting_text(name: str, rows: Sequence[SettingRow]) -> str:
    timed, sized = not math.isnan(rows[0].seconds), any(row.mib is not None for row in rows)
    head = [name, "error", "means", *(["seconds"] if timed else []), *(["MiB"] if sized else []), ""]
    lines = []
    for row in rows:
        cells = [row.value, f"{100 * row.error:.3g}", f"{100 * row.mean:+.2g}"]
        cells += [f"{row.seconds:.3g} ({row.least:.3g} to {row.most:.3g})"] if timed else []
        cells += ["" if row.mib is None else f"{row.mib:.3g}"] if sized else []
        lines.append(
            [*(f"**{cell}**" if row.present and cell else cell for cell in cells), "★" if row.on_front else ""]
        )
    return f"Seconds of: {rows[0].cost}.\n\n{table(head, lines)}" if timed else f"{table(head, lines)}"


def _plot(file: Path, settings: Mapping[str, Sequence[SettingRow]]) -> None:
    """One small plot a setting."""
    n_lines = -(-len(settings) // COLUMNS)
    figure, all_axes = plt.subplots(
        n_lines, COLUMNS, figsize=(AXES_SIZE[0] * COLUMNS, AXES_SIZE[1] * n_lines), layout="constrained", squeeze=False
    )
    for axes in all_axes.ravel()[len(settings) :]:
        axes.set_visible(False)
    for axes, (name, rows) in zip(all_axes.ravel(), settings.items(), strict=False):
        _draw(axes, name, rows)
    save_figure(file, figure)


def _draw(axes: Axes, name: str, rows: Sequence[SettingRow]) -> None:
    """Error over seconds, or over the values in their order where these have none."""
    timed = not math.isnan(rows[0].seconds)
    unit, scale = ("ms", 1e3) if timed and max(row.seconds for row in rows) < SHORT_SECONDS else ("s", 1.0)
    xs = [scale * max(row.seconds, LEAST_SECONDS) if timed else float(i) for i, row in enumerate(rows)]
    ys = [max(100.0 * row.error, LEAST_ERROR) for row in rows]
    best = sorted((x, y) for x, y, row in zip(xs, ys, rows, strict=True) if row.on_front)
    axes.plot(*zip(*best, strict=True), color=FRONT_COLOUR, linewidth=1.2, zorder=1)
    for x, y, row in zip(xs, ys, rows, strict=True):
        axes.plot(x, y, "o", color=PRESENT if row.present else POINT, markersize=8 if row.present else 5, zorder=2)
    axes.set_title(name, fontsize=9, loc="left", color=INK)
    axes.set_yscale("log")
    read_well(axes.yaxis)
    if timed:
        axes.set_xscale("log")
        read_well(axes.xaxis)
        axes.set_xlabel(f"{unit}, {rows[0].cost}", fontsize=7, color=INK)
    else:
        axes.set_xticks([])
    axes.set_ylabel("relRMSE, %", fontsize=7, color=INK)
    axes.tick_params(labelsize=7)
    axes.margins(0.16)
    axes.autoscale_view()
    _names_apart(axes, rows, xs, ys)
    axes.grid(True, color="#e4e4e4", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _names_apart(axes: Axes, rows: Sequence[SettingRow], xs: Sequence[float], ys: Sequence[float]) -> None:
    """The values beside their points; those whose points all but coincide are named together."""
    places = axes.transAxes.inverted().transform(axes.transData.transform(list(zip(xs, ys, strict=True))))
    groups: list[list[int]] = []
    for i, place in enumerate(places):
        for group in groups:
            if (abs(places[group[0]] - place) < CLOSE).all():
                group.append(i)
                break
        else:
            groups.append([i])
    for group in groups:
        name, at = "; ".join(rows[i].value for i in group), (xs[group[0]], ys[group[0]])
        axes.annotate(name, at, (5, 4), textcoords="offset points", fontsize=7, color=INK)
