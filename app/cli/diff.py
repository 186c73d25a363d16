"""The command that compares two pictures: one number, and false colours."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import print_line


def diff(
    picture: Annotated[Path, typer.Argument(help="A picture: EXR, HDR, PNG, JPEG or WebP.", show_default=False)],
    reference: Annotated[Path, typer.Argument(help="What it is compared with, of the same size.", show_default=False)],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="OUT.png: the difference in false colours.")
    ] = None,
    absolute: Annotated[
        bool, typer.Option("--absolute", help="Sizes of differences in place of red (brighter) and blue (darker).")
    ] = False,
) -> int:
    """Compare two pictures in linear light, and print their relRMSE."""
    from app.stills.stills import check_output
    from app.system.atomic import save_file, set_inputs
    from engine.render.display import pixels_png
    from engine.render.picture_difference import check_same_size, difference_colours, errors, largest_difference
    from engine.render.picture_files import read_picture

    if output is not None:
        set_inputs((picture, reference))
        check_output(output, (".png",))
    ours, other = read_picture(picture), read_picture(reference)
    check_same_size(ours, other, str(reference))
    found, largest = errors(ours, other), largest_difference(ours, other)
    where = f"{largest.share:.3g} of the mean at {largest.column}, {largest.row}"
    print_line(f"relRMSE {found.rmse:.4g}, means differ by {found.mean:+.3g}, largest difference {where}")
    if output is not None:
        save_file(output, pixels_png(difference_colours(ours, other, "absolute" if absolute else "signed")))
        print_line(f"{output}: {ours.shape[1]} x {ours.shape[0]}")
    return 0
