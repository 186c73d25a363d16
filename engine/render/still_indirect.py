"""The indirect light of a still: what the editor shows at rest, by the same sums."""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import map_steps, run_to_end
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.clamping import clamp_radiance, unscaled
from engine.precompute.indirect.gather import object_of_rows
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer, view_factors
from engine.precompute.indirect.indirect_light import GatherPolynomial, IndirectLight
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries, SamplingSettings
from engine.precompute.indirect.solver import Solver
from engine.render.path_tracer import trace_halves
from engine.render.still import StillLayer, StillProgress, by_object
from engine.scene.primary_hits import PrimaryHits

# Number of points whose direct light is estimated, and of paths for each.
_N_ROWS, _N_PATHS = 2048, 8


def indirect_radiance(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, series: BounceSeries,
    settings: SamplingSettings = STILL,
    as_needed: bool = False,
) -> Generator[StillProgress, None, NDArray[np.float32]]:  # fmt: skip
    """Radiance (P, 3) that reaches the camera after 2 bounces to all of the series, at the points of the hits;
    arguments: see `find_indirect`."""
    found = yield from find_indirect(placement, layers, sky, series, settings, as_needed)
    return run_to_end(reflected_light(found, layers, series.second, placement.hits))


def find_indirect(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, series: BounceSeries, settings: SamplingSettings,
    as_needed: bool,
) -> Generator[StillProgress, None, IndirectLight]:  # fmt: skip
    """Compute the light of a picture after 2 bounces to all of the series; as_needed: by no more rays than it needs."""
    other_light = None
    if as_needed:
        looking = StillProgress(0.0, "tracing gather points")
        other_light = yield from map_steps(direct_mean(placement, by_object(layers), sky), lambda step: looking)
    solver = Solver(placement, models_of(layers), sky, series.n_bounces, settings, series.second != 1, other_light)
    steps = solver.solve(indirect_layers(layers, series.second))
    return (yield from map_steps(steps, lambda step: StillProgress(*step)))


def reflected_light(
    found: IndirectLight, layers: Sequence[StillLayer], second: int | None, hits: PrimaryHits,
    polynomial: GatherPolynomial | None = None,
) -> Generator[None, None, NDArray[np.float32]]:  # fmt: skip
    """The same of light that was computed before, in steps; second: the most bands of the second bounce, as in
    `BounceSeries`; polynomial: of the same rays; caches what does not depend on curves.

    Layers with images are computed one by one: what they reflect varies slowly between gather points, the images do
    not.
    """
    reflecting = indirect_layers(layers, second)
    found = found.without_glossy_hits() if second == 1 else found
    polynomial = GatherPolynomial(found, keeps=False) if polynomial is None else polynomial.with_light(found)
    frozen = yield from polynomial.freeze(reflecting)
    gather_points = found.points.samples.points
    objects = object_of_rows(hits, gather_points)

    def at_points(i: int, layer: IndirectLayer) -> NDArray[np.float32]:
        """Radiance (p, 3) of layer i at the gather points."""
        out = np.zeros((len(gather_points), 3), np.float32)
        mine = np.flatnonzero(objects == layer.i_object)
        with np.errstate(over="ignore"):
            out[mine] = frozen.reflected[i][:, 0] * view_factors(hits, gather_points[mine], layer)
        return out

    def at_pixels(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        rows, weights = found.footprint
        return unscaled(np.einsum("pk,pkc->pc", weights, clamp_radiance(radiance)[rows]), found.unit)

    pairs = list(zip(layers, reflecting, strict=True))
    plain = np.zeros((len(gather_points), 3), np.float32)
    for i, (each, layer) in enumerate(pairs):
        if each.maps is None:
            plain += at_points(i, layer)
    total = at_pixels(plain)
    for i, (each, layer) in enumerate(pairs):
        begin, end = hits.object_ranges[each.i_object]
        if (factor := each.factor(hits, np.arange(begin, end))) is not None:
            alone = at_pixels(at_points(i, replace(layer, gain=each.layer.scale())))
            total[begin:end] += alone[begin:end] * factor
    return total


def noise_in(found: IndirectLight, layers: Sequence[StillLayer], second: int | None) -> Generator[None, None, float]:
    """Noise in that light as the layers reflect it, RMS radiance, in steps; arguments: see `reflected_light`."""
    found = found.without_glossy_hits() if second == 1 else found
    relative, mean = yield from found.noise(indirect_layers(layers, second))
    return relative * mean


def direct_mean(
    placement: Placement, layers_of: Mapping[int, Sequence[Layer]], sky: SkyState
) -> Generator[StillProgress, None, float]:
    """Mean of the direct light that the picture's points reflect with these layers of each object, by path tracing:
    accurate to some per cent."""
    hits = placement.hits
    if not len(hits.pixel):
        return 0.0
    rows = np.sort(np.random.default_rng(1).choice(len(hits.pixel), min(_N_ROWS, len(hits.pixel)), replace=False))
    halves = yield from trace_halves(placement, layers_of, sky, 1, _N_PATHS, 1, rows)
    weights = hits.share[rows] / max(float(hits.share[rows].sum()), 1e-30)
    return float(weights @ halves[:, :, 0].mean(axis=(0, 2)))


def models_of(layers: Sequence[StillLayer]) -> dict[int, list[str]]:
    """Names of the models of every object's layers, by the object's index."""
    models: dict[int, list[str]] = {}
    for each in layers:
        models.setdefault(each.i_object, []).append(each.layer.model.name)
    return models


def indirect_layers(layers: Sequence[StillLayer], second: int | None = None) -> list[IndirectLayer]:
    """The layers in the form of the indirect light; second: the most bands of the second bounce, as in
    `BounceSeries`."""
    return [
        indirect_layer(each.i_object, each.layer, each.bands[: len(each.layer.model.factors)], second, each.mean_factor)
        for each in layers
    ]
