"""Images of layers at points of surfaces: at primary hits, filtered over pixels; at vertices of paths; and spread
uniformly over an object for their means.

At primary hits the images are sampled once; strokes are painted on the samples. Primary hits store neither triangle nor
barycentric coordinates, which most scenes do not need: the few rays of a textured object are traced again. At further
vertices of paths an image is interpolated between texels; the editor instead uses its mean over a part of the surface
there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.material.layer_maps import Images, LayerMaps, MapMeans
from engine.material.strokes import Strokes
from engine.scene.cutouts import pixel_chances
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import Footprints, colours_at, corner_uvs, pixel_footprints, positions_at, uvs_at
from engine.texture.pyramid import Pyramid
from engine.texture.stroke_painting import PaintedPoints
from engine.texture.texture_store import TextureStore, sample_images

Float64Array = NDArray[np.float64]
Factors = NDArray[np.float32]
_N_MEAN_SAMPLES = 1 << 15
_MOST_CACHED = 4
# Parts of a pixel along each side, each filtered by itself: a pyramid's filter is wider than a pixel. Of one part the
# mean of a texture in tiles of 8 texels is 1.3 to 5 % off, by 0.4 to 10 texels a pixel, of two 0.4 to 2 %, of four 0.1
# to 0.9 %. A metal in it is 4.7, 1.8 and 0.9 % off under a lamp (64 x 64, `benchmarks/gltf_materials.py`).
_PIXEL_PARTS = 4
# Look-ups that cover an oblique pixel in moving pictures, each in one level of the image pyramid.
MOVING_PROBES = 2


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


def spread_points(scene: Scene, i_object: int, images: Images) -> SpreadPoints:
    """Points that each represent an equal part of the object's area, where it is there, and a share of the images,
    without strokes: for means, by which light is reflected further. Raises LoadError."""
    begin, area = scene.triangle_ranges[i_object][0], _double_areas(scene, i_object)
    whole = float(area.sum())
    triangle, u, v = even_points(scene, i_object, _N_MEAN_SAMPLES)
    if scene.cutouts.passable[begin]:
        there = scene.cutouts.opacity_at(triangle, u, v) > np.random.default_rng(1).random(len(u))
        if there.any():
            triangle, u, v = triangle[there], u[there], v[there]

    def sample(image: Pyramid, repeats: tuple[float, float]) -> NDArray[np.float32]:
        uvs = image.in_own_set(corner_uvs(scene, triangle))
        stretch = np.abs(np.linalg.det(uvs[:, 1:] - uvs[:, :1])) / area[triangle - begin]
        share = stretch * whole / _N_MEAN_SAMPLES  # of the image, for each point
        level = image.level_of(share * abs(repeats[0] * repeats[1]))
        return image.at(uvs_at(scene, triangle, u, v), level, repeats)

    colours, shares = sample_images(
        images.for_bounces, scene.textures, len(u), sample, lambda: colours_at(scene, triangle, u, v)
    )
    return SpreadPoints(
        colours.astype(np.float64), shares, positions_at(scene, triangle, u, v), scene.geometric_normals[triangle]
    )


def even_points(scene: Scene, i_object: int, n: int) -> tuple[NDArray[np.intp], Float64Array, Float64Array]:
    """n points that each represent an equal part of an object's area: triangles (n,), ascending, and their u and v."""
    begin, end = scene.triangle_ranges[i_object]
    cumulative = np.cumsum(_double_areas(scene, i_object))
    places = (np.arange(n) + 0.5) / n * cumulative[-1]
    return begin + np.minimum(np.searchsorted(cumulative, places), end - begin - 1), *_even_barycentrics(n)


def _double_areas(scene: Scene, i_object: int) -> Float64Array:
    """Twice the area (T,) of each of an object's triangles."""
    begin, end = scene.triangle_ranges[i_object]
    a, b, c = np.moveaxis(scene.vertices[scene.triangles[begin:end]].astype(np.float64), 1, 0)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1))


def _even_barycentrics(n: int) -> tuple[Float64Array, Float64Array]:
    """n points spread uniformly over a triangle, their u and v: multiples of powers of a root, modulo 1 [Roberts18]."""
    root = 1.32471795724474602596  # x³ = x + 1
    a, b = ((np.arange(n) * step + 0.5) % 1.0 for step in (1.0 / root, 1.0 / root**2))
    folded = a + b > 1.0
    return np.where(folded, 1.0 - a, a), np.where(folded, 1.0 - b, b)


