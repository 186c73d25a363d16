"""The commands that write pictures: of a scene, of all around it, and of the window."""

from __future__ import annotations

import sys
import time
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import complain
from app.cli.frontend import Frontend
from app.cli.options import (
    Bounces,
    KeptView,
    Lights,
    Patches,
    Resolution,
    Rotation,
    Samples,
    Scene,
    Series,
    Time,
    Values,
    ViewName,
    assignments,
    window_size,
)
from app.cli.output import progress, tell_notes
from app.machine.paths import state_problem
from app.project import Project, open_project
from app.sources import find_source
from engine.colour import view_named
from engine.errors import InsituError
from engine.indirect.series import BounceSeries, parse_series
from engine.plan import N_LIGHTS, N_PATCHES
from engine.scene.builtin import DEFAULT_SCENE


class StillMode(Enum):
    """Whose engine draws a still."""

    PLACEMENT = "placement"
    ORBIT = "orbit"
    DEFORM = "deform"


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
    time_: Time = None,
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
    frames: Annotated[
        int | None,
        typer.Option(
            "--frames", metavar="N", min=1, max=10_000, help="N frames of the scene's animation, in a folder OUT/."
        ),
    ] = None,
) -> int:
    """Render a picture with the editor's engine, without a window."""
    if reference and mode is not StillMode.PLACEMENT:
        raise InsituError(f"--mode {mode.value} --reference: brute force is the judge of both, expected one of them")
    if mode is not StillMode.PLACEMENT and (series is not None or lights != N_LIGHTS):
        hint, name = "--lights" if series is None else "--series", mode.value.capitalize()
        raise typer.BadParameter(f"{name} cuts no lights and has no bands, expected --mode placement", param_hint=hint)
    chosen = None if series is None else parse_series(series)
    if bounces is not None:
        if chosen is not None and chosen.n_bounces != bounces:
            raise InsituError(f"--bounces {bounces} --series {series}: expected as many bounces in both")
        chosen = chosen or BounceSeries(bounces)
    if samples is not None and not reference:
        raise InsituError(f"--samples {samples}: transport takes no samples, expected --reference as well")
    values = assignments(set_, rotation, time_)
    if turntable is not None or frames is not None:
        _check_frames(turntable, frames, mode, reference, time_)
        project = open_project(scene, resolution, values, camera)
        return _frames(project, output, turntable, frames, mode, lights, patches, chosen, view)
    from app.stills import StillProgress, check_output, render_project, write_picture
    from engine.indirect.beyond import TOO_BRIGHT, is_beyond

    check_output(output)
    shown = None if view is None else view_named(view)
    if shown is not None and output.suffix.lower() == ".exr":
        raise InsituError(f"--view {view}: {output} holds light itself, expected a name that ends in .png")
    started = time.monotonic()
    project = open_project(scene, resolution, values, camera)
    noise: float | None = None
    with progress() as report:

        def follow(step: StillProgress) -> None:
            nonlocal noise
            noise = step.noise
            report(step.fraction, step.text)

        still = render_project(
            project, follow, n_lights=lights, n_patches=patches, reference=reference, series=chosen, n_samples=samples,
            estimates_error=True, mode=mode.value,
        )  # fmt: skip
    tell_notes(project)
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


def _check_frames(
    turntable: int | None, frames: int | None, mode: StillMode, reference: bool, time_: float | None
) -> None:
    """Refuses what does not go with many frames."""
    asked, other = (f"--turntable {turntable}", "orbit") if frames is None else (f"--frames {frames}", "deform")
    if turntable is not None and frames is not None:
        raise InsituError(f"--turntable {turntable} {asked}: expected one of them")
    if mode is not StillMode.PLACEMENT and mode.value != other:
        raise InsituError(f"{asked} --mode {mode.value}: expected --mode placement or {other}")
    if reference:
        raise InsituError(f"{asked} --reference: expected one of them")
    if frames is not None and time_ is not None:
        raise InsituError(f"{asked} --time {time_:g}: expected one of them")


def _frames(
    project: Project, output: Path, turntable: int | None, animation: int | None, mode: StillMode, lights: int,
    patches: int, series: BounceSeries | None, view: str | None,
) -> int:  # fmt: skip
    """Frames all around a scene or through its animation; those that are there already are kept."""
    from app.cli.turntable import Frames, animate, turn

    count, draw = (turntable or 0, turn) if animation is None else (animation, animate)
    started, frames = time.monotonic(), Frames.of(output, count)
    if view is not None and frames.ending == ".exr":
        raise InsituError(f"--view {view}: {output} holds light itself, expected a name that ends in .png")
    with progress() as report:
        drawn = draw(
            project, frames, lambda step: report(step.fraction, step.text), mode=mode.value, n_lights=lights,
            n_patches=patches, series=series, view=project.view if view is None else view_named(view),
        )  # fmt: skip
    tell_notes(project)
    kept = f", {count - drawn} were there" if drawn < count else ""
    print(f"{frames.folder}: {drawn} frames{kept}, {time.monotonic() - started:.1f} s")
    return 0


def screenshot(
    context: typer.Context,
    output: Annotated[Path, typer.Option("-o", "--output", help="UI.png; pictures of the script go beside it.")],
    scene: Scene = DEFAULT_SCENE,
    script: Annotated[Path | None, typer.Option("--script", help="A TOML list of edits to carry out first.")] = None,
    size: Annotated[tuple[int, int], typer.Option("--size", metavar="W H", callback=window_size)] = (1280, 800),
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
