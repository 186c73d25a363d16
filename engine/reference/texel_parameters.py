"""Layers whose parameters are looked up at each point: the truth for `engine.material.parameter_nodes`.

Where layers still have their parameter maps, the path tracer evaluates the model's own formula with the parameter's
value at the hit: in the texture's full resolution, at a random place of the pixel at the first hit, interpolated
between texels. Values are rounded to a thousandth of the channel's range, and one evaluation serves all hits with equal
ones. Nodes determine the lobes of BRDF sampling, whose density is exact whatever they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Directions, Layer, evaluate_in_frame
from engine.material.layer_maps import ChannelImage
from engine.material.parameter_maps import ParameterMaps
from engine.material.parameter_nodes import plan_nodes
from engine.scene.map_sampler import MapSampler
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import uvs_at

Float64Array = NDArray[np.float64]
Rows = NDArray[np.integer]
_N_STEPS = 1000


def sampling_layers(scene: Scene, layers: Sequence[Layer]) -> list[Layer]:
    """The layers with the nodes of those with parameter maps. Raises LoadError."""
    textures, found = scene.textures, list[Layer]()
    for layer in layers:
        statistics = [textures.channel_statistics(each.image) for each in layer.parameter_maps]
        found += plan_nodes(layer, statistics) if statistics else [layer]
    return found


class TexelParameters:
    """The values of the images that parameter maps of one scene's layers read."""

    def __init__(self, scene: Scene, layers_of: Mapping[int, Sequence[Layer]]) -> None:
        self._scene = scene
        self._images: dict[int, tuple[ChannelImage, ...]] = {}
        for i_object, layers in layers_of.items():
            images = dict.fromkeys(each.image for layer in layers if layer.visible for each in _maps_of(layer))
            if images:
                self._images[i_object] = tuple(images)
        self._n_columns = max(map(len, self._images.values()), default=0)

    def images(self, i_object: int) -> tuple[ChannelImage, ...]:
        """The images of an object, one for each of the first columns of values."""
        return self._images.get(i_object, ())

    def at_path_vertices(self, found: Intersections, ids: Rows, rays: Rows) -> Float64Array:
        """Channel values (N, T) at some of the rays that were traced, on objects ids (R,)."""
        objects = ids[rays]
        mine = np.flatnonzero(np.isin(objects, list(self._images)))
        own = found.of(rays[mine])
        of_mine = uvs_at(self._scene, own.triangle, own.u, own.v)
        uv = np.zeros((len(rays), of_mine.shape[1]))
        uv[mine] = of_mine
        return self.look_up(objects, uv)

    def in_pixels(self, caster: RayCaster, hits: PrimaryHits) -> PixelTexels:
        """The same images in the pixels of primary hits."""
        sampler = MapSampler(self._scene, caster, hits)
        n_columns = 2 if self._scene.uvs is None else self._scene.uvs.shape[2]
        footprints = np.zeros((3, len(hits.pixel), n_columns))
        for i_object in self._images:
            footprints[:, slice(*hits.object_ranges[i_object])] = sampler.footprints(i_object)
        return PixelTexels(self, hits.objects, footprints)

    def look_up(self, objects: Rows, uv: Float64Array) -> Float64Array:
        """Channel values (N, T) on objects (N,), at texture coordinates (N, 2 K)."""
        values = np.zeros((len(uv), self._n_columns))
        for i_object, images in self._images.items():
            mine = np.flatnonzero(objects == i_object)
            for column, image in enumerate(images):
                texels = self._scene.textures.numbers(image).at(uv[mine], repeats=image.repeats)
                values[mine, column] = np.round(_N_STEPS * texels[:, 0]) / _N_STEPS
        return values


class PixelTexels:
    """The images of parameter maps in pixels; footprints (3, P, 2 K): the middle of each pixel in texture coordinates,
    and its two sides."""

    def __init__(self, parameters: TexelParameters, objects: Rows, footprints: Float64Array) -> None:
        self._parameters, self._objects, self._footprints = parameters, objects, footprints

    def sample(self, rows: Rows, u: Float64Array) -> Float64Array:
        """Channel values (N, T) at places of the pixels of hits (N,), by random numbers u (N, 2) in [0, 1)."""
        middle, across, down = self._footprints[:, rows]
        uv = middle + (u[:, :1] - 0.5) * across + (u[:, 1:] - 0.5) * down
        return self._parameters.look_up(self._objects[rows], uv)


def evaluate_layers_by_texel(
    layers: Sequence[Layer], images: Sequence[ChannelImage], wi: Float64Array, wo: Float64Array,
    factors: NDArray[np.floating], texels: Float64Array, in_coat: tuple[Float64Array, Float64Array] | None = None,
) -> Float64Array:  # fmt: skip
    """Σ over layers of ρ(ωi, ωo) cosθi, (N, 3), with the parameters at each point; wi, wo, in_coat: see
    `evaluate_layers`.

    factors (N, K, 3): of the first K layers; texels (N, T): channel values of the images.
    """
    total, directions = np.zeros((len(wi), 3)), ((wi, wo), (wi, wo) if in_coat is None else in_coat)
    for k, layer in enumerate(layers):
        value = _evaluate_by_texel(layer, images, directions, texels)
        total += value if k >= factors.shape[1] else value * factors[:, k]
    return total


def _evaluate_by_texel(
    layer: Layer, images: Sequence[ChannelImage], directions: Directions, texels: Float64Array
) -> Float64Array:
    """The layer's formula, and that of its covers, one evaluation for all points with equal values."""
    maps, n_points = _maps_of(layer), len(texels)
    if not maps or not n_points:
        return evaluate_in_frame(layer, directions)
    columns = [images.index(each.image) for each in maps]
    found, which = np.unique(texels[:, columns], axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(which.ravel(), minlength=len(found)))[:-1])
    value = np.empty((n_points, 3))
    for channels, rows in zip(found, groups, strict=True):
        known = dict(zip((each.image for each in maps), channels.tolist(), strict=True))
        covers = tuple(_at_texel(cover, known) for cover in layer.covers)
        (wi, wo), (coat_wi, coat_wo) = directions
        own = (wi[rows], wo[rows]), (coat_wi[rows], coat_wo[rows])
        value[rows] = evaluate_in_frame(_at_texel(layer, known).replace(covers=covers), own)
    return value


def _maps_of(layer: Layer) -> ParameterMaps:
    """The maps of a layer and of those that lie on it, of each image the first."""
    every = [each for one in (layer, *layer.covers) for each in one.parameter_maps]
    return tuple({each.image: each for each in reversed(every)}.values())


def _at_texel(layer: Layer, channels: Mapping[ChannelImage, float]) -> Layer:
    """A layer with the values of its maps for channel values by image."""
    for each in layer.parameter_maps:
        layer = layer.with_parameter(each.parameter, each.value_at(channels[each.image]))
    return layer
