"""The command line: what each command takes, and nothing of how it is done.

Exit status: 0; 1, the work failed and one line on standard error says why and what to do; 2, usage (and no display to
open a window on); 130, Ctrl-C; 143, SIGTERM while measuring. Libraries of the engine are imported by the commands that
need them, never before.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from app.console import FAILED, INTERRUPTED, USAGE, complain
from app.frontend import Frontend
from app.paths import state_problem
from app.project import Project, open_project, parse_assignment
from app.sources import find_source
from engine.colour import view_named
from engine.errors import InsituError
from engine.indirect.series import MOST_BOUNCES, BounceSeries, parse_series
from engine.plan import FEWEST_LIGHTS, MOST_LIGHTS, N_LIGHTS, N_PATCHES, Plan, plan_lines
from engine.scene.builtin import DEFAULT_SCENE, builtin_scenes
from engine.scene.description import MAX_RESOLUTION

Report = Callable[[float, str], None]

cli = typer.Typer(
    name="insitu",
    help="A desktop editor for materials and light in their final placement.",
    epilog="`insitu` alone opens the editor; `insitu SCENE` opens it on a scene. SCENE is a scene.toml, a session, a "
    "mesh (.ply, .obj, .glb: it stands on a floor, in grey where it has no materials), an environment (.exr, .hdr: the "
    f"default scene under that light), or one of: {', '.join(builtin_scenes())}.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def run(arguments: Sequence[str], frontend: Frontend) -> int:
    """Carry out a command line; the exit status. Errors of the work itself are raised, see `console.guarded`."""
    arguments = list(arguments)
    command = typer.main.get_command(cli)
    first = next((word for word in arguments if not word.startswith("-")), None)
    if first is not None and first not in command.commands:  # type: ignore[attr-defined]
        arguments.insert(0, "edit")
    try:
        status = command.main(arguments, "insitu", standalone_mode=False, obj=frontend)
    except typer.Abort:
        return INTERRUPTED
    except Exception as error:
        if not hasattr(error, "format_message"):  # not the library's word for a wrong command line
            raise
        complain(f"{error.format_message()} (insitu --help says what there is)")
        return USAGE
    return status if isinstance(status, int) else 0


# ------------------------------------------------------------------------------------------------- what commands take


def _resolution(value: tuple[int, int] | None) -> tuple[int, int] | None:
    if value is not None and not all(1 <= side <= MAX_RESOLUTION for side in value):
        raise typer.BadParameter(f"{value[0]} x {value[1]}, expected 1 to {MAX_RESOLUTION} pixels each way")
    return value


def _size(value: tuple[int, int]) -> tuple[int, int]:
    if not (320 <= value[0] <= 8192 and 240 <= value[1] <= 8192):
        raise typer.BadParameter(f"{value[0]} x {value[1]}, expected 320 x 240 to 8192 x 8192")
    return value


SCENE_HELP = "A scene file, a session, a mesh, an environment, or a built-in scene's name."
Scene = Annotated[str, typer.Argument(help=SCENE_HELP)]
Values = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="For example teapot.1.alpha=0.3.")
]
Resolution = Annotated[
    tuple[int, int] | None,
    typer.Option("--resolution", metavar="W H", callback=_resolution, help="In place of the scene's own."),
]
_LIGHTS = typer.Option("--lights", min=FEWEST_LIGHTS, max=MOST_LIGHTS, help="Triangles that the sky is cut into.")
Lights = Annotated[int, _LIGHTS]
Patches = Annotated[
    int,
    typer.Option("--patches", min=FEWEST_LIGHTS, max=MOST_LIGHTS, help="Parts that lamps are cut into for shadows."),
]
ViewName = Annotated[
    str | None,
    typer.Option("--view", metavar="NAME", help="Filmic, AgX, ACES 2.0, ACES 1.3, Standard or False colour."),
]
KeptView = Annotated[
    str | None, typer.Option("--camera", metavar="NAME", help="Seen from the view that the session keeps so.")
]
Rotation = Annotated[float | None, typer.Option("--rotation", help="Of the environment, degrees about +Y.")]
Bounces = Annotated[
    int | None,
    typer.Option("--bounces", min=1, max=MOST_BOUNCES, help="Reflections between light and eye; the scene says too."),
]
Series = Annotated[
    str | None, typer.Option("--series", metavar="J,1,...", help="Bands of each bounce, from the eye: 64,1,1,1.")
]
Samples = Annotated[
    int | None,
    typer.Option("--samples", min=1, max=1 << 20, help="Paths a pixel of --reference; four times: half the noise."),
]


def _assignments(values: list[str] | None, rotation: float | None = None) -> list[tuple[str, Any]]:
    given = [parse_assignment(text) for text in values or ()]
    return given if rotation is None else [*given, ("light.rotation", rotation)]


# ---------------------------------------------------------------------------------------------------------- commands


@cli.command(hidden=True)
def edit(context: typer.Context, scene: Scene = DEFAULT_SCENE) -> int:
    """Open the editor (what `insitu SCENE` does)."""
    frontend: Frontend = context.obj
    return frontend.open_window(find_source(scene))


class StillMode(Enum):
    """Whose engine draws a still."""

    PLACEMENT = "placement"
    ORBIT = "orbit"


@cli.command()
def render(
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.exr (linear) or OUT.png (as on screen).")],
    scene: Scene = DEFAULT_SCENE,
    set_: Values = None,
    bounces: Bounces = None,
    series: Series = None,
    lights: Lights = N_LIGHTS,
    patches: Patches = N_PATCHES,
    resolution: Resolution = None,
    rotation: Rotation = None,
    reference: Annotated[
        bool, typer.Option("--reference", help="By brute force instead of transport: slow, to compare with.")
    ] = False,
    samples: Samples = None,
    view: ViewName = None,
    camera: KeptView = None,
    mode: Annotated[
        StillMode, typer.Option("--mode", help="The way to look whose engine draws it.")
    ] = StillMode.PLACEMENT,
    turntable: Annotated[
        int | None,
        typer.Option(
            "--turntable", metavar="N", min=1, max=10_000, help="N frames around the scene, in a folder OUT/."
        ),
    ] = None,
) -> int:
    """Render a picture with the editor's engine, without a window."""
    if reference and mode is not StillMode.PLACEMENT:
        raise InsituError(f"--mode {mode.value} --reference: brute force is the judge of both, expected one of them")
    if mode is StillMode.ORBIT and (series is not None or lights != N_LIGHTS):
        hint = "--lights" if series is None else "--series"
        raise typer.BadParameter("Orbit cuts no lights and has no bands, expected --mode placement", param_hint=hint)
    chosen = None if series is None else parse_series(series)
    if bounces is not None:
        if chosen is not None and chosen.n_bounces != bounces:
            raise InsituError(f"--bounces {bounces} --series {series}: expected as many bounces in both")
        chosen = chosen or BounceSeries(bounces)
    if samples is not None and not reference:
        raise InsituError(f"--samples {samples}: transport takes no samples, expected --reference as well")
    if turntable is not None:
        if reference:
            raise InsituError(f"--turntable {turntable} --reference: expected one of them")
        project = open_project(scene, resolution, _assignments(set_, rotation), camera)
        return _turntable(project, output, turntable, mode, lights, patches, chosen, view)
    from app.stills import StillProgress, check_output, render_project, write_picture
    from engine.indirect.beyond import TOO_BRIGHT, is_beyond

    check_output(output)
    shown = None if view is None else view_named(view)
    if shown is not None and output.suffix.lower() == ".exr":
        raise InsituError(f"--view {view}: {output} holds light itself, expected a name that ends in .png")
    started = time.monotonic()
    project = open_project(scene, resolution, _assignments(set_, rotation), camera)
    noise: float | None = None
    with _progress() as report:

        def follow(step: StillProgress) -> None:
            nonlocal noise
            noise = step.noise
            report(step.fraction, step.text)

        still = render_project(
            project, follow, n_lights=lights, n_patches=patches, reference=reference, series=chosen, n_samples=samples,
            estimates_error=True, mode=mode.value,
        )  # fmt: skip
    _tell_notes(project)
    picture, error = still.picture, still.error
    remains = "" if noise is None else f"noise {noise:.2%}"
    said = remains if error is None else error.text
    write_picture(output, picture, shown or project.view, said)
    if is_beyond(picture):
        print(TOO_BRIGHT, file=sys.stderr)
    line = f"{output}: {picture.shape[1]} x {picture.shape[0]}, {time.monotonic() - started:.1f} s"
    print(f"{line}, {said}" if said else line)
    if error is not None and error.is_poor:
        print(f"note: {error.advice}")
    if still.warning:
        print(f"note: {still.warning}")
    return 0


