"""Pictures of fitted lobes: `python -m assets.scripts.lobes [FOLDER] [NAME ...]`. Two minutes.

`lobes_random.png` after [Sloan05, fig. 2], `lobes_head.png` after figure 3.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from app.measure.report import save_figure
from app.project.project import open_project
from app.stills.stills import layers_by_object
from assets.scripts.bounces import save
from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics.deform_engine import ORDER, Deform, finish_deform
from engine.realtime.zonal_harmonics.zonal import Zonal, fit
from engine.render.display import display_picture
from engine.scene.surface_kinds import NO_SURFACE
from engine.sphere.harmonics import bands, basis

Float64Array = NDArray[np.float64]

COUNTS = (1, 2, 3, 4)
RED, BLUE = np.array([0.78, 0.22, 0.17]), np.array([0.18, 0.40, 0.60])
N_ROWS, N_COLUMNS = 61, 121
SIZE, N_POINTS, N_RAYS = (230, 230), 0, 1000


def main(folder: Path, names: Sequence[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or MAKERS:
        MAKERS[name](folder / f"lobes_{name}.png")
        print(folder / f"lobes_{name}.png", (folder / f"lobes_{name}.png").stat().st_size, flush=True)


def random(file: Path) -> None:
    """A random function of order 6, its fits by 1 to 4 lobes, and the lobes of the last; the radius is the value."""
    vector = np.random.default_rng(7).normal(size=(8, ORDER * ORDER))[7:]
    vector /= np.linalg.norm(vector)
    fits = {count: run_to_end(fit(vector, count)) for count in COUNTS}
    row = [("function", vector[0])]
    row += [(f"{n} lobe{'s' * (n > 1)}: {each.errors[0]:.0%} off", each.harmonics()[0]) for n, each in fits.items()]
    parts = [("bands 0 and 1", np.pad(fits[4].low[0], (0, ORDER * ORDER - 4)))]
    parts += [(f"lobe {i + 1} of 4", each) for i, each in enumerate(lobe_vectors(fits[4]))]
    figure = plt.figure(figsize=(11.0, 4.6), layout="constrained")
    for i, (title, each) in enumerate((*row, *parts)):
        axes = figure.add_subplot(2, len(row), i + 1, projection="3d")
        _draw(axes, title, each)
    save_figure(file, figure)


def lobe_vectors(zonal: Zonal) -> Float64Array:
    """The vectors (N, n^2) of the lobes of the first point, without what is stored exactly."""
    n = zonal.coefficients.shape[2]
    return basis(zonal.axes[0], n) * zonal.coefficients[0][:, bands(n)]


def _draw(axes: object, title: str, vector: Float64Array) -> None:
    polar, azimuth = np.meshgrid(
        np.linspace(0.0, np.pi, N_ROWS), np.linspace(0.0, 2.0 * np.pi, N_COLUMNS), indexing="ij"
    )
    sine = np.sin(polar)
    directions = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)], axis=-1)
    values = basis(directions.reshape(-1, 3), ORDER) @ vector
    values = values.reshape(polar.shape)
    x, y, z = np.moveaxis(directions * np.abs(values)[..., None], -1, 0)
    colours = np.where(values[..., None] > 0.0, RED, BLUE)
    axes.plot_surface(x, y, z, facecolors=colours, rstride=1, cstride=1, linewidth=0, antialiased=False)  # type: ignore[attr-defined]
    for name in "xyz":
        getattr(axes, f"set_{name}lim")(-0.55, 0.55)
    axes.set_box_aspect((1, 1, 1), zoom=1.35)  # type: ignore[attr-defined]
    axes.set_axis_off()  # type: ignore[attr-defined]
    axes.set_title(title, fontsize=10, y=1.04)  # type: ignore[attr-defined]


def head(file: Path) -> None:
    """The carved head: without shadows, by 1, 2, 3 and 4 lobes, and below each the error of its fit."""
    project = open_project("idol", SIZE)
    deform = Deform(project.resting, N_POINTS, N_RAYS)
    deform.set_light(project.sky)
    deform.set_layers(layers_by_object(project))
    deform.set_surfaces((("head", NO_SURFACE),))
    deform.set_bending(("head",))
    columns, camera = [], project.resting.description.camera
    for count in (0, *COUNTS):
        deform.set_effort(N_RAYS, count)
        finish_deform(deform)
        drawn = display_picture(deform.draw(camera, SIZE, (), "rest"), tone_mapping="filmic")
        errors = display_picture(deform.draw_errors(camera, SIZE), tone_mapping="false_colour")
        titled = np.vstack([_named("unshadowed" if not count else f"{count} lobe{'s' * (count > 1)}"), drawn])
        columns.append(np.vstack([titled, np.full_like(errors, 255) if not count else errors]))
    save(file, np.hstack(columns))


def _named(text: str) -> NDArray[np.uint8]:
    strip = Image.new("RGB", (SIZE[0], 18), "white")
    ImageDraw.Draw(strip).text((SIZE[0] / 2, 3), text, "black", anchor="ma")
    return np.asarray(strip)


MAKERS: dict[str, Callable[[Path], None]] = {"random": random, "head": head}

if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"), sys.argv[2:])
