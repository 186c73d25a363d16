"""The worker's estimate of the error of the picture that it made: its radiance once more, and how far off that is.

What the window shows is the same sums: transport under the curves as they are, and indirect light as it was found.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from app.jobs.bench import Bench
from app.jobs.layer_data import STAGES, LayerData, shape_of
from app.messages import Response
from app.placement.messages import ErrorEstimated, EstimateError
from app.scene_state import LayerState
from engine.errors import InsituError
from engine.indirect.light import IndirectLight
from engine.render.error_estimate import estimate_error
from engine.render.indirect import reflected_light
from engine.render.picture_error import ErrorEstimate
from engine.render.still import StillLayer, seen_as, with_maps
from engine.steps import told_as
from engine.transport.pipeline import FINAL, Placement, Quality


def estimated(
    request: EstimateError, bench: Bench, held: Mapping[str, LayerData], found: IndirectLight | None
) -> Iterator[Response | None]:
    """The answer. held: transport by layer; found: indirect light, None where there is none. Raises InsituError where
    not every pixel has been computed."""
    placement, states = bench.open_placement, request.scene.visible
    if not states:
        yield ErrorEstimated(ErrorEstimate(0.0))  # nothing reflects: there is nothing to be off
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
        radiance[begin:end] += _as_edited(held[state.key], state).radiance * seen_as(
            placement.hits, np.arange(begin, end), each
        )
        yield None
    indirect, n_bounces = None, 1
    if found is not None:
        n_bounces = found.n_bounces
        indirect = yield from reflected_light(found, layers, request.second_bands, placement.hits)
        radiance += indirect
    sky = bench.sky(first.lit_by.light)
    estimating = estimate_error(placement, layers, sky, quality, n_bounces, radiance, indirect)
    estimate = yield from told_as(estimating, lambda step: None)  # without a word: nobody waits for it
    yield ErrorEstimated(estimate)


def _quality(data: LayerData) -> Quality:
    """How finely a layer's light was computed; of few lights the preview is the last stage."""
    stage, lit_by = STAGES[data.stage], data.lit_by
    return replace(stage, n_lights=lit_by.n_lights, n_patches=lit_by.n_patches if stage is FINAL else stage.n_patches)


def _as_edited(data: LayerData, state: LayerState) -> LayerData:
    """What is held of a layer, under its curves as they are by now: the window edits them without asking anybody."""
    return data if data.is_fixed else data.under(replace(state, bands=data.work.bands))


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
