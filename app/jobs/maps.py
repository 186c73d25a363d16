"""The worker's share of textures and weight maps: images sampled where the eye sees them, and their thumbnails."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.jobs.messages import MapsRefused, MapsSampled
from engine.errors import LoadError
from engine.material.maps import Images
from engine.render.display import encode_srgb
from engine.scene.load import Scene
from engine.texture.pyramid import Pyramid
from engine.texture.surface import MapSampler

THUMBNAIL_SIDE = 64


def sampled_maps(scene: Scene, sampler: MapSampler, key: str, images: Images) -> MapsSampled | MapsRefused:
    """The images of the layer called `key` at all pixels of its object, or why there are none."""
    names = [described.name for described in scene.description.objects]
    try:
        seen = sampler.see(names.index(key.rpartition(".")[0]), images)
        pyramids = {"texture": scene.textures.texture(images), "weight": scene.textures.weight(images)}
    except LoadError as error:
        return MapsRefused(key, images, " ".join(str(error).split()))
    samples = np.concatenate([seen.texture, seen.weight[:, None]], axis=1).astype(np.float16)
    thumbnails = {what: thumbnail(pyramid) for what, pyramid in pyramids.items() if pyramid is not None}
    return MapsSampled(key, images, samples, seen.means, thumbnails)


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
