"""Scopes of the shown picture, for a panel: the graphics card samples it evenly, the processor counts.

At most `SIDE` x `SIDE` pixels are read, whatever the size of the picture, so that a frame has time for it.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.render.crop import Crop
from engine.render.scopes import Scopes, measure_scopes
from ui.gl.display import ShownPicture
from ui.gl.gpu_memory import TextureMemory

SIDE = 192


def scopes_of(picture: ShownPicture, crop: Crop | None = None) -> Scopes:
    """The scopes of what is shown, or of a part of it; waits for the GPU."""
    box = (0, 0, *picture.linear.size) if crop is None else crop.box(picture.linear.size)
    _, _, width, height = box
    size = min(width, SIDE), min(height, SIDE)
    pixels = picture.display.sampled(picture.linear, picture.view, box, size)
    return measure_scopes(np.asarray(pixels[..., :3], np.uint8), width * height)


class ScopeTexture:
    """A picture of a waveform, for a panel to draw."""

    def __init__(self, context: moderngl.Context) -> None:
        self._memory = TextureMemory(context)
        self._texture: moderngl.Texture | None = None

    def show(self, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """The texture of pixels (H, W, 3), row 0 at the top."""
        alpha = np.full((*pixels.shape[:2], 1), 255, np.uint8)
        data = np.concatenate([pixels, alpha], axis=2)
        size = pixels.shape[1], pixels.shape[0]
        if self._texture is None or self._texture.size != size:
            self.release()
            self._texture = self._memory.texture(size, 4, "f1")
        self._texture.write(np.ascontiguousarray(data), alignment=1)
        return self._texture

    def release(self) -> None:
        """Free it."""
        self._memory.release(self._texture)
        self._texture = None
