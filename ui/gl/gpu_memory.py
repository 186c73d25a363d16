"""Textures and buffers that shaders read, and their memory, every allocation checked.

moderngl returns an object also when OpenGL could not allocate; only the context's error flag tells, so it is cleared
before and read after. Sizes beyond the driver's limits are refused before they reach the driver, and a limit of
Insitu's own refuses what would make a machine swap."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ui.gl.context import GraphicsError, most_buffer_bytes

AnyTexture = moderngl.Texture | moderngl.TextureArray | moderngl.Texture3D
BYTES_PER_COMPONENT = {"f1": 1, "f2": 2, "f4": 4, "i4": 4, "u4": 4}


class TextureMemory:
    """Allocates the textures of one context and counts their bytes; `limit` in bytes, None for the driver's own."""

    def __init__(self, context: moderngl.Context, limit: int | None = None) -> None:
        self.context = context
        self.limit = limit
        self.bytes_in_use = 0

    def texture(
        self, size: tuple[int, int], components: int, dtype: str, data: NDArray[np.generic] | None = None
    ) -> moderngl.Texture:
        """A 2D texture, nearest filtering, clamped; raises GraphicsError when it does not fit."""
        limit = self.context.info["GL_MAX_TEXTURE_SIZE"]
        self._refuse_above("texture", size, (limit, limit))
        n_bytes = size[0] * size[1] * components * BYTES_PER_COMPONENT[dtype]
        self._refuse_beyond_limit(n_bytes)
        _drain_errors(self.context)
        raw = None if data is None else np.ascontiguousarray(data)
        made = self._attempt(lambda: self.context.texture(size, components, raw, dtype=dtype, alignment=1), n_bytes)
        _sample_nearest(made)
        return made

    def texture_array(self, size: tuple[int, int, int], components: int, dtype: str) -> moderngl.TextureArray:
        """An empty 2D array texture of (width, height, layers); raises GraphicsError when it does not fit."""
        side, layers = self.context.info["GL_MAX_TEXTURE_SIZE"], self.context.info["GL_MAX_ARRAY_TEXTURE_LAYERS"]
        self._refuse_above("array texture", size, (side, side, layers))
        n_bytes = size[0] * size[1] * size[2] * components * BYTES_PER_COMPONENT[dtype]
        self._refuse_beyond_limit(n_bytes)
        _drain_errors(self.context)
        made = self._attempt(lambda: self.context.texture_array(size, components, dtype=dtype, alignment=1), n_bytes)
        _sample_nearest(made)
        return made

    def cube(self, side: int, components: int, dtype: str, data: NDArray[np.generic]) -> moderngl.Texture3D:
        """A 3D texture of `side` texels each way, sampled linearly between them, clamped."""
        limit = self.context.info["GL_MAX_3D_TEXTURE_SIZE"]
        self._refuse_above("3D texture", (side,) * 3, (limit,) * 3)
        n_bytes = side**3 * components * BYTES_PER_COMPONENT[dtype]
        self._refuse_beyond_limit(n_bytes)
        _drain_errors(self.context)
        size, raw = (side,) * 3, np.ascontiguousarray(data)
        made = self._attempt(lambda: self.context.texture3d(size, components, raw, dtype=dtype, alignment=1), n_bytes)
        made.filter = (moderngl.LINEAR, moderngl.LINEAR)
        made.repeat_x = made.repeat_y = made.repeat_z = False
        return made  # type: ignore[no-any-return]

    def latlong(self, radiance: NDArray[np.floating]) -> moderngl.Texture:
        """A latitude-longitude image (H, W, 3), sampled linearly between texels, which wraps around."""
        height, width = radiance.shape[:2]
        made = self.texture((width, height), 3, "f4", radiance.astype(np.float32))
        made.filter, made.repeat_x = (moderngl.LINEAR, moderngl.LINEAR), True
        return made

    def copied(self, texture: moderngl.Texture) -> moderngl.Texture:
        """Another texture of the same texels; raises GraphicsError when it does not fit."""
        made = self.texture(texture.size, texture.components, texture.dtype)
        # Between framebuffers: copied into a texture, numbers would be clamped to [0, 1].
        source, target = self.context.framebuffer([texture]), self.context.framebuffer([made])
        self.context.copy_framebuffer(target, source)
        self.release_framebuffer(source)
        self.release_framebuffer(target)
        return made

    def release(self, texture: AnyTexture | None) -> None:
        if texture is None:
            return
        self.bytes_in_use -= texture_bytes(texture)
        texture.release()

    def framebuffer(self, textures: Sequence[moderngl.Texture]) -> moderngl.Framebuffer:
        """A framebuffer that draws into these textures, all black."""
        made = self.context.framebuffer(list(textures))
        made.use()
        made.clear()
        return made

    def release_framebuffer(self, framebuffer: moderngl.Framebuffer | None) -> None:
        """Free it and leave framebuffer 0 bound: moderngl would bind the last one again later, also a freed one."""
        if framebuffer is not None:
            self.context.detect_framebuffer(0).use()
            framebuffer.release()

    def _attempt(self, make, n_bytes: int):  # type: ignore[no-untyped-def]  # moderngl has no types
        try:
            made = make()
        except moderngl.Error as failure:
            raise GraphicsError(f"{_mib(n_bytes)} MiB of texture refused: {failure}") from failure
        error = self.context.error
        if error != "GL_NO_ERROR":
            made.release()
            _drain_errors(self.context)
            raise GraphicsError(f"no room for {_mib(n_bytes)} MiB of texture ({error}); the old picture stays")
        self.bytes_in_use += n_bytes
        return made

    def _refuse_above(self, what: str, size: tuple[int, ...], limits: tuple[int, ...]) -> None:
        if any(n < 1 or n > limit for n, limit in zip(size, limits, strict=True)):
            raise GraphicsError(f"{what} of {size} texels, expected 1 to {limits}; the old picture stays")

    def _refuse_beyond_limit(self, n_bytes: int) -> None:
        if self.limit is not None and self.bytes_in_use + n_bytes > self.limit:
            raise GraphicsError(
                f"{_mib(n_bytes)} MiB of texture beside {_mib(self.bytes_in_use)} MiB in use exceed the limit of "
                f"{_mib(self.limit)} MiB; the old picture stays"
            )


