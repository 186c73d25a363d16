"""Stores what is shown, to compare later pictures with it: as it is when it is asked for, in steps of a frame.

The graphics card copies the picture at once; the copy is read in bands of rows, one a frame, and a thread makes light
of it. Rejected: reading the picture itself in bands, which may be of several pictures while it changes.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.editor.editor import Editor
from engine.core.errors import InsituError
from ui.gl.display import ShownPicture
from ui.gl.gpu_memory import TextureMemory
from ui.gl.row_bands import RowReading

Light = NDArray[np.float32]


@dataclass
class _Storing:
    """One picture that is to be stored: its copy, what is said of it, and how far it is."""

    name: str
    remark: str
    intensity: float
    copy: moderngl.Texture
    target: moderngl.Framebuffer
    reading: RowReading = field(init=False)
    made: Future[Light] | None = None

    def __post_init__(self) -> None:
        self.reading = RowReading(self.copy.size)


class PictureStoring:
    """The pictures of one editor that are about to be stored, in the order in which they were asked for."""

    def __init__(self, context: moderngl.Context, editor: Editor) -> None:
        self._editor, self._memory = editor, TextureMemory(context)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="storing")
        self._waiting: deque[_Storing] = deque()

    @property
    def is_under_way(self) -> bool:
        """Whether a picture is still to be stored."""
        return bool(self._waiting)

    def begin(self, name: str, shown: ShownPicture) -> None:
        """Store a picture under a name, "" for a new one. Raises InsituError."""
        self._editor.stored.check_name(name, len(self._waiting))
        copy = self._memory.copied(shown.linear)
        target = self._memory.context.framebuffer([copy])
        remark = "" if self._editor.status.picture == "exact" else ", a preview: it is not exact yet"
        self._waiting.append(_Storing(name, remark, shown.intensity, copy, target))

    def follow(self) -> bool:
        """Take a step, once a frame; returns whether there is more to do, or something new."""
        if not self._waiting:
            return False
        first = self._waiting[0]
        if first.made is None:
            if first.reading.step(first.target):
                self._release(first)
                first.made = self._thread.submit(_light, first.reading.pixels, first.intensity)
        elif first.made.done():
            self._waiting.popleft()
            self._store(first, first.made.result())
        return True

    def _store(self, storing: _Storing, light: Light) -> None:
        editor = self._editor
        try:
            editor.stored.store(light, storing.name)
        except InsituError as error:
            editor.notify(str(error), True)
            return
        editor.notify(f"stored as {editor.view.stored}{storing.remark}")

    def _release(self, storing: _Storing) -> None:
        self._memory.release_framebuffer(storing.target)
        self._memory.release(storing.copy)

    def close(self) -> None:
        """Give up what is not stored yet, and free its copies."""
        self._thread.shutdown(wait=True)
        for each in self._waiting:
            if each.made is None:
                self._release(each)
        self._waiting.clear()


def _light(pixels: Light, intensity: float) -> Light:
    """A picture (H, W, 4) with the light's intensity, all values finite."""
    pixels[..., :3] *= np.float32(intensity)
    return np.nan_to_num(pixels, copy=False, posinf=0.0, neginf=0.0)
