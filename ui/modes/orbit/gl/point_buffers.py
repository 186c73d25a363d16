"""The data of moving pictures in buffers of the graphics card: filled part by part, see
`engine.realtime.triple_product.gpu_parts`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.realtime.triple_product import gpu_parts
from engine.realtime.triple_product.gpu_parts import (
    N_HEAD,
    BouncedPart,
    LightPart,
    MeshPart,
    SkyPart,
    TablePart,
    TermsPart,
)
from ui.gl.buffers import BufferMemory
from ui.gl.program import ProgramCache, set_uniforms
from ui.gl.textures import TextureMemory


@dataclass(frozen=True, eq=False)
class Tables:
    """One term's slices: their layout, and buffers of coefficients, values, images and places."""

    shape: TablePart
    buffers: tuple[moderngl.Buffer, ...]


class PointBuffers:
    """All that the exported parts contain so far."""

    def __init__(self, context: moderngl.Context, programs: ProgramCache) -> None:
        self._context, self._programs = context, programs
        self._memory, self._textures = BufferMemory(context), TextureMemory(context)
        self.mesh: MeshPart | None = None
        self.terms: tuple[gpu_parts.ExportedTerm, ...] = ()
        self.emission = np.zeros((0, 3), np.float32)
        self.tables: dict[int, Tables] = {}
        self.sky: moderngl.Texture | None = None
        self.turn, self.scale = 0.0, 1.0
        self.n_strokes = 0
        self._named: dict[str, moderngl.Buffer] = {}

    @property
    def is_ready(self) -> bool:
        """Whether there is something to draw."""
        return self.mesh is not None and self.sky is not None and "strokes" in self._named

    def __getitem__(self, name: str) -> moderngl.Buffer:
        return self._named[name]

    def take(self, part: gpu_parts.Part) -> None:
        """Take a part. Raises GraphicsError where there is no room for it."""
        match part:
            case MeshPart():
                self._take_mesh(part)
            case LightPart():
                self._put(part.which, part.irradiance.view(np.uint32), "irradiance", 4)
                self._put(part.place, part.rows, "rows", self.row_words)
            case BouncedPart():
                self._named["indirect"].write(np.ascontiguousarray(part.indirect))
            case SkyPart():
                self._take_sky(part)
            case TermsPart():
                self._take_terms(part)

    @property
    def row_words(self) -> int:
        """Words per row of a point with gloss."""
        assert self.mesh is not None
        return N_HEAD + 2 * self.mesh.n_coefficients

    def _take_mesh(self, part: MeshPart) -> None:
        self.mesh = None
        n_points = len(part.points)
        self._replace("points", self._memory.filled(part.points))
        self._replace("corners", self._memory.filled(part.corners))
        for name, n_bytes in (("irradiance", 16), ("indirect", 16), ("gloss", 16), ("seen", 4)):
            self._replace(name, self._memory.empty(n_bytes * n_points))
        self._replace("rows", self._memory.empty(4 * (N_HEAD + 2 * part.n_coefficients) * part.n_rows))
        self.mesh = part

    def _take_sky(self, part: SkyPart) -> None:
        self.turn, self.scale = part.turn, part.scale
        if part.image is not None:
            height, width = part.image.shape[:2]
            made = self._textures.texture((width, height), 3, "f4", part.image)
            made.filter, made.repeat_x = (moderngl.LINEAR, moderngl.LINEAR), True
            self._textures.release(self.sky)
            self.sky = made

    def _take_terms(self, part: TermsPart) -> None:
        self.terms, self.emission = part.terms, part.emission
        used = {term.tables for term in part.terms}
        for serial in [serial for serial in self.tables if serial not in used]:
            self._release_all(self.tables.pop(serial).buffers)
        for serial, each in part.tables.items():
            arrays = each.coefficients, each.values, each.images, each.places
            self.tables[serial] = Tables(each, tuple(map(self._memory.filled, arrays)))
        if part.images is not None:
            self._replace("images", self._memory.filled(part.images))
        self.n_strokes = max((term.maps.strokes[1] for term in part.terms if term.maps is not None), default=0)
        self._replace("strokes", self._memory.filled(part.strokes))

    def _put(self, where: NDArray[np.int32], sent: NDArray[np.uint32], name: str, n_words: int) -> None:
        """Write rows of words (N, k) to their places in a buffer whose rows are k or more words long."""
        if not len(where):
            return
        buffers = self._memory.filled(sent), self._memory.filled(where.astype(np.int32)), self._named[name]
        for binding, buffer in enumerate(buffers):
            buffer.bind_to_storage_buffer(binding)
        program = self._programs.compute("orbit/put.comp.glsl")
        set_uniforms(program, n_sent=sent.shape[1], n_target=n_words)
        program.run(len(where))
        self._context.memory_barrier()
        self._release_all(buffers[:2])

    def _replace(self, name: str, made: moderngl.Buffer) -> None:
        if name in self._named:
            self._memory.release(self._named[name])
        self._named[name] = made

    def _release_all(self, buffers: Iterable[moderngl.Buffer]) -> None:
        for buffer in buffers:
            self._memory.release(buffer)

    @property
    def memory_bytes(self) -> int:
        """Bytes of buffers and textures."""
        return self._memory.bytes_in_use + self._textures.bytes_in_use

    def release(self) -> None:
        """Free all; nothing is ready then."""
        self._release_all(self._named.values())
        for tables in self.tables.values():
            self._release_all(tables.buffers)
        self._textures.release(self.sky)
        self._named.clear()
        self.tables.clear()
        self.mesh = self.sky = None
