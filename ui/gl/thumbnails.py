"""Thumbnails of the library's materials. Those that come with the program are files beside them, because drawing one
the first time compiles a shader, for some 100 ms without a graphics card; for the user's own, spheres are drawn, a step
a frame, while the window has nothing else to do.

`python -m ui.gl.thumbnails` writes those files anew.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image

from app.document.linked_layers import Layers
from app.files.materials import Library, LibraryEntry
from ui.gl.brdf_stack import BrdfStack
from ui.gl.brdf_views import LitSphere, sphere_picture
from ui.gl.context import GraphicsError, create_headless_context
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.measured_tables import MeasuredTables
from ui.gl.program import Passes
from ui.gl.python_to_glsl import Untranslatable

SIDE = 96
MANY_STEPS = 64


class Thumbnails:
    """The thumbnails that panels requested, by the file of the material; only requested ones are made.

    complete: the layers of a material with all that was measured of them, which is then in `tables`; None until it is.
    """

    def __init__(
        self,
        context: moderngl.Context,
        tables: MeasuredTables | None = None,
        complete: Callable[[Layers], Layers | None] = lambda layers: layers,
    ) -> None:
        self._passes, self._memory = Passes(context), TextureMemory(context)
        self._stack, self._complete = BrdfStack(self._passes, self._memory, tables), complete
        self._sphere: LitSphere | None = None
        self._finished: dict[Path, tuple[LibraryEntry, moderngl.Texture | None]] = {}
        self._wanted: dict[Path, LibraryEntry] = {}

    def texture(self, entry: LibraryEntry) -> moderngl.Texture | None:
        """The picture, RGBA8 with row 0 at the top; None while there is none, or where it cannot be drawn."""
        known, texture = self._finished.get(entry.path, (None, None))
        if known is None or known.material is not entry.material:
            self._wanted[entry.path] = entry
        return texture

    @property
    def is_waiting(self) -> bool:
        """Whether a thumbnail is requested that could be made now."""
        return any(entry_picture(e) is not None or self._layers(e) is not None for e in self._wanted.values())

    def step(self, may_draw: bool) -> bool:
        """Continue the thumbnail that was requested first: read it, or where `may_draw` draw a part of it.

        Returns whether a thumbnail is finished.
        """
        there = ((e, entry_picture(e)) for e in self._wanted.values())
        ready = ((e, file) for e, file in there if file is not None or (may_draw and self._layers(e) is not None))
        entry, file = next(ready, (None, None))
        if entry is None:
            return False
        try:
            texture = self._drawn(self._layers(entry) or ()) if file is None else self._read(file)
        except (GraphicsError, Untranslatable, OSError):
            texture = None
        else:
            if texture is None:
                return False
        del self._wanted[entry.path]
        self._memory.release(self._finished.get(entry.path, (entry, None))[1])
        self._finished[entry.path] = entry, texture
        return True

    def release(self) -> None:
        """Free all textures."""
        for _, texture in self._finished.values():
            self._memory.release(texture)
        if self._sphere is not None:
            self._sphere.release()
        self._stack.release()
        self._passes.release()
        self._finished, self._wanted = {}, {}

    def _read(self, file: Path) -> moderngl.Texture:
        pixels = np.asarray(Image.open(file).convert("RGBA"))
        return self._memory.texture((pixels.shape[1], pixels.shape[0]), 4, "f1", pixels)

    def _layers(self, entry: LibraryEntry) -> Layers | None:
        return self._complete(tuple(layer for layer in entry.material.layers if layer.visible))

    def _drawn(self, layers: Layers) -> moderngl.Texture | None:
        """Draw one step; returns the picture when that was the last one."""
        if self._sphere is None:
            self._sphere = LitSphere(self._passes, self._memory, SIDE)
        if self._stack.set_layers(layers):
            self._sphere.restart()
        if self._sphere.step(self._stack):
            return None
        pixels = read_texture(self._sphere.texture, np.uint8)
        self._sphere.restart()
        return self._memory.texture((SIDE, SIDE), 4, "f1", pixels)


def entry_picture(entry: LibraryEntry) -> Path | None:
    """The file with the picture of a material that comes with the program."""
    file = entry.path.with_suffix(".png")
    return None if entry.is_own or not file.is_file() else file


def main() -> None:
    library = Library()
    library.read_all()
    context = create_headless_context()
    for entry in library.entries:
        if not entry.is_own:
            pixels = sphere_picture(context, entry.material.layers, SIDE, MANY_STEPS)
            Image.fromarray(pixels).save(entry.path.with_suffix(".png"), optimize=True)


if __name__ == "__main__":
    main()
