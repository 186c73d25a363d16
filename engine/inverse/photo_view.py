"""The points of a scene's picture that a photograph is compared with, and what layers reflect there.

Direct light by transport [BenArtzi07, eq. 4.16], made anew where a quotient changes, and light between surfaces by the
rays of its gather points, which no layer changes. Both are linear in the curves of the last reflection: their rows.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StillProgress, map_steps, run_to_end
from engine.inverse.layer_fit import LayerPixels
from engine.precompute.direct.bandstore import BandStore, join_tiles
from engine.precompute.direct.linking import light_groups
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.precompute.indirect.frozen_light import FrozenLight, SelectedCurve
from engine.precompute.indirect.gather_polynomial import Freezing, GatherPolynomial
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import BounceSeries, SamplingSettings
from engine.render.still import (
    StillLayer,
    curves_of,
    find_indirect,
    indirect_layers,
    reflected_light,
    shape_of,
    view_factors,
    with_maps,
)
from engine.scene.primary_hits import PrimaryHits

# Pixels about the edge of an object that do not count: a camera that is found is off by about one.
EDGE = 2
# Transport that is stored, of layers and of trials of their quotients.
_N_STORES = 16


def inner_pixels(hits: PrimaryHits, usable: NDArray[np.bool_]) -> NDArray[np.int32]:
    """The object (H, W) that each pixel shows with all pixels about it, -1 for none; -2 where a photograph is not
    usable (H, W), or at an edge."""
    from scipy.ndimage import minimum_filter

    objects, size = hits.object_image, 2 * EDGE + 1
    whole = minimum_filter(objects, size, mode="nearest") == -minimum_filter(-objects.astype(np.int32), size)
    return np.where(whole & usable, objects, -2).astype(np.int32)


def rows_of_pixels(hits: PrimaryHits, pixels: NDArray[np.integer]) -> NDArray[np.int32]:
    """The points, ascending, at the centres of pixels (n,), by row-major index; those without one are left out."""
    rows = hits.row_image.ravel()[pixels]
    return np.sort(rows[rows >= 0]).astype(np.int32)


@dataclass(frozen=True, eq=False)
class PhotoView:
    """lights: which objects (M,) each light reaches, and that light at the points; found: light between surfaces, None
    where light is reflected once."""

    placement: Placement
    lights: tuple[tuple[NDArray[np.bool_], VisibleLight], ...]
    found: GatherPolynomial | None
    light: IndirectLight | None
    _stores: OrderedDict[tuple[int, LayerShape], BandStore]

    def rows_of(self, i_object: int) -> NDArray[np.integer]:
        """The points of an object."""
        return self.placement.rows_of(i_object)

    def direct(self, layers: Sequence[StillLayer]) -> NDArray[np.float64]:
        """The direct light that the points reflect, (P, 3)."""
        radiance = np.zeros((len(self.placement.hits.pixel), 3))
        for each in layers:
            radiance[self.rows_of(each.i_object)] += self.reflected(each)
        return radiance

    def reflected(self, each: StillLayer) -> NDArray[np.float64]:
        """The direct light that a layer's points reflect, (p, 3)."""
        curves = (*curves_of(each), np.ones((1, 3)))
        view = view_factors(self.placement.hits, self.rows_of(each.i_object), each) * self._light(each).lighting.unit
        return np.asarray(self._store(each).radiance(curves[0], curves[1]) * view, np.float64)

    def indirect(self, layers: Sequence[StillLayer]) -> NDArray[np.float64]:
        """The light between surfaces that the points reflect, (P, 3)."""
        hits = self.placement.hits
        if self.light is None:
            return np.zeros((len(hits.pixel), 3))
        return np.asarray(run_to_end(reflected_light(self.light, layers, None, hits, self.found)), np.float64)

    def pixels(self, each: StillLayer, between: dict[str, NDArray[np.floating]], is_scaled: bool) -> LayerPixels:
        """A layer's points, with the rows of light between surfaces, see `rows_between`."""
        curves = dict(zip((f.name for f in each.layer.model.factors), curves_of(each), strict=False))
        seen = view_factors(self.placement.hits, self.rows_of(each.i_object), each)
        rows = {name: found * seen for name, found in between.items()}
        return LayerPixels(self._store(each), seen * self._light(each).lighting.unit, curves, rows, is_scaled)

    def rows_between(
        self, layers: Sequence[StillLayer], wanted: dict[int, str]
    ) -> dict[int, dict[str, NDArray[np.floating]]]:
        """What curves reflect of the light between surfaces, (J, p, 3) without f_q and f_o, for a 1 in each band; by
        the number of the layer and the name of its curve, one each, of one object."""
        if self.light is None or self.found is None or not wanted:
            return {}
        reflecting, i_object = indirect_layers(layers), layers[next(iter(wanted))].i_object
        factors = {i: [f.name for f in layers[i].layer.model.factors].index(name) for i, name in wanted.items()}
        chosen = [SelectedCurve(i, factor) for i, factor in factors.items()]
        frozen = _frozen_bands(self.found.freeze(reflecting, i_object, chosen))
        own = [each for each in layers if each.i_object == i_object]
        albedo = np.sum([equivalent_albedo(each.layer, each.bands) * each.mean_factor for each in own], axis=0)
        rows = self.rows_of(i_object)
        return {
            i: {name: self.light.curve_rows(frozen.bands[i], albedo, rows) * self.light.unit}
            for i, name in wanted.items()
        }

    def _light(self, each: StillLayer) -> VisibleLight:
        return next(light for objects, light in self.lights if objects[each.i_object])

    def _store(self, each: StillLayer) -> BandStore:
        shape = shape_of(each)
        key = each.i_object, shape
        if key not in self._stores:
            tiles = project_layer(self.placement.hits, self.rows_of(each.i_object), self._light(each), shape)
            self._stores[key] = join_tiles(shape.bands, tiles)
            while len(self._stores) > _N_STORES:
                self._stores.popitem(last=False)
        self._stores.move_to_end(key)
        return self._stores[key]


def _frozen_bands(steps: Freezing) -> FrozenLight:
    """The light of a freezing once it is known by bands, before what curves send on to other surfaces is."""
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            found: FrozenLight = end.value
            return found
        if step is not None:
            return step


def trace_view(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    settings: SamplingSettings, as_needed: bool,
) -> Generator[StillProgress, None, PhotoView]:  # fmt: skip
    """The view of a placement's points. quality: of direct light; settings, as_needed: of light between surfaces, see
    `engine.render.still.find_indirect`."""
    lights = []
    for group in light_groups(placement, sky):
        light = yield from map_steps(
            group.placement.light(group.sky, quality), lambda fraction: StillProgress(min(fraction, 1.0), "shadows")
        )
        lights.append((group.objects, light))
    found = None
    if n_bounces > 1:
        found = yield from find_indirect(placement, layers, sky, BounceSeries(n_bounces), settings, as_needed)
    polynomial = None if found is None else GatherPolynomial(found)
    return PhotoView(placement, tuple(lights), polynomial, found, OrderedDict())


def sampled(placement: Placement, layers: Sequence[StillLayer]) -> tuple[StillLayer, ...]:
    """The layers with their images at a placement's points."""
    return with_maps(placement, [replace(each, maps=None) for each in layers])
