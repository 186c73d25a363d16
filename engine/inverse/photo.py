"""Photographs as measurements of light: what they say of radiance, how precisely, and where they say nothing.

A file of whole numbers is decoded by its transfer curve; each value is known as precisely as its code, and one at the
end of the scale is not known at all. Linear files are taken as they are. All values are up to one factor, the exposure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import decode_srgb
from engine.inverse.transfer_curve import LINEAR, SRGB, Transfer
from engine.light.radiance_files import read_radiance_image
from engine.render.picture_files import is_linear, read_codes

# Codes of 255 from which on a value may have been clipped, by the sensor or by compression.
CLIPPED_CODE = 254
# A linear picture that has its largest value in more than this share of its pixels was clipped there.
_CLIPPED_SHARE, _CLIPPED_PIXELS = 1e-3, 16


@dataclass(frozen=True, eq=False)
class Photo:
    """radiance (H, W, 3), linear Rec. 709 at an exposure that is not known, row 0 on top; error (H, W, 3): its standard
    deviation in the same unit; usable (H, W): where it is known."""

    radiance: NDArray[np.float32]
    error: NDArray[np.float32]
    usable: NDArray[np.bool_]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.radiance.shape[1], self.radiance.shape[0]

    def masked(self, mask: NDArray[np.bool_]) -> Photo:
        """The same where only the pixels of a mask (H, W) count."""
        return Photo(self.radiance, self.error, self.usable & mask)

    def resized(self, size: tuple[int, int]) -> Photo:
        """The same in another size: the mean over each pixel, usable where all of it is."""
        if size == self.size:
            return self
        radiance, error = (_area_means(np.where(self.usable[..., None], each, 0.0), size) for each in self._parts)
        return Photo(radiance, error, _area_means(self.usable[..., None], size)[..., 0] > 1.0 - 1e-4)

    @property
    def _parts(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return self.radiance, self.error


def size_for(photo: tuple[int, int], most: int) -> tuple[int, int]:
    """A photograph's (width, height) with the longer side at most so long."""
    scale = min(1.0, most / max(photo))
    width, height = (max(round(side * scale), 1) for side in photo)
    return width, height


def read_photo(file: Path, transfer: Transfer = SRGB) -> Photo:
    """Read a photograph: OpenEXR and Radiance HDR as linear light, all others as 8 bits by a transfer curve. Raises
    LoadError."""
    if is_linear(file):
        return photo_from_light(read_radiance_image(file, may_reduce=False))
    return photo_from_codes(255.0 * read_codes(file, "linear"), transfer)


def photo_from_light(light: NDArray[np.floating]) -> Photo:
    """A photograph of linear radiance (H, W, 3). Values that are not finite or negative, and the largest of a channel
    where many pixels have it, are not known."""
    finite = np.isfinite(light) & (light >= 0.0)
    light = np.where(finite, light, 0.0).astype(np.float32)
    largest = light.max(axis=(0, 1), initial=0.0)
    at_end = (light == largest) & (largest > 0.0)
    most = max(_CLIPPED_PIXELS, _CLIPPED_SHARE * light.shape[0] * light.shape[1])
    clipped = at_end & (at_end.sum(axis=(0, 1)) > most) & (light.min(axis=(0, 1)) < largest)
    return Photo(light, np.zeros_like(light), np.asarray((finite & ~clipped).all(axis=2)))


def photo_from_codes(codes: NDArray[np.floating], transfer: Transfer = SRGB) -> Photo:
    """A photograph of values (H, W, 3) from 0 to 255 in a transfer curve."""
    codes = np.clip(codes, 0.0, 255.0)
    below, light, above = (_decoded(np.clip(codes + step, 0.0, 255.0) / 255.0, transfer) for step in (-0.5, 0.0, 0.5))
    # A code stands for all values that are rounded to it, evenly.
    error = (above - below) / math.sqrt(12.0)
    usable = (codes < CLIPPED_CODE).all(axis=2)
    return Photo(light.astype(np.float32), error.astype(np.float32), np.asarray(usable))


def _decoded(values: NDArray[np.floating], transfer: Transfer) -> NDArray[np.float64]:
    if transfer == SRGB:
        return np.asarray(decode_srgb(values), np.float64)
    return np.asarray(values if transfer == LINEAR else values ** float(transfer), np.float64)


def _area_means(values: NDArray[np.generic], size: tuple[int, int]) -> NDArray[np.float32]:
    """The means (h, w, c) of an image (H, W, c) over the pixels of another size."""
    from PIL import Image

    planes = np.moveaxis(np.asarray(values, np.float32), -1, 0)
    means = [Image.fromarray(np.ascontiguousarray(plane)).resize(size, Image.Resampling.BOX) for plane in planes]
    return np.stack([np.asarray(each, np.float32) for each in means], axis=-1)
