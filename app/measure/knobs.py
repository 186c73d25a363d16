"""Speed against accuracy, knob by knob and mode by mode: one loop over settings, one table [docs/accuracy.md].

A knob is a name, its settings, and how to compute the picture of one: `make(setting)` prepares what the setting does
not cost and gives a function, which is timed and gives radiance at the points where the knob's truth is known. Truths
are brute force: sums over all directions, or paths. All other knobs are meanwhile as they are at present. Seconds are
the processor's, of all threads, so that others at work on the machine do not count.

    placement_knobs, orbit_knobs, deform_knobs ─► measured ─► knobs.csv, front.json, plots, report.md
"""

from __future__ import annotations

import csv
import io
import json
import math
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from app.measure.accuracy import errors
from app.system.atomic import save_file

KnobMode = Literal["placement", "orbit", "deform"]
CSV, FRONT = "knobs.csv", "front.json"
NO_TIME = math.nan
# Seconds in all from which on a setting is not computed again: at once, and where it has been as often as asked for.
LONG, QUICK, MOST = 6.0, 0.05, 20


@dataclass(frozen=True, eq=False)
class Shown:
    """Radiance (p, 3) at the judged points, and what it takes of memory where that is of interest (MiB)."""

    radiance: NDArray[np.floating]
    mib: float | None = None


@dataclass(frozen=True, eq=False)
class Knob:
    """See above. truth (p, 3); present: the setting that the program has, None for none of them; cost: what the seconds
    are of; timed: False where the picture is computed in another way than the program does, so that its seconds would
    say nothing."""

    mode: KnobMode
    name: str
    settings: Sequence[Any]
    make: Callable[[Any], Callable[[], Shown]]
    truth: NDArray[np.floating]
    present: Any
    cost: str
    timed: bool = True


@dataclass(frozen=True)
class KnobRow:
    """One setting: relRMSE and relative difference of means against brute force; seconds, the median, least and most
    of the repetitions (NaN where they say nothing); on_front: no other setting of the knob is as quick and as right."""

    mode: KnobMode
    knob: str
    setting: str
    error: float
    mean: float
    seconds: float
    least: float
    most: float
    mib: float | None
    present: bool
    on_front: bool
    cost: str


def measured(knobs: Iterable[Knob], repetitions: int, report: Callable[[str], None]) -> list[KnobRow]:
    """Every setting of every knob, in their order."""
    return [row for knob in knobs if knob.settings for row in _settings(knob, repetitions, report)]


def _settings(knob: Knob, repetitions: int, report: Callable[[str], None]) -> Iterator[KnobRow]:
    report(f"{knob.mode}: {knob.name}")
    if knob.timed and repetitions > 1:
        knob.make(knob.settings[0])()  # compiled before anything is timed
    found = [(str(setting), *_computed(knob, setting, repetitions)) for setting in knob.settings]
    off = [errors(shown.radiance, knob.truth) for _, shown, _ in found]
    costs = [statistics.median(seconds) for *_, seconds in found] if knob.timed else list(range(len(found)))
    front = pareto_front(costs, [each.rmse for each in off])
    for (setting, shown, seconds), each, on_front in zip(found, off, front, strict=True):
        spread = statistics.median(seconds), min(seconds), max(seconds)
        present = setting == str(knob.present)
        yield KnobRow(
            knob.mode, knob.name, setting, each.rmse, each.mean, *spread, shown.mib, present, on_front, knob.cost
        )


def _computed(knob: Knob, setting: Any, repetitions: int) -> tuple[Shown, list[float]]:
    """One setting and the seconds of each of its repetitions: more where they are quick, fewer where they take long."""
    if not knob.timed:
        return knob.make(setting)(), [NO_TIME]
    seconds: list[float] = []
    while not seconds or sum(seconds) < (LONG if len(seconds) < repetitions else QUICK) and len(seconds) < MOST:
        compute = knob.make(setting)
        begun = time.process_time()
        shown = compute()
        seconds.append(time.process_time() - begun)
    return shown, seconds


def pareto_front(costs: Sequence[float], wrongs: Sequence[float]) -> list[bool]:
    """Which settings no other one beats: none is as cheap and as right, and better in one of the two.

    Both smaller is better; equal settings stand or fall together. NaN is beaten by everything.
    """
    points = [(float(c), float(w)) for c, w in zip(costs, wrongs, strict=True)]
    return [
        not any(math.isnan(x) for x in p) and not any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in points)
        for p in points
    ]


def knobs_of(rows: Sequence[KnobRow]) -> dict[str, dict[str, list[KnobRow]]]:
    """The rows by mode and knob."""
    found: dict[str, dict[str, list[KnobRow]]] = {}
    for row in rows:
        found.setdefault(row.mode, {}).setdefault(row.knob, []).append(row)
    return found


def write_knobs(folder: Path, rows: Sequence[KnobRow], facts: Mapping[str, Any]) -> None:
    """knobs.csv, one line a setting; front.json: each knob's settings that no other beats, the quickest first, by mode
    and name, with `facts` of the run."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(KnobRow))
    writer.writerows([_cell(value) for value in astuple(row)] for row in rows)
    save_file(folder / CSV, text.getvalue().encode())
    fronts = {
        mode: {name: _front(own) for name, own in by_name.items() if not math.isnan(own[0].seconds)}
        for mode, by_name in knobs_of(rows).items()
    }
    save_file(folder / FRONT, (json.dumps(dict(facts) | fronts, indent=2, allow_nan=False) + "\n").encode())


def _front(rows: Sequence[KnobRow]) -> dict[str, Any]:
    best = sorted((row for row in rows if row.on_front), key=lambda row: row.seconds)
    present = next((row.setting for row in rows if row.present), None)
    stops = [{"setting": row.setting, "error": row.error, "seconds": row.seconds} for row in best]
    return {"present": present, "front": stops}


def _cell(value: object) -> str:
    if value is None or value != value:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
