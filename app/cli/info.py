"""`insitu info`: what a file contains, and every property that is not shown; as aligned text or as JSON.

The JSON form is one object with `version`, `file`, `kind` and the keys of its kind, which docs/guides/files.md lists.
Keys are added from version to version; none is renamed or removed without a higher `version`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli.console import print_json, print_line
from app.cli.options import SCENE_HELP, progress
from app.document.looks import look_names
from app.document.sources import LIGHT_ENDINGS, find_source, likely_mapping, probe_size, source_of
from app.project.project import open_project
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.core.safe_files import resolved
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS

INFO_VERSION = 1
Report = Callable[[float, str], None]


@dataclass(frozen=True)
class FileInfo:
    """What a file contains: its kind, lines of text, and values for JSON."""

    kind: str
    lines: tuple[str, ...]
    values: dict[str, Any]


def info(
    file: Annotated[str, typer.Argument(help=f"{SCENE_HELP[:-1]}, or a measured BRDF.")],
    json: Annotated[bool, typer.Option("--json", help="Print JSON, with all names.")] = False,
) -> int:
    """Print what a file contains, and every property of it that is not shown."""
    with progress() as report:
        found = describe_file(file, report)
    if json:
        print_json({"version": INFO_VERSION, "file": file, "kind": found.kind, **found.values})
        return 0
    print_line(f"{file}: {found.kind}")
    for line in found.lines:
        print_line(line)
    return 0


def describe_file(name: str, report: Report) -> FileInfo:
    """Read a file, whatever its kind; report: takes the progress of what is slow. Raises InsituError."""
    ending = Path(name).suffix.lower()
    if ending in MEASURED_ENDINGS:
        return _describe_measured(name, report)
    if ending in LIGHT_ENDINGS:
        return _describe_environment(find_source(name))
    return _describe_scene(find_source(name))


def _describe_scene(name: str) -> FileInfo:
    """A scene, a mesh, or a session with its scene."""
    from dataclasses import replace

    from engine.scene.import_report import report_lines, report_scene, report_values

    project = open_project(name, (1, 1))  # the picture's size does not matter here
    environment = project.sky.environment
    found = report_scene(project.resting)
    found = replace(found, notes=(*found.notes, *project.notes, *(() if environment is None else environment.notes)))
    session = source_of(name).session
    if session is None:
        return FileInfo("scene", tuple(report_lines(found)), report_values(found))
    looks = look_names(project.document)
    values = {"scene": project.document.source, "looks": list(looks), **report_values(found)}
    lines = [f"of the scene {project.document.source}", *([f"looks       {', '.join(looks)}"] if looks else [])]
    return FileInfo("session", (*lines, *report_lines(found)), values)


def _describe_environment(name: str) -> FileInfo:
    from app.document.commands.light import MAPPING
    from engine.light.environment import load_environment

    mapping = likely_mapping(Path(name))
    environment = load_environment(name, mapping)
    width, height = probe_size(Path(name)) or environment.radiance.shape[1::-1]
    title = dict(zip(MAPPING.choices, MAPPING.titles, strict=True))[mapping]
    mean = [float(value) for value in environment.light_above[-1].mean(axis=0) / 2.0]  # over the sphere's solid angle
    largest = float(environment.radiance.max())
    lines = [
        f"size        {width} x {height}, {title.lower()}",
        f"radiance    mean {' '.join(f'{value:.4g}' for value in mean)} (red green blue), at most {largest:.4g}",
        *(f"note        {note}" for note in environment.notes),
    ]
    values = {
        "width": width, "height": height, "mapping": mapping, "mean": mean, "largest": largest,
        "notes": list(environment.notes),
    }  # fmt: skip
    return FileInfo("environment", tuple(lines), values)


def _describe_measured(name: str, report: Report) -> FileInfo:
    from app.files.brdf_files import import_lines
    from app.worker.cache import ArrayCache
    from engine.measured.tables import read_measurement

    measurement = run_to_end(read_measurement(resolved(Path(name)), ArrayCache()), lambda step: report(*step))
    if measurement.report is None:
        raise InsituError(f"{name}: no report on its fit, expected one")
    values = {
        "anisotropic": measurement.is_anisotropic, "highlight": measurement.highlight,
        "diffuse_strength": list(measurement.strengths[0]), "fit": asdict(measurement.report),
    }  # fmt: skip
    return FileInfo("measured BRDF", tuple(import_lines(measurement, cloth=False)), values)
