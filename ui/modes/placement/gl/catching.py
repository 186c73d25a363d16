"""What the compositor needs of shadow catchers: which samples are theirs, and the light that they send alone."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory


class Catching:
    """The shadow catchers of one picture (`app.stills.shadow_catcher`). textures: by the shader's names."""

    def __init__(
        self, memory: TextureMemory, objects: tuple[int, ...], light: NDArray[np.floating], rows: NDArray[np.uint8]
    ) -> None:
        """objects: by index; light (H, W, 3): what they send where nothing throws shadows, as if they filled each
        pixel; rows: of the samples of all objects, 255 for theirs and 0 for others."""
        self._objects, self._light = objects, light
        height, width, _ = light.shape
        catching = memory.texture((1, len(rows)), 1, "f1", rows[:, None])
        try:
            empty = memory.texture((width, height), 3, "f4", np.ascontiguousarray(light, np.float32))
        except GraphicsError:
            memory.release(catching)
            raise
        self.textures: dict[str, moderngl.Texture] = {"catching": catching, "empty": empty}

    def is_of(self, objects: Sequence[int], light: NDArray[np.floating]) -> bool:
        """Whether it was made of the same."""
        return self._objects == tuple(objects) and self._light is light

    def release(self, memory: TextureMemory) -> None:
        for texture in self.textures.values():
            memory.release(texture)
