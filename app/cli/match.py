"""The command that finds the material of an object that a photograph shows."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import print_line
from app.cli.options import SCENE_HELP, Bounces, Values, assignments, print_notes, print_project_notes, progress
from app.document.sources import source_of
from app.document.view_state import ViewState
from app.project.project import open_project, session_of
from app.system.atomic import require_place, set_inputs
from engine.core.errors import InsituError
from engine.core.generators import run_to_end

if TYPE_CHECKING:
    from engine.inverse.camera_fit import PointPair

Mask = Annotated[
    Path | None, typer.Option("--mask", help="A picture of the photograph's size, black where that does not count.")
]
Pairs = Annotated[
    list[str] | None,
    typer.Option(
        "--pair", metavar="C,R=X,Y,Z",
        help="A pixel of the photograph, and the point of the scene there, metres; four or more align the camera.",
    ),
]  # fmt: skip
Finds = Annotated[
    list[str] | None,
    typer.Option("--find", metavar="LAYER.NAME", help="A curve, a scale or a parameter, such as 0.theta_h; several."),
]


def match(
    scene: Annotated[str, typer.Argument(help=SCENE_HELP)],
    object_: Annotated[str, typer.Argument(metavar="OBJECT", help="Whose material is found.")],
    photo: Annotated[Path, typer.Argument(help="Taken in the light of the scene: EXR, HDR, PNG, JPEG or WebP.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="OUT.insitu: a session with what was found.")
    ] = None,
    transfer: Annotated[
        str, typer.Option("--transfer", metavar="CURVE", help="Of whole numbers: srgb, linear or a gamma.")
    ] = "srgb",
    pairs: Pairs = None,
    mask: Mask = None,
    finds: Finds = None,
    exposure: Annotated[
        float | None,
        typer.Option("--exposure", metavar="FACTOR", help="From radiance to the photograph; found where not given."),
    ] = None,
    rotation: Annotated[bool, typer.Option("--rotation", help="Find how the environment was turned.")] = False,
    lights: Annotated[bool, typer.Option("--lights", help="Find how strong each light was.")] = False,
    bounces: Bounces = None,
    side: Annotated[
        int, typer.Option("--side", metavar="PIXELS", help="The longer side of the picture that is compared.")
    ] = 1024,
    start: Annotated[
        str, typer.Option("--start", metavar="MATERIAL", help="Of the library, to begin with; else the object's own.")
    ] = "",
    set_: Values = None,
) -> int:  # fmt: skip
    """Find the material of an object from a photograph in the scene's light, and print how near it comes."""
    from app.files.session import save_session
    from app.photo.photo_match import match_photo
    from app.photo.photo_request import PhotoRequest

    started = time.monotonic()
    request = PhotoRequest(
        object_, photo, transfer, tuple(map(pair_of, pairs or ())), mask, tuple(finds or ()), exposure, rotation,
        lights, bounces, side, start,
    )  # fmt: skip
    if output is not None:
        set_inputs((photo,))
        require_place(output)
    project = open_project(scene, None, assignments(set_))
    print_project_notes(project)
    with progress() as report:
        outcome = run_to_end(match_photo(project, request), lambda step: report(step.fraction, step.text))
    for line in outcome.lines:
        print_line(line)
    print_notes(outcome.notes)
    if output is not None:
        session = session_of(source_of(scene))
        view = ViewState() if session is None else session.view
        camera = view.camera if outcome.camera is None else outcome.camera.camera
        view = replace(view, camera=camera, resolution=outcome.resolution)
        output = save_session(output, outcome.edit.apply(project.document), view)
    print_line(f"{output or photo}: {object_}, {time.monotonic() - started:.1f} s")
    return 0


def pair_of(text: str) -> PointPair:
    """The pair that "C,R=X,Y,Z" means. Raises InsituError."""
    from engine.inverse.camera_fit import PointPair

    place, _, point = text.partition("=")
    try:
        column, row = (float(number) for number in place.split(","))
        x, y, z = (float(number) for number in point.split(","))
    except ValueError:
        raise InsituError(f"pair = {text!r}, expected C,R=X,Y,Z: a pixel, and a point in metres") from None
    return PointPair((column, row), (x, y, z))
