"""The guides' pictures of Orbit, after [Ma06], figures 5, 8 to 14: `python -m assets.scripts.orbit [FOLDER] [ROW ...]`.

Each is a row of pictures that Orbit draws at rest, of variants of built-in scenes. (Figure 7 is a plot, which `insitu
measure` writes.)
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.project.project import Project, open_project
from assets.scripts.bounces import GAP
from engine.material.layer import Layer
from engine.realtime.triple_product import reflections
from engine.realtime.triple_product.orbit_engine import N_COEFFICIENTS, Orbit
from engine.realtime.triple_product.view_radiance import Quality
from engine.render.display import display_picture
from engine.scene.builtin import builtin_environments, builtin_scenes, scene_path

HEIGHT = 240
N_POINTS = 20_000
MOVED = {"position": (-1.05, 0.42, 0.78), "target": (0.03, 0.22, 0.0)}
CLOSE = {"fov_y": 20.0}
LOW = {"position": (0.10, 0.34, 0.86), "target": (0.16, 0.0, 0.22), "fov_y": 38.0}
LAMPS = ((-0.75, 1.05, 0.55), (0.85, 0.80, 0.35), (0.10, 1.25, -0.80))
BALL = """
version = 1
name = "ball"
[camera]
position = [0.0, 0.25, 1.75]
target = [0.0, 0.0, 0.0]
fov_y = 38.0
{light}
[[object]]
name = "ball"
primitive = "sphere"
layer = [{{ model = "ward_anisotropic", name = "brushed", alpha_u = 0.1, alpha_v = 1.0, scale = [0.8, 0.72, 0.6] }}]
"""
PANEL = """
[[object]]
name = "panel"
primitive = "quad"
editable = false
transform = [0.9, 0, 0, 0,  0, -0.5, -0.7, 2.2,  0, 0.7, -0.5, 1.6,  0, 0, 0, 1]
emission = [9.0, 9.0, 9.0]
"""

Row = list[NDArray[np.uint8]]


@dataclass(frozen=True)
class View:
    """One picture of a row: what is changed in the scene's file, which values are set, the camera, the coefficients;
    at_points: whether sharp gloss is shaded at points, as blunt gloss is."""

    scene: str = "rings"
    edit: Callable[[str], str] = str
    values: Sequence[tuple[str, Any]] = ()
    camera: dict[str, Any] | None = None
    n_coefficients: int = N_COEFFICIENTS
    quality: Quality = "still"
    width: int = 320
    at_points: bool = False


def environment(name: str, rotation: float, scale: float) -> Callable[[str], str]:
    """The scene's file under another environment."""

    def edit(text: str) -> str:
        before, _, after = text.partition("[environment]")
        rest = after[after.index("[[object]]") :]
        return f'{before}[environment]\nfile = "{name}.exr"\nrotation = {rotation}\nscale = {scale}\n\n{rest}'

    return edit


def under_lamps(text: str) -> str:
    """The scene without a sky, under three lamps of different colours."""
    before, _, after = text.partition("[environment]")
    body, _, _ = after[after.index("[[object]]") :].partition('[[object]]\nname = "lamp"')
    colours = ((26.0, 20.0, 13.0), (6.0, 10.0, 18.0), (14.0, 8.0, 10.0))
    lamps = [
        f'[[object]]\nname = "lamp {k}"\nmesh = "lamp.ply"\nsmooth = false\neditable = false\n'
        f"transform = [1, 0, 0, {x + 0.75}, 0, 1, 0, {y - 1.05}, 0, 0, 1, {z - 0.55}, 0, 0, 0, 1]\n"
        f"emission = [{', '.join(map(str, colour))}]\n"
        for k, ((x, y, z), colour) in enumerate(zip(LAMPS, colours, strict=True))
    ]
    return before + body + "\n".join(lamps)


