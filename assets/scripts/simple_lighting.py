"""The guide's picture of one edit under simple light and in place, after figures 1.2 to 1.4 and 4.4 of [BenArtzi07]:
`python -m assets.scripts.simple_lighting [FILE]`.

The tea tray's copper before (above) and after it was brushed (below): under one distant light, on a ball in the scene's
environment, under that environment without shadows, and in place.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from app.project.project import Project, open_project
from assets.scripts.bounces import GAP
from engine.core.generators import run_to_end
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.precompute.direct.simple_lighting import simple_lighting
from engine.render.display import display_picture
from engine.render.still import StillLayer, render_still
from engine.scene.builtin import builtin_environments
from engine.settings import Lighting

SIZE = 256
CAPTION = 22
BANDS = (64, 32)
BRUSHED: Sequence[tuple[str, Any]] = (("teapot.copper.n_u", 6.0), ("teapot.copper.n_v", 1200.0))
EDITS: tuple[Sequence[tuple[str, Any]], ...] = ((), BRUSHED)
COLUMNS: tuple[tuple[str, str, Lighting], ...] = (
    ("one light", "teatray", "point_light"), ("on a ball", "ball", "scene"),
    ("no shadows", "teatray", "no_shadows"), ("in place", "teatray", "scene"),
)  # fmt: skip
BALL = """
version = 1
name = "ball"
[camera]
position = [-0.9, 1.4, 1.9]
target = [0.0, 0.0, 0.0]
fov_y = 26.0
[environment]
file = "{environment}"
[[object]]
name = "teapot"
primitive = "sphere"
layer = [
  {{ model = "lambert", name = "base", albedo = [0.085, 0.032, 0.016] }},
  {{ model = "ashikhmin_shirley", name = "copper", n_u = 320.0, n_v = 70.0, scale = [0.92, 0.50, 0.33] }},
]
"""


def opened(scene: str, values: Sequence[tuple[str, Any]], size: int, folder: Path) -> Project:
    """The tea tray, or a ball of the teapot's material under the same environment, with these values set."""
    if scene == "teatray":
        return open_project(scene, (size, size), values)
    file = folder / "scene.toml"
    (folder / "studio.exr").write_bytes(Path(builtin_environments()["studio"]).read_bytes())
    file.write_text(BALL.format(environment="studio.exr"), encoding="utf-8")
    return open_project(str(file), (size, size), values)


def picture(scene: str, lighting: Lighting, values: Sequence[tuple[str, Any]], size: int = SIZE) -> NDArray[np.uint8]:
    """One picture (H, W, 3), sRGB."""
    with tempfile.TemporaryDirectory() as folder:
        project = opened(scene, values, size, Path(folder))
        placement, sky = simple_lighting(Placement(project.scene, n_edge_rays=8), project.sky, lighting)
        layers = [
            StillLayer(i, layer, (BANDS[0], BANDS[1] if len(layer.model.factors) == 2 else 1), True)
            for i, layer in project.indexed_layers
        ]
        return display_picture(run_to_end(render_still(placement, layers, sky, FINAL), lambda step: None))


def figure(size: int = SIZE) -> Image.Image:
    """All pictures, with a line of words above each column."""
    height = CAPTION + 2 * size + GAP
    sheet = Image.new("RGB", (len(COLUMNS) * (size + GAP) - GAP, height), "white")
    draw = ImageDraw.Draw(sheet)
    for column, (words, scene, lighting) in enumerate(COLUMNS):
        left = column * (size + GAP)
        draw.text((left + size // 2, CAPTION // 2), words, "black", ImageFont.load_default(14), anchor="mm")
        for row, values in enumerate(EDITS):
            sheet.paste(Image.fromarray(picture(scene, lighting, values, size)), (left, CAPTION + row * (size + GAP)))
    return sheet


def main() -> None:
    figure().save(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/simple_lighting.png"), optimize=True)


if __name__ == "__main__":
    main()
