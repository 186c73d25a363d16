"""`insitu` and its commands; each imports what it needs when it runs, never before."""

from __future__ import annotations

import importlib.metadata
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import FAILED, INTERRUPTED, USAGE, Frontend, print_error, print_line
from app.cli.contact_sheet import contact_sheet
from app.cli.diff import diff
from app.cli.exchange import export, export_brdf, import_brdf, save_environment, save_scene
from app.cli.info import info
from app.cli.match import match
from app.cli.options import (
    LIGHTS,
    Axis,
    Configuration,
    Lights,
    Override,
    Resolution,
    Scene,
    Scheduler,
    Up,
    Values,
    assignments,
    lines,
    oriented,
    print_project_notes,
    progress,
)
from app.cli.pictures import render, screenshot
from app.document.sources import find_source
from app.files.old_names import upgrade_arguments, upgrade_part
from app.project.project import ProjectSpec
from app.system.memory import available_memory
from engine.core.colour import ConfigView
from engine.core.colour_config import config_name
from engine.scene.builtin import DEFAULT_SCENE, builtin_scenes
from engine.scene.mesh import MESH_ENDINGS
from engine.settings import N_LIGHTS


def edit(context: typer.Context, scene: Scene = DEFAULT_SCENE, up: Up = Axis.Y, ocio: Configuration = None) -> int:
    """Open the editor (what `insitu SCENE` does)."""
    frontend: Frontend = context.obj
    view = None if ocio is None else ConfigView(config_name(ocio))
    return frontend.open_window(find_source(oriented(scene, up)), view)


def precompute(
    scene: Scene = DEFAULT_SCENE, set_: Values = None, lights: Annotated[int | None, LIGHTS] = None,
    resolution: Resolution = None, overrides: Override = None, scheduler: Scheduler = None, up: Up = Axis.Y,
) -> int:  # fmt: skip
    """Precompute the transport of a scene into the cache, so that the editor opens it at once."""
    from app.cli.precompute import precompute as fill
    from app.cluster.cluster_project import open_on_cluster

    started = time.monotonic()
    own = () if lights is None else (("n_lights", lights),)
    named = oriented(scene, up)
    words = ProjectSpec(named, resolution, tuple(assignments(set_)), None, own, tuple(lines(overrides).items()))
    with progress() as report, open_on_cluster(words, scheduler) as (project, cluster):
        done = fill(project, lambda step: report(step.fraction, f"{step.stage}: {step.text}"), cluster=cluster)
    megabytes, seconds = done.n_bytes / 2**20, time.monotonic() - started
    print_line(f"{scene}: {megabytes:.0f} MiB of transport, {seconds:.1f} s, {done.error.text}")
    if done.error.is_large:
        print_line(f"note: {done.error.advice}")
    return 0


def plan(
    scene: Scene = DEFAULT_SCENE,
    set_: Values = None,
    overrides: Override = None,
    lights: Lights = N_LIGHTS,
    resolution: Resolution = None,
    up: Up = Axis.Y,
    check: Annotated[
        bool, typer.Option("--check", help="Also carry it out, with an empty cache, and print what it cost.")
    ] = False,
) -> int:
    """Print what the scene requires: settings, reasons and cost."""
    from app.cli.planning import describe_check, describe_plan, memory_note, plan_project

    started = time.process_time()
    own = (("n_lights", lights),)
    named = oriented(scene, up)
    words = ProjectSpec(named, resolution, tuple(assignments(set_)), None, own, tuple(lines(overrides).items()))
    project = words.open()
    opening = time.process_time() - started
    with progress() as report:
        planned = plan_project(project, lambda step: report(step.fraction, step.text), opening_seconds=opening)
    for line in describe_plan(planned):
        print_line(line)
    if note := memory_note(planned, available_memory()):
        print_line(f"note: {note}")
    if check:
        from app.cli.precompute import carry_out

        print_line(describe_check(planned, carry_out(words)))
    print_project_notes(project)
    return 0


def measure(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for the report, CSV and plots.")],
    scene: Scene = DEFAULT_SCENE,
    up: Up = Axis.Y,
    quick: Annotated[
        bool, typer.Option("--quick", help="Tiny pictures and few values, to check that everything works.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="PART", help="One part only: settings (of all modes), placement, orbit or deform."
        ),
    ] = None,
) -> int:
    """Measure what each setting of a scene costs and brings: errors, seconds, the Pareto front."""
    from app.measure.study import FULL, PARTS, QUICK, ended_in_order, measure_settings

    with ended_in_order():
        effort, parts = QUICK if quick else FULL, [upgrade_part(name) for name in only or PARTS]
        measure_settings(find_source(oriented(scene, up)), output, effort, print_line, parts)
    return 0


def doctor(context: typer.Context) -> int:
    """Check what works on this computer, and say how to fix the rest."""
    from app.cli.doctor import examine

    marks = {"ok": "ok     ", "without": "without", "broken": "BROKEN "}
    status = 0
    for finding in examine(context.obj):
        print_line(f"{marks[finding.state]} {finding.name}: {' '.join(finding.found.split())}")
        if finding.mend:
            print_line(f"        to fix it: {finding.mend}")
        if finding.state == "broken":
            status = FAILED
    return status


cli = typer.Typer(
    name="insitu",
    help="A desktop editor for materials and light in their final placement.",
    epilog="`insitu` alone opens the editor; `insitu SCENE` opens it on a scene. SCENE is a scene.toml, a session, a "
    f"mesh ({', '.join(MESH_ENDINGS)}: it stands on a floor, in grey where it has no materials), a folder or a .zip "
    "with one of these, an environment (.exr, .hdr: the "
    f"default scene under that light), or one of: {', '.join(builtin_scenes())}.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def print_version(is_asked: bool) -> None:
    if is_asked:
        print_line(f"insitu {importlib.metadata.version('insitu')}")
        raise typer.Exit


@cli.callback()
def program_options(
    version: Annotated[
        bool, typer.Option("--version", callback=print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options in place of a command."""


cli.command(hidden=True)(edit)
cli.command()(render)
cli.command()(precompute)
cli.command()(screenshot)
cli.command()(plan)
cli.command()(info)
cli.command()(measure)
cli.command("import-brdf")(import_brdf)
cli.command("export-brdf")(export_brdf)
cli.command()(export)
cli.command("save-scene")(save_scene)
cli.command("contact-sheet")(contact_sheet)
cli.command()(diff)
cli.command()(match)
cli.command("save-environment")(save_environment)
cli.command()(doctor)


def run(arguments: Sequence[str], frontend: Frontend) -> int:
    """Carry out a command line; returns the exit status. Errors of the work itself are raised, see
    `console.run_guarded`."""
    arguments = upgrade_arguments(arguments)
    command = typer.main.get_command(cli)
    first = next((word for word in arguments if not word.startswith("-")), None)
    if first is not None and first not in command.commands:  # type: ignore[attr-defined]
        arguments.insert(0, "edit")
    try:
        status = command.main(arguments, "insitu", standalone_mode=False, obj=frontend)
    except typer.Abort:
        return INTERRUPTED
    except Exception as error:
        if not hasattr(error, "format_message"):  # if it is not the library's error for a wrong command line
            raise
        print_error(f"{error.format_message()} (see insitu --help)")
        return USAGE
    return status if isinstance(status, int) else 0