def _turntable(
    project: Project, output: Path, count: int, mode: StillMode, lights: int, patches: int,
    series: BounceSeries | None, view: str | None,
) -> int:  # fmt: skip
    """Frames all around a scene; those that are there already are kept."""
    from app.turntable import Frames, turn

    started, frames = time.monotonic(), Frames.of(output, count)
    if view is not None and frames.ending == ".exr":
        raise InsituError(f"--view {view}: {output} holds light itself, expected a name that ends in .png")
    with _progress() as report:
        drawn = turn(
            project, frames, lambda step: report(step.fraction, step.text), mode=mode.value, n_lights=lights,
            n_patches=patches, series=series, view=project.view if view is None else view_named(view),
        )  # fmt: skip
    _tell_notes(project)
    kept = f", {count - drawn} were there" if drawn < count else ""
    print(f"{frames.folder}: {drawn} frames{kept}, {time.monotonic() - started:.1f} s")
    return 0


@cli.command()
def precompute(
    scene: Scene = DEFAULT_SCENE, set_: Values = None, lights: Annotated[int | None, _LIGHTS] = None,
    resolution: Resolution = None,
) -> int:  # fmt: skip
    """Fill the cache, so that the editor opens the scene at once; of a session with as many lights as it has."""
    from app.precompute import precompute as fill

    started = time.monotonic()
    project = open_project(scene, resolution, _assignments(set_))
    with _progress() as report:
        done = fill(project, lambda progress: report(progress.fraction, f"{progress.stage}: {progress.text}"), lights)
    megabytes, seconds = done.n_bytes / 2**20, time.monotonic() - started
    print(f"{scene}: {megabytes:.0f} MiB of transport, {seconds:.1f} s, {done.error.text}")
    if done.error.is_poor:
        print(f"note: {done.error.advice}")
    return 0


