"""What plans say that scenes will cost, against what they cost (`app.cli.precompute`): built-in ones, those with
references, and hills of more and more triangles."""

from __future__ import annotations

import csv
import io
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from app.cli.planning import plan_project
from app.cli.precompute import ActualCost, carry_out
from app.project.project import ProjectSpec, open_project
from app.system.atomic import save_file
from benchmarks.references import REFERENCES, reference_folder
from engine.planner import Plan
from engine.scene.builtin import builtin_scenes


@dataclass(frozen=True)
class PlanRow:
    """A scene, and of each cost what was planned and what it was; planning_seconds: what it took to say so."""

    scene: str
    resolution: str
    triangles: int
    bounces: int
    planned_seconds: float
    seconds: float
    planned_memory_mib: float
    memory_mib: float
    planned_disk_mib: float
    disk_mib: float
    planned_editing_mib: float
    editing_mib: float
    planning_seconds: float

    @property
    def errors(self) -> tuple[float, float, float, float]:
        """By how much time, memory, disk and what an editor holds were planned too high (or, below 0, too low), of what
        they were."""
        pairs = (
            (self.planned_seconds, self.seconds),
            (self.planned_memory_mib, self.memory_mib),
            (self.planned_disk_mib, self.disk_mib),
            (self.planned_editing_mib, self.editing_mib),
        )
        return tuple(planned / max(was, 1e-9) - 1.0 for planned, was in pairs)  # type: ignore[return-value]


@dataclass(frozen=True)
class PlanEffort:
    """Which scenes are planned and carried out: names or files of such, and rooms of so many triangles, a picture of
    so many pixels across and down, and bounces, that are made for it."""

    scenes: tuple[str, ...] = ()
    generated: tuple[tuple[int, tuple[int, int], int], ...] = (
        (10_000, (256, 256), 4),
        (100_000, (640, 480), 4),
        (1_000_000, (1920, 1080), 1),
    )


def measure_plans(effort: PlanEffort, output: Path, report: Callable[[str], None]) -> tuple[PlanRow, ...]:
    """The rows, as `planning.csv` has them; report gets a line for each."""
    rows: list[PlanRow] = []
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        sources = effort.scenes or (*builtin_scenes(), *_references())
        made = (write_hills(Path(folder), *each) for each in effort.generated)
        for source in (*sources, *made):
            rows.append(check(source))
            write_rows(output / "planning.csv", rows)
            time_off, memory_off, disk_off, held = (f"{100 * error:+.0f} %" for error in rows[-1].errors)
            report(f"plan of {rows[-1].scene}: time {time_off}, memory {memory_off}, disk {disk_off}, held {held}")
    return tuple(rows)


def _references() -> Iterator[str]:
    folder = reference_folder()
    if folder is not None:
        yield from (str(folder / f"{name}.toml") for name in sorted({name.split("_")[0] for name in REFERENCES}))


def check(source: str, resolution: tuple[int, int] | None = None) -> PlanRow:
    """Plan a scene and carry it out; resolution: None for its own. Raises InsituError."""
    started = time.process_time()
    project = open_project(source, resolution)
    opened = time.process_time() - started
    plan = plan_project(project, lambda step: None, opening_seconds=opened)
    planning = time.process_time() - started - opened
    scene = project.scene
    was = carry_out(ProjectSpec(source, resolution))
    return compared(source, plan, was, scene.resolution, len(scene.triangles), planning)


def compared(
    source: str, plan: Plan, was: ActualCost, resolution: tuple[int, int], n_triangles: int, planning_seconds: float
) -> PlanRow:
    """A plan with its cost beside what it took."""
    cost = plan.cost
    if cost is None:
        raise ValueError("expected a plan with its cost")
    return PlanRow(
        Path(source).stem, "{} x {}".format(*resolution), n_triangles, plan.settings.n_bounces or 1,
        cost.seconds, was.seconds,
        cost.memory_mib, was.memory_mib, cost.disk_mib, was.disk_mib, cost.editing_mib, was.editing_mib,
        planning_seconds,
    )  # fmt: skip


def write_rows(file: Path, rows: Sequence[PlanRow]) -> None:
    """The table as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([field.name for field in fields(PlanRow)])
    writer.writerows([f"{value:.2f}" if isinstance(value, float) else value for value in astuple(row)] for row in rows)
    save_file(file, text.getvalue().encode())


def write_hills(folder: Path, n_triangles: int, resolution: tuple[int, int], bounces: int) -> str:
    """A scene of hills with a glossy ball among them, under the sky; the name of its file."""
    n = round((n_triangles / 2) ** 0.5)
    name = f"hills_{2 * n * n}_{bounces}"
    z, x = np.mgrid[-4.0 : 4.0 : (n + 1) * 1j, -4.0 : 4.0 : (n + 1) * 1j]
    y = 0.4 * np.sin(1.7 * x) * np.cos(2.3 * z) + 0.03 * np.sin(19.0 * x + 5.0 * z) * np.sin(23.0 * z)
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    corners = np.stack([first, first + n + 1, first + 1, first + 1, first + n + 1, first + n + 2], axis=1)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {(n + 1) ** 2}\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    header += f"element face {2 * n * n}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.zeros(2 * n * n, [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, corners.reshape(-1, 3)
    vertices = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1).astype("<f4")
    save_file(folder / f"{name}.ply", header.encode() + vertices.tobytes() + faces.tobytes())
    gloss = 'layer = [{ model = "lambert", albedo = 0.2 }, { model = "rough_conductor", alpha = 0.2 }]'
    text = f"""version = 1
bounces = {bounces}
[camera]
position = [0, 3, 6]
target = [0, 0, 0]
fov_y = 45
resolution = [{resolution[0]}, {resolution[1]}]
[environment]
radiance = [0.8, 0.9, 1.0]
[[object]]
name = "hills"
mesh = "{name}.ply"
smooth = true
layer = [{{ model = "lambert", albedo = 0.5 }}]
[[object]]
name = "ball"
primitive = "sphere"
transform = [1.6, 0, 0, 0, 0, 1.6, 0, 0.9, 0, 0, 1.6, 0, 0, 0, 0, 1]
{gloss}
"""
    file = folder / f"{name}.toml"
    save_file(file, text.encode())
    return str(file)