ROWS: dict[str, Sequence[View]] = {
    # Figure 5: shaded per point, per pixel while the camera moves, and per pixel at rest.
    "per_pixel": [
        View("teatray", camera=CLOSE, quality="moving", at_points=True),
        View("teatray", camera=CLOSE, quality="moving"),
        View("teatray", camera=CLOSE, quality="rest"),
    ],
    # Figure 8: the same picture by more and more coefficients.
    "coefficients": [View(n_coefficients=n, quality="rest", width=240) for n in (20, 80, 320, 1280)],
    # Figure 9: a material edited.
    "material": [
        View(values=[("gilded.gold.alpha", alpha), ("gilded.gold.scale", 1.0 if alpha < 0.2 else 0.9)])
        for alpha in (0.08, 0.22, 0.55)
    ],
    # Figures 10 and 12: a floor whose material and whose normals vary, under light from two sides.
    "floor": [View(camera=LOW, values=[("light.rotation", angle)], width=400) for angle in (40.0, 200.0)],
    # Figure 11: Ward's anisotropic BRDF, 0.1 and 1.0, under a panel and under a hall.
    "ward": [
        View("ball", lambda _: BALL.format(light=PANEL), width=300),
        View("ball", lambda _: BALL.format(light='[environment]\nfile = "hall.exr"'), width=300),
    ],
    # Figure 13: several lamps, each with its shadows.
    "lamps": [View(edit=under_lamps), View(edit=under_lamps, camera=MOVED)],
    # Figure 14: other light, other views.
    "light": [
        View(edit=environment("hall", 60.0, 0.6)),
        View(edit=environment("hall", 60.0, 0.6), camera=MOVED),
        View(edit=environment("sky", 120.0, 0.5), camera=MOVED),
    ],
}  # fmt: skip


def opened(view: View, folder: Path, height: int) -> Project:
    """The scene of a view, copied into a folder and changed there."""
    text = ""
    if view.scene in builtin_scenes():
        source = scene_path(view.scene)
        shutil.copytree(source.parent, folder, dirs_exist_ok=True)
        text = source.read_text(encoding="utf-8")
    for file in builtin_environments().values():
        shutil.copy(file, folder)
    (folder / "scene.toml").write_text(view.edit(text), encoding="utf-8")
    return open_project(str(folder / "scene.toml"), (round(height * view.width / HEIGHT), height), view.values)


def picture(view: View, height: int = HEIGHT) -> NDArray[np.uint8]:
    """As Orbit draws it when all rests (H, W, 3), sRGB."""
    with tempfile.TemporaryDirectory() as folder:
        project = opened(view, Path(folder), height)
        camera = project.scene.description.camera
        if view.camera is not None:
            camera = camera.model_copy(update=view.camera)
        orbit = Orbit(project.scene, n_points=N_POINTS, n_coefficients=view.n_coefficients)
        orbit.set_light(project.sky)
        orbit.set_layers(layers_of(project))
        orbit.set_bounces(project.scene.description.bounces or 1)
        for _ in range(2):  # once more for the backs that the first picture sees
            for _step in orbit.work():
                pass
            drawn = orbit.draw(camera, project.scene.resolution, view.quality)
        if view.at_points:
            with mock.patch.object(reflections, "SHARP", 0.0):
                drawn = orbit.draw(camera, project.scene.resolution, view.quality)
    return display_picture(drawn)


def layers_of(project: Project) -> dict[int, tuple[Layer, ...]]:
    """The layers of each object, by its index."""
    found: dict[int, tuple[Layer, ...]] = {}
    for i_object, layer in project.indexed_layers:
        found[i_object] = (*found.get(i_object, ()), layer)
    return found


def row(name: str, height: int = HEIGHT) -> NDArray[np.uint8]:
    """The pictures of a row beside each other, white between them (H, W, 3) sRGB."""
    parts: Row = []
    for view in ROWS[name]:
        parts += [np.full((height, GAP, 3), 255, np.uint8), picture(view, height)]
    return np.concatenate(parts[1:], axis=1)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images")
    for name in sys.argv[2:] or ROWS:
        Image.fromarray(row(name)).save(folder / f"orbit_{name}.png", optimize=True)


if __name__ == "__main__":
    main()
