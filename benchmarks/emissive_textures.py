"""Surfaces under a lamp with a texture, in each mode against path tracing at the texture's full resolution:
`python -m benchmarks.emissive_textures [MODE ...]` prints the table of docs/accuracy.md.

The lamp is a square of 64 x 64 texels in tiles, most of them dark, at two fifths of its side above a floor. Paths draw
it by the power of its parts, and look its texture up at the very point.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from app.project.project import open_project
from app.stills.stills import Mode, render_project
from engine.render.picture_difference import Errors, errors

SIDE = 48
N_SAMPLES = 4096
SURFACES = {
    "diffuse": 'model = "lambert", albedo = 0.8',
    "gloss, α = 0.4": 'model = "microfacet", alpha = 0.4, f0 = 0.9, f90 = 1.0',
    "gloss, α = 0.2": 'model = "microfacet", alpha = 0.2, f0 = 0.9, f90 = 1.0',
    "gloss, α = 0.1": 'model = "microfacet", alpha = 0.1, f0 = 0.9, f90 = 1.0',
}
MODES: tuple[Mode, ...] = ("placement", "orbit", "deform")
_SCENE = """version = 1
bounces = 1
[camera]
position = [0, 0.32, 1.4]
target = [0, 0, 0]
fov_y = 34
resolution = [{side}, {side}]
[[object]]
name = "floor"
primitive = "quad"
transform = [2,0,0,0, 0,0,2,0, 0,-2,0,0, 0,0,0,1]
smooth = false
layer = [{{ {surface} }}]
[[object]]
name = "lamp"
primitive = "quad"
transform = [1,0,0,0, 0,0,-1,0.4, 0,1,0,0, 0,0,0,1]
emission = 10
emission_texture = {{ texture = "tiles.png" }}
"""


def write_texture(file: Path) -> None:
    """Tiles of random colours, three in four of them dark."""
    generator = np.random.default_rng(3)
    tiles = generator.integers(60, 256, (8, 8, 3)) * (generator.random((8, 8, 1)) < 0.25)
    Image.fromarray(np.uint8(np.maximum(tiles, 3).repeat(8, axis=0).repeat(8, axis=1))).save(file)


def pictures(surface: str, folder: Path, modes: tuple[Mode, ...]) -> dict[str, np.ndarray]:
    """The picture of each mode, and "paths"."""
    write_texture(folder / "tiles.png")
    (folder / "scene.toml").write_text(_SCENE.format(side=SIDE, surface=surface), encoding="utf-8")
    project = open_project(str(folder / "scene.toml")).with_settings(n_edge_rays=0)
    found = {
        mode: render_project(project, lambda *_: None, mode=mode).picture for mode in modes
    } | {"paths": render_project(project, lambda *_: None, reference=True, n_samples=N_SAMPLES).picture}  # fmt: skip
    return {name: np.asarray(picture) for name, picture in found.items()}


def measure(surface: str, folder: Path, modes: tuple[Mode, ...]) -> dict[str, Errors]:
    """The error of each mode over the pixels that show the floor, which is black nowhere."""
    found = pictures(surface, folder, modes)
    truth = found.pop("paths")
    floor = np.zeros(truth.shape[:2], bool)
    floor[SIDE // 2 :] = True  # the lamp is above the middle
    floor &= (truth > 0.0).all(axis=2)
    return {mode: errors(picture[floor], truth[floor]) for mode, picture in found.items()}


def main() -> None:
    modes = tuple(mode for mode in MODES if mode in sys.argv[1:] or len(sys.argv) < 2)
    print(f"| floor | {' | '.join(modes)} |\n| --- |{' --- |' * len(modes)}")
    with tempfile.TemporaryDirectory() as folder:
        for name, surface in SURFACES.items():
            found = measure(surface, Path(folder), modes)
            row = [f"{100 * found[mode].rmse:.2f} % ({100 * found[mode].mean:+.2f} %)" for mode in modes]
            print(f"| {name} | {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