@cli.command()
def screenshot(
    context: typer.Context,
    output: Annotated[Path, typer.Option("-o", "--output", help="UI.png; pictures of the script go beside it.")],
    scene: Scene = DEFAULT_SCENE,
    script: Annotated[Path | None, typer.Option("--script", help="A TOML list of edits to carry out first.")] = None,
    size: Annotated[tuple[int, int], typer.Option("--size", metavar="W H", callback=_size)] = (1280, 800),
    scale: Annotated[float, typer.Option("--scale", min=0.5, max=4.0, help="1 is 96 dots an inch.")] = 1.0,
    resolution: Resolution = None,
    view: ViewName = None,
) -> int:
    """Take a picture of the whole editor window; no display is needed."""
    from app.script import ChooseView, load_script
    from app.stills import check_output

    check_output(output, (".png",))
    steps = load_script(script, output.resolve().parent) if script is not None else ()
    if problem := state_problem():
        complain(problem)  # own materials are not there; the picture is
    if view is not None:
        steps = (ChooseView(view_named(view)), *steps)
    frontend: Frontend = context.obj
    frontend.take_screenshot(find_source(scene), output, steps, size, scale, resolution)
    print(f"{output}: {size[0]} x {size[1]}")
    return 0


@cli.command()
def plan(
    scene: Scene = DEFAULT_SCENE,
    set_: Values = None,
    overrule: Annotated[
        list[str] | None, typer.Option("--overrule", metavar="LINE=VALUE", help="For example teapot.1.theta_h=64.")
    ] = None,
    lights: Lights = N_LIGHTS,
    resolution: Resolution = None,
) -> int:
    """Say what the scene requires, why, and what it will cost."""
    from app.planning import plan_project

    project = open_project(scene, resolution, _assignments(set_))
    with _progress() as report:
        planned = plan_project(
            project, lambda step: report(step.fraction, step.text), n_lights=lights,
            overrides=dict(parse_assignment(text) for text in overrule or ()),
        )  # fmt: skip
    for line in describe_plan(planned):
        print(line)
    _tell_notes(project)
    return 0


@cli.command()
def measure(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for figures, CSV and plots.")],
    scene: Scene = DEFAULT_SCENE,
    quick: Annotated[bool, typer.Option("--quick", help="Tiny pictures, to see that all works.")] = False,
) -> int:
    """Measure speed against accuracy on this machine: CSV, plots, figures.json."""
    from app import measure as measuring
    from app.measure.ending import ended_in_order

    with ended_in_order():
        measuring.run(find_source(scene), output, quick)
    return 0


