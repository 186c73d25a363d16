"""The commands that import files of other programs, and export for them."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import print_line
from app.cli.options import (
    SCENE_HELP,
    Axis,
    Bounces,
    Resolution,
    Up,
    Values,
    assignments,
    oriented,
    print_notes,
    progress,
)
from app.document.sources import source_of
from app.document.view_state import ViewState
from app.export import require_package_place
from app.project.project import open_project, session_of
from app.system.atomic import require_folder, require_place
from engine.core.generators import run_to_end


def import_brdf(
    file: Annotated[Path, typer.Argument(help="A measured BRDF: MERL FILE.binary, Cornell FILE.brdf, RGL FILE.bsdf.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.toml, a material; scenes take its layers.")],
    smooth: Annotated[float, typer.Option("--smooth", min=0.0, max=1.0, help="Takes noise out of the curves.")] = 0.0,
    cloth: Annotated[bool, typer.Option("--cloth", help="One layer P(θi) Q(θh) P(θo) in place of two.")] = False,
) -> int:
    """Turn a measured BRDF into an editable material, and print the fit error."""
    from app.files.brdf_files import import_file, import_lines
    from app.worker.cache import ArrayCache

    started = time.monotonic()
    with progress() as report:
        measurement = import_file(file, output, smooth, cloth, ArrayCache(), report)
    for line in import_lines(measurement, cloth):
        print_line(line)
    print_line(f"{output}: {file.name}, {time.monotonic() - started:.1f} s")
    return 0


def export_brdf(
    scene: Annotated[str, typer.Argument(help=SCENE_HELP)],
    object_: Annotated[str, typer.Argument(metavar="OBJECT", help="Whose material is written.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.binary (a MERL table) or OUT.toml.")],
    set_: Values = None,
) -> int:
    """Write the edited material of an object: as a MERL table, or as a material file."""
    from app.document.named_files import with_full_names
    from app.files.brdf_files import check_merl_name, export_steps
    from app.files.materials import SUFFIX, Material, save_material
    from engine.render.tabulate import untabulated_features

    as_it_is = output.suffix == SUFFIX
    if not as_it_is:
        check_merl_name(output)
    started = time.monotonic()
    document = open_project(scene, (1, 1), assignments(set_)).document
    require_place(output)
    layers = document.object(object_).layers
    if as_it_is:
        save_material(output, Material(object_, with_full_names(layers, document.source)))
        print_line(f"{output}: {object_}, {len(layers)} layers")
        return 0
    with progress() as report:
        for fraction in export_steps(layers, output):
            report(fraction, "evaluating the layers")
    print_notes(untabulated_features(layers))
    print_line(f"{output}: {object_}, {len(layers)} layers, {time.monotonic() - started:.1f} s")
    return 0


def save_scene(
    scene: Annotated[str, typer.Argument(help=SCENE_HELP)],
    output: Annotated[Path, typer.Option("-o", "--output", help="A new folder, or OUT.insitu.zip.")],
    set_: Values = None,
    replace_: Annotated[bool, typer.Option("--replace", help="Replaces an OUT.insitu.zip that is there.")] = False,
    up: Up = Axis.Y,
) -> int:
    """Save the edited scene with everything it needs, in a folder or in one file that opens elsewhere."""
    from app.export.package import package_steps

    require_package_place(output, replace_)
    name = oriented(scene, up)
    project = open_project(name, None, assignments(set_))
    session = session_of(source_of(name))
    view = ViewState() if session is None else session.view
    steps = package_steps(project.document, view, project.scene.files, output)
    with progress() as report:
        package = run_to_end(steps, lambda step: report(step[0], f"copying {step[1]}"))
    print_notes(package.notes)
    print_line(f"{output}: a session and {len(package.copies)} files")
    return 0


def save_environment(
    scene: Annotated[str, typer.Argument(help=SCENE_HELP)],
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.exr, a lat-long map.")],
    set_: Values = None,
    up: Up = Axis.Y,
) -> int:
    """Write the environment with what is painted on it, its suns and their mix as an OpenEXR map."""
    from app.export.environment import require_environment_file, write_environment

    require_environment_file(output)
    project = open_project(oriented(scene, up), (1, 1), assignments(set_))
    height, width = write_environment(output, project.sky)
    print_line(f"{output}: {width} x {height} texels")
    return 0


def export(
    scene: Annotated[str, typer.Argument(help=SCENE_HELP)],
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder to write.")],
    set_: Values = None,
    bounces: Bounces = None,
    resolution: Resolution = None,
    up: Up = Axis.Y,
) -> int:
    """Export the edited scene for Mitsuba 3, with a program that renders it."""
    from app.export.mitsuba import export_scene

    require_folder(output)
    project = open_project(oriented(scene, up), resolution, assignments(set_))
    with progress() as report:
        notes = export_scene(project, output, bounces or project.scene.description.bounces or 1, report)
    print_notes(notes)
    print_line(f"{output}: scene.xml; python {output / 'render.py'} renders it where Mitsuba 3 is installed")
    return 0
