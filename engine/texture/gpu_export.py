"""Images and strokes in the form of shaders: words of two buffers, and the place of each layer's in them
(`shaders/common/maps.glsl`); vertex colours, and opacities of objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import MAX_UV_SETS, WRAPS
from engine.material.opacity import MODES
from engine.material.strokes import HARDEST

if TYPE_CHECKING:
    from engine.material.layer_maps import LayerMaps
    from engine.material.strokes import Strokes
    from engine.scene.scene_loader import Scene
    from engine.texture.pyramid import Pyramid
    from engine.texture.texture_store import TextureStore

Words = NDArray[np.uint32]
Float32Array = NDArray[np.float32]

_LEVELS = 16  # of an image, at most
_HEAD = 1 + 3 * _LEVELS + 5
_STROKE_WORDS = 8


@dataclass(frozen=True)
class ExportedMaps:
    """The factors of a layer, see `LayerMaps`: where its images begin among all words, −1 for none; whether vertex
    colours multiply its texture; first and last (excluded) of its strokes. other_texture: a second image that
    multiplies the texture, in another set of texture coordinates."""

    texture: int
    scale: tuple[float, float]
    other_texture: int
    other_scale: tuple[float, float]
    strength: float
    vertex_colours: bool
    weight: int
    start: float
    inverts: bool
    strokes: tuple[int, int]


class ImageExporter:
    """Collects images and strokes, in the order of the requests."""

    def __init__(self, store: TextureStore, origin: NDArray[np.float64]) -> None:
        """origin (3,): of the scene that is exported, see `engine.scene.scene_loader.Scene`."""
        self._store, self._origin = store, origin
        self._begins: dict[Pyramid, int] = {}
        self._n_words = self._n_strokes = 0
        self.strokes: tuple[Strokes, ...] = ()

    @property
    def images(self) -> tuple[Pyramid, ...]:
        return tuple(self._begins)

    def maps(self, maps: LayerMaps) -> ExportedMaps:
        images, first = maps.images, self._n_strokes
        if images.strokes:
            self.strokes += (images.strokes.about(self._origin),)
            self._n_strokes += len(images.strokes.strokes)
        own = [(self.image(self._store.texture(each)), each.texture_scale) for each in images.textures]
        own += [(-1, (1.0, 1.0))] * (MAX_UV_SETS - len(own))
        return ExportedMaps(
            *own[0], *own[1], maps.sampled_strength,
            images.vertex_colours, self.image(self._store.weight(images)), images.weight_start, maps.inverts,
            (first, self._n_strokes),
        )  # fmt: skip

    def image(self, image: Pyramid | None) -> int:
        """The first word of an image, −1 for none."""
        if image is None:
            return -1
        if image not in self._begins:
            self._begins[image] = self._n_words
            self._n_words += _HEAD + 2 * len(image.texels)
        return self._begins[image]


def opacity_rows(scene: Scene, images: ImageExporter) -> Float32Array:
    """A row of each object (M, 8), see `shaders/common/opacity.glsl`; (0, 8) where all are opaque."""
    cutouts = scene.cutouts
    rows = np.zeros((len(scene.smooth) if cutouts.opacities else 0, 8), np.float32)
    for i, own in cutouts.opacities.items():
        mode, image = MODES.index(own.opacity_mode), images.image(cutouts.images.get(i))
        rows[i, :7] = mode, image, *own.opacity_repeats, own.opacity_factor, own.opacity_cutoff, own.opacity_vertices
    return rows


def image_words(images: tuple[Pyramid, ...]) -> Words:
    """Words of images: the number of levels; height, width and first texel of each; rotation, offset, wrap and set of
    coordinates; and the texels: up to three half floats in two words."""
    words = []
    for image in images:
        head = np.zeros(_HEAD, np.uint32)
        sizes = np.array(image.shapes[:_LEVELS], np.uint32)
        areas = sizes.prod(axis=1)
        head[0] = len(sizes)
        head[1 : 1 + 3 * len(sizes)] = np.column_stack([sizes, np.cumsum(areas) - areas]).ravel()
        moves = np.array([*image.transform.turn, *image.transform.offset], np.float32)
        head[_HEAD - 5 : _HEAD - 1] = moves.view(np.uint32)
        u, v = (WRAPS.index(wrap) for wrap in image.transform.wrap)
        head[_HEAD - 1] = u + len(WRAPS) * (v + len(WRAPS) * image.transform.uv_set)
        texels = np.zeros((len(image.texels), 4), np.float16)
        texels[:, : image.n_channels] = np.clip(image.texels, -65504.0, 65504.0)
        words += [head, texels.view(np.uint32).ravel()]
    return np.concatenate(words) if words else np.zeros(0, np.uint32)


def in_all_sets(uvs: NDArray[np.floating]) -> NDArray[np.floating]:
    """Texture coordinates (..., 2 K) in all sets that shaders know, (..., 4): the first in place of those that are not
    there."""
    return np.concatenate([uvs, *[uvs[..., :2]] * (MAX_UV_SETS - uvs.shape[-1] // 2)], axis=-1)


def colour_words(colours: NDArray[np.floating]) -> Words:
    """Vertex colours (..., 4) as words (..., 2): half floats, the lower half first."""
    return np.ascontiguousarray(colours, np.float16).view(np.uint32)


def stroke_words(strokes: tuple[Strokes, ...]) -> Words:
    """Words of strokes: 8 each: first and last dab, radius, inner radius, strength, value, 0, 0; then all dabs."""
    every = [stroke for each in strokes for stroke in each.strokes]
    ends = np.cumsum([0, *(stroke.n_dabs for stroke in every)])
    head = np.zeros((len(every), _STROKE_WORDS), np.float32)
    for k, stroke in enumerate(every):
        inner = min(stroke.hardness, HARDEST) * stroke.radius
        head[k, :2] = ends[k : k + 2].astype(np.int32).view(np.float32)
        head[k, 2:6] = stroke.radius, inner, stroke.strength, stroke.value
    dabs = [stroke.array.ravel() for stroke in every]
    return np.concatenate([head.ravel(), *dabs]).astype(np.float32).view(np.uint32)
