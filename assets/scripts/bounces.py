"""The guides' pictures of indirect light: `python -m assets.scripts.bounces [FOLDER] [SCENE ...]`.

Each shows a built-in scene twice side by side, as `insitu render` makes it: --bounces 1 on the left, the scene's own
number on the right.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from app.measure.subject import at_most, open_subject
from app.project.project import open_project
from app.stills.stills import render_picture
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.display import display_picture

SCENES = ("cornell", "vase", "room", "ring")
SIDE = 320
GAP = 6
MOST_BYTES = 150_000


def side_by_side(name: str, side: int = SIDE) -> np.ndarray:
    """Both pictures of a scene, at most `side` pixels wide each, with white between them (H, 2 W + gap, 3) sRGB."""
    project = open_project(name, at_most(open_subject(name).scene.resolution, side))
    pair = [
        display_picture(render_picture(project, lambda step: None, series=series)) for series in (BounceSeries(1), None)
    ]
    return np.concatenate([pair[0], np.full((len(pair[0]), GAP, 3), 255, np.uint8), pair[1]], axis=1)


def save(file: Path, pixels: np.ndarray) -> None:
    """As a PNG, with a dithered palette of 256 colours where it would take too much without."""
    image = Image.fromarray(pixels)
    image.save(file, optimize=True)
    if file.stat().st_size > MOST_BYTES:
        palette = image.quantize(256, Image.Quantize.MEDIANCUT)
        image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).save(file, optimize=True)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images")
    for name in sys.argv[2:] or SCENES:
        save(folder / f"bounces_{name}.png", side_by_side(name))


if __name__ == "__main__":
    main()
