"""Reads finished pictures, of this program or another: OpenEXR, Radiance HDR, PNG, JPEG and WebP, from files that
may be broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.light.exr_files import EXR_MAGIC
from engine.light.picture_bands import refuse_size
from engine.light.radiance_files import read_radiance_image, read_start
from engine.material.layer_maps import Space
from engine.texture.texture_files import MAX_IMAGE_BYTES, MAX_PIXELS, Image, image_orientation, image_size, read_texture

PICTURE_ENDINGS = (".exr", ".hdr", ".png", ".jpg", ".jpeg", ".webp")


def is_linear(file: Path) -> bool:
    """Whether a file has light itself, as OpenEXR and Radiance HDR have, by its first bytes. Raises LoadError."""
    return read_start(file).startswith((EXR_MAGIC, b"#?"))


def read_picture(file: Path, may_have_gaps: bool = False) -> NDArray[np.float32]:
    """Linear light (H, W, 3), row 0 on top, of a picture in whole; colours of whole numbers are decoded by sRGB, those
    of 16 bits cut to 8, as Pillow reads them. may_have_gaps: values that are not finite become 0. Raises LoadError,
    also for a picture that is too large, or has such values and may not."""
    if not is_linear(file):
        return read_codes(file, "srgb")
    light = read_radiance_image(file, may_reduce=False)
    if may_have_gaps:
        return np.nan_to_num(light, copy=False, posinf=0.0, neginf=0.0)
    finite = np.isfinite(light).all(axis=2)
    if not finite.all():
        row, column = (int(i) for i in np.argwhere(~finite)[0])
        raise LoadError(file, f"pixel {column}, {row}", tuple(map(float, light[row, column])), "finite values")
    return light


def read_codes(file: Path, space: Space) -> Image:
    """A picture of whole numbers in whole, (H, W, 3), row 0 on top, as the camera that took it was held: as shares of
    the largest, decoded by sRGB where that is its space. Raises LoadError."""
    data = read_regular_file(file, MAX_IMAGE_BYTES)
    size = image_size(data, file)
    if size is None:
        raise LoadError(file, "first bytes", data[:8], "an OpenEXR, Radiance HDR, PNG, JPEG or WebP picture")
    if size[0] * size[1] > MAX_PIXELS:
        refuse_size(file, *size, MAX_PIXELS)
    return _upright(read_texture(data, file, space), image_orientation(data, file))


def _upright(pixels: Image, orientation: int) -> Image:
    """A picture (H, W, 3) turned and mirrored so that it is upright."""
    if orientation > 4:  # row 0 is at the left or right
        pixels = pixels.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels)
