"""The commands that write pictures: of a scene, of a turn around it, and of the window."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.console import Frontend, print_error, print_line
from app.cli.options import (
    Accuracy,
    Axis,
    Bounces,
    Configuration,
    CropSides,
    Edges,
    Exposure,
    Gamma,
    Lights,
    LookName,
    Nodes,
    Override,
    Patches,
    Resolution,
    Rotation,
    Samples,
    SavedView,
    Scene,
    Scheduler,
    Series,
    Time,
    Up,
    Values,
    Variant,
    ViewName,
    assignments,
    chosen_of_sets,
    chosen_view,
    lines,
    oriented,
    print_project_notes,
    progress,
    window_size,
)
from app.document.sources import find_source
from app.project.project import ProjectSpec
from app.system.atomic import require_folder, require_place
from app.system.paths import state_problem
from engine.core.colour import AnyView, find_view
from engine.core.errors import InsituError
from engine.precompute.indirect.sampling_settings import BounceSeries, parse_series
from engine.scene.builtin import DEFAULT_SCENE
from engine.settings import DEFAULT_SETTINGS, MODE_LINES, N_LIGHTS, N_PATCHES

if TYPE_CHECKING:
    from app.stills.frame_sequence import Frames
    from app.stills.stills import Shown
    from engine.render.crop import Crop


class StillMode(Enum):
    """The mode whose engine draws a still."""

    PLACEMENT = "placement"
    ORBIT = "orbit"
    DEFORM = "deform"


def render(
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.exr (linear) or OUT.png (as on screen).")],
    scene: Scene = DEFAULT_SCENE,
    up: Up = Axis.Y,
    set_: Values = None,
    bounces: Bounces = None,
    series: Series = None,
    lights: Lights = N_LIGHTS,
    patches: Patches = N_PATCHES,
    resolution: Resolution = None,
    rotation: Rotation = None,
    time_: Time = None,
    variant: Variant = None,
    look: LookName = None,
    reference: Annotated[bool, typer.Option("--reference", help="By brute force instead of transport: slow.")] = False,
    edges: Edges = None,
    nodes: Nodes = None,
    overrides: Override = None,
    samples: Samples = None,
    view: ViewName = None,
    ocio: Configuration = None,
    camera: SavedView = None,
    mode: Annotated[StillMode, typer.Option("--mode", help="The mode whose engine renders it.")] = StillMode.PLACEMENT,
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
    scheduler: Scheduler = None,
    accuracy: Accuracy = None,
    aovs: Annotated[
        bool, typer.Option("--aovs", help="With layers: each light, direct and indirect light, masks, normals, depth.")
    ] = False,
    exposure: Exposure = None,
    gamma: Gamma = None,
    crop: CropSides = None,
) -> int:
    """Render a picture with the editor's engine, without a window."""
    from app.stills.stills import Shown
    from engine.render.crop import Crop

    part = None if crop is None else Crop.checked(crop, "--crop")
    _check_display(output, exposure, gamma, part, frames if turntable is None else turntable)
    written = Shown(exposure or 0.0, 1.0 if gamma is None else gamma, part)
    if aovs:
        _check_layers(output, mode, reference, turntable, frames)
    shown = chosen_view(view, ocio)
    _check_view(output, view, ocio)
    if reference and mode is not StillMode.PLACEMENT:
        raise InsituError(f"--mode {mode.value} --reference: brute force is their reference, expected one of them")
    if mode is not StillMode.PLACEMENT and (series is not None or lights != N_LIGHTS):
        hint, name = "--lights" if series is None else "--series", mode.value.capitalize()
        raise typer.BadParameter(f"{name} cuts no lights and has no bands, expected --mode placement", param_hint=hint)
    settings: dict[str, Any] = {"n_lights": lights, "n_patches": patches}
    if accuracy is not None:
        settings |= _settings_at(accuracy, mode, reference, settings)
    chosen = None if series is None else parse_series(series)
    if bounces is not None:
        if chosen is not None and chosen.n_bounces != bounces:
            raise InsituError(f"--bounces {bounces} --series {series}: expected as many bounces in both")
        chosen = chosen or BounceSeries(bounces)
    planned = lines(overrides)
    if n_hemisphere_rays := settings.pop("n_hemisphere_rays", 0):
        planned = {"rays": n_hemisphere_rays, **planned}
    _check_lines(planned, mode, reference)
    if "precision" in planned:
        raise InsituError("--override precision: a still is made in single floats, expected another line of the plan")
    if samples is not None and not reference:
        raise InsituError(f"--samples {samples}: transport takes no samples, expected --reference as well")
    values = assignments(set_, rotation, time_, None if chosen_of_sets(scene, variant) else variant, look)
    if (turntable is not None or frames is not None) and mode is not StillMode.PLACEMENT and accuracy is not None:
        many = "--turntable" if frames is None else "--frames"
        raise InsituError(f"--accuracy {accuracy:g} {many}: expected --mode placement, or one picture")
    own = tuple((name, n) for name, n in (("n_edge_rays", edges), ("n_map_nodes", nodes)) if n is not None)
    words = ProjectSpec(oriented(scene, up, variant), resolution, tuple(values), camera, own, tuple(planned.items()))
    if turntable is not None or frames is not None:
        from app.stills.frame_sequence import Frames

        _check_frames(turntable, frames, mode, reference, time_)
        count, animated = (frames, True) if turntable is None else (turntable, False)
        requested = Frames(count or 0, animated, mode.value, tuple(settings.items()), chosen)
        return _frames(words, output, requested, shown, scheduler)
    if scheduler is not None:
        raise InsituError(
            f"--scheduler {scheduler}: one picture is drawn here, expected --turntable or --frames as well"
        )
    how = {"series": chosen, **settings}
    if not aovs:
        how |= {"reference": reference, "n_samples": samples, "mode": mode.value, "estimates_error": True, "crop": part}
    return _still(words, output, shown, how, aovs, written)


