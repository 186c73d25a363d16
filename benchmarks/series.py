"""Series of bands by bounce beside paths: how far each is off, and how far any series of that kind has to be
[BenArtzi07, sect. 5.2, fig. 5.3, 5.5 and 5.6].

    .venv/bin/python -m benchmarks.series

A series is compared with paths of four bounces whose materials are whole at each. Beside it stand paths with whole
curves at as many bounces as the series has bands at, and equivalent albedos at the others: that far the approximation
is off, whatever finds the light. Errors are relRMSE over the points of objects; the noise of paths is taken out, as
that of their halves is independent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.measure.report import table
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object, render_picture
from engine.core.generators import run_to_end
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.precompute.indirect.sampling_settings import BounceSeries, parse_series
from engine.reference.path_tracer import LayersOf, trace_halves

N_BOUNCES, SEED, SIDE, N_PATHS = 4, 5, 32, 1024
BANDS = 128, 32
SCENES = "cornell", "teatray", "ring"
# Each with the number of bounces at which it has curves.
SERIES: Mapping[str, int] = {
    "direct+1,1,1,1": 0, "64,1,1,1": 1, "128,8,1,1": 2, "64,16,1,1": 2, "16,8,1,1": 2, "64,16,8,1": 3,
}  # fmt: skip
Halves = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """A series; its error and the difference of its mean, relative to the mean of paths, and the same of paths whose
    materials are as simple; None where there are none."""

    name: str
    error: float
    mean: float
    error_of_paths: float | None = None
    mean_of_paths: float | None = None


def series_rows(project: Project, n_paths: int) -> list[Row]:
    """The rows of a project with one ray through each pixel, and so many paths a pixel."""
    placement = Placement(project.scene)
    own: LayersOf = layers_by_object(project)
    simple: LayersOf = {i: _by_albedo(layers) for i, layers in own.items()}

    def paths(curves: int, seed: int = SEED) -> Halves:
        """Light (2, P, 2, 3), direct and all, of curves at so many bounces."""
        stages = [own] * curves + [simple] * (N_BOUNCES - curves)
        rows = np.arange(len(placement.hits.pixel))
        return run_to_end(trace_halves(placement, stages[0], project.sky, N_BOUNCES, n_paths, seed, rows, stages[1:]))

    whole = paths(N_BOUNCES)
    rows = [_row("whole curves", _points(project, placement, BounceSeries(N_BOUNCES)), whole[:, :, 1])]
    for text, curves in SERIES.items():
        seen = _points(project, placement, parse_series(text))
        alike = paths(curves, SEED + 1)[:, :, 1]
        if not curves:  # direct light is whole
            alike += whole[:, :, 0] - paths(curves, SEED + 1)[:, :, 0]
        rows.append(_row(text, seen, whole[:, :, 1], alike))
    rows.append(_row("direct light", _points(project, placement, BounceSeries(1)), whole[:, :, 1]))
    return rows


def _points(project: Project, placement: Placement, series: BounceSeries) -> NDArray[np.float64]:
    """A still at the points of the picture, (P, 3)."""
    picture = render_picture(project, lambda step: None, series=series)
    return picture.reshape(-1, 3)[placement.hits.pixel].astype(np.float64)


def _row(name: str, seen: NDArray[np.float64], whole: Halves, alike: Halves | None = None) -> Row:
    both = np.stack([seen, seen])
    if alike is None:
        return Row(name, _error(both, whole), _difference(both, whole))
    return Row(name, _error(both, whole), _difference(both, whole), _error(alike, whole), _difference(alike, whole))


def _error(found: Halves, truth: Halves) -> float:
    """relRMSE without noise: the products of the halves' differences have the mean of its square."""
    first, second = found - truth
    return float(np.sqrt(max((first * second).mean(), 0.0)) / truth.mean())


def _difference(found: Halves, truth: Halves) -> float:
    return float(found.mean() / truth.mean() - 1.0)


def _by_albedo(layers: Sequence[Layer]) -> tuple[Layer, ...]:
    """One diffuse layer that reflects as much light [BenArtzi07, 5.2.4]."""
    if not layers:
        return ()
    albedo = sum((equivalent_albedo(each, BANDS[: len(each.model.factors)]) for each in layers), np.zeros(3))
    return (make_layer(MODELS["lambert"], {"albedo": tuple(np.minimum(albedo, 1.0).tolist())}),)


def series_table(rows: Sequence[Row]) -> str:
    """The rows as a table of percentages."""
    lines = [
        [
            row.name, f"{row.error:.1%}", f"{row.mean:+.1%}",
            "" if row.error_of_paths is None else f"{row.error_of_paths:.1%}",
            "" if row.mean_of_paths is None else f"{row.mean_of_paths:+.1%}",
        ]
        for row in rows
    ]  # fmt: skip
    return table(["series", "relRMSE", "means", "such paths", "means"], lines)


if __name__ == "__main__":
    for each in SCENES:
        opened = open_project(each, (SIDE, SIDE)).with_settings(n_edge_rays=0)
        print(f"{each}\n\n{series_table(series_rows(opened, N_PATHS))}\n", flush=True)
