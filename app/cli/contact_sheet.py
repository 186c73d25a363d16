"""`insitu contact-sheet`: all looks of a session on one page."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import print_line
from app.cli.options import (
    Axis,
    Configuration,
    Resolution,
    SavedView,
    Scene,
    Up,
    Values,
    ViewName,
    assignments,
    chosen_view,
    oriented,
    print_project_notes,
    progress,
)
from app.project.project import ProjectSpec
from app.system.atomic import require_place
from engine.scene.builtin import DEFAULT_SCENE


def contact_sheet(
    output: Annotated[Path, typer.Option("-o", "--output", help="SHEET.png.")],
    scene: Scene = DEFAULT_SCENE,
    looks: Annotated[
        str | None, typer.Option("--looks", metavar="A,B,…", help="Those of these names, in this order; all without.")
    ] = None,
    columns: Annotated[
        int | None, typer.Option("--columns", min=1, max=64, help="How many stand beside each other.")
    ] = None,
    width: Annotated[
        int | None, typer.Option("--width", min=1, max=16384, help="Of each picture, in pixels; the scene's without.")
    ] = None,
    exr: Annotated[bool, typer.Option("--exr", help="Also each look's linear picture, in a file beside it.")] = False,
    set_: Values = None,
    resolution: Resolution = None,
    view: ViewName = None,
    ocio: Configuration = None,
    camera: SavedView = None,
    up: Up = Axis.Y,
) -> int:
    """Render all looks of a session, and put them on one page with their names."""
    from app.stills.contact_sheet import linear_files, render_sheet, sheet_of, write_sheet
    from app.stills.stills import check_output

    check_output(output, (".png",))
    shown = chosen_view(view, ocio)
    started = time.monotonic()
    project = ProjectSpec(oriented(scene, up), resolution, tuple(assignments(set_)), camera).open()
    sheet = sheet_of(project, looks, columns, width, exr)
    require_place(output, *linear_files(output, sheet))
    with progress() as report:
        pictures = render_sheet(project, sheet, lambda step: report(step.fraction, step.text))
    print_project_notes(project)
    write_sheet(output, pictures, sheet, shown or project.view)
    height, across = pictures[0][1].shape[:2]
    print_line(f"{output}: {len(pictures)} looks of {across} x {height}, {time.monotonic() - started:.1f} s")
    return 0
