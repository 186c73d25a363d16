"""Buffers that shaders read, and their memory, every allocation checked (see `textures`)."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ui.gl.context import GraphicsError

_LEAST = 16  # bytes: OpenGL has no empty buffers


class BufferMemory:
    """Allocates the buffers of one context and counts their bytes."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.bytes_in_use = 0

    def filled(self, array: NDArray[np.generic]) -> moderngl.Buffer:
        """A buffer of an array; raises GraphicsError when it does not fit."""
        made = self._made(array.nbytes)
        made.write(np.ascontiguousarray(array))
        return made

    def empty(self, n_bytes: int) -> moderngl.Buffer:
        """A buffer of zeros; raises GraphicsError when it does not fit."""
        made = self._made(n_bytes)
        made.clear()
        return made

    def _made(self, n_bytes: int) -> moderngl.Buffer:
        most = most_buffer_bytes(self._context)
        if n_bytes > most:
            raise GraphicsError(f"a buffer of {_mib(n_bytes)} MiB, where OpenGL takes {_mib(most)} at most")
        while self._context.error != "GL_NO_ERROR":
            pass
        try:
            made = self._context.buffer(reserve=max(n_bytes, _LEAST))
        except moderngl.Error as failure:
            raise GraphicsError(f"{_mib(n_bytes)} MiB of buffer refused: {failure}") from failure
        error = self._context.error
        if error != "GL_NO_ERROR":
            made.release()
            raise GraphicsError(f"no room for {_mib(n_bytes)} MiB of buffer ({error})")
        self.bytes_in_use += made.size
        return made

    def release(self, buffer: moderngl.Buffer) -> None:
        """Free it."""
        self.bytes_in_use -= buffer.size
        buffer.release()


def most_buffer_bytes(context: moderngl.Context) -> int:
    """The largest size of one buffer that shaders can read; 0 where they can read none."""
    return int(context.info.get("GL_MAX_SHADER_STORAGE_BLOCK_SIZE", 0))


def _mib(n_bytes: int) -> int:
    return -(-n_bytes // 2**20)
