"""The scene that is measured: opened as the worker opens it, precomputed, and its pictures against our brute-force
oracle.

Times of a precomputed stage begin with an opened scene. Kernels are compiled before anything is timed.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.project.project import Project, open_project
from app.stills.stills import render_picture
from engine.core.generators import run_to_end
from engine.core.threads import on_threads
from engine.light.environment import Environment
from engine.material.layer import Layer
from engine.planner import band_counts, bands_for_sharpest
from engine.precompute.direct.bandstore import BandStore, curve_planes, join_tiles
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.reference.integrator import integrate_direct
from engine.scene.scene_loader import Scene
from engine.settings import Precision
from engine.visibility.coherent_grid import coherent_visibility
from engine.visibility.point_visibility import VISIBILITY_LEVEL, empty_visibility, evaluate_rows, sphere_targets

Bands = dict[str, int]


@dataclass(frozen=True, eq=False)
class Subject:
    """An opened scene. sky: as it reaches objects that no light excludes; errors of settings are alike for others."""

    source: str
    scene: Scene
    document: Document
    sky: SkyState

    @property
    def most_bands(self) -> int:
        """J of the curve that is planned with the most."""
        return max((n for _, layer in self.layers for n in band_counts(layer).values()), default=1)

    @property
    def layers(self) -> tuple[tuple[int, Layer], ...]:
        """(object index, layer) of all layers that reflect, in the scene's order."""
        return tuple(
            (i_object, layer) for i_object, state in enumerate(self.document.objects) for layer in state.layers
        )


def open_subject(source: str, resolution: tuple[int, int] | None = None) -> Subject:
    """Open what the user named; `resolution` (width, height) replaces the scene's own. Raises InsituError."""
    project = open_project(source, resolution)
    return Subject(source, project.scene, project.document, replace(project.sky, links=()))


def at_most(resolution: tuple[int, int], side: int) -> tuple[int, int]:
    """The resolution scaled down so that its longer side has at most `side` pixels."""
    longest = max(resolution)
    if longest <= side:
        return resolution
    width, height = (max(1, round(n * side / longest)) for n in resolution)
    return width, height


def layer_bands(layer: Layer, most: int | None = None) -> Bands:
    """J of each of a layer's curves: as planned, or with `most` (a power of two) for the sharpest."""
    planned = band_counts(layer)
    return planned if most is None else bands_for_sharpest(layer, planned, most)


def layer_shape(layer: Layer, bands: Bands) -> LayerShape:
    """What the projection needs to know of a layer."""
    counts = (*bands.values(), 1)
    return LayerShape(layer.model.name, tuple(layer.quotient_parameters().tolist()), (counts[0], counts[1]))


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


ORACLE_PATCHES = 1024

Radiance = NDArray[np.float64]


def seen_scale(placement: Placement, rows: NDArray[np.integer], layer: Layer) -> Radiance:
    """f_q f_o(θ_o) of a layer, (p, 3)."""
    return layer.scale() * layer.view_factors(placement.hits.view_angles(rows))


def reflected(done: Precomputed) -> Radiance:
    """Radiance (P, 3) that all points reflect to the camera, from the transport of a stage."""
    placement = done.placement
    total = np.zeros((len(placement.hits.pixel), 3))
    for transport in done.transports:
        rows = placement.rows_of(transport.i_object)
        picture = transport.store.radiance(*layer_coefficients(transport)) * done.light.lighting.unit
        total[rows] += picture * seen_scale(placement, rows, transport.layer)
    return total


def oracle(
    subject: Subject, placement: Placement, rows: NDArray[np.integer], level: int, layers: Sequence[Layer] | None = None
) -> Radiance:
    """Radiance (p, 3) at rows of the hits by brute force over 20·4^level directions and 1,024 patches.

    layers: in the place of the subject's, in its order.
    """
    of_object: dict[int, list[Layer]] = {}
    given = layers or [layer for _, layer in subject.layers]
    for (i_object, _), layer in zip(subject.layers, given, strict=True):
        of_object.setdefault(i_object, []).append(layer)
    environment, patches = _scaled(subject), placement.patches(ORACLE_PATCHES)

    def part(block: NDArray[np.integer]) -> Radiance:
        return integrate_direct(
            placement.hits, block, placement.caster, lambda i: of_object.get(i, ()), environment, subject.sky.rotation,
            patches, level,
        )  # fmt: skip

    return np.concatenate(on_threads(part, np.array_split(rows, max(1, len(rows) // 16))))


def _scaled(subject: Subject) -> Environment | None:
    environment = subject.sky.environment
    if environment is None:
        return None
    return environment.scale_by(subject.sky.scale)


def random_rows(placement: Placement, n_points: int, seed: int = 3) -> NDArray[np.integer]:
    """Rows of random points of the picture, ascending."""
    n_points = min(n_points, len(placement.hits.pixel))
    return np.sort(np.random.default_rng(seed).choice(len(placement.hits.pixel), n_points, replace=False))


def box_averaged(picture: NDArray[np.floating], n: int) -> Radiance:
    """Means (H, W, 3) over n × n pixels of (n H, n W, 3)."""
    height, width = picture.shape[0] // n, picture.shape[1] // n
    return np.asarray(picture.reshape(height, n, width, n, 3).mean(axis=(1, 3), dtype=np.float64))


def direct_picture(project: Project, n_edge_rays: int) -> NDArray[np.floating]:
    """The still (H, W, 3) of direct light with so many rays through pixels at edges."""
    return render_picture(project.with_settings(n_edge_rays=n_edge_rays), lambda step: None, series=BounceSeries(1))
