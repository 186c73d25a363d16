"""Output of commands: warnings, plans, costs, progress bars."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from app.cli.console import print_line
from app.project.project import Project
from app.system.memory import gib
from engine.core.errors import plain_line, plain_notes
from engine.planner import Plan, plan_lines

if TYPE_CHECKING:
    from app.cli.plan_check import ActualCost

Report = Callable[[float, str], None]


def print_project_notes(project: Project) -> None:
    """Print warnings about the scene and its light, and what was done about them."""
    environment = project.sky.environment
    print_notes((*project.scene.notes, *(() if environment is None else environment.notes)))


def print_notes(notes: Iterable[str]) -> None:
    """Print notes, a line each; of very many only the first."""
    for note in plain_notes(notes):
        print_line(f"note: {note}")


def describe_plan(plan: Plan) -> Iterator[str]:
    """A plan as aligned lines of text."""
    lines = list(plan_lines(plan))
    first, second = (max(len(line[i]) for line in lines) for i in (0, 1))
    for name, value, reason in lines:
        yield f"{name:<{first}}  {value:<{second}}  {reason}"
    if plan.cost is not None:
        cost = plan.cost
        yield (
            f"about {cost.seconds / cost.n_cores:.0f} s on {cost.n_cores} cores "
            f"({cost.seconds:.0f} s of processor time, "
            f"{cost.visibility_seconds:.0f} s of them shadows, {cost.indirect_seconds:.0f} s indirect light), "
            f"{cost.memory_mib:.0f} MiB of main memory, {cost.disk_mib:.0f} MiB on disk, "
            f"{cost.gpu_mib:.0f} MiB on the GPU (largest layer selected)"
        )
        yield f"measured on {cost.n_sampled:,} of {cost.n_points:,} points and a few windows: within about 30 %"


def memory_note(plan: Plan, free: int) -> str:
    """A warning where a plan needs more main memory than so many bytes, else "".

    An editor also holds what precomputation leaves on the disk.
    """
    if plan.cost is None:
        return ""
    precomputing, editing = plan.cost.memory_mib * 2**20, (plan.cost.memory_mib + plan.cost.disk_mib) * 2**20
    if editing <= free:
        return ""
    who = "to precompute it" if precomputing > free else "to edit it"
    needed = precomputing if precomputing > free else editing
    return f"{who} takes {gib(round(needed))} of main memory, {gib(free)} are free; give a smaller --resolution"


def describe_check(plan: Plan, was: ActualCost) -> str:
    """The actual cost of a plan that was carried out, as one line."""
    cost = plan.cost
    if cost is None:
        raise ValueError("expected a plan with its cost")
    pairs = (
        (was.seconds, cost.seconds, "s of processor time"),
        (was.memory_mib, cost.memory_mib, "MiB of main memory"),
        (was.disk_mib, cost.disk_mib, "MiB on disk"),
    )
    said = (f"{is_:.0f} {unit} (planned {100 * (planned / max(is_, 1e-9) - 1):+.0f} %)" for is_, planned, unit in pairs)
    return "carried out: " + ", ".join(said)


@contextmanager
def progress() -> Iterator[Report]:
    """A progress bar on standard error where that is a terminal; nothing otherwise."""
    if not sys.stderr.isatty():
        yield lambda fraction, text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)

        def report(fraction: float, text: str) -> None:
            if fraction < bar.tasks[0].completed - 0.01:
                bar.reset(task)  # another stage begins
            bar.update(task, completed=fraction, description=plain_line(text))

        yield report