def _still(
    words: ProjectSpec, output: Path, view: AnyView | None, how: Mapping[str, Any], aovs: bool, written: Shown
) -> int:
    """Draw one picture, with its layers or without; how: as `render_layers` or `render_project` takes it."""
    from app.stills.picture_layers import render_layers
    from app.stills.stills import StillProgress, check_output, render_project, write_picture
    from engine.core.clamping import TOO_BRIGHT, is_clamped
    from engine.render.crop import cropped

    check_output(output)
    started = time.monotonic()
    project = words.open()
    require_place(output)  # now the files that were read are known
    noise: float | None = None
    with progress() as report:

        def follow(step: StillProgress) -> None:
            nonlocal noise
            noise = step.noise
            report(step.fraction, step.text)

        still = (render_layers if aovs else render_project)(project, follow, **how)
    print_project_notes(project)
    picture, error = still.picture, still.error
    remains = "" if noise is None else f"noise {noise:.2%}"
    said = remains if error is None else error.text
    write_picture(output, picture, view or project.view, said, still.layers, written)
    picture = cropped(picture, written.crop)
    if is_clamped(picture):
        print(TOO_BRIGHT, file=sys.stderr)
    line = f"{output}: {picture.shape[1]} x {picture.shape[0]}, {time.monotonic() - started:.1f} s"
    print_line(f"{line}, {said}" if said else line)
    if error is not None and error.advice:
        print_line(f"note: {error.advice}")
    if still.warning:
        print_line(f"note: {still.warning}")
    return 0


def _check_view(output: Path, view: str | None, ocio: str | None) -> None:
    """Refuse a view of light itself."""
    given = f"--view {view}" if view is not None else f"--ocio {ocio}"
    if (view is not None or ocio is not None) and output.suffix.lower() == ".exr":
        raise InsituError(f"{given}: {output} holds light itself, expected a name that ends in .png")


def _check_display(
    output: Path, exposure: float | None, gamma: float | None, crop: Crop | None, n_frames: int | None
) -> None:
    """Refuse exposure and gamma of light itself, and what frames do not have."""
    for name, value in (("--exposure", exposure), ("--gamma", gamma)):
        if value is not None and output.suffix.lower() == ".exr":
            raise InsituError(f"{name} {value:g}: {output} holds light itself, expected a name that ends in .png")
        if value is not None and n_frames is not None:
            raise InsituError(f"{name} {value:g}: expected one picture, without --turntable and --frames")
    if crop is not None and n_frames is not None:
        raise InsituError("--crop: expected one picture, without --turntable and --frames")


def _check_layers(output: Path, mode: StillMode, reference: bool, turntable: int | None, frames: int | None) -> None:
    """Refuse what has no layers."""
    if output.suffix.lower() != ".exr":
        raise InsituError(f"--aovs: {output} holds one picture, expected a name that ends in .exr")
    others = {
        f"--mode {mode.value}": mode is not StillMode.PLACEMENT, "--reference": reference,
        f"--turntable {turntable}": turntable is not None, f"--frames {frames}": frames is not None,
    }  # fmt: skip
    for other in (name for name, is_given in others.items() if is_given):
        raise InsituError(f"--aovs {other}: layers are those of one picture of Placement, expected one of them")


def _settings_at(accuracy: float, mode: StillMode, reference: bool, chosen: Mapping[str, int]) -> Mapping[str, int]:
    """The settings of the mode by name, as one number sets them."""
    if reference or any(value != getattr(DEFAULT_SETTINGS, name) for name, value in chosen.items()):
        other = "--reference" if reference else "--lights, --patches"
        raise InsituError(f"--accuracy {accuracy:g} {other}: expected one of them")
    from app.document.pareto_front import load_front

    return dict(load_front().nearest_point(mode.value, accuracy).settings)


