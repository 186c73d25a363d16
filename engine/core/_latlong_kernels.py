"""Compiled look-ups in latitude-longitude images, as `engine.light.environment.Environment.evaluate` does them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST


class Texels(NamedTuple):
    """Four texels around a direction: their rows and columns, and the position between them, down and right, 0 to 1."""

    top: int
    bottom: int
    left: int
    after: int
    down: np.float32
    right: np.float32


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def texels_around(image: NDArray[np.float32], x: float, y: float, z: float, turn: float) -> Texels:
    """The texels of an image (h, w, 3), rotated by turn radians about +Y, around a direction of any length."""
    height, width = image.shape[0], image.shape[1]
    # Latitude and longitude of the direction.
    theta = np.arctan2(np.sqrt(x * x + z * z), y)
    phi = np.arctan2(x, -z) + turn
    # Pixel coordinates: columns wrap around, rows are clamped at the poles.
    column = (phi / (2.0 * np.pi) + 0.5) * width - 0.5
    row = min(max(theta / np.pi * height - 0.5, 0.0), height - 1.0)
    top, left = int(np.floor(row)), int(np.floor(column))
    down, right = np.float32(row - top), np.float32(column - left)
    return Texels(top, min(top + 1, height - 1), left % width, (left + 1) % width, down, right)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def between_texels(image: NDArray[np.float32], at: Texels, i: int) -> float:
    """Interpolate channel i of an image (h, w, 3) between four texels."""
    upper = image[at.top, at.left, i] + at.right * (image[at.top, at.after, i] - image[at.top, at.left, i])
    lower = image[at.bottom, at.left, i] + at.right * (image[at.bottom, at.after, i] - image[at.bottom, at.left, i])
    return upper + at.down * (lower - upper)
