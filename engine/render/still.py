"""Renders a finished picture without a window: computes the editor's own transport, contracts it at once and composes
it.

For every pixel that sees a reflecting object, over the layers of that object,

    L = sum over layers of f_q f_o(theta_o) sum_jk c_j c_k U_jk        [BenArtzi07, eq. 3.1 and 4.16],

times texture and weight map where a layer has them; for other pixels, the emitter or the background. Pixels at edges
have several points, weighted by their shares. Transport is contracted tile by tile and never stored, so a still needs
only the memory of its visibility. Indirect light is what the editor shows at rest, by the same sums. Reference pictures
are rendered in the same way with `integrate_direct`, or with paths, instead of transport.
"""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engine.core.clamping import clamp_radiance, unscaled
from engine.core.generators import StillProgress, map_steps, run_to_end
from engine.core.threads import n_threads, pool
from engine.light.emitters import EmitterPatches
from engine.material import MODELS, make_layer
from engine.material.layer import Layer, object_of
from engine.planner import Plan
from engine.precompute.direct.bandstore import BandStore, BandTile
from engine.precompute.direct.linking import LightGroup, light_groups
from engine.precompute.direct.pipeline import FINAL, Placement, Quality, SkyState, final_quality
from engine.precompute.direct.projection import LayerShape, project_layer
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.precompute.indirect.gather import object_of_rows
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from engine.precompute.indirect.indirect_layers import view_factors as gather_view_factors
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries, SamplingSettings
from engine.precompute.indirect.solver import Solver
from engine.reference.integrator import integrate_direct
from engine.reference.path_tracer import N_SAMPLES, trace_halves, trace_paths
from engine.scene.map_sampler import MapFactors, MapSampler, MapSamples
from engine.scene.primary_hits import PrimaryHits

# Share of the time that shadows take, for an even progress bar.
SHADOWS = 0.3
REFERENCE_POINTS = 32
REFERENCE_LEVEL = 6

Picture = NDArray[np.float32]


@dataclass(frozen=True)
class StillLayer:
    """A visible layer of one object (its index in the scene) and the bands (J, K) it is computed with.

    editable: whether an editor would store these bands; a still never does. maps: its images, if it has any and they
    were sampled (see `with_maps`).
    """

    i_object: int
    layer: Layer
    bands: tuple[int, int]
    editable: bool
    maps: MapSamples | None = None

    @property
    def mean_factor(self) -> NDArray[np.float64]:
        """Mean factor of its images over the surface, (3,)."""
        return np.ones(3) if self.maps is None else self.maps.means.factor(self.layer.maps)

    def factor(self, hits: PrimaryHits, rows: NDArray[np.integer]) -> NDArray[np.floating] | None:
        """Factor of its images at some rows of its object, (p, 3); None without images."""
        if self.maps is None:
            return None
        own = rows - hits.object_ranges[self.i_object, 0]
        return self.layer.maps.factor(self.maps.texture[own], self.maps.weight[own])


def by_object(layers: Iterable[StillLayer]) -> dict[int, list[Layer]]:
    """The layers of each object, by its index."""
    found: dict[int, list[Layer]] = {}
    for each in layers:
        found.setdefault(each.i_object, []).append(each.layer)
    return found


def with_maps(placement: Placement, layers: Iterable[StillLayer]) -> tuple[StillLayer, ...]:
    """The layers with their images sampled at the placement's points. Raises LoadError."""
    sampler = MapSampler(placement.scene, placement.caster, placement.hits)
    return tuple(
        each if each.layer.maps.is_plain else replace(each, maps=sampler.sample(each.i_object, each.layer.maps.images))
        for each in layers
    )


def still_quality(plan: Plan) -> Quality:
    """The quality of a plan: every pixel, its lights and patches, the sphere where needed."""
    return replace(final_quality(plan.light_settings), name="still")


def render_still(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality = FINAL,
    indirect: NDArray[np.floating] | None = None,
) -> Generator[StillProgress, None, Picture]:  # fmt: skip
    """Linear radiance (H, W, 3) float32 of the scene with these layers under this sky. Arguments: see
    `reflect_layers`."""
    return compose(placement, (yield from reflect_layers(placement, layers, sky, quality, indirect)), sky)