def _check_lines(planned: Mapping[str, Any], mode: StillMode, reference: bool) -> None:
    """Refuse lines of the plan that the picture does not depend on."""
    if planned and reference:
        raise InsituError(f"--override {next(iter(planned))} --reference: expected one of them")
    for line in planned:
        own = MODE_LINES.get(mode.value)
        if own is not None and line not in ("bounces", "nodes", *own):
            expected = ", ".join(("bounces", "nodes", *own))
            raise InsituError(f"--override {line} --mode {mode.value}: expected a line that it goes by: {expected}")
        if own is None and any(line in lines for lines in MODE_LINES.values()):
            needed = next(mode for mode, lines in MODE_LINES.items() if line in lines)
            raise InsituError(f"--override {line}: expected --mode {needed} as well")


def _check_frames(
    turntable: int | None, frames: int | None, mode: StillMode, reference: bool, time_: float | None
) -> None:
    """Refuse options that do not go with many frames."""
    requested, other = (f"--turntable {turntable}", "orbit") if frames is None else (f"--frames {frames}", "deform")
    if turntable is not None and frames is not None:
        raise InsituError(f"--turntable {turntable} {requested}: expected one of them")
    if mode is not StillMode.PLACEMENT and mode.value != other:
        raise InsituError(f"{requested} --mode {mode.value}: expected --mode placement or {other}")
    if reference:
        raise InsituError(f"{requested} --reference: expected one of them")
    if frames is not None and time_ is not None:
        raise InsituError(f"{requested} --time {time_:g}: expected one of them")


def _frames(words: ProjectSpec, output: Path, frames: Frames, view: AnyView | None, scheduler: str | None) -> int:
    """Draw frames around a scene or through its animation; existing ones are reused."""
    from app.cli.turntable import FrameFiles, draw_frames
    from app.cluster.cluster_project import open_on_cluster
    from app.stills.frame_sequence import draw_here

    started, files = time.monotonic(), FrameFiles.of(output, frames.count)
    require_folder(files.folder)  # before the scene is read and workers are waited for
    with progress() as report, open_on_cluster(words, scheduler) as (project, cluster):
        drawn, error = draw_frames(
            project, frames, files, lambda step: report(step.fraction, step.text),
            project.view if view is None else view, draw_here if cluster is None else cluster.draw,
        )  # fmt: skip
    print_project_notes(project)
    kept = f", {frames.count - drawn} were there" if drawn < frames.count else ""
    print_line(f"{files.folder}: {drawn} frames{kept}, {time.monotonic() - started:.1f} s")
    if error:
        print_line(f"note: {error}")
    return 0


def screenshot(
    context: typer.Context,
    output: Annotated[Path, typer.Option("-o", "--output", help="UI.png; the script saves its pictures beside it.")],
    scene: Scene = DEFAULT_SCENE,
    up: Up = Axis.Y,
    script: Annotated[Path | None, typer.Option("--script", help="A TOML list of edits to carry out first.")] = None,
    size: Annotated[tuple[int, int], typer.Option("--size", metavar="W H", callback=window_size)] = (1280, 800),
    scale: Annotated[float, typer.Option("--scale", min=0.5, max=4.0, help="1 is 96 dots per inch.")] = 1.0,
    resolution: Resolution = None,
    view: ViewName = None,
    ocio: Configuration = None,
    variant: Variant = None,
    look: LookName = None,
) -> int:
    """Take a picture of the whole editor window; no display is needed."""
    from app.operators.inspect import ConfiguredView
    from app.operators.script import WRITTEN_FILES, Step, load_script
    from app.stills.stills import check_output

    check_output(output, (".png",))
    steps = load_script(script, Path(os.path.abspath(output)).parent) if script is not None else ()
    for step in steps:
        if step.name in ("capture", "picture"):
            check_output(step.value, WRITTEN_FILES[step.name])
    if problem := state_problem():
        print_error(problem)  # the user's own materials are missing; the picture is made
    if variant is not None and not chosen_of_sets(scene, variant):
        steps = (Step("set", {"variant": variant}), *steps)
    if look is not None:
        steps = (Step("look", look), *steps)
    if ocio is not None:
        steps = (Step("ocio", ConfiguredView(config=ocio, view=view or "")), *steps)
    elif view is not None:
        steps = (Step("view", find_view(view)), *steps)
    frontend: Frontend = context.obj
    frontend.take_screenshot(find_source(oriented(scene, up, variant)), output, steps, size, scale, resolution)
    print_line(f"{output}: {size[0]} x {size[1]}")
    return 0
