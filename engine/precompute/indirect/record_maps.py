"""Reflectance of irradiance cache records: by texture maps, and by the angle of the incident light.

A dark wainscot reflects less than the light wall above it. The plan of a still and the window's albedo use the mean of
a map over its object. Light, however, reaches some parts of an object more than others, and the backs of walls not at
all: in a stairwell whose walls have a dark wainscot, light after two to four bounces was 4, 4 and 10 % too dark on
average, and on the floor 20 to 46 % too bright. Each record therefore multiplies the mean by its own relative factor,
the mean over its sample positions. The result remains a polynomial in the albedo of an edited object.

A glossy surface does not reflect all incident light equally: a polished floor reflects a twentieth of the light from a
lamp above it, half at grazing incidence. The equivalent albedo is the mean over all directions, which differs from that
for a single lamp: below a low lamp the third bounce was 2 to 4 % too bright. Records therefore store direct irradiance
by angle of incidence.
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
from engine.precompute.indirect.albedo import N_SLANTS
from engine.precompute.indirect.indirect_layers import IndirectLayer, is_glossy
from engine.scene.surface_uvs import colours_at, corner_uvs_of_set, positions_at, uvs_at
from engine.texture.stroke_painting import PaintedPoints
from engine.texture.texture_store import sample_images

if TYPE_CHECKING:
    from engine.precompute.indirect._cache_kernels import CacheTable
    from engine.scene.scene_loader import Scene
    from engine.texture.pyramid import Pyramid

Float32Array = NDArray[np.float32]
_LEAST_ALBEDO = 1e-6
_MAX_CACHED = 16


@dataclass(frozen=True, eq=False)
class RecordReflectance:
    """Reflectance of C records. relative (C, 3): their equivalent albedo relative to that of their object; diffuse (C,
    3): the share of diffuse layers in it, 1 where the albedo is 0; slant (C, N_SLANTS, 3): albedo for light from one
    direction relative to that for all, None if nothing is glossy; texels (K, C, 3): factors of K glossy layers relative
    to their means; image (L): index into texels for each layer, −1 for none."""

    relative: Float32Array
    diffuse: Float32Array
    slant: Float32Array | None
    texels: Float32Array
    image: tuple[int, ...]

    @property
    def digest(self) -> bytes:
        """Identifies the texels."""
        return hashlib.blake2b(self.texels.tobytes(), digest_size=16).digest()


class _Places:
    """The sample positions of one object's records, and the means of its texture maps over each record."""

    def __init__(self, scene: Scene, table: CacheTable, i_object: int, images: Images) -> None:
        self.records, self._origin = np.flatnonzero(table.objects == i_object), scene.origin
        counts = table.n_places[self.records].astype(np.int64)
        self._start, self._counts = np.cumsum(counts) - counts, counts
        record = np.repeat(self.records, counts)
        place = np.arange(counts.sum()) - np.repeat(self._start, counts)
        triangle, u, v = (array[record, place] for array in (table.triangle, table.u, table.v))
        position = positions_at(scene, triangle, u, v)
        area = np.repeat(self._spread(position) / counts, counts)
        uv = uvs_at(scene, triangle, u, v)

        def sample(image: Pyramid, repeats: tuple[float, float]) -> Float32Array:
            share = area * _stretch(scene, triangle, image.transform.uv_set)
            return image.at(uv, image.level_of(share * abs(repeats[0] * repeats[1])), repeats)

        self._texture, weight = sample_images(
            images, scene.textures, len(uv), sample, lambda: colours_at(scene, triangle, u, v)
        )
        self._painted = PaintedPoints(weight, position, scene.geometric_normals[triangle])

    def factor(self, maps: LayerMaps) -> NDArray[np.float64]:
        """The mean factor of each record, (k, 3)."""
        weight = self._painted.weights(maps.strokes.about(self._origin))
        both = self._texture * weight[:, None]
        return factor_of_means(maps, *(self._means(each) for each in (self._texture, weight, both)))

    def _means(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        """Means per record of values (n, ...) at all positions."""
        sums = np.add.reduceat(values, self._start, axis=0, dtype=np.float64) if len(values) else values
        return np.asarray((sums.T / self._counts).T, np.float64)

    def _spread(self, position: Float32Array) -> NDArray[np.float64]:
        """The area (k,) that each record's positions cover: six times their variance, since that of a square is a sixth
        of its area."""
        mean = self._means(position)
        return 6.0 * np.maximum((self._means(position.astype(np.float64) ** 2) - mean**2).sum(axis=1), 0.0)


def _stretch(scene: Scene, triangle: NDArray[np.integer], uv_set: int) -> NDArray[np.float64]:
    """Texture area in a set of coordinates per square metre of triangles (n,)."""
    uvs = corner_uvs_of_set(scene, triangle, uv_set)
    corners = scene.vertices[scene.triangles[triangle]].astype(np.float64)
    one, two = np.moveaxis(uvs[:, 1:] - uvs[:, :1], 1, 0)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)


class RecordMaps:
    """The texture maps of a scene at the records of one table; caches the latest samples."""

    def __init__(self, scene: Scene, table: CacheTable) -> None:
        self._scene, self._table = scene, table
        self._cached: dict[tuple[int, Images], _Places] = {}

    def reflectance(self, layers: Sequence[IndirectLayer], n_objects: int) -> RecordReflectance:
        """The reflectance of the records under these layers."""
        factors = [self._relative_factor(layer) for layer in layers]
        if any(factor is not None for factor in factors):
            return _reflectance(layers, factors, self._table.objects, n_objects)
        # Without maps all records of an object are alike.
        found = _reflectance(layers, factors, np.arange(n_objects), n_objects)
        objects = self._table.objects
        slant = None if found.slant is None else found.slant[objects]
        texels = np.zeros((0, len(objects), 3), np.float32)
        return RecordReflectance(found.relative[objects], found.diffuse[objects], slant, texels, found.image)

    def _relative_factor(self, layer: IndirectLayer) -> NDArray[np.float64] | None:
        """The factor (k, 3) of a layer's maps at the records of its object, relative to their mean; None without maps.
        Also None if a map cannot be read: its mean, known from before, then applies everywhere."""
        if layer.maps.is_plain:
            return None
        images = layer.maps.images.without_strokes.for_bounces
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


def _reflectance(
    layers: Sequence[IndirectLayer], factors: Sequence[NDArray[np.float64] | None], objects: NDArray[np.integer],
    n_objects: int,
) -> RecordReflectance:  # fmt: skip
    """The reflectance of records on these objects (C,). factors: of each layer at the records of its object, (k, 3)."""
    albedos = np.zeros((2, len(objects), 3))  # of all layers, of diffuse ones
    of_object = np.zeros((n_objects, 3))
    slanted = np.zeros((len(objects), N_SLANTS, 3)) if any(map(is_glossy, layers)) else None
    texels, image = [], [-1] * len(layers)
    for i, (layer, factor) in enumerate(zip(layers, factors, strict=True)):
        mine = np.flatnonzero(objects == layer.i_object)
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


def _ratio(part: NDArray[np.float64], whole: NDArray[np.float64]) -> Float32Array:
    """part / whole, 1 where the whole is almost 0."""
    return np.where(whole > _LEAST_ALBEDO, part / np.maximum(whole, _LEAST_ALBEDO), 1.0).astype(np.float32)