def reflect_layers(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality = FINAL,
    indirect: NDArray[np.floating] | None = None,
) -> Generator[StillProgress, None, NDArray[np.float64]]:  # fmt: skip
    """Radiance (P, 3) that the points of the hits reflect.

    quality: its stride must be 1; indirect (P, 3): indirect light to be added. Emitters radiate as the scene says.
    """
    if quality.stride != 1:
        raise ValueError(f"stride = {quality.stride}, expected 1: a still has every pixel")
    radiance = np.zeros((len(placement.hits.pixel), 3)) if indirect is None else indirect.astype(np.float64)
    total, done = sum(len(placement.rows_of(each.i_object)) for each in layers), 0
    for group in light_groups(placement, sky):
        own = [each for each in layers if group.objects[each.i_object]]
        n = sum(len(placement.rows_of(each.i_object)) for each in own)
        if n:
            span = partial(_progress_within, done / total, n / total)
            yield from map_steps(_reflect_group(group, own, quality, n, radiance), span)
            done += n
    return radiance


def _progress_within(begin: float, share: float, step: StillProgress) -> StillProgress:
    return StillProgress(begin + share * step.fraction, step.text)


def _reflect_group(
    group: LightGroup, layers: Sequence[StillLayer], quality: Quality, n: int, radiance: NDArray[np.float64]
) -> Generator[StillProgress, None, None]:
    """Add to radiance (P, 3) what layers of objects that the same lights reach reflect at their n points."""
    placement, done = group.placement, 0
    light = yield from map_steps(
        placement.light(group.sky, quality), lambda fraction: StillProgress(SHADOWS * min(fraction, 1.0), "shadows")
    )
    for each in layers:
        rows, curves = placement.rows_of(each.i_object), curves_of(each)
        for tile in project_layer(placement.hits, rows, light, shape_of(each)):
            covered = rows[tile.begin : tile.begin + len(tile.scale)]
            radiance[covered] += layer_radiance(placement.hits, covered, each, tile, light.lighting.unit, curves)
            done += len(covered)
            yield StillProgress(SHADOWS + (1 - SHADOWS) * done / n, f"{each.layer.name} of object {each.i_object}")


def render_reference(
    placement: Placement, layers_of: Mapping[int, Sequence[Layer]], sky: SkyState, n_patches: int, level: int
) -> Generator[StillProgress, None, Picture]:
    """Render the same picture by brute force; see `reference_radiance`."""
    radiance = yield from reference_radiance(placement, layers_of, sky, n_patches, level)
    return compose(placement, radiance, sky)


def reference_radiance(
    placement: Placement, layers_of: Mapping[int, Sequence[Layer]], sky: SkyState, n_patches: int, level: int
) -> Generator[StillProgress, None, NDArray[np.float64]]:
    """What points reflect once (P, 3) by brute force: every one samples 20·4^level directions and `n_patches` patches.
    Slow."""
    n_points, done = len(placement.hits.pixel), 0
    radiance = np.zeros((n_points, 3))
    for group in light_groups(placement, sky):
        rows = np.flatnonzero(group.objects[placement.hits.objects])
        patches = group.placement.patches(n_patches)
        blocks = [rows[i : i + REFERENCE_POINTS] for i in range(0, len(rows), REFERENCE_POINTS)]
        work = _reference_work(placement, layers_of, group.sky, patches, level)
        with pool() as threads:
            for i in range(0, len(blocks), n_threads()):
                some = blocks[i : i + n_threads()]
                for block, found in zip(some, threads.map(work, some), strict=True):
                    radiance[block] = found
                    done += len(block)
                yield StillProgress(done / n_points, "every direction of every pixel")
    return radiance


def render_paths(
    placement: Placement,
    layers_of: Mapping[int, Sequence[Layer]],
    sky: SkyState,
    n_bounces: int,
    n_samples: int = N_SAMPLES,
    seed: int = 0,
    transparent: bool = False,
) -> Generator[StillProgress, None, Picture]:
    """Linear radiance (H, W, 3) float32 after up to n_bounces reflections, emitters and background included."""
    estimate = yield from trace_paths(placement, layers_of, sky, n_bounces, n_samples, seed)
    return compose(placement, estimate.radiance, sky, transparent)


