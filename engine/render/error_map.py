"""Maps where a picture has errors: spreads the errors of sampled points over their objects, as colours.

At a single point noise exceeds the error (`error_estimate`), so each pixel has the weighted mean of the squares of the
nearest points on its own object, the nearer ones counting more. Objects that were not sampled stay transparent.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from engine.render.display import false_colour
from engine.render.error_colours import error_to_radiance
from engine.render.error_estimate import PointErrors
from engine.scene.primary_hits import PrimaryHits

NEIGHBOURS = 12
OPACITY = 0.8
_PIXELS_AT_ONCE = 1 << 15

Colours = NDArray[np.uint8]


def error_colours(hits: PrimaryHits, estimated: PointErrors) -> Generator[None, None, Colours]:
    """The picture's errors, relative to its mean, as colours (H, W, 4) with opacity; block by block."""
    errors = yield from error_map(hits, estimated)
    height, width = errors.shape
    image = np.zeros((height * width, 4), np.uint8)
    known = np.flatnonzero(np.isfinite(errors.ravel()))
    for i in range(0, len(known), _PIXELS_AT_ONCE):
        block = known[i : i + _PIXELS_AT_ONCE]
        light = np.repeat(error_to_radiance(errors.ravel()[block])[:, None], 3, axis=1)
        image[block, :3] = np.rint(255.0 * false_colour(light))
        image[block, 3] = round(255 * OPACITY)
        yield
    return image.reshape(height, width, 4)


def error_map(hits: PrimaryHits, estimated: PointErrors) -> Generator[None, None, NDArray[np.float32]]:
    """The errors themselves (H, W); NaN where unknown."""
    width, height = hits.resolution
    objects = np.where(hits.row_image >= 0, hits.object_image, -1).ravel()  # emitters have no error
    errors = np.full(width * height, np.nan, np.float32)
    of_point = objects[estimated.pixel]
    for i in np.unique(of_point[of_point >= 0]):
        mine = np.flatnonzero(of_point == i)
        places = np.stack(np.divmod(estimated.pixel[mine], width), axis=1).astype(np.float64)
        tree, n = KDTree(places), min(NEIGHBOURS, len(mine))
        pixels = np.flatnonzero(objects == i)
        for j in range(0, len(pixels), _PIXELS_AT_ONCE):
            block = pixels[j : j + _PIXELS_AT_ONCE]
            distance, near = tree.query(np.stack(np.divmod(block, width), axis=1), k=np.arange(1, n + 1))
            weight = 1.0 / (1.0 + (distance / np.maximum(distance[:, -1:], 1.0)) ** 2)
            squares = (weight * estimated.squares[mine][near]).sum(axis=1) / weight.sum(axis=1)
            errors[block] = np.sqrt(np.maximum(squares, 0.0))
            yield
    return errors.reshape(height, width)
