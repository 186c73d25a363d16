"""Rooms of few quads whose direct light is hard: a gap between two rooms, blinds before a window, small lamps.

Each is written as one scene file with its meshes beside it. Quads are (corner, edge, edge); their front is where
edge × edge points.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.pictures import write_exr
from tests.scene_text import camera, environment, material, placed, scaled

Quad = tuple[Sequence[float], Sequence[float], Sequence[float]]
PLASTER = 'model = "lambert", albedo = [0.7, 0.7, 0.7]'


def write_quads(path: Path, quads: Iterable[Quad]) -> None:
    """An OBJ file of parallelograms."""
    lines = []
    for i, (corner, u, v) in enumerate(quads):
        a, b, c = (np.asarray(each, np.float64) for each in (corner, u, v))
        lines += ["v {:.9g} {:.9g} {:.9g}".format(*place) for place in (a, a + b, a + b + c, a + c)]
        lines.append("f " + " ".join(str(4 * i + k) for k in (1, 2, 3, 4)))
    path.write_text("\n".join(lines) + "\n")


def meshed(folder: Path, name: str, quads: Iterable[Quad], more: str) -> str:
    """An object of quads, and what else is said of it."""
    write_quads(folder / f"{name}.obj", quads)
    return placed(name, f"{name}.obj", more="smooth = false\n" + more)


def box(low: Sequence[float], high: Sequence[float], inwards: bool = False) -> list[Quad]:
    """The six sides of a box."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    x, y, z = np.diag(b - a)
    outside = [(a, z, y), (b, -y, -z), (a, x, z), (b, -z, -x), (a, y, x), (b, -x, -y)]
    return [(corner, v, u) if inwards else (corner, u, v) for corner, u, v in outside]  # type: ignore[misc]


# Of `box`: the lower side and the one towards +X.
FLOOR, WINDOW_SIDE = 2, 1

GAP, GAP_WALL = (1.0, 1.02), 0.0  # heights of the gap; z of the wall it is in
GAP_LAMP: Quad = ((-0.4, 0.05, -0.6), (0.8, 0.0, 0.0), (0.0, 0.5, 0.0))
GAP_RADIANCE = 50.0


def gap_room(folder: Path, resolution: tuple[int, int] = (48, 36)) -> Path:
    """A lamp near the floor of one room; the camera is in the other, and looks at the ceiling above the gap."""
    low, high = GAP
    walls: list[Quad] = box((-1.5, 0.0, -2.0), (1.5, 2.5, 3.0), inwards=True)
    wall = [((-1.5, 0.0, GAP_WALL), (3, 0, 0), (0, low, 0)), ((-1.5, high, GAP_WALL), (3, 0, 0), (0, 2.5 - high, 0))]
    text = camera((0.3, 0.9, 2.7), 62, resolution, (0, 2.3, 1.2), "bounces = 1\n")
    text += meshed(folder, "walls", walls, material(PLASTER))
    text += meshed(folder, "wall", wall, material(PLASTER))
    text += meshed(folder, "lamp", [GAP_LAMP], f"editable = false\nemission = {[GAP_RADIANCE] * 3}\n")
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


def gap_irradiance(points: NDArray[np.floating], normals: NDArray[np.floating]) -> NDArray[np.float64]:
    """Exact irradiance (P,) of points behind the wall of `gap_room`: of the part of the lamp that the gap shows."""
    corner, u, v = (np.asarray(each, np.float64) for each in GAP_LAMP)
    lamp = np.array([corner, corner + u, corner + u + v, corner + v])
    found = np.zeros(len(points))
    for i, (p, n) in enumerate(zip(points.astype(np.float64), normals.astype(np.float64), strict=True)):
        if p[2] <= GAP_WALL + 1e-6:
            continue
        seen = lamp
        for height, side in zip(GAP, (1.0, -1.0), strict=True):
            # The plane of the eye point and one edge of the gap, which runs along x.
            normal = side * np.cross((1.0, 0.0, 0.0), np.array([0.0, height, GAP_WALL]) - (0.0, p[1], p[2]))
            seen = clipped(seen, p, normal)
        seen = clipped(seen, p, n)
        found[i] = GAP_RADIANCE * polygon_irradiance(seen, p, n)
    return found


