"""Reads finished pictures, of this program or another: OpenEXR, Radiance HDR and PNG, from files that may be broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.light.exr_files import EXR_MAGIC
from engine.light.picture_bands import refuse_size
from engine.light.radiance_files import read_radiance_image, read_start
from engine.texture.texture_files import MAX_IMAGE_BYTES, MAX_PIXELS, image_size, read_texture

PICTURE_ENDINGS = (".exr", ".hdr", ".png")
_PNG_MAGIC = b"\x89PNG"


def read_picture(file: Path) -> NDArray[np.float32]:
    """Linear light (H, W, 3), row 0 on top, of a picture in whole; colours of a PNG are decoded by sRGB, those
    of 16 bits cut to 8, as Pillow reads them. Raises LoadError, also for one that is too large, or has values that are
    not finite."""
    start = read_start(file)
    if start.startswith(_PNG_MAGIC):
        data = read_regular_file(file, MAX_IMAGE_BYTES)
        size = image_size(data, file)
        if size is not None and size[0] * size[1] > MAX_PIXELS:
            refuse_size(file, *size, MAX_PIXELS)
        return read_texture(data, file, "srgb")
    if not start.startswith((EXR_MAGIC, b"#?")):
        raise LoadError(file, "first bytes", start[:8], "an OpenEXR, a Radiance HDR or a PNG picture")
    light = read_radiance_image(file, may_reduce=False)
    finite = np.isfinite(light).all(axis=2)
    if not finite.all():
        row, column = (int(i) for i in np.argwhere(~finite)[0])
        raise LoadError(file, f"pixel {column}, {row}", tuple(map(float, light[row, column])), "finite values")
    return light
