"""The indirect light of a still: what the editor shows when everything rests, by the same sums."""

from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.indirect.beyond import in_full
from engine.indirect.layers import IndirectLayer, indirect_layer
from engine.indirect.light import IndirectLight
from engine.indirect.reflection import SentLight
from engine.indirect.series import BounceSeries
from engine.indirect.solver import STILL, Fineness, Solver
from engine.render.still import StillLayer, StillProgress
from engine.scene.hits import PrimaryHits
from engine.steps import finish, told_as
from engine.transport.pipeline import Placement, SkyState


def indirect_radiance(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, series: BounceSeries, fineness: Fineness = STILL
) -> Generator[StillProgress, None, NDArray[np.float32]]:
    """Radiance (P, 3) that reaches the eye after 2 bounces to all of the series, at the points of the hits."""
    reflecting = indirect_layers(layers, series.second)
    solver = Solver(placement, models_of(layers), sky, series.n_bounces, fineness, glossy=series.second != 1)
    found = yield from told_as(solver.solve(reflecting), lambda step: StillProgress(*step))
    return finish(reflected_light(found, layers, series.second, placement.hits))


def reflected_light(
    found: IndirectLight, layers: Sequence[StillLayer], second: int | None, hits: PrimaryHits
) -> Generator[None, None, NDArray[np.float32]]:
    """The same of light that was found, in steps; second: the most bands of the second bounce, as a
    `BounceSeries` has them.

    Layers with images one by one: what they reflect varies slowly between gather points, the images do not."""
    reflecting = indirect_layers(layers, second)
    found = found.by_albedo() if second == 1 else found
    light = found.sent(reflecting)
    yield
    pairs = list(zip(layers, reflecting, strict=True))
    total = yield from _reflected(found, [seen for each, seen in pairs if each.seen is None], light)
    for each, seen in pairs:
        begin, end = hits.object_ranges[each.i_object]
        if (factor := each.factor(hits, np.arange(begin, end))) is not None:
            alone = yield from _reflected(found, [replace(seen, gain=each.layer.scale())], light)
            total[begin:end] += alone[begin:end] * factor
    return total


def _reflected(
    found: IndirectLight, layers: Sequence[IndirectLayer], light: SentLight
) -> Generator[None, None, NDArray[np.float32]]:
    """What some layers reflect of light that all of them sent, (P, 3)."""
    at_points = yield from found.points.reflected(layers, light)
    rows, weights = found.footprint
    return in_full(np.einsum("pk,pkc->pc", weights, at_points[rows]), found.unit)


def models_of(layers: Sequence[StillLayer]) -> dict[int, list[str]]:
    """Names of the models of every object's layers, by the object's index."""
    models: dict[int, list[str]] = {}
    for each in layers:
        models.setdefault(each.i_object, []).append(each.layer.model.name)
    return models


def indirect_layers(layers: Sequence[StillLayer], second: int | None = None) -> list[IndirectLayer]:
    """The layers as indirect light sees them; second: the most bands of the second bounce, as a `BounceSeries` has
    them."""
    return [
        indirect_layer(each.i_object, each.layer, each.bands[: len(each.layer.model.factors)], second, each.mean_factor)
        for each in layers
    ]
