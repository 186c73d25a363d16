"""Averages lat-long images over solid angle, to any size, without loss of light; and reduces images by block means."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_CHUNK = 64


def reduction(width: int, height: int, most_pixels: int) -> int:
    """The divisor of an image's sides: the least power of two that leaves at most `most_pixels`."""
    k = 1
    while -(-width // k) * -(-height // k) > most_pixels:
        k *= 2
    return k


def block_means(
    values: NDArray[np.generic], k: int, decode: Callable[[NDArray[np.generic]], NDArray[np.float32]]
) -> NDArray[np.float32]:
    """The mean of each k x k block of `decode`d values (H, W, C); beyond the edges the last row and column repeat."""
    if k == 1:
        return decode(values)
    whole = np.pad(values, (*((0, -values.shape[axis] % k) for axis in (0, 1)), (0, 0)), mode="edge")
    each = (decode(whole[i::k, j::k]) for i in range(k) for j in range(k))
    total = next(each)
    for more in each:
        total = total + more
    return total * np.float32(1.0 / k**2)


def area_average(image: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """Resamples a lat-long image (H, W, 3) to (height, width, 3): each new texel is the mean of the old ones over its
    area.

    The integral over the sphere is preserved exactly, also for sizes that do not divide and for larger sizes.
    """
    rows, columns, _ = image.shape
    narrowed = image
    if width != columns:
        edges = np.linspace(0.0, columns, width + 1)
        narrowed = np.empty((rows, width, 3), np.float32)
        for start in range(0, rows, _CHUNK):  # in strips: a large map in double precision would not fit
            narrowed[start : start + _CHUNK] = _strip_means(image[start : start + _CHUNK], edges, np.ones(columns))
    if height == rows:
        return np.array(narrowed)
    edges, measure = _row_edges(rows, height)
    averaged = np.empty((height, width, 3), np.float32)
    for start in range(0, width, _CHUNK):
        strip = narrowed[:, start : start + _CHUNK].transpose(1, 0, 2)
        averaged[:, start : start + _CHUNK] = _strip_means(strip, edges, measure).transpose(1, 0, 2)
    return averaged


def _row_edges(rows: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Edges of the new rows in units of old rows by solid angle, and the solid angle of the old rows over 2 pi."""
    theta = math.pi * np.linspace(0.0, 1.0, height + 1)
    whole = np.minimum(np.floor(np.linspace(0.0, rows, height + 1) + 1e-9), rows - 1)
    top, bottom = math.pi * whole / rows, math.pi * (whole + 1) / rows
    part = _cosine_step(top, theta) / _cosine_step(top, bottom)
    middle = math.pi * (np.arange(rows) + 0.5) / rows
    return whole + np.clip(part, 0.0, 1.0), 2.0 * np.sin(middle) * math.sin(0.5 * math.pi / rows)


def _cosine_step(top: NDArray, bottom: NDArray) -> NDArray:
    """cos(top) - cos(bottom) without cancellation."""
    return 2.0 * np.sin(0.5 * (top + bottom)) * np.sin(0.5 * (bottom - top))


def _strip_means(strip: NDArray, edges: NDArray[np.float64], measure: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means along axis 1 of (A, N, 3) between `edges` (in cells), each cell weighted by its `measure`: (A, M, 3)."""
    cells = strip.astype(np.float64) * measure[:, None]
    running = np.concatenate([np.zeros_like(cells[:, :1]), np.cumsum(cells, axis=1)], axis=1)
    running_measure = np.concatenate([[0.0], np.cumsum(measure)])
    whole = np.minimum(np.floor(edges).astype(np.int64), len(measure) - 1)
    part = edges - whole
    at_edges = running[:, whole] + part[:, None] * cells[:, whole]
    measure_at_edges = running_measure[whole] + part * measure[whole]
    return np.maximum(np.diff(at_edges, axis=1), 0.0) / np.diff(measure_at_edges)[:, None]
