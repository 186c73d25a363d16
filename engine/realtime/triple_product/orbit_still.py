"""Renders a still with Orbit's method, from geometry to pixels."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.triple_product.orbit_engine import MOST_BYTES, MOST_SLICE_BYTES, N_COEFFICIENTS, N_POINTS, Orbit
from engine.realtime.triple_product.reflections import LayersOf
from engine.render.still import StillProgress

_DRAWING = 0.97  # progress when drawing begins


def render_orbit(
    placement: Placement,
    layers_of: LayersOf,
    sky: SkyState,
    n_patches: int,
    n_points: int = N_POINTS,
    n_coefficients: int = N_COEFFICIENTS,
    n_bounces: int = 1,
    most_bytes: int = MOST_BYTES,
    most_slice_bytes: int = MOST_SLICE_BYTES,
) -> Generator[StillProgress, None, NDArray[np.float32]]:
    """Render radiance (H, W, 3) after up to n_bounces reflections, as Orbit shows it at rest; yield the progress.

    layers_of: the layers of each object, by its index; most_bytes and most_slice_bytes: limits for the points' data and
    for the slices, see `Orbit`.
    """
    orbit = Orbit(placement.scene, placement.caster, n_points, n_coefficients, n_patches, most_bytes, most_slice_bytes)
    orbit.set_light(sky)
    orbit.set_layers(layers_of)
    orbit.set_bounces(n_bounces)
    camera, resolution = placement.scene.description.camera, placement.hits.resolution
    for step in orbit.work():
        yield StillProgress(_DRAWING * step.fraction, step.text)
    picture = orbit.draw(camera, resolution, "still")
    if not orbit.is_done:  # the picture shows the backs of some objects
        for step in orbit.work():
            yield StillProgress(_DRAWING * step.fraction, step.text)
        picture = orbit.draw(camera, resolution, "still")
    return picture
