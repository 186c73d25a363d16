"""Compiled look-ups in latitude-longitude images, as `engine.light.environment.Environment.evaluate` does them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._angle_kernels import arc_tangent
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
def texel_place(height: int, width: int, x: float, y: float, z: float, turn: float) -> tuple[float, float]:
    """Row, 0 to height - 1, and column, 0 to width, of a direction of any length in an image of that size, rotated by
    turn radians about +Y. Without branches: over many directions, a loop of nothing else vectorizes."""
    # Latitude and longitude of the direction.
    theta = arc_tangent(math.sqrt(x * x + z * z), y)
    phi = arc_tangent(x, -z) + turn
    # Pixel coordinates: columns wrap around, rows are clamped at the poles.
    column = (phi / (2.0 * math.pi) + 0.5) * width - 0.5
    row = min(max(theta / math.pi * height - 0.5, 0.0), height - 1.0)
    return row, column - width * math.floor(column / width)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def texels_at(image: NDArray[np.float32], row: float, column: float) -> Texels:
    """The texels of an image (h, w, 3) around a place of `texel_place`."""
    height, width = image.shape[0], image.shape[1]
    top, left = int(row), int(column)
    down, right = np.float32(row - top), np.float32(column - left)
    left = left if left < width else 0  # a column that rounds to the width
    return Texels(top, min(top + 1, height - 1), left, left + 1 if left + 1 < width else 0, down, right)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def texels_around(image: NDArray[np.float32], x: float, y: float, z: float, turn: float) -> Texels:
    """The texels of an image (h, w, 3), rotated by turn radians about +Y, around a direction of any length."""
    row, column = texel_place(image.shape[0], image.shape[1], x, y, z, turn)
    return texels_at(image, row, column)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def between_texels(image: NDArray[np.float32], at: Texels, i: int) -> float:
    """Interpolate channel i of an image (h, w, 3) between four texels."""
    upper = image[at.top, at.left, i] + at.right * (image[at.top, at.after, i] - image[at.top, at.left, i])
    lower = image[at.bottom, at.left, i] + at.right * (image[at.bottom, at.after, i] - image[at.bottom, at.left, i])
    return upper + at.down * (lower - upper)
