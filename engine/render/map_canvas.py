"""A layer's images on one object: at its primary hits, and spread uniformly over it for their means.

The images are sampled once; strokes are painted on the samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import Images, MapMeans
from engine.material.strokes import Strokes
from engine.scene.primary_hits import PrimaryHits
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import corner_uvs, positions_at, uvs_at
from engine.texture.pyramid import Pyramid
from engine.texture.stroke_painting import PaintedPoints

Float64Array = NDArray[np.float64]
_N_MEAN_SAMPLES = 1 << 15


@dataclass(frozen=True, eq=False)
class MapSamples:
    """The images of one layer at the primary hits: texture (p, 3) and weight (p,) float32 at the points of its object,
    in the order of the hits, ones where there is no image; and their means over the surface."""

    texture: NDArray[np.float32]
    weight: NDArray[np.float32]
    means: MapMeans


@dataclass(frozen=True, eq=False)
class SpreadPoints:
    """Points uniformly spread over a surface: texture (N, 3) and weight (N,) without strokes, position and normal."""

    texture: Float64Array
    weight: NDArray[np.float32]
    position: NDArray[np.float32]
    normal: NDArray[np.float32]

    def means(self, weight: NDArray[np.float32]) -> MapMeans:
        """Means by area, under these weights (N,)."""
        red, green, blue = self.texture.mean(axis=0).tolist()
        both = (self.texture * weight[:, None]).mean(axis=0).tolist()
        return MapMeans((red, green, blue), float(weight.mean(dtype=np.float64)), (both[0], both[1], both[2]))


class Canvas:
    """One layer's images on one object, and the result of its strokes."""

    def __init__(
        self, unpainted: MapSamples, hits: PrimaryHits, i_object: int, spread: SpreadPoints, origin: Float64Array
    ) -> None:
        """origin (3,): of the scene, see `Scene`."""
        self._unpainted, self._hits, self._i_object, self._spread = unpainted, hits, i_object, spread
        self._origin = origin
        self._seen: PaintedPoints | None = None
        self._everywhere: PaintedPoints | None = None

    def paint(self, strokes: Strokes) -> MapSamples:
        """Return the images under these strokes; fast if they continue those of the last call."""
        if not strokes:
            return self._unpainted
        spread = self._spread
        if self._seen is None or self._everywhere is None:
            rows = slice(*self._hits.object_ranges[self._i_object])
            self._seen = PaintedPoints(self._unpainted.weight, self._hits.position[rows], self._hits.outward[rows])
            self._everywhere = PaintedPoints(spread.weight, spread.position, spread.normal)
        strokes = strokes.about(self._origin)
        means = spread.means(self._everywhere.weights(strokes))
        return MapSamples(self._unpainted.texture, self._seen.weights(strokes), means)


def spread_points(
    scene: Scene, i_object: int, images: Images, texture: Pyramid | None, weight: Pyramid | None
) -> SpreadPoints:
    """Points that each represent an equal part of the object's area, and a share of the images, without strokes."""
    begin, end = scene.triangle_ranges[i_object]
    corners = scene.vertices[scene.triangles[begin:end]].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    cumulative = np.cumsum(area)
    places = (np.arange(_N_MEAN_SAMPLES) + 0.5) / _N_MEAN_SAMPLES * cumulative[-1]
    triangle = begin + np.minimum(np.searchsorted(cumulative, places), end - begin - 1)
    u, v = _even_barycentrics(_N_MEAN_SAMPLES)
    colours, shares = np.ones((len(u), 3)), np.full(len(u), images.weight_start, np.float32)
    if texture is not None or weight is not None:
        uv = uvs_at(scene, triangle, u, v)
        uvs = corner_uvs(scene, triangle)
        edges = uvs[:, 1:] - uvs[:, :1]
        stretch = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / area[triangle - begin]
        share = stretch * cumulative[-1] / _N_MEAN_SAMPLES  # of the image, for each point
        if texture is not None:
            scale = np.array(images.texture_scale)
            colours = texture.at(uv * scale, texture.level_of(share * abs(scale.prod()))).astype(np.float64)
        if weight is not None:
            shares = weight.at(uv, weight.level_of(share))[:, 0]
    return SpreadPoints(colours, shares, positions_at(scene, triangle, u, v), scene.geometric_normals[triangle])


def mean_maps(scene: Scene, i_object: int, images: Images, texture: Pyramid | None, weight: Pyramid | None) -> MapMeans:
    """Means by area over an object, strokes included."""
    spread = spread_points(scene, i_object, images, texture, weight)
    if not images.strokes:
        return spread.means(spread.weight)
    return spread.means(
        PaintedPoints(spread.weight, spread.position, spread.normal).weights(images.strokes.about(scene.origin))
    )


def _even_barycentrics(n: int) -> tuple[Float64Array, Float64Array]:
    """n points spread uniformly over a triangle, their u and v: multiples of powers of a root, modulo 1 [Roberts18]."""
    root = 1.32471795724474602596  # x³ = x + 1
    a, b = ((np.arange(n) * step + 0.5) % 1.0 for step in (1.0 / root, 1.0 / root**2))
    folded = a + b > 1.0
    return np.where(folded, 1.0 - a, a), np.where(folded, 1.0 - b, b)