def clipped(polygon: NDArray[np.float64], place: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray:
    """The part of a convex polygon (K, 3) on the front side of a plane [Sutherland74]."""
    if not len(polygon):
        return polygon
    height = (polygon - place) @ normal
    kept = []
    for k in range(len(polygon)):
        j = (k + 1) % len(polygon)
        if height[k] >= 0.0:
            kept.append(polygon[k])
        if (height[k] < 0.0) != (height[j] < 0.0):
            kept.append(polygon[k] + (polygon[j] - polygon[k]) * (height[k] / (height[k] - height[j])))
    return np.array(kept).reshape(-1, 3)


def polygon_irradiance(polygon: NDArray[np.float64], place: NDArray[np.float64], normal: NDArray[np.float64]) -> float:
    """E / L of a polygon (K, 3) above the horizon by Lambert's formula: half the sum of its edges' angles, each times
    the cosine of its plane to the normal."""
    if len(polygon) < 3:
        return 0.0
    unit = polygon - place
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(unit, np.roll(unit, -1, axis=0), strict=True):
        across = np.cross(a, b)
        length = float(np.linalg.norm(across))
        total += np.arctan2(length, a @ b) * float(across @ normal) / length if length > 0.0 else 0.0
    return abs(total) / 2.0


SUN = np.array([0.75, 0.5, 0.15]) / np.linalg.norm([0.75, 0.5, 0.15])


def write_sunny_sky(path: Path, rows: int = 1024, degrees: float = 0.7, sun: float = 1e5) -> None:
    """An even blue sky with a sun of that diameter, towards `SUN`."""
    theta = np.pi * (np.arange(rows) + 0.5) / rows
    phi = np.pi * ((np.arange(2 * rows) + 0.5) / rows - 1.0)
    d = np.stack(np.broadcast_arrays(
        np.sin(theta)[:, None] * np.sin(phi), np.cos(theta)[:, None], -np.sin(theta)[:, None] * np.cos(phi)
    ), -1)  # fmt: skip
    sky = np.where(d[..., 1:2] > 0.0, np.array([0.6, 0.8, 1.2]), 0.1)
    sky[d @ SUN > np.cos(np.radians(0.5 * degrees))] = np.array([1.0, 0.9, 0.75]) * sun
    write_exr(path, sky.astype(np.float32))


def blinds_room(folder: Path, resolution: tuple[int, int] = (48, 36), n_slats: int = 24) -> Path:
    """A dining room: the sun falls through the slats of blinds onto a table and a glossy floor."""
    write_sunny_sky(folder / "sky.exr")
    sides = box((-2, 0, -2), (2, 2.6, 2), inwards=True)
    floor, walls = [sides[FLOOR]], [side for i, side in enumerate(sides) if i not in (FLOOR, WINDOW_SIDE)]
    low, high, left, right = 0.7, 2.2, -1.2, 1.2
    walls += [
        ((2, 0, -2), (0, 0, 4), (0, low, 0)), ((2, high, -2), (0, 0, 4), (0, 2.6 - high, 0)),
        ((2, low, -2), (0, 0, left + 2), (0, high - low, 0)), ((2, low, right), (0, 0, 2 - right), (0, high - low, 0)),
    ]  # fmt: skip
    pitch = (high - low) / n_slats
    slats = [((1.95, low + pitch * (i + 0.5), left), (0, 0, right - left), (-0.045, 0.0, 0)) for i in range(n_slats)]
    table = box((-0.9, 0.70, -0.6), (0.5, 0.74, 0.6))
    for x in (-0.85, 0.40):
        for z in (-0.55, 0.50):
            table += box((x, 0.0, z), (x + 0.05, 0.70, z + 0.05))
    text = camera((-1.7, 1.7, 1.7), 58, resolution, (0.3, 0.6, -0.4), "bounces = 1\n")
    text += environment(file="sky.exr")
    text += meshed(folder, "walls", walls, material(PLASTER))
    gloss = 'model = "rough_conductor", distribution = "ggx", alpha = 0.2, eta = [1.5, 1.5, 1.5], k = [0, 0, 0]'
    text += meshed(folder, "floor", floor, material(PLASTER, gloss))
    text += meshed(folder, "slats", slats, material(PLASTER))
    text += meshed(folder, "table", table, material('model = "lambert", albedo = [0.4, 0.2, 0.1]'))
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


def lamp_room(folder: Path, resolution: tuple[int, int] = (48, 36), radius: float = 0.2) -> Path:
    """A round lamp over a matt floor."""
    text = camera((0.0, 1.5, 3.0), 50, resolution, (0, 0.2, 0), "bounces = 1\n")
    text += meshed(folder, "floor", [((-2, 0, 2), (4, 0, 0), (0, 0, -4))], material(PLASTER))
    lamp = scaled(2 * radius, (0, LAMP_HEIGHT, 0))
    text += placed("lamp", "sphere", lamp, "editable = false\nemission = [10.0, 10.0, 10.0]\n")
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


LAMP_HEIGHT = 1.0


def sphere_irradiance(points: NDArray[np.floating], radius: float) -> NDArray[np.float64]:
    """Exact irradiance (P,) of the floor under the lamp of `lamp_room`: π L (R / d)² cos θ, a whole sphere above it."""
    towards = np.array([0.0, LAMP_HEIGHT, 0.0]) - points
    distance = np.linalg.norm(towards, axis=1)
    return np.pi * 10.0 * (radius / distance) ** 2 * towards[:, 1] / distance


def plate_room(folder: Path, resolution: tuple[int, int] = (48, 36), alpha: float = 0.01) -> Path:
    """A polished plate that mirrors small lamps: balls of 2, 6 and 20 mm and a square."""
    text = camera((0.0, 1.0, 1.6), 40, resolution, (0, 0.0, -0.1), "bounces = 1\n")
    metal = 'model = "rough_conductor", distribution = "ggx", eta = [0.2, 0.9, 1.1], k = [3.9, 2.4, 2.2], '
    metal += f"alpha = {alpha}"
    text += meshed(folder, "plate", [((-0.8, 0, 0.8), (1.6, 0, 0), (0, 0, -1.6))], material(metal))
    for i, (x, size) in enumerate(((-0.5, 0.004), (-0.17, 0.012), (0.17, 0.04))):
        radiance = [0.01 / size**2] * 3
        text += placed(
            f"ball {i}", "sphere", scaled(size, (x, 0.6, -0.9)), f"editable = false\nemission = {radiance}\n"
        )
    lamp = [((0.46, 0.56, -0.9), (0.08, 0, 0), (0, 0.08, 0))]
    text += meshed(folder, "square", lamp, "editable = false\nemission = [6.0, 6.0, 6.0]\n")
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"
