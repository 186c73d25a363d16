"""Options that more than one command has, and the output that commands share: notes and progress bars."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import Annotated, Any

import typer

from app.cli.console import print_line
from app.document.scene_files import has_variants, with_axis, with_variants
from app.project.assignments import parse_assignment
from app.project.project import Project
from engine.core.colour import AnyView, ConfigView, find_view
from engine.core.errors import plain_line, plain_notes
from engine.precompute.indirect.sampling_settings import MOST_BOUNCES
from engine.scene.description import MAX_RESOLUTION
from engine.scene.variant_choice import parse_choices
from engine.settings import SETTINGS


def picture_size(value: tuple[int, int] | None) -> tuple[int, int] | None:
    """Check a picture's resolution, and return it. Raises BadParameter for one that no picture can have."""
    if value is not None and not all(1 <= side <= MAX_RESOLUTION for side in value):
        raise typer.BadParameter(f"{value[0]} x {value[1]}, expected 1 to {MAX_RESOLUTION} pixels per side")
    return value


def window_size(value: tuple[int, int]) -> tuple[int, int]:
    """Check a window's size, and return it. Raises BadParameter for one that no window can have."""
    if not (320 <= value[0] <= 8192 and 240 <= value[1] <= 8192):
        raise typer.BadParameter(f"{value[0]} x {value[1]}, expected 320 x 240 to 8192 x 8192")
    return value


def setting_option(name: str, most: int | None = None) -> Any:
    """The option of a render setting."""
    setting = SETTINGS[name]
    if isinstance(setting.values, range):
        least, greatest = setting.values[0], most or setting.values[-1]
        return typer.Option(setting.option, min=least, max=greatest, help=setting.help)
    *some, last = setting.values
    help_text = f"{setting.help[:-1]}: {', '.join(map(str, some))} or {last}."
    return typer.Option(setting.option, metavar="N", help=help_text)


class Axis(StrEnum):
    """The axis of a mesh that points up."""

    Y = "y"
    Z = "z"


SCENE_HELP = (
    "A scene file, a session, a mesh, a folder or a zip archive with one of these, an environment, or a built-in "
    "scene's name."
)
Scene = Annotated[str, typer.Argument(help=SCENE_HELP)]
Up = Annotated[Axis, typer.Option("--up", help="The axis of a mesh that points up; glTF, USD, 3MF and COLLADA say it.")]
Values = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="For example teapot.1.alpha=0.3.")
]
Resolution = Annotated[
    tuple[int, int] | None,
    typer.Option("--resolution", metavar="W H", callback=picture_size, help="In place of the scene's own."),
]
LIGHTS = setting_option("n_lights")
Lights = Annotated[int, LIGHTS]
Patches = Annotated[int, setting_option("n_patches")]
ViewName = Annotated[
    str | None,
    typer.Option("--view", metavar="NAME", help="Filmic, AgX, ACES 2.0, ACES 1.3, Standard or False colour."),
]
Configuration = Annotated[
    str | None,
    typer.Option(
        "--ocio", metavar="FILE", help="An OpenColorIO configuration; --view names a view of it, or DISPLAY: VIEW."
    ),
]
Exposure = Annotated[
    float | None,
    typer.Option(
        "--exposure", metavar="STOPS", min=-20.0, max=20.0, help="Of a PNG: twice as bright for each stop. Default 0."
    ),
]
Gamma = Annotated[
    float | None,
    typer.Option("--gamma", metavar="G", min=0.2, max=5.0, help="Of a PNG: its colours to the power of 1 / G."),
]
CropSides = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option(
        "--crop", metavar="X0 Y0 X1 Y1",
        help="A part of the picture: fractions from its upper left corner. EXR files keep its place in the whole.",
    ),
]  # fmt: skip
SavedView = Annotated[
    str | None, typer.Option("--camera", metavar="NAME", help="A view saved in the session, or a camera of the file.")
]
Rotation = Annotated[float | None, typer.Option("--rotation", help="Of the environment about +Y, in degrees.")]
Time = Annotated[
    float | None, typer.Option("--time", metavar="SECONDS", help="Time in the scene's animation; it repeats.")
]
Variant = Annotated[
    str | None,
    typer.Option(
        "--variant", metavar="NAME", help="A variant of the scene's materials, as in its file; of a stage SET=NAME."
    ),
]
LookName = Annotated[str | None, typer.Option("--look", metavar="NAME", help="A look of the session.")]
# Path tracing follows more bounces than the view shows.
Bounces = Annotated[int | None, setting_option("n_bounces", most=MOST_BOUNCES)]
Series = Annotated[
    str | None,
    typer.Option(
        "--series", metavar="J,1,...", help="Bands of each bounce, from the camera: 64,8,1,1; direct+1,1,1,1."
    ),
]
Edges = Annotated[int | None, setting_option("n_edge_rays")]
Nodes = Annotated[int | None, setting_option("n_map_nodes")]
Override = Annotated[
    list[str] | None,
    typer.Option("--override", metavar="LINE=VALUE", help="Override a line of `insitu plan`: teapot.1.theta_h=64."),
]
Accuracy = Annotated[
    float | None,
    typer.Option("--accuracy", min=0.0, max=1.0, help="0 is fastest, 1 most accurate; sets all quality options."),
]
Scheduler = Annotated[
    str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A Dask cluster to compute on, HOST:PORT.")
]
Samples = Annotated[
    int | None,
    typer.Option("--samples", min=1, max=1 << 20, help="Paths per pixel of --reference."),
]


def oriented(scene: str, up: Axis, variant: str | None = None) -> str:
    """The scene's name with the axis of its mesh that points up, and with what is chosen of the sets of a stage."""
    scene = with_axis(scene, "z") if up is Axis.Z else scene
    return with_variants(scene, chosen_of_sets(scene, variant))


def chosen_of_sets(scene: str, variant: str | None) -> dict[str, str]:
    """The variants of sets of a stage that are chosen, by the names of these; none where it is one of materials."""
    chosen = parse_choices(variant or "")
    return chosen if chosen is not None and has_variants(scene) else {}


def chosen_view(view: str | None, config: str | None) -> AnyView | None:
    """The view transform that options name; None for the project's own. Raises LoadError."""
    if config is None:
        return None if view is None else find_view(view)
    from engine.core.colour_config import config_name, resolve_view  # late: few commands read one

    return resolve_view(ConfigView(config_name(config), view=view or ""))


def lines(overrides: list[str] | None) -> dict[str, Any]:
    """The overrides of the plan, by line."""
    return dict(parse_assignment(text) for text in overrides or ())


def assignments(
    values: list[str] | None, rotation: float | None = None, time: float | None = None, variant: str | None = None,
    look: str | None = None,
) -> list[tuple[str, Any]]:  # fmt: skip
    """Path and value of each assignment; look and variant first, whose layers others may change."""
    given = [parse_assignment(text) for text in values or ()]
    own = {"light.rotation": rotation, "time": time}
    first = [(path, name) for path, name in (("look", look), ("variant", variant)) if name is not None]
    return [*first, *given, *((path, value) for path, value in own.items() if value is not None)]


Report = Callable[[float, str], None]


def print_project_notes(project: Project) -> None:
    """Print warnings about the scene and its light, and what was done about them."""
    environment = project.sky.environment
    print_notes((*project.notes, *project.scene.notes, *(() if environment is None else environment.notes)))


def print_notes(notes: Iterable[str]) -> None:
    """Print notes, a line each; of very many only the first."""
    for note in plain_notes(notes):
        print_line(f"note: {note}")


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