def compose(placement: Placement, radiance: NDArray[np.floating], sky: SkyState, transparent: bool = False) -> Picture:
    """Compose the points' reflected radiance (P, 3), emitters and the background to one picture (H, W, 3) float32.

    transparent: without the sky behind all, and with a fourth channel: alpha, the share of each pixel that something
    covers.
    """
    hits = placement.hits
    image = hits.emission_image.astype(np.float32)
    open_ = hits.open_image > 0.0
    if sky.environment is not None and not transparent and open_.any():
        seen = sky.environment.evaluate(hits.ray_directions[open_], sky.rotation)
        image[open_] += seen * (np.float32(sky.scale) * hits.open_image[open_, None])
    shown = np.flatnonzero(hits.share)  # a share of 0 times infinite radiance would be NaN
    share, pixel = hits.share[shown, None], hits.pixel[shown]
    np.add.at(image.reshape(-1, 3), pixel, np.asarray(share * radiance[shown], np.float32))
    return with_alpha(image, 1.0 - hits.open_image) if transparent else image


def with_alpha(image: NDArray[np.floating], alpha: NDArray[np.floating]) -> Picture:
    """A picture (H, W, 4) of light (H, W, 3) and alpha (H, W)."""
    return np.concatenate([image, alpha[..., None]], axis=2, dtype=np.float32)


def shape_of(each: StillLayer) -> LayerShape:
    """The properties of a layer that projection needs."""
    return LayerShape(each.layer.model.name, tuple(each.layer.quotient_parameters().tolist()), each.bands)


def layer_radiance(
    hits: PrimaryHits, rows: NDArray[np.integer], each: StillLayer, tile: BandTile, unit: float,
    curves: Sequence[NDArray[np.float64]],
) -> NDArray[np.floating]:  # fmt: skip
    """Radiance (p, 3) that a layer reflects at the rows of a tile under these curves (J, 3); unit: that of its
    transport."""
    contracted = BandStore(each.bands, (replace(tile, begin=0),)).radiance(curves[0], (*curves, np.ones((1, 3)))[1])
    return contracted * unit * view_factors(hits, rows, each)


def curves_of(each: StillLayer) -> tuple[NDArray[np.float64], ...]:
    """Band values (J, 3) of the one or two curves of a layer."""
    factors = each.layer.model.factors
    return tuple(each.layer.coefficients(factor.name, n) for factor, n in zip(factors, each.bands, strict=False))


def view_factors(hits: PrimaryHits, rows: NDArray[np.integer], each: StillLayer) -> NDArray[np.float64]:
    """f_q f_o(theta_o), times texture and weight, (p, 3)."""
    factor = each.factor(hits, rows)
    seen = np.tile(each.layer.scale(), (len(rows), 1))
    if each.layer.has_view_curve:
        seen *= each.layer.view_factors(hits.view_angles(rows))
    return seen if factor is None else seen * factor


def _reference_work(
    placement: Placement, layers_of: Mapping[int, Sequence[Layer]], sky: SkyState, patches: EmitterPatches | None,
    level: int,
) -> Callable[[NDArray[np.integer]], NDArray[np.float64]]:  # fmt: skip
    environment, factors = (
        sky.environment,
        MapFactors(placement.scene, layers_of).at_primary_hits(placement.caster, placement.hits),
    )
    if environment is not None and sky.scale != 1.0:
        environment = environment.scale_by(sky.scale)
    return lambda block: integrate_direct(
        placement.hits, block, placement.caster, lambda i: layers_of.get(i, ()), environment, sky.rotation, patches,
        level, factors,
    )  # fmt: skip


def still_layers(
    layers: Iterable[tuple[str, Layer]], object_names: Sequence[str], plan: Plan
) -> tuple[StillLayer, ...]:
    """The visible layers by key ("object.index") in a still's form, with the plan's bands."""
    indices = {name: index for index, name in enumerate(object_names)}
    return tuple(
        StillLayer(indices[object_of(key)], layer, plan.layer(key).shape, plan.layer(key).editable)
        for key, layer in layers if layer.visible
    )  # fmt: skip


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
    return run_to_end(reflected_light(found, layers, series.second, placement.hits, third=series.third))


