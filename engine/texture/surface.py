"""Where on its images each point of a surface lies, what a pixel sees of them, and their mean over a surface.

Primary hits keep neither triangle nor barycentric coordinates, which most scenes have no use for: the few rays of a
textured object are traced again. How far a pixel reaches over an image is found by where the rays of the pixels to its
right and below meet the plane of its own triangle [Igehy99], so that silhouettes and seams do not matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.maps import Images, MapMeans
from engine.scene.camera import pixel_directions
from engine.scene.hits import PrimaryHits
from engine.scene.load import Scene
from engine.scene.raycaster import Intersections, RayCaster
from engine.texture.pyramid import Pyramid
from engine.texture.store import TextureStore

Floats = NDArray[np.float64]
_N_MEAN_SAMPLES = 1 << 15
_MOST_KEPT = 4


@dataclass(frozen=True, eq=False)
class SeenMaps:
    """The images of one layer as the eye sees them: texture (p, 3) and weight (p,) float32 at the points of its object,
    in the order of the hits, ones where there is none; and their means over the surface."""

    texture: NDArray[np.float32]
    weight: NDArray[np.float32]
    means: MapMeans


def uvs_at(scene: Scene, triangle: NDArray[np.integer], u: NDArray, v: NDArray) -> Floats:
    """Texture coordinates (N, 2) of points (1 − u − v) A + u B + v C of triangles (N,); 0 where a mesh has none."""
    if scene.uvs is None:
        return np.zeros((len(triangle), 2))
    corners = scene.uvs[triangle].astype(np.float64)
    u, v = np.asarray(u, np.float64)[:, None], np.asarray(v, np.float64)[:, None]
    return np.asarray((1.0 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2])


class MapSampler:
    """Samples images where the eye sees an object. What layers of one object share is found once: where its points lie
    on its images, and a weight map by which two of them are blended."""

    def __init__(self, scene: Scene, caster: RayCaster, hits: PrimaryHits) -> None:
        self._scene, self._caster, self._hits = scene, caster, hits
        self._footprints: dict[int, tuple[Floats, Floats, Floats]] = {}
        self._sampled: dict[tuple[object, ...], NDArray[np.float32]] = {}

    def see(self, i_object: int, images: Images) -> SeenMaps:
        """A layer's images at all points of its object that the eye sees. Raises LoadError."""
        scene = self._scene
        scene.check_has_uvs(i_object, "texture" if images.texture else "weight")
        texture, weight = scene.textures.texture(images), scene.textures.weight(images)
        begin, end = self._hits.object_ranges[i_object]
        colours, shares = np.ones((end - begin, 3), np.float32), np.ones(end - begin, np.float32)
        if texture is not None:
            own = images.texture, images.texture_space, images.texture_scale
            colours = self._samples(i_object, own, texture, images.texture_scale)
        if weight is not None:
            shares = self._samples(i_object, (images.weight,), weight, (1.0, 1.0))[:, 0]
        return SeenMaps(colours, shares, mean_maps(scene, i_object, images, texture, weight))

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
            self._sampled[key] = pyramid.over(uv, across, down).astype(np.float32)
        return self._sampled[key]


