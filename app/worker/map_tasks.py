"""The worker's part of textures and weight maps: images sampled where the camera sees them, strokes painted on them,
and their thumbnails."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import MapsRefused, MapsSampled, SampleMaps
from engine.core.colour import encode_srgb
from engine.core.errors import LoadError
from engine.material.layer import object_of
from engine.material.layer_maps import Images
from engine.material.strokes import Strokes
from engine.precompute.direct.pipeline import Placement
from engine.scene.map_sampler import Canvas, MapSampler
from engine.scene.primary_hits import PrimaryHits
from engine.scene.scene_loader import PROJECTED_NOTE
from engine.texture.pyramid import Pyramid

THUMBNAIL_SIDE = 64
MAX_PAINTED = 4
NOTHING = 64  # the grey of pixels outside the object


class MapTasks:
    """The images of one scene's layers. Those of a stroke are stored, so that each dab costs only itself."""

    def __init__(self, placement: Placement) -> None:
        self._placement = placement
        self._painted_layers: dict[tuple[int, Images], _PaintedLayer] = {}

    def answers(self, request: SampleMaps) -> Iterator[Response | None]:
        """Each layer's images at all pixels of its object, or the reason why there are none."""
        placement = self._placement
        sampler = MapSampler(placement.scene, placement.caster, placement.hits)
        for key, images in request.layers:
            yield None
            yield self._answer(sampler, key, images)

    def _answer(self, sampler: MapSampler, key: str, images: Images) -> MapsSampled | MapsRefused:
        scene = self._placement.scene
        i_object, textures = scene.object_index(object_of(key)), scene.textures
        try:
            begun = self._work(sampler, i_object, images)
            seen = begun.canvas.paint(images.strokes)
            pyramids = {"texture": textures.texture(images.without_node), "weight": textures.weight(images)}
        except LoadError as error:
            return MapsRefused(key, images, " ".join(str(error).split()))
        samples = begun.unpainted.copy()
        samples[:, 3] = seen.weight
        thumbnails = {what: thumbnail(pyramid) for what, pyramid in pyramids.items() if pyramid is not None}
        if images.strokes:
            thumbnails["weight"] = begun.thumbnail.of(seen.weight)
        by_box = images.is_of_files and not scene.has_uvs[i_object]
        note = f"{object_of(key)}: {PROJECTED_NOTE}" if by_box else ""
        return MapsSampled(key, images, samples, seen.means, thumbnails, note)

    def _work(self, sampler: MapSampler, i_object: int, images: Images) -> _PaintedLayer:
        """The images that strokes are painted on; made anew for unchanged strokes, because files were written since."""
        place = (i_object, images.without_strokes)
        begun = self._painted_layers.pop(place, None)
        if begun is None or begun.last == images or not images.strokes:
            canvas = sampler.canvas(i_object, images)
            seen = canvas.paint(Strokes())
            samples = np.concatenate([seen.texture, seen.weight[:, None]], axis=1).astype(np.float16)
            begun = _PaintedLayer(images, canvas, samples, MapThumbnail(self._placement.hits, i_object))
        self._painted_layers = dict(list(self._painted_layers.items())[1 - MAX_PAINTED :])
        self._painted_layers[place] = replace(begun, last=images)
        return begun


@dataclass(frozen=True, eq=False)
class _PaintedLayer:
    """A layer's images during a stroke: as requested last, their canvas, their samples (p, 4) without strokes (float16:
    converting them takes longer than painting), and the thumbnail of the painted map."""

    last: Images
    canvas: Canvas
    unpainted: NDArray[np.float16]
    thumbnail: MapThumbnail


class MapThumbnail:
    """A painted map, which has no texels, as the camera sees it on its object: at most 64 pixels wide and high, grey
    outside the object."""

    def __init__(self, hits: PrimaryHits, i_object: int) -> None:
        pixel = hits.pixel[slice(*hits.object_ranges[i_object])]
        row, column = pixel // hits.resolution[0], pixel % hits.resolution[0]
        if len(pixel):
            row, column = row - row.min(), column - column.min()
        shrink = max(int(row.max(initial=0)) + 1, int(column.max(initial=0)) + 1, THUMBNAIL_SIDE) / THUMBNAIL_SIDE
        self._shape = int(row.max(initial=0) / shrink) + 1, int(column.max(initial=0) / shrink) + 1
        cells = (row / shrink).astype(np.int64) * self._shape[1] + (column / shrink).astype(np.int64)
        self._cells, self._points = np.unique(cells, return_index=True)

    def of(self, weight: NDArray[np.floating]) -> NDArray[np.uint8]:
        """The picture (h, w, 3) of weights (p,)."""
        image = np.full(self._shape[0] * self._shape[1], NOTHING, np.uint8)
        image[self._cells] = np.round(255.0 * weight[self._points])
        return np.repeat(image.reshape(*self._shape, 1), 3, axis=2)


def thumbnail(pyramid: Pyramid) -> NDArray[np.uint8]:
    """An image at most 64 texels wide and high, (h, w, 3) in sRGB, with its aspect ratio."""
    width, height = pyramid.size
    shrink = max(width, height, THUMBNAIL_SIDE) / THUMBNAIL_SIDE
    columns, rows = max(1, round(width / shrink)), max(1, round(height / shrink))
    u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, 1.0 - (np.arange(rows) + 0.5) / rows)
    texels = pyramid.at(np.stack([u, v], axis=2).reshape(-1, 2), np.log2(max(shrink, 1.0)))
    texels = np.clip(texels, 0.0, 1.0)
    shares = encode_srgb(texels) if texels.shape[1] == 3 else texels  # a mask is shown as its file has it
    shown = np.round(255.0 * shares).astype(np.uint8)
    return np.ascontiguousarray(np.broadcast_to(shown, (len(shown), 3)).reshape(rows, columns, 3))
