"""What cells reflect: by their part of an image, and by where light comes from.

A dark wainscot sends less on than the light wall above it.
The mean of an image over all of its object is what a still's plan and the window's albedo go by. Light, though, falls
on some of the object more than on the rest, and on the backs of walls not at all: in a stairwell whose walls have a
dark wainscot, light after two to four bounces was 4, 4 and 10 % too dark in the mean, and on the floor 20 to 46 % too
bright. So a cell multiplies the mean by its own factor over it, which is the mean over its places; what follows the
albedo of an object that is edited stays a polynomial in it.

Nor does a gloss send all light on alike: of what falls on a polished floor from a lamp above it a twentieth, of what
grazes it a half. The equivalent albedo is the mean over all directions, which that of one lamp is not: below a low lamp
the third bounce was 2 to 4 % too bright. So cells keep by the angle of incidence what lights bring them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.material.layer_maps import Images, LayerMaps, factor_of_means
from engine.precompute.indirect.albedo_from_curves import N_SLANTS
from engine.precompute.indirect.indirect_layers import IndirectLayer, is_glossy
from engine.scene.surface_uvs import corner_uvs, positions_at, uvs_at
from engine.texture.stroke_painting import PaintedPoints
from engine.texture.texture_store import sample_images

if TYPE_CHECKING:
    from engine.precompute.indirect._cache_kernels import CacheTable
    from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
_LEAST_ALBEDO = 1e-6
_MAX_CACHED = 16


@dataclass(frozen=True, eq=False)
class RecordReflectance:
    """What C cells reflect: relative (C, 3), their equivalent albedo over that of their object; matt (C, 3), the share
    that matt layers have of it, 1 where there is no albedo; slant (C, N_SLANTS, 3), what it is for light from one
    direction over what it is for all, None where nothing is glossy; texels (K, C, 3), the factors of K glossy layers
    over their means; image (L): which of these each of all layers has, −1 for none."""

    relative: Float32Array
    diffuse: Float32Array
    slant: Float32Array | None
    texels: Float32Array
    image: tuple[int, ...]

    @property
    def digest(self) -> bytes:
        """What differs where texels do."""
        return hashlib.blake2b(self.texels.tobytes(), digest_size=16).digest()


class _Places:
    """The places of the cells of one object, and what its images do there on average over each cell."""

    def __init__(self, scene: Scene, table: CacheTable, i_object: int, images: Images) -> None:
        self.cells, self._origin = np.flatnonzero(table.objects == i_object), scene.origin
        counts = table.n_places[self.cells].astype(np.int64)
        self._start, self._counts = np.cumsum(counts) - counts, counts
        cell = np.repeat(self.cells, counts)
        place = np.arange(counts.sum()) - np.repeat(self._start, counts)
        triangle, u, v = (array[cell, place] for array in (table.triangle, table.u, table.v))
        position = positions_at(scene, triangle, u, v)
        area = np.repeat(self._spread(position) / counts, counts)
        uv = uvs_at(scene, triangle, u, v)
        share = area * _stretch(scene, triangle)
        self._texture, weight = sample_images(
            images, scene.textures, len(uv),
            lambda image, repeats: image.at(
                uv * np.array(repeats), image.level_of(share * abs(repeats[0] * repeats[1]))
            ),
        )  # fmt: skip
        self._painted = PaintedPoints(weight, position, scene.geometric_normals[triangle])

    def factor(self, maps: LayerMaps) -> NDArray[np.float64]:
        """The mean factor of each cell, (k, 3)."""
        weight = self._painted.weights(maps.strokes.about(self._origin))
        both = self._texture * weight[:, None]
        return factor_of_means(maps, *(self._means(each) for each in (self._texture, weight, both)))

    def _means(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        """By cell, of values (n, ...) at all places."""
        sums = np.add.reduceat(values, self._start, axis=0, dtype=np.float64) if len(values) else values
        return np.asarray((sums.T / self._counts).T, np.float64)

    def _spread(self, position: Float32Array) -> NDArray[np.float64]:
        """The area (k,) that each cell's places are spread over: six times their variance, as that of a square is a
        sixth of its area."""
        mean = self._means(position)
        return 6.0 * np.maximum((self._means(position.astype(np.float64) ** 2) - mean**2).sum(axis=1), 0.0)


def _stretch(scene: Scene, triangle: NDArray[np.integer]) -> NDArray[np.float64]:
    """Areas of images on a square metre of triangles (n,)."""
    uvs, corners = corner_uvs(scene, triangle), scene.vertices[scene.triangles[triangle]].astype(np.float64)
    one, two = np.moveaxis(uvs[:, 1:] - uvs[:, :1], 1, 0)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)


class RecordMaps:
    """The images of a scene at the cells of one table; what was sampled last is kept."""

    def __init__(self, scene: Scene, table: CacheTable) -> None:
        self._scene, self._table = scene, table
        self._cached: dict[tuple[int, Images], _Places] = {}

    def reflectance(self, layers: Sequence[IndirectLayer], n_objects: int) -> RecordReflectance:
        """What the cells reflect under these layers."""
        objects = self._table.objects
        albedos = np.zeros((2, len(objects), 3))  # of all layers, of matt ones
        of_object = np.zeros((n_objects, 3))
        slanted = np.zeros((len(objects), N_SLANTS, 3)) if any(map(is_glossy, layers)) else None
        texels, image = [], [-1] * len(layers)
        for i, layer in enumerate(layers):
            mine = np.flatnonzero(objects == layer.i_object)
            factor = self._relative_factor(layer)
            own = layer.albedo if factor is None else layer.albedo * factor
            albedos[0, mine] += own
            of_object[layer.i_object] += layer.albedo
            if slanted is not None:
                slanted[mine] += np.broadcast_to(own, (len(mine), 3))[:, None] * layer.slant
            if not is_glossy(layer):
                albedos[1, mine] += own
            elif factor is not None:
                texels.append(np.ones((len(objects), 3), np.float32))
                texels[-1][mine] = factor
                image[i] = len(texels) - 1
        whole, diffuse = albedos
        relative = _ratio(whole, of_object[objects])
        of_images = np.array(texels, np.float32).reshape(len(texels), len(objects), 3)
        slant = None if slanted is None else _ratio(slanted, np.broadcast_to(whole[:, None], slanted.shape))
        return RecordReflectance(relative, _ratio(diffuse, whole), slant, of_images, tuple(image))

    def _relative_factor(self, layer: IndirectLayer) -> NDArray[np.float64] | None:
        """Of the cells of a layer's object, the factor (k, 3) of its images over what the layer takes for their mean;
        None without images, or where these cannot be read: the mean was known, and has to do."""
        if layer.maps.is_plain:
            return None
        images = layer.maps.images.without_strokes
        try:
            places = self._cached.pop((layer.i_object, images), None)
            if places is None:
                places = _Places(self._scene, self._table, layer.i_object, images)
            factor = places.factor(layer.maps)
        except LoadError:
            return None
        self._cached[layer.i_object, images] = places
        while len(self._cached) > _MAX_CACHED:
            del self._cached[next(iter(self._cached))]
        return np.divide(factor, layer.share, out=np.zeros_like(factor), where=layer.share > 0.0)


def _ratio(part: NDArray[np.float64], whole: NDArray[np.float64]) -> Float32Array:
    """1 where there is next to nothing of the whole."""
    return np.where(whole > _LEAST_ALBEDO, part / np.maximum(whole, _LEAST_ALBEDO), 1.0).astype(np.float32)
