"""The mesh that Deform is measured on: a relief on a ball, and the sky that it stands under.

Its brows, sockets and furrows shade themselves, as those of [Sloan05, fig. 1].
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import Environment
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.scene.scene_loader import Scene, load_scene

Float64Array = NDArray[np.float64]

# Sockets, a nose and a mouth: where (x, y) on the ball, how far out, how wide.
_FEATURES = ((0.35, 0.2, -0.22, 0.2), (-0.35, 0.2, -0.22, 0.2), (0.0, 0.0, 0.3, 0.16), (0.0, -0.4, -0.15, 0.25))
BEND = Deformation("bend", 60.0)


def relief(columns: int, rows: int) -> Scene:
    """A ball with a relief, of so many vertices around and from pole to pole."""
    polar, around = (np.arange(rows) + 0.5) / rows * np.pi, np.arange(columns) / columns * 2.0 * np.pi
    theta, phi = (each.ravel() for each in np.meshgrid(polar, around, indexing="ij"))
    unit = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=1)
    height = 0.05 * np.sin(9.0 * phi) * np.sin(theta) ** 2 * np.sin(7.0 * theta)
    for x, y, depth, width in _FEATURES:
        place = np.array([x, y, np.sqrt(1.0 - x * x - y * y)])
        height += depth * np.exp(-(((unit - place) / width) ** 2).sum(axis=1))
    vertices = unit * (1.0 + height)[:, None] * (0.8, 1.2, 0.9)
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1], np.roll(at, -1, 1)[:-1], at[1:], np.roll(at, -1, 1)[1:]
    faces = [np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, c, b), (b, c, d))]
    caps = [[at[0, 0], at[0, i], at[0, i + 1]] for i in range(1, columns - 1)]
    caps += [[at[-1, 0], at[-1, i + 1], at[-1, i]] for i in range(1, columns - 1)]
    return _scene(vertices, np.concatenate([*faces, np.array(caps)]))


def _scene(vertices: Float64Array, triangles: NDArray[np.integer]) -> Scene:
    with tempfile.TemporaryDirectory(prefix="insitu-relief-") as folder:
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
        Path(folder, "relief.obj").write_text("\n".join(lines), encoding="utf-8")
        text = (
            "version = 1\n[camera]\nposition = [0, 0.6, 4]\ntarget = [0.2, 0, 0]\nfov_y = 42\nresolution = [512, 384]\n"
            '[environment]\nradiance = [1, 1, 1]\n[[object]]\nname = "relief"\nmesh = "relief.obj"\nsmooth = true\n'
        )
        Path(folder, "relief.toml").write_text(text, encoding="utf-8")
        return load_scene(Path(folder, "relief.toml"))


def varied_sky() -> SkyState:
    """A bright side, and another colour from below."""
    image = np.full((32, 64, 3), 0.15, np.float32)
    image[4:12, 40:52] = (6.0, 5.0, 4.0)
    image[20:, :] = (0.1, 0.2, 0.35)
    return SkyState(Environment(image, "a lamp over a blue floor"))
