"""A whole precomputed stage of a scene: its light, the transport of every layer, and what both took.

Times begin with an opened scene. Kernels are compiled before anything is timed.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.measure.subject import Subject, layer_bands, layer_shape
from engine.core.generators import run_to_end
from engine.material.layer import Layer
from engine.precompute.direct.bandstore import BandStore, curve_planes, join_tiles
from engine.precompute.direct.pipeline import Placement, Quality
from engine.precompute.direct.projection import VisibleLight, project_layer
from engine.settings import Precision
from engine.visibility.coherent_grid import coherent_visibility
from engine.visibility.point_visibility import VISIBILITY_LEVEL, empty_visibility, evaluate_rows, sphere_targets

PRECISIONS: tuple[Precision, ...] = ("half", "float")
BYTES = {"half": 2, "float": 4}
MIB = float(2**20)


@dataclass(frozen=True, eq=False)
class ComputedLayer:
    """The transport of one layer and what it was computed for."""

    i_object: int
    layer: Layer
    bands: dict[str, int]
    store: BandStore


@dataclass(frozen=True, eq=False)
class Precomputed:
    """A whole stage: light with its visibility, transport of all layers, and the seconds of both."""

    placement: Placement
    light: VisibleLight
    transports: tuple[ComputedLayer, ...]
    light_seconds: float
    projection_seconds: float

    @property
    def seconds(self) -> float:
        return self.light_seconds + self.projection_seconds

    @property
    def rays(self) -> int:
        """Shadow rays traced."""
        return sum(each.rays.traced for each in (self.light.sphere, self.light.fine, self.light.emitters))

    @property
    def store_bytes(self) -> int:
        return sum(transport.store.n_bytes for transport in self.transports)


def precompute(subject: Subject, quality: Quality, most_bands: int | None = None) -> Precomputed:
    """One stage from an opened scene with nothing known of its shadows; opening it is not in the time."""
    return precompute_on(Placement(subject.scene), subject, quality, most_bands)


def precompute_on(
    placement: Placement, subject: Subject, quality: Quality, most_bands: int | None = None
) -> Precomputed:
    """One stage on a placement; visibility that it holds already is used. most_bands: see `layer_bands`."""
    started = time.perf_counter()
    light = run_to_end(placement.light(subject.sky, quality))
    lit = time.perf_counter()
    transports = []
    for i_object, layer in subject.layers:
        bands = layer_bands(layer, most_bands)
        rows, shape = placement.rows_of(i_object), layer_shape(layer, bands)
        store = join_tiles(shape.bands, project_layer(placement.hits, rows, light, shape))
        transports.append(ComputedLayer(i_object, layer, bands, store))
    return Precomputed(placement, light, tuple(transports), lit - started, time.perf_counter() - lit)


def visibility_seconds(placement: Placement) -> float:
    """Computes level-4 visibility of every point by coherence, from nothing, into the placement's sphere."""
    visibility = empty_visibility(placement.hits, sphere_targets(VISIBILITY_LEVEL))
    started = time.perf_counter()
    for _ in coherent_visibility(placement.hits, placement.caster, visibility):
        pass
    evaluate_rows(placement.hits, placement.caster, visibility, np.arange(len(placement.hits.pixel)))
    seconds = time.perf_counter() - started
    placement.sphere = visibility
    return seconds


def layer_coefficients(transport: ComputedLayer, layer: Layer | None = None) -> tuple[NDArray, NDArray]:
    """Band values (J, 3) and (K, 3) of a layer's curves; (1, 3) ones where there is no second curve."""
    layer = layer or transport.layer
    curves = [layer.coefficients(name, n) for name, n in transport.bands.items()]
    return curves[0], (*curves, np.ones((1, 3)))[1]


def gpu_planes(done: Precomputed, transport: ComputedLayer, precision: Precision) -> NDArray[np.float32]:
    """Transport along a layer's first curve as the GPU reads it: (J, P, 3), Daub4 domain, true radiance."""
    unit = done.light.lighting.unit
    planes = curve_planes(transport.store, 0, layer_coefficients(transport), unit, precision)
    return planes.numbers.astype(np.float32) * planes.scale.astype(np.float32)[:, None, None]


def largest_on_gpu(done: Precomputed, precision: Precision) -> int:
    """Bytes that the largest curve's transport takes on the GPU: one layer's is there at a time."""
    sizes = [
        n * transport.store.n_points * 3 * BYTES[precision]
        for transport in done.transports
        for n in transport.bands.values()
    ]
    return max(sizes, default=0)