class MapSampler:
    """Samples images at an object's primary hits. What an object's layers share is computed once: texture coordinates,
    and a weight map by which two layers are blended."""

    def __init__(self, scene: Scene, caster: RayCaster, hits: PrimaryHits) -> None:
        self._scene, self._caster, self._hits = scene, caster, hits
        self._hit: dict[int, Intersections] = {}
        self._footprints: dict[int, Footprints] = {}
        self._sampled: dict[tuple[object, ...], NDArray[np.float32]] = {}

    def sample(self, i_object: int, images: Images) -> MapSamples:
        """A layer's images at all primary hits of its object. Raises LoadError."""
        return self.canvas(i_object, images).paint(images.strokes)

    def canvas(self, i_object: int, images: Images) -> Canvas:
        """The canvas for strokes on a layer's images. Raises LoadError."""
        scene = self._scene
        begin, end = self._hits.object_ranges[i_object]

        def vertex_colours() -> NDArray[np.float32]:
            hit = self._found(i_object)
            return colours_at(scene, hit.triangle, hit.u, hit.v)

        sample = partial(self._samples, i_object)
        colours, shares = sample_images(images, scene.textures, int(end - begin), sample, vertex_colours)
        spread = spread_points(scene, i_object, images)
        return Canvas(
            MapSamples(colours, shares, spread.means(spread.weight)), self._hits, i_object, spread, scene.origin
        )

    def _samples(self, i_object: int, pyramid: Pyramid, repeats: tuple[float, float]) -> NDArray[np.float32]:
        """An image at an object's hits, the mean over each pixel."""
        key = i_object, pyramid, repeats
        if key not in self._sampled:
            self._sampled = dict(list(self._sampled.items())[1 - _MOST_CACHED :])
            self._sampled[key] = mean_over_pixels(pyramid, self.footprints(i_object), repeats)
        return self._sampled[key]

    def footprints(self, i_object: int) -> Footprints:
        """Texture coordinates and footprints of an object's hits, see `pixel_footprints`; of the last object cached."""
        if i_object not in self._footprints:
            self._footprints = {i_object: self._trace_footprints(i_object)}
        return self._footprints[i_object]

    def _trace_footprints(self, i_object: int) -> Footprints:
        """Texture coordinates and footprints of an object's hits, see `pixel_footprints`."""
        places = self._hits.places[slice(*self._hits.object_ranges[i_object])]
        return pixel_footprints(self._scene, self._found(i_object), places, self._hits.resolution)

    def _found(self, i_object: int) -> Intersections:
        """Trace the rays to an object's hits again."""
        if i_object not in self._hit:
            rows = slice(*self._hits.object_ranges[i_object])
            towards = -self._hits.wo[rows]
            origins = np.tile(self._scene.camera_position.astype(np.float32), (len(towards), 1))
            chances = pixel_chances(self._hits.places[rows], self._hits.resolution[0])
            self._hit = {i_object: self._caster.intersect(origins, towards, chances)}
        return self._hit[i_object]


def mean_over_pixels(
    pyramid: Pyramid, footprints: Footprints, repeats: tuple[float, float], is_quick: bool = False
) -> NDArray[np.float32]:
    """Means (N, C) of an image over pixels, by their coordinates, see `Pyramid.over`: of their parts, each filtered
    alone, as pictures at rest have them; is_quick: of whole pixels by fewer look-ups, for moving ones."""
    uv, across, down = footprints
    if is_quick:
        return pyramid.over(uv, across, down, MOVING_PROBES, repeats, is_quick)
    steps, share = (np.arange(_PIXEL_PARTS) + 0.5) / _PIXEL_PARTS - 0.5, 1.0 / _PIXEL_PARTS
    total = np.zeros((len(uv), pyramid.n_channels), np.float32)
    for x, y in product(steps, steps):
        total += pyramid.over(uv + x * across + y * down, share * across, share * down, repeats=repeats)
    return total / np.float32(_PIXEL_PARTS**2)


def look_up_images(
    images: Images, store: TextureStore, uv: Float64Array, vertex_colours: NDArray[np.float32] | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Texture (N, 3) and weight (N,) at coordinates (N, 2 K), interpolated between texels, without filter or strokes;
    vertex_colours (N, 4): those of the mesh there, None for none."""
    white = np.ones((len(uv), 3), np.float32)
    return sample_images(
        images, store, len(uv), lambda image, repeats: image.at(uv, repeats=repeats),
        lambda: white if vertex_colours is None else vertex_colours,
    )  # fmt: skip


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
    spread = spread_points(scene, i_object, images)
    weight = spread.weight
    if images.strokes:
        weight = PaintedPoints(weight, spread.position, spread.normal).weights(images.strokes.about(scene.origin))
    return spread.means(weight).factor(maps)


class MapFactors:
    """Factors (N, K, 3) of the visible layers of each object, in their order; K is the largest number of layers of an
    object with maps, 0 if there is none."""

    def __init__(self, scene: Scene, layers_of: Mapping[int, Sequence[Layer]]) -> None:
        self._scene = scene
        self._maps: dict[int, list[tuple[int, LayerMaps]]] = {}
        n_layers = 0
        for i_object, layers in layers_of.items():
            visible = [layer for layer in layers if layer.visible]
            found = [(k, layer.maps) for k, layer in enumerate(visible) if not layer.maps.is_plain]
            if found:
                self._maps[i_object] = found
                n_layers = max(n_layers, len(visible))
        self._n_layers = n_layers

    def at_primary_hits(self, caster: RayCaster, hits: PrimaryHits) -> Factors:
        """Factors at all points of the hits, (P, K, 3)."""
        factors, sampler = self._ones(len(hits.pixel)), MapSampler(self._scene, caster, hits)
        for i_object, found in self._maps.items():
            begin, end = hits.object_ranges[i_object]
            for k, maps in found:
                seen = sampler.sample(i_object, maps.images)
                factors[begin:end, k] = maps.factor(seen.texture, seen.weight)
        return factors

    def at_path_vertices(self, found: Intersections, ids: NDArray[np.integer], rays: NDArray[np.integer]) -> Factors:
        """Factors at some of the rays that were traced, on objects ids (R,): (N, K, 3)."""
        factors = self._ones(len(rays))
        for i_object, layers in self._maps.items():
            mine = np.flatnonzero(ids[rays] == i_object)
            own = found.of(rays[mine])
            uv = uvs_at(self._scene, own.triangle, own.u, own.v)
            colours = colours_at(self._scene, own.triangle, own.u, own.v)
            for k, maps in layers:
                texture, weight = look_up_images(maps.images, self._scene.textures, uv, colours)
                factors[mine, k] = maps.factor(texture, paint_weights(self._scene, own, maps.strokes, weight))
        return factors

    def _ones(self, n: int) -> Factors:
        return np.ones((n, self._n_layers, 3), np.float32)
