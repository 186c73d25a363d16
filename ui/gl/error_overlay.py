"""The false colours of errors as a texture that the picture's panel draws over it."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray


class ErrorOverlay:
    """One texture, of the colours that were requested last."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._colours: NDArray[np.uint8] | None = None
        self._texture: moderngl.Texture | None = None

    def texture(self, colours: NDArray[np.uint8] | None) -> moderngl.Texture | None:
        """The texture of colours (H, W, 4), row 0 at the top; uploaded where they differ from those before."""
        if colours is None:
            return None
        if colours is not self._colours:
            size = colours.shape[1], colours.shape[0]
            if self._texture is None or self._texture.size != size:
                self.release()
                self._texture = self._context.texture(size, 4)
            self._texture.write(np.ascontiguousarray(colours))
            self._colours = colours
        return self._texture

    def release(self) -> None:
        """Free the texture."""
        if self._texture is not None:
            self._texture.release()
        self._texture = self._colours = None
