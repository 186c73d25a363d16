"""Histogram and waveform of a picture as it is shown, and the shares of it that the screen clips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEVELS = 256
# Of luma, from encoded colours [ITU-R BT.709].
LUMA = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True, eq=False)
class Scopes:
    """What scopes show of pixels: counts (4, 256), of red, green, blue and luma; waveforms (4, 256, columns), the
    counts of each level in each column; black, white: the shares of pixels of which a channel is 0, or 255; n_pixels:
    how many were counted, of n_all."""

    counts: NDArray[np.int64]
    waveforms: NDArray[np.int64]
    black: tuple[float, float, float]
    white: tuple[float, float, float]
    n_pixels: int
    n_all: int


def measure_scopes(pixels: NDArray[np.uint8], n_all: int | None = None) -> Scopes:
    """The scopes of display colours (H, W, 3). n_all: of how many pixels they are a sample."""
    height, width = pixels.shape[:2]
    luma = np.rint(pixels @ LUMA).astype(np.uint8)
    planes = np.stack([*np.moveaxis(pixels, 2, 0), luma]).astype(np.int64)
    # Counted together: each plane, column and level has an index of its own.
    columns = np.arange(width)
    index = (np.arange(4)[:, None, None] * width + columns) * LEVELS + planes
    waveforms = np.bincount(index.ravel(), minlength=4 * width * LEVELS).reshape(4, width, LEVELS).swapaxes(1, 2)
    counts, n = waveforms.sum(axis=2), height * width
    black, white = (tuple((counts[:3, level] / n).tolist()) for level in (0, LEVELS - 1))
    return Scopes(counts, waveforms, black, white, n, n if n_all is None else n_all)


def waveform_picture(waveforms: NDArray[np.int64], parade: bool) -> NDArray[np.uint8]:
    """Waveforms (4, 256, columns) as a picture (256, W, 3), bright levels at the top: of luma in grey, or red, green
    and blue beside each other. Brightness grows with the root of the share of a column, so that thin traces are
    seen."""
    share = np.sqrt(waveforms / np.maximum(waveforms.sum(axis=1, keepdims=True), 1))
    shades = np.clip(40.0 * (waveforms > 0) + 500.0 * share, 0.0, 255.0)[:, ::-1].astype(np.uint8)
    if not parade:
        return np.repeat(shades[3][..., None], 3, axis=2)
    parts = [np.stack([shades[i] if k == i else shades[i] // 3 for k in range(3)], axis=2) for i in range(3)]
    return np.concatenate(parts, axis=1)
