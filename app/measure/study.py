"""`insitu measure`: the settings of all modes on one scene, speed against accuracy, into a folder; on what machine,
with what versions and under what load; and how it ends when it is stopped by Ctrl-C or SIGTERM."""

from __future__ import annotations

import contextlib
import importlib.metadata
import platform
import re
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import Any

import psutil

from app.measure import settings_deform, settings_orbit, settings_placement
from app.measure.report import write_report
from app.measure.settings import CSV, MODES, Setting, measure_values, write_settings
from app.measure.settings_deform import DeformValues, deform_settings
from app.measure.settings_orbit import OrbitValues, orbit_settings
from app.measure.settings_placement import PlacementValues, placement_settings
from app.measure.subject import Subject, at_most, open_subject
from app.project.project import Project, open_project
from app.system.atomic import make_folder_of, require_place
from app.system.memory import memory_bytes
from engine.core.errors import InsituError
from engine.core.threads import n_cores

PACKAGES = ("numpy", "scipy", "numba", "embreex", "OpenEXR", "moderngl", "glfw", "imgui-bundle")


def machine_facts() -> dict[str, Any]:
    """CPU, cores, memory, system, versions, date (UTC) and load as they are now."""
    return {
        "cpu": _first_match(Path("/proc/cpuinfo"), r"model name\s*:\s*(.+)") or platform.processor(),
        "cores": n_cores(),
        "ram_gib": round(memory_bytes()[1] / 2**30, 2),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: version for name in PACKAGES if (version := _version(name))},
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "load_average": load_average(),
    }


def load_average() -> list[float] | None:
    """Runnable processes over 1, 5 and 15 minutes; None where the system does not tell."""
    try:
        return list(psutil.getloadavg())
    except OSError:
        return None


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _first_match(file: Path, pattern: str) -> str | None:
    try:
        found = re.search(pattern, file.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return None
    return found.group(1).strip() if found else None


ENDINGS = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def ended_in_order() -> Iterator[None]:
    """Within the block both signals unwind the stack; a second one does not disturb what the first has set off.

    Raises KeyboardInterrupt on SIGINT and SystemExit with the status a shell gives (143) on SIGTERM. Main thread only.
    """

    def unwind(number: int, frame: FrameType | None) -> None:
        for ending in ENDINGS:
            signal.signal(ending, signal.SIG_IGN)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)

    before = {ending: signal.signal(ending, unwind) for ending in ENDINGS}
    try:
        yield
    finally:
        for ending, handler in before.items():
            signal.signal(ending, handler)


ALL = "settings"
PARTS: tuple[str, ...] = (ALL, *MODES)
# The parts that moved to `benchmarks/`.
MOVED = ("figures", "visibility", "planning")


@dataclass(frozen=True)
class StudyEffort:
    """Which values of each mode's settings are computed, and how often."""

    placement: PlacementValues = field(default_factory=PlacementValues)
    orbit: OrbitValues = field(default_factory=OrbitValues)
    deform: DeformValues = field(default_factory=DeformValues)
    repetitions: int = 3


FULL = StudyEffort()
QUICK = StudyEffort(settings_placement.QUICK, settings_orbit.QUICK, settings_deform.QUICK, 1)


def measure_settings(
    source: str, output: Path, effort: StudyEffort = FULL, report: Callable[[str], None] = print,
    only: Sequence[str] = (ALL,), others: Callable[[Subject, Project], Iterable[Setting]] | None = None,
) -> None:  # fmt: skip
    """Measure a scene (built-in name or file): settings.csv, front.json, report.md and its plots in a folder.

    report gets a line for each setting. only: which of `PARTS`, "settings" for all modes. others: settings to measure
    after those of the program, of the opened scene. Raises InsituError when the scene cannot be opened or there is no
    such part.
    """
    for name in only:
        if name in MOVED:
            raise InsituError(f"{name!r} measures the project, not a scene: `make measure` of the sources has it")
        if name not in PARTS:
            raise InsituError(f"no part {name!r}, expected one of {', '.join(PARTS)}")
    make_folder_of(output / CSV)
    require_place(output / CSV)
    facts, subject = machine_facts(), open_subject(source)
    resolution = at_most(subject.scene.resolution, effort.placement.side)
    subject = replace(subject, scene=replace(subject.scene, resolution=resolution))
    project = open_project(source, resolution)
    by_mode: dict[str, Callable[[], Iterable[Setting]]] = {
        "placement": lambda: placement_settings(subject, effort.placement),
        "orbit": lambda: orbit_settings(subject, project, effort.orbit),
        "deform": lambda: deform_settings(effort.deform),
    }
    settings = chain.from_iterable(by_mode[mode]() for mode in MODES if ALL in only or mode in only)
    rows = measure_values(chain(settings, others(subject, project) if others else ()), effort.repetitions, report)
    context = {
        "scene": subject.scene.description.name,
        "resolution": list(resolution),
        "repetitions": effort.repetitions,
        "machine": facts,
        "load_average_after": load_average(),
    }
    write_settings(output, rows, context)
    write_report(output, rows, context)
