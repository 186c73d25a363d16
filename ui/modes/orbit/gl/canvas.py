"""Shows complete pictures of any resolution, and fades another mode's in over them."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.scene.picture_frame import PictureFrame
from ui.gl.context import GraphicsError
from ui.gl.display import Display, DisplayView
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Passes


class PictureCanvas:
    """The linear picture at the size of a frame, made of the picture that came last, and its display."""

    def __init__(self, context: moderngl.Context) -> None:
        self._memory = TextureMemory(context)
        self._passes = Passes(context)
        self._picture = self._picture_texture(np.zeros((1, 1, 3), np.float32))
        self._drawn: moderngl.Texture | None = None
        self._linear: moderngl.Texture | None = None
        self._target: moderngl.Framebuffer | None = None
        self._display: Display | None = None
        self.frame: PictureFrame | None = None
        self.is_empty = True  # nothing has come since it was made, or cleared

    def set_frame(self, frame: PictureFrame) -> None:
        """Use this size from now on, with its silhouettes; the picture that came last stays, the snapshot does not."""
        linear = self._memory.texture((frame.width, frame.height), 4, "f4")
        display = Display(self._passes, self._memory, frame)
        self._release_frame()
        self._linear, self._display, self.frame = linear, display, frame
        self._target = self._memory.framebuffer([linear])

    def set_picture(self, radiance: NDArray[np.floating]) -> None:
        """Take another picture: linear radiance (h, w, 3), or with alpha (h, w, 4)."""
        if radiance.ndim != 3 or radiance.shape[2] not in (3, 4):
            raise GraphicsError(f"a picture of shape {radiance.shape}, expected (h, w, 3) or (h, w, 4)")
        self._drawn, self.is_empty = None, False
        height, width, n_channels = radiance.shape
        if (*self._picture.size, self._picture.components) == (width, height, n_channels):
            self._picture.write(np.ascontiguousarray(radiance, np.float32), alignment=1)
            return
        picture = self._picture_texture(radiance)
        self._memory.release(self._picture)
        self._picture = picture

    def show(self, drawn: moderngl.Texture | None) -> None:
        """Show a linear picture that is drawn here, in place of the one that came last; its owner keeps it as long as
        it is shown. None: the one that came last."""
        self._drawn, self.is_empty = drawn, self.is_empty and drawn is None

    def clear(self) -> None:
        """Show black until another picture comes."""
        self.set_picture(np.zeros((1, 1, 3), np.float32))
        self.is_empty = True

    def draw(self, view: DisplayView, other: moderngl.Texture | None = None, share: float = 0.0) -> moderngl.Texture:
        """The display picture, with another linear picture of the same size over it with this opacity."""
        self._blend(other, share)
        display = self._shown()
        display.draw(self._linear_texture(), view, (0, 0, *self._linear_texture().size))
        return display.texture

    def take_snapshot(self, other: moderngl.Texture | None = None) -> None:
        """Store what came last, or another linear picture, as A of a comparison."""
        self._blend(other, 0.0 if other is None else 1.0)
        assert self._target is not None
        self._shown().take_snapshot(self._target)

    def drop_snapshot(self) -> None:
        self._shown().drop_snapshot()

    def finished_image(self, view: DisplayView) -> NDArray[np.float32]:
        """The picture (H, W, 3) that came last in the screen's values, for files, over a transparent background with
        alpha (H, W, 4); waits for the GPU."""
        self._blend(None, 0.0)
        return self._shown().finished(self._linear_texture(), view)

    @property
    def shown(self) -> tuple[Display, moderngl.Framebuffer]:
        """The display, and what the linear picture was drawn into last."""
        assert self._target is not None
        return self._shown(), self._target

    def linear_image(self) -> NDArray[np.float32]:
        """The picture (H, W, 3) that came last, at the frame's size; waits for the GPU."""
        return self.linear_image_with_alpha()[..., :3]

    def linear_image_with_alpha(self) -> NDArray[np.float32]:
        """The same with the share of each pixel that is covered (H, W, 4)."""
        self._blend(None, 0.0)
        return read_texture(self._linear_texture(), np.float32).astype(np.float32)

    def release(self) -> None:
        self._release_frame()
        self._memory.release(self._picture)
        self._passes.release()

    def _blend(self, other: moderngl.Texture | None, share: float) -> None:
        linear = self._linear_texture()
        program = self._passes.full_screen("orbit/blend.frag.glsl")
        picture = self._drawn or self._picture
        textures = {"picture": picture, "other": picture if other is None else other}
        assert self._target is not None
        box = (0, 0, *linear.size)
        self._passes.draw(program, self._target, box, textures, size=linear.size, share=share if other else 0.0)

    def _picture_texture(self, radiance: NDArray[np.floating]) -> moderngl.Texture:
        height, width, n_channels = radiance.shape
        made = self._memory.texture((width, height), n_channels, "f4", np.ascontiguousarray(radiance, np.float32))
        made.filter = (moderngl.LINEAR, moderngl.LINEAR)
        return made

    def _shown(self) -> Display:
        if self._display is None:
            raise GraphicsError("no scene is open; wait for the worker's first answer")
        return self._display

    def _linear_texture(self) -> moderngl.Texture:
        if self._linear is None:
            raise GraphicsError("no scene is open; wait for the worker's first answer")
        return self._linear

    def _release_frame(self) -> None:
        if self._display is not None:
            self._display.release()
        self._memory.release_framebuffer(self._target)
        self._memory.release(self._linear)
        self._linear = self._target = self._display = self.frame = None
