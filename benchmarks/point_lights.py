"""Lights that keep their extent, against points: `python -m benchmarks.point_lights FOLDER`.

After [BenArtzi07, 4.2, fig. 4.3]. The same cut of an environment is taken twice. As *triangles* each light spreads over
the bands that it covers (eq. 4.12), as Placement computes; as *points* all of its power comes from its centre.
Visibility is asked once per light, at its centre, in both. The truth is a sum over 81,920 directions with a ray for
each. Errors are of random pixels, of the tea tray's copper as it is and with sharper gloss, where points become visible
one by one.

FOLDER gets point_lights.csv, and point_lights.png: points above, triangles below, with more lights to the right.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from app.project.project import Project, open_project
from app.stills.stills import layers_by_object
from app.system.atomic import save_file
from benchmarks.haar_truncation import factors_at
from engine.core.generators import run_to_end
from engine.light.triangle_lights import cut_lights
from engine.material.layer import Layer
from engine.planner import band_counts
from engine.precompute.direct.pipeline import FINAL, Placement, SkyState
from engine.reference.integrator import integrate_direct
from engine.render.display import display_picture
from engine.render.picture_difference import errors
from engine.render.still import StillLayer, compose, reflect_layers

Float64Array = NDArray[np.float64]
Layers = Mapping[int, Sequence[Layer]]

N_LIGHTS = (400, 4000, 10_000)
SCENES: Mapping[str, Sequence[tuple[str, float]]] = {
    "tea tray": (),
    "tea tray, sharper copper": (("teapot.copper.n_u", 4000.0), ("teapot.copper.n_v", 2000.0)),
}
SIZE, N_PIXELS, LEVEL = 192, 1500, 6
SHOWN = "tea tray, sharper copper"
CSV, PICTURE = "point_lights.csv", "point_lights.png"
CAPTION, GAP = 20, 6


@dataclass(frozen=True)
class Row:
    """relRMSE of one scene with the environment as so many points or triangles."""

    scene: str
    lights: str
    n: int
    rmse: float


def as_points(placement: Placement, rows: NDArray[np.integer], layers: Layers, sky: SkyState, n: int) -> Float64Array:
    """Direct light (p, 3) of the sky at some rows of the hits, from the centres of n lights."""
    assert sky.environment is not None
    lights = cut_lights(sky.environment, n, sky.rotation, FINAL.max_level)
    power = lights.power.astype(np.float64) * sky.scale
    shining = power.any(axis=1)
    towards, power = lights.centre[shining].astype(np.float64), power[shining]
    found, objects = np.zeros((len(rows), 3)), placement.hits.objects
    for i, row in enumerate(rows):
        own = layers.get(int(objects[row]), ())
        visible, reflected = factors_at(placement.hits, int(row), placement.caster, own, towards)
        found[i] = (power * visible[:, None] * reflected).sum(axis=0)
    return found


def as_triangles(placement: Placement, project: Project, n: int) -> Float64Array:
    """Direct light (P, 3) of the sky at all hits, as Placement computes it with n lights and a ray to each."""
    quality = replace(FINAL, n_lights=n, own_rays=True, sun_level=0)
    layers = []
    for i_object, layer in project.indexed_layers:
        counts = (*band_counts(layer).values(), 1)
        layers.append(StillLayer(i_object, layer, (counts[0], counts[1]), True))
    return run_to_end(reflect_layers(placement, layers, project.sky, quality), lambda step: None)


def measure(
    scenes: Mapping[str, Sequence[tuple[str, float]]] = SCENES, size: int = SIZE, n_pixels: int = N_PIXELS,
    counts: Sequence[int] = N_LIGHTS, level: int = LEVEL, source: str = "teatray",
) -> Iterator[Row]:  # fmt: skip
    """The errors of each scene, representation and number of lights."""
    for name, values in scenes.items():
        project = open_project(source, (size, size), values)
        placement, layers, sky = Placement(project.scene), layers_by_object(project), project.sky
        n = len(placement.hits.pixel)
        rows = np.sort(np.random.default_rng(1).choice(n, min(n_pixels, n), replace=False))
        truth = integrate_direct(
            placement.hits, rows, placement.caster, lambda i, own=layers: own.get(i, ()),  # type: ignore[misc]
            sky.environment, sky.rotation, None, level,
        )  # fmt: skip
        for count in counts:
            points = as_points(placement, rows, layers, sky, count)
            yield Row(name, "points", count, errors(points, sky.scale * truth).rmse)
            triangles = as_triangles(placement, project, count)[rows]
            yield Row(name, "triangles", count, errors(triangles, sky.scale * truth).rmse)


def figure(size: int = SIZE, counts: Sequence[int] = N_LIGHTS, source: str = "teatray") -> Image.Image:
    """Points above, triangles below."""
    project = open_project(source, (size, size), SCENES[SHOWN] if source == "teatray" else ())
    placement, layers = Placement(project.scene), layers_by_object(project)
    rows = np.arange(len(placement.hits.pixel))
    sheet = Image.new("RGB", (len(counts) * (size + GAP) - GAP, CAPTION + 2 * size + GAP), "white")
    draw = ImageDraw.Draw(sheet)
    for column, n in enumerate(counts):
        left = column * (size + GAP)
        words = f"{n:,} lights"
        draw.text((left + size // 2, CAPTION // 2), words, "black", ImageFont.load_default(13), anchor="mm")
        radiances = as_points(placement, rows, layers, project.sky, n), as_triangles(placement, project, n)
        for row, radiance in enumerate(radiances):
            shown = Image.fromarray(display_picture(compose(placement, radiance, project.sky)))
            sheet.paste(shown, (left, CAPTION + row * (size + GAP)))
    return sheet


def write_rows(file: Path, found: Sequence[Row]) -> None:
    """The table, whole or not at all."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("scene", "lights as", "lights", "relRMSE"))
    writer.writerows((each.scene, each.lights, each.n, f"{each.rmse:.4g}") for each in found)
    save_file(file, text.getvalue().encode())


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    write_rows(folder / CSV, list(measure()))
    figure().save(folder / PICTURE, optimize=True)


if __name__ == "__main__":
    main()
