"""Speed against accuracy, setting by setting and mode by mode: one loop over values, one table.

A setting is a name, its values, and how to compute the picture of one: `make(value)` prepares what is no part of the
cost and returns a function, which is timed and returns radiance at the points where the truth is known. Truths are
brute force: sums over all directions, or paths. All other settings keep the values that the program has. Seconds are
those of the processor, of all threads, so that other programs on the machine do not count.

    placement_settings, orbit_settings, deform_settings ─► measure_values ─► settings.csv, front.json, plots, report.md
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
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.system.atomic import save_file
from engine.render.picture_difference import errors

Mode = Literal["placement", "orbit", "deform"]
MODES: tuple[Mode, ...] = get_args(Mode)
CSV, FRONT = "settings.csv", "front.json"
NO_TIME = math.nan
# Seconds in all from which on a value is not computed again: at once, and after as many repetitions as asked for.
LONG, QUICK, MOST = 6.0, 0.05, 20


@dataclass(frozen=True, eq=False)
class Outcome:
    """Radiance (p, 3) at the judged points, and what it takes of memory where that is of interest (MiB)."""

    radiance: NDArray[np.floating]
    mib: float | None = None


@dataclass(frozen=True, eq=False)
class Setting:
    """See above. truth (p, 3); present: the value that the program has, None for none of them; cost: what the seconds
    are of; timed: False where the picture is computed in another way than the program does, so that its seconds would
    say nothing."""

    mode: Mode
    name: str
    values: Sequence[Any]
    make: Callable[[Any], Callable[[], Outcome]]
    truth: NDArray[np.floating]
    present: Any
    cost: str
    timed: bool = True


@dataclass(frozen=True)
class SettingRow:
    """One value: relRMSE and relative difference of means against brute force; seconds, the median, least and most of
    the repetitions (NaN where they say nothing); on_front: no other value of the setting is as quick and as right."""

    mode: Mode
    setting: str
    value: str
    error: float
    mean: float
    seconds: float
    least: float
    most: float
    mib: float | None
    present: bool
    on_front: bool
    cost: str


def measure_values(settings: Iterable[Setting], repetitions: int, report: Callable[[str], None]) -> list[SettingRow]:
    """Every value of every setting, in their order."""
    return [row for setting in settings if setting.values for row in _rows_of(setting, repetitions, report)]


def _rows_of(setting: Setting, repetitions: int, report: Callable[[str], None]) -> Iterator[SettingRow]:
    report(f"{setting.mode}: {setting.name}")
    if setting.timed and repetitions > 1:
        setting.make(setting.values[0])()  # compiled before anything is timed
    found = [(str(value), *_compute(setting, value, repetitions)) for value in setting.values]
    found_errors = [errors(outcome.radiance, setting.truth) for _, outcome, _ in found]
    costs = [statistics.median(seconds) for *_, seconds in found] if setting.timed else list(range(len(found)))
    front = pareto_front(costs, [each.rmse for each in found_errors])
    for (value, outcome, seconds), error, on_front in zip(found, found_errors, front, strict=True):
        spread = statistics.median(seconds), min(seconds), max(seconds)
        yield SettingRow(
            setting.mode, setting.name, value, error.rmse, error.mean, *spread, outcome.mib,
            value == str(setting.present), on_front, setting.cost,
        )  # fmt: skip


def _compute(setting: Setting, value: Any, repetitions: int) -> tuple[Outcome, list[float]]:
    """One value and the seconds of each of its repetitions: more where they are quick, fewer where they take long."""
    if not setting.timed:
        return setting.make(value)(), [NO_TIME]
    seconds: list[float] = []
    while not seconds or sum(seconds) < (LONG if len(seconds) < repetitions else QUICK) and len(seconds) < MOST:
        compute = setting.make(value)
        begun = time.process_time()
        outcome = compute()
        seconds.append(time.process_time() - begun)
    return outcome, seconds


def pareto_front(costs: Sequence[float], errors: Sequence[float]) -> list[bool]:
    """Which values no other one beats: none is as cheap and as right, and better in one of the two.

    Both smaller is better; equal values stand or fall together. NaN is beaten by everything.
    """
    points = [(float(c), float(e)) for c, e in zip(costs, errors, strict=True)]
    return [
        not any(math.isnan(x) for x in p) and not any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in points)
        for p in points
    ]


def rows_by_setting(rows: Sequence[SettingRow]) -> dict[str, dict[str, list[SettingRow]]]:
    """The rows by mode and setting."""
    found: dict[str, dict[str, list[SettingRow]]] = {}
    for row in rows:
        found.setdefault(row.mode, {}).setdefault(row.setting, []).append(row)
    return found


def write_settings(folder: Path, rows: Sequence[SettingRow], facts: Mapping[str, Any]) -> None:
    """settings.csv, one line a value; front.json: each setting's values that no other beats, the quickest first, by
    mode and name, with `facts` of the run."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(SettingRow))
    writer.writerows([_cell(value) for value in astuple(row)] for row in rows)
    save_file(folder / CSV, text.getvalue().encode())
    fronts = {
        mode: {name: _front(own) for name, own in by_name.items() if not math.isnan(own[0].seconds)}
        for mode, by_name in rows_by_setting(rows).items()
    }
    save_file(folder / FRONT, (json.dumps(dict(facts) | fronts, indent=2, allow_nan=False) + "\n").encode())


def _front(rows: Sequence[SettingRow]) -> dict[str, Any]:
    best = sorted((row for row in rows if row.on_front), key=lambda row: row.seconds)
    present = next((row.value for row in rows if row.present), None)
    stops = [{"value": row.value, "error": row.error, "seconds": row.seconds} for row in best]
    return {"present": present, "front": stops}


def _cell(value: object) -> str:
    if value is None or value != value:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
