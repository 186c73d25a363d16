"""Estimates the error of a picture that the worker made, by computing its radiance again at sample points.

The window shows the same sums in Placement: transport under the present curves, and indirect light as it was found.
Pictures of other modes are compared with the same reference, for the open view.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.document.scene_state import LayerState
from app.messages.worker_messages import Response
from app.modes.orbit.orbit_messages import DrawnErrorEstimated, EstimateDrawn
from app.modes.placement.placement_messages import ErrorEstimated, EstimateError
from app.worker.kernels import ESTIMATE
from app.worker.layer_data import STAGES, LayerData, shape_of
from app.worker.tasks import WorkerContext
from engine.core.errors import InsituError
from engine.core.generators import map_steps
from engine.planner import band_counts
from engine.precompute.direct.pipeline import FINAL, Placement, Quality, final_quality
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.render.error_estimate import (
    MAP_POINTS,
    N_POINTS,
    Colours,
    PointErrors,
    error_colours,
    estimate_drawn_errors,
    estimate_point_errors,
)
from engine.render.picture_error import ErrorEstimate
from engine.render.still import StillLayer, noise_in, reflected_light, view_factors, with_maps

DrawSteps = Generator[object, None, NDArray[np.float32]]


def estimate_error(
    request: EstimateError, context: WorkerContext, held: Mapping[str, LayerData], found: IndirectLight | None
) -> Iterator[Response | None]:
    """The response. held: transport by layer; found: indirect light, None where there is none. Raises InsituError where
    not every pixel has been computed."""
    placement, states = context.open_placement, request.scene.visible
    if not states:
        yield ErrorEstimated(ErrorEstimate(0.0))  # nothing reflects: there is no error
        return
    if not all(state.key in held and STAGES[held[state.key].stage].stride == 1 for state in states):
        raise InsituError("the error is estimated of a whole picture, and not every pixel of this one is computed yet")
    first = held[states[0].key]
    quality = _quality(first)
    yield None
    layers = _layers(states, placement, held)
    yield None
    radiance = np.zeros((len(placement.hits.pixel), 3))
    for each, state in zip(layers, states, strict=True):
        begin, end = placement.hits.object_ranges[each.i_object]
        data = held[state.key]
        if not data.is_fixed:  # the window edits curves without a request
            data = data.with_curves(replace(state, bands=data.work.bands))
        radiance[begin:end] += data.radiance * view_factors(placement.hits, np.arange(begin, end), each)
        yield None
    indirect, noise, n_bounces = None, None, 1
    if found is not None:
        n_bounces = found.n_bounces
        indirect = yield from reflected_light(found, layers, request.second_bands, placement.hits)
        radiance += indirect
        noise = yield from map_steps(noise_in(found, layers, request.second_bands), lambda step: None)
    sky = context.sky(first.lit_by.light)
    n_points = MAP_POINTS if request.has_map else N_POINTS
    estimating = estimate_point_errors(
        placement, layers, sky, quality, n_bounces, radiance, indirect, n_points=n_points, noise=noise
    )
    estimated = yield from map_steps(estimating, lambda step: None)  # without progress: it runs in the background
    yield ErrorEstimated(estimated.estimate, (yield from _colours(request.has_map, placement, estimated)))


def estimate_drawn_error(
    request: EstimateDrawn, context: WorkerContext, n_bounces: int, drawing: Callable[[Any], DrawSteps]
) -> Iterator[Response | None]:
    """The response. drawing: makes a requested picture (h, w, 3). n_bounces: the number of reflections in it."""
    yield from context.until_compiled(ESTIMATE)
    pictures = []
    for wanted in (request.at_rest, request.moving):
        pictures.append((yield from map_steps(drawing(wanted), lambda step: None)))
    placement, scene = context.open_placement, request.scene
    placement.set_emission(dict(scene.emission))
    layers = with_maps(placement, (_with_own_bands(state, placement) for state in scene.layers))
    yield None
    n_points = MAP_POINTS if request.has_map else N_POINTS
    estimating = estimate_drawn_errors(
        placement, layers, context.sky(scene.light), n_bounces, pictures, n_points=n_points
    )
    at_rest, moving = yield from map_steps(estimating, lambda step: None)
    colours = yield from _colours(request.has_map, placement, at_rest)
    yield DrawnErrorEstimated(at_rest.estimate, moving.estimate, colours)


def _colours(is_wanted: bool, placement: Placement, estimated: PointErrors) -> Generator[None, None, Colours | None]:
    """The error map of the picture."""
    return (yield from error_colours(placement.hits, estimated)) if is_wanted else None


def _with_own_bands(state: LayerState, placement: Placement) -> StillLayer:
    """A layer with the bands that its curves need."""
    first, second = (*band_counts(state.layer).values(), 1, 1)[:2]
    return StillLayer(placement.scene.object_index(state.object), state.layer, (first, second), False)


def _quality(data: LayerData) -> Quality:
    """How finely a layer's light was computed; with few lights the preview is the last stage."""
    stage, settings = STAGES[data.stage], data.lit_by.planned_settings or data.lit_by.settings
    return final_quality(settings) if stage is FINAL else replace(stage, n_lights=settings.n_lights)


def _layers(
    states: Iterable[LayerState], placement: Placement, held: Mapping[str, LayerData]
) -> tuple[StillLayer, ...]:
    found = (
        StillLayer(
            placement.scene.object_index(state.object), state.layer, shape_of(held[state.key].work).bands,
            not held[state.key].is_fixed,
        )
        for state in states
    )  # fmt: skip
    return with_maps(placement, found)
