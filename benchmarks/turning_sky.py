"""A sky that turns over frozen materials, by n wavelets of its light a frame, shared by all pixels [BenArtzi07, 7.2].

Three strategies choose them (`app.measure.settings_placement`); a coefficient counts by its size times the RMS of what
pixels reflect of it. Beside them stand the rows that Placement keeps, whose terms each pixel chooses for itself
(`engine.precompute.direct.relight`). docs/relighting.md has the results.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.measure.settings_placement import STRATEGIES, Strategy, frame_coefficients
from app.project.project import Project, open_project
from app.system.atomic import save_file
from engine.core.generators import run_to_end
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.precompute.direct.relight import MEAN_TERMS, RowMaker, light_coefficients, turning_effects
from engine.sphere.haar import levels_of_coefficients
from engine.visibility.point_visibility import VISIBILITY_LEVEL

ROWS = "rows, each pixel's own"
FILE = "turning.csv"
# Frames at the beginning that are not judged: all strategies begin with the whole light.
_SETTLING = 3

Float32Array = NDArray[np.float32]


@dataclass(frozen=True)
class TurningEffort:
    """The picture and how many of a layer's points are taken, by how many degrees the sky turns a frame, terms."""

    resolution: tuple[int, int] = (256, 256)
    n_points: int = 120
    degrees: tuple[float, ...] = (1.0, 3.0, 10.0)
    terms: tuple[int, ...] = (64, 128, 256, 512)
    n_frames: int = 31
    n_lights: int = FINAL.n_lights


@dataclass(frozen=True)
class Turning:
    """relRMSE of a turn's frames by so many terms, against all of them."""

    degrees: float
    strategy: str
    terms: int
    error: float


def turning_errors(effort: TurningEffort, report: Callable[[str], None], source: str = "teatray") -> list[Turning]:
    """Every strategy with every number of terms, and the rows."""
    report(f"wavelets of a turning sky: {source}")
    project = open_project(source, effort.resolution)
    rows, kept = _reflected(project, effort)
    sky, found = project.sky, []
    assert sky.environment is not None
    for degrees in effort.degrees:
        lights = [light_coefficients(sky.environment, degrees * i, sky.scale) for i in range(effort.n_frames)]
        truth = _lit(rows, lights)
        found.append(Turning(degrees, ROWS, MEAN_TERMS, _error(_lit(kept, lights), truth)))
        for strategy in STRATEGIES:
            for n in effort.terms:
                found.append(
                    Turning(degrees, strategy, n, _error(_lit(rows, followed(rows, lights, n, strategy)), truth))
                )
    return found


def followed(
    rows: Float32Array, lights: Sequence[Float32Array], n_terms: int, strategy: Strategy
) -> list[Float32Array]:
    """The coefficients (T, 3) that each frame's picture is of, after lights (T, 3), the first of them whole.

    rows (P, T, 3): what points reflect; n_terms: coefficients that change in a frame.
    """
    weight = np.sqrt(np.mean(rows**2, axis=(0, 2)))
    return frame_coefficients(weight, levels_of_coefficients(VISIBILITY_LEVEL), lights, n_terms, strategy)


def write_turning(output: Path, found: Sequence[Turning]) -> None:
    """One line a setting under a line of names."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("degrees", "strategy", "terms", "error"))
    writer.writerows((each.degrees, each.strategy, each.terms, f"{each.error:.6g}") for each in found)
    save_file(output / FILE, text.getvalue().encode())


def _reflected(project: Project, effort: TurningEffort) -> tuple[Float32Array, Float32Array]:
    """What some points of all layers reflect of each wavelet, (P, T, 3), and that with as many terms as rows have."""
    placement, sky = Placement(project.scene), project.sky
    assert sky.environment is not None
    run_to_end(placement.light(sky, replace(FINAL, n_lights=effort.n_lights)))
    effects = run_to_end(turning_effects(sky.environment, sky.scale))
    maker, random = RowMaker(placement.hits, placement.sphere, effects), np.random.default_rng(1)
    parts = []
    for i_object, layer in project.indexed_layers:
        points = placement.rows_of(i_object)
        some = np.sort(random.choice(points, min(effort.n_points, len(points)), replace=False))
        parts.append(_dense(maker, layer, some))
    rows = np.concatenate(parts)
    effect = np.abs(rows).max(axis=2) * effects
    n_kept = min(MEAN_TERMS * len(rows), effect.size)
    least = np.partition(effect.ravel(), -n_kept)[-n_kept]
    return rows, np.where((effect >= least)[..., None], rows, np.float32(0.0))


def _dense(maker: RowMaker, layer: Layer, points: NDArray[np.integer]) -> Float32Array:
    dense, begin = np.zeros((len(points), len(maker.effects), 3), np.float32), 0
    for tile in maker.rows(layer, points):
        mine = begin + np.repeat(np.arange(len(tile.scale)), np.diff(tile.start))
        dense[mine, tile.number] = tile.value * (tile.scale / 32767.0)[mine - begin, None]
        begin += len(tile.scale)
    return np.asarray(dense * layer.scale(), np.float32)


def _lit(rows: Float32Array, lights: Sequence[Float32Array]) -> Float32Array:
    """Radiance (F, P, 3) of the frames that are judged."""
    return np.asarray(np.einsum("pkc,fkc->fpc", rows, np.stack(lights[_SETTLING:]), optimize=True), np.float32)


def _error(found: Float32Array, truth: Float32Array) -> float:
    return float(np.sqrt(np.mean((found - truth) ** 2)) / np.mean(truth))
