"""A real scene so small that its transport takes a second: a ball on a ground under a lamp and a coloured sky."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.render.image_files import write_exr

SCENE = """version = 1
name = "small"
[camera]
position = [0.4, 1.2, 2.6]
target = [0, 0.45, 0]
fov_y = 42
resolution = [96, 64]
[environment]
file = "sky.exr"
[[object]]
name = "ground"
primitive = "quad"
transform = [5,0,0,0, 0,0,5,0, 0,-5,0,0, 0,0,0,1]
layer = [{ model = "lambert", name = "clay", albedo = [0.6, 0.5, 0.4] }]
[[object]]
name = "ball"
primitive = "sphere"
transform = [0.9,0,0,0, 0,0.9,0,0.5, 0,0,0.9,0, 0,0,0,1]
layer = [{ model = "lambert", name = "base", albedo = [0.1, 0.2, 0.4] }, { model = "rough_conductor", name = "coat", alpha = 0.3 }]
[[object]]
name = "lamp"
primitive = "quad"
transform = [0.5,0,0,-0.8, 0,0.35,-0.35,1.05, 0,0.35,0.35,-0.6, 0,0,0,1]
emission = [9, 7, 5]
"""  # noqa: E501


def write_small_scene(folder: Path, text: str = SCENE) -> Path:
    """Write the scene and its sky into a folder; the scene's file."""
    write_exr(folder / "sky.exr", coloured_sky())
    file = folder / "small.toml"
    file.write_text(text)
    return file


def coloured_sky(height: int = 16) -> np.ndarray:
    """Blue above, warm below, brighter in one direction: (height, 2·height, 3)."""
    v, u = np.mgrid[:height, : 2 * height] / np.array([height, 2 * height])[:, None, None]
    glow = 2.5 * np.exp(-40.0 * ((u - 0.3) ** 2 + (v - 0.35) ** 2))
    sky = 0.4 * np.stack([0.2 + 0.3 * v + glow, 0.3 + 0.1 * v + 0.9 * glow, 0.7 - 0.4 * v + 0.7 * glow], axis=-1)
    return sky.astype(np.float32)
