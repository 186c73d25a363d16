"""The resources of the frame of the next picture, made step by step while the present one stays on screen."""

from __future__ import annotations

from collections.abc import Generator

from engine.scene.picture_frame import PictureFrame
from ui.gl.context import GraphicsError
from ui.gl.display import Display
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes
from ui.modes.placement.gl.composite import Compositor


class ComingFrame:
    """A frame's compositor and display. made: once they are there; who takes them releases them."""

    def __init__(self, passes: Passes, memory: TextureMemory, frame: PictureFrame) -> None:
        self.frame = frame
        self.made: tuple[Compositor, Display] | None = None
        self._steps = self._making(passes, memory)

    def advance(self) -> bool:
        """Do one step; returns whether there are more. Raises GraphicsError, and then frees what was made."""
        if self.made is None:
            try:
                next(self._steps)
            except StopIteration as end:
                self.made = end.value
        return self.made is None

    def release(self) -> None:
        """Free what was made of a frame that is no longer wanted."""
        self._steps.close()
        for made in self.made or ():
            made.release()

    def _making(self, passes: Passes, memory: TextureMemory) -> Generator[None, None, tuple[Compositor, Display]]:
        compositor = Compositor(passes, memory, self.frame)
        yield from compositor.allocating()
        try:
            return compositor, Display(passes, memory, self.frame)
        except GraphicsError:
            compositor.release()
            raise
