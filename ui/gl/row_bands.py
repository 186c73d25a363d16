"""Reads pictures from the graphics card, and writes them to it, in bands of rows, one a frame: so that a frame has time
for it, whatever the size of the picture.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

# Of a band: 4 MiB in single precision.
BAND_PIXELS = 1 << 18


class RowReading:
    """Reads linear light with alpha; ``pixels`` (H, W, 4) are whole once `step` has returned True."""

    def __init__(self, size: tuple[int, int]) -> None:
        width, height = size
        self.pixels = np.empty((height, width, 4), np.float32)
        self._row = 0

    def step(self, target: moderngl.Framebuffer) -> bool:
        """Read the next band of what was drawn into a target; returns whether that was the last. Waits for the GPU."""
        height, width = self.pixels.shape[:2]
        n = _rows(width, height - self._row)
        raw = target.read(viewport=(0, self._row, width, n), components=4, dtype="f4", alignment=1)
        self.pixels[self._row : self._row + n] = np.frombuffer(raw, np.float32).reshape(n, width, 4)
        self._row += n
        return self._row == height


class RowUpload:
    """Writes pixels (H, W, components) to a texture of their size."""

    def __init__(self, texture: moderngl.Texture, pixels: NDArray[np.generic]) -> None:
        self._texture, self._pixels, self._row = texture, pixels, 0

    def step(self) -> bool:
        """Write the next band; returns whether that was the last."""
        height, width = self._pixels.shape[:2]
        n = _rows(width, height - self._row)
        band = np.ascontiguousarray(self._pixels[self._row : self._row + n])
        self._texture.write(band, viewport=(0, self._row, width, n), alignment=1)
        self._row += n
        return self._row == height


def _rows(width: int, left: int) -> int:
    """How many rows are in the next band."""
    return min(max(BAND_PIXELS // width, 1), left)
