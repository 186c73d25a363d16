"""Reads normal maps and heights as slopes: the derivatives of a surface along u and v.

Slopes can be averaged: their mean over a pixel is the mean slope of what the pixel shows, where a mean of normals would
need normalization. 8-bit and 16-bit codes have a centre that is exactly flat, 128 and 32,768, as painted maps intend;
in OpenEXR it is 0.5. Normal maps are never decoded by sRGB.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.core.errors import LoadError
from engine.texture.texture_files import Image, ReportNote, Values, grey_shares, ignore_note, read_image

# tan 87 degrees: steeper slopes, or normals into the surface, are clamped to it.
STEEPEST = 20.0
_MIDDLES = {"uint8": 128, "uint16": 32768}


def read_normal_map(data: bytes, file: Path | str, tell: ReportNote = ignore_note) -> Image:
    """Slopes (H, W, 2) of a normal map's texels along its x and y, row 0 on top. Raises LoadError."""
    return read_image(data, file, lambda values: _slopes(values, file), tell)


def _slopes(values: Values, file: Path | str) -> Image:
    """Slopes from numbers (h, W, 3) of a file."""
    if values.shape[2] != 3:
        raise LoadError(file, "channels", values.shape[2], "the three of a normal map; heights are a bump_map")
    if middle := _MIDDLES.get(values.dtype.name):
        vectors = (values.astype(np.float32) - np.float32(middle)) / np.float32(middle - 1)
    else:
        vectors = np.float32(2.0) * np.asarray(values, np.float32) - np.float32(1.0)
    flat = np.hypot(vectors[..., 0], vectors[..., 1])
    up = np.maximum(vectors[..., 2], np.maximum(flat, np.float32(1e-3)) / np.float32(STEEPEST))
    return np.ascontiguousarray(-vectors[..., :2] / up[..., None], np.float32)


def read_heights(data: bytes, file: Path | str, tell: ReportNote = ignore_note) -> Image:
    """Derivatives along u and v of heights from 0 to 1 of an image that repeats, (H, W, 2), row 0 on top; for a colour
    image those of its luminance. Raises LoadError."""
    height = read_image(data, file, grey_shares, tell)[..., 0]
    n_rows, n_columns = height.shape
    along_u = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) * np.float32(0.5 * n_columns)
    along_v = (np.roll(height, 1, axis=0) - np.roll(height, -1, axis=0)) * np.float32(0.5 * n_rows)
    return np.stack([along_u, along_v], axis=2)