def find_indirect(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, series: BounceSeries, settings: SamplingSettings,
    as_needed: bool,
) -> Generator[StillProgress, None, IndirectLight]:  # fmt: skip
    """Compute the light of a picture after 2 bounces to all of the series; as_needed: by no more rays than it needs."""
    other_light = None
    if as_needed:
        tracing = StillProgress(0.0, "tracing gather points")
        other_light = yield from map_steps(direct_mean(placement, by_object(layers), sky), lambda step: tracing)
    solver = Solver(
        placement, models_of(layers), sky, series.n_bounces, settings, series.second != 1, other_light,
        thrice=series.third != 1,
    )  # fmt: skip
    steps = solver.solve(indirect_layers(layers, series.second, series.third))
    return (yield from map_steps(steps, lambda step: StillProgress(*step)))


def reflected_light(
    found: IndirectLight, layers: Sequence[StillLayer], second: int | None, hits: PrimaryHits,
    polynomial: GatherPolynomial | None = None,
    third: int | None = None,
) -> Generator[None, None, NDArray[np.float32]]:  # fmt: skip
    """The same of light that was computed before, in steps; second, third: the most bands of these bounces, as in
    `BounceSeries`; polynomial: of the same rays; caches what does not depend on curves.

    Layers with images are computed one by one: what they reflect varies slowly between gather points, the images do
    not.
    """
    reflecting = indirect_layers(layers, second, third)
    found = found.without_glossy_hits() if second == 1 else found
    polynomial = GatherPolynomial(found, keeps=False) if polynomial is None else polynomial.with_light(found)
    frozen = yield from map_steps(polynomial.freeze(reflecting), lambda step: None)
    gather_points = found.points.samples.points
    objects = object_of_rows(hits, gather_points)

    def at_points(i: int, layer: IndirectLayer) -> NDArray[np.float32]:
        """Radiance (p, 3) of layer i at the gather points."""
        out = np.zeros((len(gather_points), 3), np.float32)
        mine = np.flatnonzero(objects == layer.i_object)
        with np.errstate(over="ignore"):
            out[mine] = frozen.reflected[i][:, 0].T * gather_view_factors(hits, gather_points[mine], layer)
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


def noise_in(
    found: IndirectLight, layers: Sequence[StillLayer], second: int | None, third: int | None = None
) -> Generator[None, None, float]:
    """Noise in that light as the layers reflect it, RMS radiance, in steps; arguments: see `reflected_light`."""
    found = found.without_glossy_hits() if second == 1 else found
    relative, mean = yield from found.noise(indirect_layers(layers, second, third))
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


def indirect_layers(
    layers: Sequence[StillLayer], second: int | None = None, third: int | None = None
) -> list[IndirectLayer]:
    """The layers in the form of the indirect light; second, third: the most bands of these bounces, as in
    `BounceSeries`."""
    return [
        indirect_layer(each.i_object, each.layer, _bands_of(each), second, each.mean_factor, third) for each in layers
    ]


def first_bounce_layers(layers: Sequence[StillLayer], series: BounceSeries) -> tuple[StillLayer, ...]:
    """The layers as the first number of a series limits them, for indirect light, and for direct light unless that is
    whole."""
    if series.whole_direct and series.first == 1:
        return tuple(map(_by_albedo, layers))
    most = series.first
    if most is None:
        return tuple(layers)
    return tuple(replace(each, bands=(min(each.bands[0], most), min(each.bands[1], most))) for each in layers)


def _by_albedo(each: StillLayer) -> StillLayer:
    """A diffuse layer that reflects as much light as a layer, under the same images [BenArtzi07, 5.2.4]."""
    albedo = np.minimum(equivalent_albedo(each.layer, _bands_of(each)), 1.0)
    diffuse = make_layer(MODELS["lambert"], {"albedo": tuple(albedo.tolist())})
    return replace(each, layer=diffuse.replace(maps=each.layer.maps, name=each.layer.name), bands=(1, 1))


def _bands_of(each: StillLayer) -> tuple[int, ...]:
    return each.bands[: len(each.layer.model.factors)]
