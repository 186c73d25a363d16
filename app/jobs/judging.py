"""The worker's judgement of the picture that it made: its radiance once more, and how far off that is.

What the window shows is the same sums: transport under the curves as they are, and indirect light as it was found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from app.jobs.bench import Bench
from app.jobs.layer_data import STAGES, LayerData, shape_of
from app.jobs.messages import Response
from app.placement.messages import ErrorEstimated, EstimateError
from engine.indirect.light import IndirectLight
from engine.material.layer import Layer, object_of
from engine.render.error_estimate import estimate_error
from engine.render.indirect import reflected_light
from engine.render.picture_error import ErrorEstimate
from engine.render.still import StillLayer, seen_as, with_maps
from engine.steps import told_as
from engine.transport.pipeline import FINAL, Placement, Quality


def judged(
    request: EstimateError, bench: Bench, held: Mapping[str, LayerData], found: IndirectLight | None
) -> Iterator[Response | None]:
    """The answer; none where not every pixel has been computed. held: transport by layer; found: indirect light, None
    where there is none."""
    placement = bench.open_placement
    keys = [key for key, _ in request.layers]
    if not keys:
        yield ErrorEstimated(ErrorEstimate(0.0))  # nothing reflects: there is nothing to be off
        return
    if not all(key in held and STAGES[held[key].stage].stride == 1 for key in keys):
        return
    quality = _quality(held[keys[0]])
    yield None
    layers = _layers(request, placement, held)
    yield None
    radiance = np.zeros((len(placement.hits.pixel), 3))
    for each, key in zip(layers, keys, strict=True):
        begin, end = placement.hits.object_ranges[each.i_object]
        radiance[begin:end] += _as_edited(held[key], each.layer).radiance * seen_as(
            placement.hits, np.arange(begin, end), each
        )
        yield None
    indirect, n_bounces = None, 1
    if found is not None:
        n_bounces = found.n_bounces
        indirect = yield from reflected_light(found, layers, request.second_bands, placement.hits)
        radiance += indirect
    sky = bench.sky(held[keys[0]].lit_by.light)
    judging = estimate_error(placement, layers, sky, quality, n_bounces, radiance, indirect)
    estimate = yield from told_as(judging, lambda step: None)  # without a word: nobody waits for it
    yield ErrorEstimated(estimate)


def _quality(data: LayerData) -> Quality:
    """How finely a layer's light was computed; of few lights the preview is the last stage."""
    stage, lit_by = STAGES[data.stage], data.lit_by
    return replace(stage, n_lights=lit_by.n_lights, n_patches=lit_by.n_patches if stage is FINAL else stage.n_patches)


def _as_edited(data: LayerData, layer: Layer) -> LayerData:
    """What is held of a layer, under its curves as they are by now: the window edits them without asking anybody."""
    if data.is_fixed:
        return data
    bands = zip(data.work.factors, data.work.bands, strict=True)
    return data.under({name: layer.coefficients(name, n) for name, n in bands})


def _layers(request: EstimateError, placement: Placement, held: Mapping[str, LayerData]) -> tuple[StillLayer, ...]:
    names = [described.name for described in placement.scene.description.objects]
    found = (
        StillLayer(names.index(object_of(key)), layer, shape_of(held[key].work).bands, not held[key].is_fixed)
        for key, layer in request.layers
    )
    return with_maps(placement, found)
