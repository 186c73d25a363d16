"""Samples images at primary hits: texture coordinates, and footprints of pixels.

Primary hits store neither triangle nor barycentric coordinates, which most scenes do not need: the few rays of a
textured object are traced again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import Images, LayerMaps
from engine.material.strokes import Strokes
from engine.render.map_canvas import Canvas, MapSamples, mean_maps, spread_points
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import pixel_footprints, positions_at, uvs_at
from engine.texture.pyramid import Pyramid
from engine.texture.stroke_painting import PaintedPoints
from engine.texture.texture_store import TextureStore, sample_images

Float64Array = NDArray[np.float64]
_MOST_KEPT = 4

__all__ = [
    "MapSampler",
    "MapSamples",
    "look_up_images",
    "mean_factor",
    "mean_maps",
    "paint_weights",
    "sample_images",
    "uvs_at",
]


class MapSampler:
    """Samples images at an object's primary hits. What an object's layers share is computed once: texture coordinates,
    and a weight map by which two layers are blended."""

    def __init__(self, scene: Scene, caster: RayCaster, hits: PrimaryHits) -> None:
        self._scene, self._caster, self._hits = scene, caster, hits
        self._footprints: dict[int, tuple[Float64Array, Float64Array, Float64Array]] = {}
        self._sampled: dict[tuple[object, ...], NDArray[np.float32]] = {}

    def see(self, i_object: int, images: Images) -> MapSamples:
        """A layer's images at all primary hits of its object. Raises LoadError."""
        return self.canvas(i_object, images).paint(images.strokes)

    def canvas(self, i_object: int, images: Images) -> Canvas:
        """The canvas for strokes on a layer's images. Raises LoadError."""
        scene = self._scene
        texture, weight = scene.textures.texture(images), scene.textures.weight(images)
        begin, end = self._hits.object_ranges[i_object]
        colours, shares = np.ones((end - begin, 3), np.float32), np.full(end - begin, images.weight_start, np.float32)
        if texture is not None:
            own = texture, images.texture_scale
            colours = self._samples(i_object, own, texture, images.texture_scale)
        if weight is not None:
            shares = self._samples(i_object, (weight,), weight, (1.0, 1.0))[:, 0]
        spread = spread_points(scene, i_object, images, texture, weight)
        return Canvas(
            MapSamples(colours, shares, spread.means(spread.weight)), self._hits, i_object, spread, scene.origin
        )

    def _samples(
        self, i_object: int, of: tuple[object, ...], pyramid: Pyramid, scale: tuple[float, float]
    ) -> NDArray[np.float32]:
        key = (i_object, *of)
        if key not in self._sampled:
            if i_object not in self._footprints:
                begin, end = self._hits.object_ranges[i_object]
                rows = np.arange(begin, end)
                self._footprints = {i_object: _footprints(self._scene, self._caster, self._hits, rows)}
            uv, across, down = (sides * np.array(scale) for sides in self._footprints[i_object])
            self._sampled = dict(list(self._sampled.items())[1 - _MOST_KEPT :])
            self._sampled[key] = pyramid.over(uv, across, down)
        return self._sampled[key]


def look_up_images(
    images: Images, store: TextureStore, uv: Float64Array
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Texture (N, 3) and weight (N,) at coordinates (N, 2), interpolated between texels, without filter or strokes."""
    return sample_images(images, store, len(uv), lambda image, repeats: image.at(uv * np.array(repeats)))


def paint_weights(
    scene: Scene, found: Intersections, strokes: Strokes, weight: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Weights (N,) at hits of rays, under strokes."""
    if not strokes:
        return weight
    places = positions_at(scene, found.triangle, found.u, found.v)
    return PaintedPoints(weight, places, scene.geometric_normals[found.triangle]).weights(strokes.about(scene.origin))


def mean_factor(scene: Scene, i_object: int, maps: LayerMaps) -> Float64Array:
    """Mean factor of a layer's images over its object, (3,). Raises LoadError."""
    if maps.is_plain:
        return np.ones(3)
    images = maps.images
    texture, weight = scene.textures.texture(images), scene.textures.weight(images)
    return mean_maps(scene, i_object, images, texture, weight).factor(maps)


def _footprints(
    scene: Scene, caster: RayCaster, hits: PrimaryHits, rows: NDArray[np.integer]
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Texture coordinates and footprints of some hits, see `pixel_footprints`."""
    eyes = np.tile(scene.camera_position.astype(np.float32), (len(rows), 1))
    found = caster.intersect(eyes, -hits.wo[rows])
    return pixel_footprints(scene, found, hits.places[rows], hits.resolution)