def look_up(images: Images, store: TextureStore, uv: Floats) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Texture (N, 3) and weight (N,) at coordinates (N, 2), between texels and without any filter."""
    texture, weight = store.texture(images), store.weight(images)
    colours, shares = np.ones((len(uv), 3), np.float32), np.ones(len(uv), np.float32)
    if texture is not None:
        colours = texture.at(uv * np.array(images.texture_scale))
    if weight is not None:
        shares = weight.at(uv)[:, 0]
    return colours, shares


def mean_maps(
    scene: Scene, i_object: int, images: Images, texture: Pyramid | None, weight: Pyramid | None
) -> MapMeans:
    """Means by area over an object, from points evenly spread over it that each stand for a share of the image."""
    begin, end = scene.triangle_ranges[i_object]
    corners = scene.vertices[scene.triangles[begin:end]].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    cumulative = np.cumsum(area)
    places = (np.arange(_N_MEAN_SAMPLES) + 0.5) / _N_MEAN_SAMPLES * cumulative[-1]
    triangle = begin + np.minimum(np.searchsorted(cumulative, places), end - begin - 1)
    u, v = _even_barycentrics(_N_MEAN_SAMPLES)
    uv = uvs_at(scene, triangle, u, v)
    assert scene.uvs is not None
    edges = scene.uvs[triangle, 1:].astype(np.float64) - scene.uvs[triangle, :1]
    stretch = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / area[triangle - begin]
    share = stretch * cumulative[-1] / _N_MEAN_SAMPLES  # of the image, that one point stands for
    colours, shares = np.ones((len(uv), 3)), np.ones(len(uv))
    if texture is not None:
        scale = np.array(images.texture_scale)
        colours = texture.at(uv * scale, _level(texture, share * abs(scale.prod()))).astype(np.float64)
    if weight is not None:
        shares = weight.at(uv, _level(weight, share))[:, 0].astype(np.float64)
    red, green, blue = colours.mean(axis=0).tolist()
    both = (colours * shares[:, None]).mean(axis=0).tolist()
    return MapMeans((red, green, blue), float(shares.mean()), (both[0], both[1], both[2]))


def _level(pyramid: Pyramid, share: Floats) -> Floats:
    """The level whose texels are as large as a share (N,) of the image's area."""
    width, height = pyramid.size
    return np.asarray(0.5 * np.log2(np.maximum(share * width * height, 1.0)))


def _even_barycentrics(n: int) -> tuple[Floats, Floats]:
    """n points spread evenly over a triangle, their u and v: multiples of powers of a root, modulo 1 [Roberts18]."""
    root = 1.32471795724474602596  # x³ = x + 1
    a, b = ((np.arange(n) * step + 0.5) % 1.0 for step in (1.0 / root, 1.0 / root**2))
    folded = a + b > 1.0
    return np.where(folded, 1.0 - a, a), np.where(folded, 1.0 - b, b)


def _footprints(
    scene: Scene, caster: RayCaster, hits: PrimaryHits, rows: NDArray[np.integer]
) -> tuple[Floats, Floats, Floats]:
    """Texture coordinates of some hits, and by how much they change over a pixel to the right and downwards, (p, 2)."""
    width, _ = hits.resolution
    pixel = hits.pixel[rows]
    directions = hits.ray_directions.reshape(-1, 3)[pixel]
    eyes = np.tile(scene.eye.astype(np.float32), (len(rows), 1))
    found = caster.intersect(eyes, directions)
    uv = uvs_at(scene, found.triangle, found.u, found.v)
    columns, lines = pixel % width + 0.5, pixel // width + 0.5
    beside = []
    for dx, dy in ((1.0, 0.0), (0.0, 1.0)):
        towards = pixel_directions(scene.description.camera, hits.resolution, columns + dx, lines + dy)
        beside.append(_uvs_in_plane(scene, found, towards.astype(np.float64)) - uv)
    return uv, beside[0], beside[1]


def _uvs_in_plane(scene: Scene, found: Intersections, directions: Floats) -> Floats:
    """Texture coordinates (p, 2) where rays from the eye meet the planes of the triangles found; far out where they
    hardly do."""
    corners = scene.vertices[scene.triangles[found.triangle]].astype(np.float64)
    a, one, two = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(one, two)
    slope = np.einsum("pk,pk->p", normal, directions)
    least = 1e-9 * np.linalg.norm(normal, axis=1)
    slope = np.where(np.abs(slope) > least, slope, np.copysign(least, slope))
    distance = np.einsum("pk,pk->p", normal, a - scene.eye) / slope
    place = scene.eye + distance[:, None] * directions - a
    squared = np.einsum("pk,pk->p", normal, normal)
    u = np.einsum("pk,pk->p", normal, np.cross(place, two)) / squared
    v = np.einsum("pk,pk->p", normal, np.cross(one, place)) / squared
    return uvs_at(scene, found.triangle, u, v)
