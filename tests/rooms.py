"""Three rooms that nobody tuned, built as scene files: slats before a window, two rooms joined by a slit, and a room
whose walls are wound outwards. Metres; y is up."""

import shutil
from pathlib import Path

import numpy as np

from assets.generate.furniture import block
from assets.generate.mesh import Mesh, axis_rotation, merged, save_ply, transformed
from tests.scene_text import camera, environment, material, placed, scaled

PLASTER = material('model = "lambert", albedo = [0.72, 0.70, 0.66]')
CLAY = material('model = "lambert", albedo = [0.60, 0.34, 0.20]')
WOOD = 'model = "lambert", albedo = [0.36, 0.27, 0.19]'
VARNISH = 'model = "rough_conductor", alpha = 0.2, eta = [1.5, 1.5, 1.5], k = [0.0, 0.0, 0.0]'
BOARDS, VARNISHED = material(WOOD), material(WOOD, VARNISH)
GOLD = "smooth = true\n" + material('model = "rough_conductor", alpha = 0.25')
SKY = Path("assets/scenes/room/sky.exr")


def inside_out(folder: Path, inward: bool = False, has_ball: bool = True) -> Path:
    """One shell of 4 × 2.6 × 4 m, its faces outward as a modeller's cube has them, seen from within; a lamp under the
    ceiling, a block and a ball. inward: the same room as it should have been built."""
    folder.mkdir(parents=True, exist_ok=True)
    shell = block((-2.0, 0.0, -2.0), (2.0, 2.6, 2.0))
    save_ply(_turned(shell) if inward else shell, folder / "shell.ply")
    save_ply(block((-1.1, 0.0, -1.0), (-0.4, 0.9, -0.3)), folder / "block.ply")
    text = (
        camera((0.6, 1.5, 1.8), 60, (96, 72), (-0.1, 0.8, -0.6), "bounces = 4\n")
        + _object("shell", "shell.ply", PLASTER)
        + _object("block", "block.ply", CLAY)
        + (placed("ball", "sphere", scaled(0.7, (0.6, 0.35, -0.5)), GOLD) if has_ball else "")
        + _lamp((0.0, 2.58, 0.0), 0.8, [14.0, 13.0, 11.0])
    )
    return _written(folder, text)


def solid(folder: Path, inward: bool = False) -> Path:
    """A block under an even sky, its faces outward, or, as some exporters leave them, all inward."""
    folder.mkdir(parents=True, exist_ok=True)
    body = block((-0.5, 0.0, -0.5), (0.5, 0.8, 0.5))
    save_ply(_turned(body) if inward else body, folder / "block.ply")
    save_ply(block((-3.0, -0.1, -3.0), (3.0, 0.0, 3.0)), folder / "floor.ply")
    text = (
        camera((1.5, 1.4, 2.2), 40, (96, 72), (0.0, 0.3, 0.0))
        + environment((1.0, 0.9, 0.8))
        + _object("block", "block.ply", CLAY)
        + _object("floor", "floor.ply", BOARDS)
    )
    return _written(folder, text)


def slit(folder: Path, width: float = 0.06) -> Path:
    """A bright room and a dark one, with 12 cm of wall between them and a slit in it, from the floor to the ceiling."""
    folder.mkdir(parents=True, exist_ok=True)
    x, y, z, thick = 1.8, 2.4, 1.8, 0.12
    parts = [
        block((-x - thick, 0.0, -3 * z - thick), (-x, y, z + thick)),
        block((x, 0.0, -3 * z - thick), (x + thick, y, z + thick)),
        block((-x, 0.0, z), (x, y, z + thick)),
        block((-x, 0.0, -3 * z - thick), (x, y, -3 * z)),
        block((-x - thick, y, -3 * z - thick), (x + thick, y + thick, z + thick)),
        block((-x, 0.0, -z - thick), (0.2, y, -z)),
        block((0.2 + width, 0.0, -z - thick), (x, y, -z)),
    ]
    save_ply(merged(parts), folder / "walls.ply")
    save_ply(block((-x - thick, -0.1, -3 * z - thick), (x + thick, 0.0, z + thick)), folder / "floor.ply")
    save_ply(block((-1.0, 0.0, -1.2), (-0.4, 0.8, -0.6)), folder / "block.ply")
    text = (
        camera((0.9, 1.4, 1.6), 58, (96, 72), (-0.1, 0.9, -1.0), "bounces = 4\n")
        + _object("walls", "walls.ply", PLASTER)
        + _object("floor", "floor.ply", BOARDS)
        + _object("block", "block.ply", CLAY)
        + _lamp((1.0, y - 0.02, -2.0 * z), 1.2, [90.0, 84.0, 72.0])
    )
    return _written(folder, text)


