"""A contact sheet: finished pictures of looks beside each other on one page, each with its name below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from app.document.looks import in_look, look_names
from app.document.view_state import Viewpoint
from app.project.project import Project
from app.stills.stills import Report, render_picture, write_picture
from app.system.atomic import require_place, save_file
from engine.core.colour import AnyView
from engine.core.errors import InsituError
from engine.core.generators import StillProgress
from engine.render.display import display_picture, pixels_png, without_alpha

GAP, TEXT = 0.04, 0.045  # between pictures, and the height of a name, by a picture's width
LEAST_GAP, LEAST_TEXT = 6, 11
BACK, INK = (24, 24, 24), (210, 210, 210)
MOST_SIDE = 16384
SCREEN = 4.0 / 3.0  # width by height of a page
NO_LOOKS = "there are no looks; make them in the editor, or by new_look of a script"


@dataclass(frozen=True)
class Sheet:
    """looks: the names of those that are shown, in this order; columns: None for a page that is as wide as a screen;
    width: of each picture in pixels, None as the scene has it; writes_linear: whether each look's linear picture is
    written beside the sheet, as EXR."""

    looks: tuple[str, ...]
    columns: int | None = None
    width: int | None = None
    writes_linear: bool = False


def chosen_looks(text: str, names: Sequence[str]) -> tuple[str, ...]:
    """The looks that a list with commas names; a name may have commas itself. Raises InsituError."""
    words, found = [each.strip() for each in text.split(",")], list[str]()
    while words:
        joined = ((n, ", ".join(words[:n])) for n in range(len(words), 0, -1))
        n, name = next(((n, name) for n, name in joined if name in names), (0, ""))
        if not n:
            there = ", ".join(names) or "none"
            raise InsituError(f"--looks {text}: there is no look {words[0]!r}; looks of this scene: {there}")
        found.append(name)
        words = words[n:]
    return tuple(found)


def render_sheet(project: Project, sheet: Sheet, report: Report) -> list[tuple[str, NDArray[np.float32]]]:
    """The linear pictures (H, W, 3 or 4) of looks with their names. Raises InsituError."""
    if not sheet.looks:
        raise InsituError(NO_LOOKS)
    width, height = project.scene.resolution
    if sheet.width is not None:
        width, height = sheet.width, max(round(height * sheet.width / width), 1)
    _require_room(sheet, width, height)
    found = list[tuple[str, NDArray[np.float32]]]()
    for index, name in enumerate(sheet.looks):

        def follow(step: StillProgress, index: int = index, name: str = name) -> None:
            share = (index + step.fraction) / len(sheet.looks)
            report(replace(step, fraction=share, text=f"{name}: {step.text}"))

        project = project.edited(in_look(project.document, name), Viewpoint(None, (width, height)))
        found.append((name, render_picture(project, follow)))
    return found


def write_sheet(
    path: Path, pictures: Sequence[tuple[str, NDArray[np.float32]]], sheet: Sheet, view: AnyView = "filmic"
) -> None:
    """Write the page as a PNG, and where they are asked for the linear pictures beside it, each whole or not at all.
    Raises InsituError."""
    files = linear_files(path, sheet)
    require_place(path, *files)
    for file, (_, radiance) in zip(files, pictures, strict=False):
        write_picture(file, radiance)
    shown = [(name, _on_screen(radiance, view)) for name, radiance in pictures]
    save_file(path, pixels_png(page(shown, sheet.columns)))


def linear_files(path: Path, sheet: Sheet) -> tuple[Path, ...]:
    """The files of the linear pictures: "sheet 2 Brass.exr" beside "sheet.png"."""
    if not sheet.writes_linear:
        return ()
    named = ("".join(each if each.isalnum() or each in " -_" else "_" for each in name) for name in sheet.looks)
    return tuple(path.with_name(f"{path.stem} {n} {name}.exr") for n, name in enumerate(named, 1))


def page(pictures: Sequence[tuple[str, NDArray[np.uint8]]], columns: int | None = None) -> NDArray[np.uint8]:
    """One page (H, W, 3) of pictures (h, w, 3) of one size, row by row, each with its name below."""
    height, width = pictures[0][1].shape[:2]
    columns = min(columns or columns_of_page(len(pictures), width, height), len(pictures))
    gap, text = max(round(GAP * width), LEAST_GAP), max(round(TEXT * width), LEAST_TEXT)
    cell = height + 2 * text + gap
    rows = -(-len(pictures) // columns)
    image = Image.new("RGB", (columns * (width + gap) + gap, rows * cell + gap), BACK)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(text)
    for n, (name, pixels) in enumerate(pictures):
        x, y = gap + (n % columns) * (width + gap), gap + (n // columns) * cell
        image.paste(Image.fromarray(pixels), (x, y))
        draw.text((x, y + height + text // 2), _fitting(name, font, width), INK, font)
    return np.asarray(image)


def columns_of_page(count: int, width: int, height: int) -> int:
    """How many columns make a page of pictures about as wide as a screen, with as few empty places as possible."""
    wanted = math.sqrt(SCREEN * count * height / width)
    near = [n for n in range(1, count + 1) if n in (math.floor(wanted), math.ceil(wanted))] or [1]
    return min(near, key=lambda n: (-count % n, abs(n - wanted)))


def _fitting(name: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> str:
    """A name that is not wider than its picture."""
    if font.getlength(name) <= width:
        return name
    kept = next((n for n in range(len(name), 0, -1) if font.getlength(name[:n] + "…") <= width), 0)
    return name[:kept] + "…"


def _on_screen(radiance: NDArray[np.float32], view: AnyView) -> NDArray[np.uint8]:
    """A picture as the viewport shows it, 8 bits; one with alpha over the page."""
    if radiance.shape[2] == 3:
        return display_picture(radiance, tone_mapping=view)
    colour, alpha = without_alpha(radiance)
    shown = display_picture(colour.astype(np.float32), tone_mapping=view).astype(np.float64)
    return np.round(alpha * shown + (1.0 - alpha) * np.array(BACK)).astype(np.uint8)


def _require_room(sheet: Sheet, width: int, height: int) -> None:
    """Raise InsituError for a page that is too large."""
    columns = min(sheet.columns or columns_of_page(len(sheet.looks), width, height), len(sheet.looks))
    rows = -(-len(sheet.looks) // columns)
    if max(columns * width, rows * height) > MOST_SIDE:
        size = f"{columns} x {rows} pictures of {width} x {height}"
        raise InsituError(f"{size} are more than {MOST_SIDE} pixels per side; expected a smaller --width")


def sheet_of(
    project: Project, looks: str | None = None, columns: int | None = None, width: int | None = None,
    writes_linear: bool = False,
) -> Sheet:  # fmt: skip
    """The sheet of a project; looks: those of a list with commas, None for all. Raises InsituError."""
    names = look_names(project.document)
    chosen = names if looks is None else chosen_looks(looks, names)
    if not chosen:
        raise InsituError(NO_LOOKS)
    return Sheet(chosen, columns, width, writes_linear)
