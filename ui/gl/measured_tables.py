"""Tables of measurements on the GPU: each an array texture of 180 x 90 x 90 samples, RGB, for brdf/measured.glsl.

Single precision, 17.5 MB each: values may be as bright as a mirror's, beyond the range of half floats, and what is
above a diffuse part is a difference; half floats save 9 MB and no time. A table is uploaded in pieces, a few ms a
frame, and is used once it is complete. The last used ones stay.
"""

from __future__ import annotations

import time
from collections.abc import Collection

import moderngl
import numpy as np
from numpy.typing import NDArray

from ui.gl.textures import TextureMemory

# Tables that stay besides those that are in use.
MOST_KEPT = 4
LAYERS_AT_ONCE = 5


class MeasuredTables:
    """The tables of one context, by the numbers that name measurements."""

    def __init__(self, memory: TextureMemory) -> None:
        self._memory = memory
        self._whole: dict[int, moderngl.TextureArray] = {}  # in the order of use, the last one at the end
        self._coming: _Upload | None = None
        self._blank: moderngl.TextureArray | None = None

    def __contains__(self, number: int) -> bool:
        return number in self._whole

    @property
    def is_uploading(self) -> bool:
        """Whether a table is under way."""
        return self._coming is not None

    def texture(self, number: int) -> moderngl.TextureArray:
        """The table of that number; a single texel where it is not there."""
        if number in self._whole:
            self._whole[number] = self._whole.pop(number)
            return self._whole[number]
        if self._blank is None:
            self._blank = self._memory.texture_array((1, 1, 1), 3, "f4")
        return self._blank

    def begin(self, number: int, samples: NDArray[np.float32]) -> None:
        """Make room for a table (90, 90, 180, 3); `step` uploads it. Raises GraphicsError."""
        n_h, n_d, n_phi, _ = samples.shape
        self._coming = _Upload(number, samples, self._memory.texture_array((n_phi, n_d, n_h), 3, "f4"))

    def step(self, seconds: float) -> bool:
        """Continue the upload under way, for about so long; returns whether it is complete."""
        upload, until = self._coming, time.perf_counter() + seconds
        if upload is None:
            return False
        while not upload.is_done:
            upload.step()
            if time.perf_counter() >= until:
                break
        if upload.is_done:
            self._whole[upload.number], self._coming = upload.texture, None
        return upload.is_done

    def forget_but(self, used: Collection[int]) -> None:
        """Free the least recently used tables beyond `MOST_KEPT`, except those in use."""
        spare = [number for number in self._whole if number not in used]
        for number in spare[: max(0, len(spare) - MOST_KEPT)]:
            self._memory.release(self._whole.pop(number))

    def release(self) -> None:
        """Free all."""
        coming = None if self._coming is None else self._coming.texture
        for texture in (*self._whole.values(), self._blank, coming):
            self._memory.release(texture)
        self._whole, self._coming, self._blank = {}, None, None


class _Upload:
    """A table that is being uploaded: so many of its layers are there."""

    def __init__(self, number: int, samples: NDArray[np.float32], texture: moderngl.TextureArray) -> None:
        self.number, self.texture = number, texture
        self._samples, self._n_done = samples, 0

    @property
    def is_done(self) -> bool:
        return self._n_done == len(self._samples)

    def step(self) -> None:
        piece = np.ascontiguousarray(self._samples[self._n_done : self._n_done + LAYERS_AT_ONCE], np.float32)
        box = (0, 0, self._n_done, self.texture.width, self.texture.height, len(piece))
        self.texture.write(piece, viewport=box, alignment=1)
        self._n_done += len(piece)