def texture_bytes(texture: AnyTexture) -> int:
    """Bytes of the texels, without the driver's own padding."""
    layers = getattr(texture, "layers", getattr(texture, "depth", 1) if isinstance(texture, moderngl.Texture3D) else 1)
    return texture.width * texture.height * layers * texture.components * BYTES_PER_COMPONENT[texture.dtype]


def read_texture(texture: moderngl.Texture, dtype: type[np.generic]) -> NDArray[np.generic]:
    """All texels (height, width, components), row 0 first."""
    raw = np.frombuffer(texture.read(alignment=1), dtype=dtype)
    return raw.reshape(texture.height, texture.width, texture.components)


def read_texels(target: moderngl.Framebuffer, box: tuple[int, int, int, int], dtype: str) -> NDArray[np.float64]:
    """A box of texels (height, width, 4) of a framebuffer's texture, "f4" or "f1" (0 to 255); waits for the GPU."""
    raw = target.read(viewport=box, components=4, dtype=dtype, alignment=1)
    numbers = np.frombuffer(raw, np.float32 if dtype == "f4" else np.uint8).astype(np.float64)
    return numbers.reshape(box[3], box[2], 4)


def _sample_nearest(texture: moderngl.Texture | moderngl.TextureArray) -> None:
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x = texture.repeat_y = False


def _drain_errors(context: moderngl.Context) -> None:
    while context.error != "GL_NO_ERROR":
        pass


def _mib(n_bytes: int) -> int:
    return -(-n_bytes // 2**20)


def small_texture(context: moderngl.Context, pixels: NDArray[np.uint8]) -> moderngl.Texture:
    """A texture of pixels (h,w,3) for panels."""
    alpha = np.full((*pixels.shape[:2], 1), 255, dtype=np.uint8)
    data = np.concatenate([pixels, alpha], axis=2).tobytes()
    texture = context.texture((pixels.shape[1], pixels.shape[0]), 4, data)
    texture.repeat_x = texture.repeat_y = False  # as for all that panels draw, so that llvmpipe need not compile anew
    return texture


# -------------------------------------------------------------------------------------------------------------- buffers


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
        _drain_errors(self._context)
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
