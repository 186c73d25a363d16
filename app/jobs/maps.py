"""The worker's share of textures and weight maps: images sampled where the eye sees them, strokes painted on them, and
their thumbnails."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from app.jobs.messages import MapsRefused, MapsSampled, Response, SampleMaps
from engine.errors import LoadError
from engine.material.maps import Images
from engine.render.display import encode_srgb
from engine.scene.hits import PrimaryHits
from engine.texture.canvas import Canvas
from engine.texture.pyramid import Pyramid
from engine.texture.surface import MapSampler
from engine.transport.pipeline import Placement

THUMBNAIL_SIDE = 64
MOST_CANVASES = 4


class MapTasks:
    """The images of one scene's layers. What a brush works on is kept, so that a dab costs itself alone."""

    def __init__(self, placement: Placement) -> None:
        self._placement = placement
        self._names = [described.name for described in placement.scene.description.objects]
        self._canvases: dict[tuple[int, Images], tuple[Images, Canvas]] = {}

    def answers(self, request: SampleMaps) -> Iterator[Response | None]:
        """Each layer's images at all pixels of its object, or why there are none."""
        placement = self._placement
        sampler = MapSampler(placement.scene, placement.caster, placement.hits)
        for key, images in request.layers:
            yield None
            yield self._answer(sampler, key, images)

    def _answer(self, sampler: MapSampler, key: str, images: Images) -> MapsSampled | MapsRefused:
        i_object, textures = self._names.index(key.rpartition(".")[0]), self._placement.scene.textures
        try:
            seen = self._canvas(sampler, i_object, images).see(images.strokes)
            pyramids = {"texture": textures.texture(images), "weight": textures.weight(images)}
        except LoadError as error:
            return MapsRefused(key, images, " ".join(str(error).split()))
        samples = np.concatenate([seen.texture, seen.weight[:, None]], axis=1).astype(np.float16)
        thumbnails = {what: thumbnail(pyramid) for what, pyramid in pyramids.items() if pyramid is not None}
        if images.strokes:
            thumbnails["weight"] = seen_thumbnail(self._placement.hits, i_object, seen.weight)
        return MapsSampled(key, images, samples, seen.means, thumbnails)

    def _canvas(self, sampler: MapSampler, i_object: int, images: Images) -> Canvas:
        """What strokes are painted on; made anew where they are those of the last time: files were written since."""
        place = (i_object, images.unpainted)
        before, canvas = self._canvases.pop(place, (None, None))
        if canvas is None or before == images or not images.strokes:
            canvas = sampler.canvas(i_object, images)
        self._canvases = dict(list(self._canvases.items())[1 - MOST_CANVASES :])
        self._canvases[place] = images, canvas
        return canvas


def thumbnail(pyramid: Pyramid) -> NDArray[np.uint8]:
    """An image at most 64 texels wide and high, (h, w, 3) as a screen shows it, its aspect kept."""
    width, height = pyramid.size
    shrink = max(width, height, THUMBNAIL_SIDE) / THUMBNAIL_SIDE
    columns, rows = max(1, round(width / shrink)), max(1, round(height / shrink))
    u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, 1.0 - (np.arange(rows) + 0.5) / rows)
    texels = pyramid.at(np.stack([u, v], axis=2).reshape(-1, 2), np.log2(max(shrink, 1.0)))
    texels = np.clip(texels, 0.0, 1.0)
    shares = encode_srgb(texels) if texels.shape[1] == 3 else texels  # a mask is shown as its file has it
    shown = np.round(255.0 * shares).astype(np.uint8)
    return np.ascontiguousarray(np.broadcast_to(shown, (len(shown), 3)).reshape(rows, columns, 3))


def seen_thumbnail(hits: PrimaryHits, i_object: int, weight: NDArray[np.floating]) -> NDArray[np.uint8]:
    """A painted map, which has no texels, as the eye sees it on its object: at most 64 pixels wide and high, grey where
    the object is not."""
    pixel = hits.pixel[slice(*hits.object_ranges[i_object])]
    if not len(pixel):
        return np.full((1, 1, 3), 64, np.uint8)
    row, column = pixel // hits.resolution[0], pixel % hits.resolution[0]
    row, column = row - row.min(), column - column.min()
    shrink = max(int(row.max()) + 1, int(column.max()) + 1, THUMBNAIL_SIDE) / THUMBNAIL_SIDE
    image = np.full((int(row.max() / shrink) + 1, int(column.max() / shrink) + 1), 64, np.uint8)
    image[(row / shrink).astype(np.int64), (column / shrink).astype(np.int64)] = np.round(255.0 * weight)
    return np.repeat(image[..., None], 3, axis=2)