def slats(folder: Path) -> Path:
    """A room behind a window of 1.6 × 1.3 m with slats before it, under a sky with its sun; a table of varnish."""
    folder.mkdir(parents=True, exist_ok=True)
    x, y, z, thick = 2.0, 2.5, 2.0, 0.2
    (x0, x1), (y0, y1) = (-0.8, 0.8), (0.8, 2.1)
    parts = [
        block((-x - thick, 0.0, -z - thick), (-x, y, z + thick)),
        block((x, 0.0, -z - thick), (x + thick, y, z + thick)),
        block((-x, 0.0, z), (x, y, z + thick)),
        block((-x - thick, y, -z - thick), (x + thick, y + thick, z + thick)),
        block((-x, 0.0, -z - thick), (x0, y, -z)),
        block((x1, 0.0, -z - thick), (x, y, -z)),
        block((x0, 0.0, -z - thick), (x1, y0, -z)),
        block((x0, y1, -z - thick), (x1, y, -z)),
    ]
    save_ply(merged(parts), folder / "walls.ply")
    save_ply(block((-x - thick, -0.1, -z - thick), (x + thick, 0.0, z + thick)), folder / "floor.ply")
    save_ply(merged([_slat(x0, x1, h, -z + 0.1) for h in np.arange(y0 + 0.1, y1, 0.2)]), folder / "slats.ply")
    legs = [block((a - 0.03, 0.0, b - 0.03), (a + 0.03, 0.7, b + 0.03)) for a in (-0.6, 0.6) for b in (-0.7, 0.1)]
    save_ply(merged([block((-0.7, 0.7, -0.8), (0.7, 0.74, 0.2)), *legs]), folder / "table.ply")
    shutil.copy(SKY, folder / "sky.exr")
    text = (
        camera((1.3, 1.6, -1.6), 68, (96, 72), (-0.6, 0.5, 0.9), "bounces = 4\n")
        + environment(file="sky.exr")
        + "rotation = 323\n"
        + _object("walls", "walls.ply", PLASTER)
        + _object("floor", "floor.ply", BOARDS)
        + _object("slats", "slats.ply", PLASTER)
        + _object("table", "table.ply", VARNISHED)
        + placed("ball", "sphere", scaled(0.24, (0.1, 0.86, -0.2)), CLAY)
    )
    return _written(folder, text)


ROOMS = {"inside_out": inside_out, "slit": slit, "slats": slats}


def _slat(x0: float, x1: float, height: float, z: float) -> Mesh:
    """16 cm wide and 6 mm thick, leaning by 10 degrees: its inner edge is the lower one."""
    flat = block((x0, -0.003, -0.08), (x1, 0.003, 0.08))
    return transformed(flat, axis_rotation((1, 0, 0), np.pi / 18), (0.0, height, z))


def _turned(mesh: Mesh) -> Mesh:
    return Mesh(mesh.positions, -mesh.normals, mesh.faces[:, ::-1])


def _object(name: str, mesh: str, more: str) -> str:
    smooth = "" if "smooth" in more else "smooth = false\n"
    return placed(name, mesh, more=smooth + more)


def _lamp(at: tuple[float, float, float], width: float, radiance: list[float]) -> str:
    """A square panel that looks down."""
    x, y, z = at
    return placed("lamp", "quad", f"{width},0,0,{x}, 0,0,-1,{y}, 0,{width},0,{z}, 0,0,0,1", f"emission = {radiance}\n")


def _written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path