@cli.command("import-brdf")
def import_brdf(
    file: Annotated[Path, typer.Argument(help="A measured BRDF: MERL FILE.binary, Cornell FILE.brdf.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.toml, a material; scenes take its layers.")],
    smooth: Annotated[float, typer.Option("--smooth", min=0.0, max=1.0, help="Takes noise out of the curves.")] = 0.0,
    cloth: Annotated[bool, typer.Option("--cloth", help="One layer P(θi) Q(θh) P(θo) in place of two.")] = False,
) -> int:
    """Turn measured data into an editable material, and say how well its factors alone fit."""
    from app.brdf_files import import_file, import_lines
    from app.jobs.cache import Store

    started = time.monotonic()
    with _progress() as report:
        measurement = import_file(file, output, smooth, cloth, Store(), report)
    for line in import_lines(measurement, cloth):
        print(line)
    print(f"{output}: {file.name}, {time.monotonic() - started:.1f} s")
    return 0


@cli.command("export-brdf")
def export_brdf(
    scene: Annotated[str, typer.Argument(help=SCENE_HELP)],
    object_: Annotated[str, typer.Argument(metavar="OBJECT", help="Whose material is written.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.binary (a MERL table) or OUT.toml.")],
    set_: Values = None,
) -> int:
    """Write an object's material, all its layers and edits: as a table of 90 x 90 x 180 angles, or as it is."""
    from app.brdf_files import check_merl_name, export_steps
    from app.commands.maps import with_full_names
    from app.material_file import SUFFIX, Material, save_material
    from engine.render.tabulate import left_out

    as_it_is = output.suffix == SUFFIX
    if not as_it_is:
        check_merl_name(output)
    started = time.monotonic()
    document = open_project(scene, (1, 1), _assignments(set_)).document
    layers = document.object(object_).layers
    if as_it_is:
        save_material(output, Material(object_, with_full_names(layers, document.source)))
        print(f"{output}: {object_}, {len(layers)} layers")
        return 0
    with _progress() as report:
        for fraction in export_steps(layers, output):
            report(fraction, "evaluating the layers")
    for note in left_out(layers):
        print(f"note: {note}")
    print(f"{output}: {object_}, {len(layers)} layers, {time.monotonic() - started:.1f} s")
    return 0


@cli.command()
def export(
    scene: Annotated[str, typer.Argument(help=SCENE_HELP)],
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder to write.")],
    set_: Values = None,
    bounces: Bounces = None,
    resolution: Resolution = None,
) -> int:
    """Write a scene, edits and all, for Mitsuba 3, with a program that renders it."""
    from app.export.mitsuba import export_scene

    project = open_project(scene, resolution, _assignments(set_))
    with _progress() as report:
        notes = export_scene(project, output, bounces or project.scene.description.bounces or 1, report)
    for note in notes:
        print(f"note: {note}")
    print(f"{output}: scene.xml; python {output / 'render.py'} renders it where Mitsuba 3 is installed")
    return 0


@cli.command()
def doctor(context: typer.Context) -> int:
    """Say what works here and how to mend the rest."""
    from app.doctor import examine

    marks = {"ok": "ok     ", "without": "without", "broken": "BROKEN "}
    status = 0
    for finding in examine(context.obj):
        print(f"{marks[finding.state]} {finding.name}: {' '.join(finding.found.split())}", flush=True)
        if finding.mend:
            print(f"        to mend it: {finding.mend}")
        if finding.state == "broken":
            status = FAILED
    return status


# ------------------------------------------------------------------------------------------------ what a person reads


def _tell_notes(project: Project) -> None:
    """What was odd about the scene, and what was done about it."""
    for note in project.scene.notes:
        print(f"note: {note}")


def describe_plan(plan: Plan) -> Iterator[str]:
    """A plan as aligned lines of text."""
    lines = list(plan_lines(plan))
    first, second = (max(len(line[i]) for line in lines) for i in (0, 1))
    for name, value, reason in lines:
        yield f"{name:<{first}}  {value:<{second}}  {reason}"
    if plan.cost is not None:
        cost = plan.cost
        yield (
            f"about {cost.seconds:.0f} s ({cost.visibility_seconds:.0f} s of them shadows), "
            f"{cost.memory_mib:.0f} MiB of main memory, {cost.disk_mib:.0f} MiB on disk, "
            f"{cost.gpu_mib:.0f} MiB on the GPU (largest layer selected)"
        )
        yield (
            f"extrapolated from {cost.n_sampled:,} of {cost.n_points:,} points: time within about a factor of two, "
            "main memory within a third, what is stored within a tenth"
        )


@contextmanager
def _progress() -> Iterator[Report]:
    """A bar on standard error where a person looks at it; nothing otherwise."""
    if not sys.stderr.isatty():
        yield lambda fraction, text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)

        def report(fraction: float, text: str) -> None:
            if fraction < progress.tasks[0].completed - 0.01:
                progress.reset(task)  # another stage begins
            progress.update(task, completed=fraction, description=text)

        yield report
