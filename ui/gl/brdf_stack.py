"""Layers on the GPU: their curves in a texture, their numbers as uniforms, and passes that evaluate their BRDF.

    layers ─► curves at angles of growing distance (4096, 3) each ─► texture, a row a curve ─┐
          ├─► strengths, quotient parameters ─► uniforms ────────────────────────────────────┼─► any brdf/*.frag.glsl
          └─► their measurements ─► tables (`measured_tables`), as far as they are there ────┘

The curves are the edited ones, with all operators: what a drag changes is a row of 64 KiB.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from ui.gl.brdf_source import brdf_source, curves_of
from ui.gl.measured_source import factor_rows, table_number
from ui.gl.measured_tables import MeasuredTables
from ui.gl.passes import Box, Passes
from ui.gl.textures import TextureMemory, read_texture

N_SAMPLES = 4096
# The angles of a curve's samples, radians; `place` in shaders/brdf/curves.glsl is the inverse.
SAMPLED_AT = (np.arange(N_SAMPLES) / (N_SAMPLES - 1.0)) ** 2 * (np.pi / 2)
LARGEST = 3e38
PAIRS_A_ROW = 1024


class BrdfStack:
    """Some layers whose BRDFs are added, as shaders see them. `set_layers` first, then any number of passes.

    Measured layers are only the product of their curves while `tables` (None: no tables) does not have theirs.
    """

    def __init__(self, passes: Passes, memory: TextureMemory, tables: MeasuredTables | None = None) -> None:
        self._passes, self._memory = passes, memory
        self._tables, self._has_own_tables = tables or MeasuredTables(memory), tables is None
        self._curves: moderngl.Texture | None = None
        self.layers: tuple[Layer, ...] = ()

    def set_layers(self, layers: tuple[Layer, ...]) -> bool:
        """Follow the layers; returns whether they differ from those before."""
        if layers == self.layers and self._curves is not None:
            return False
        rows = [row for layer in layers for row in _rows(layer)]
        texels = np.zeros((max(len(rows), 1), N_SAMPLES, 4), np.float32)
        for row, values in enumerate(rows):
            texels[row, :, :3] = np.minimum(values, LARGEST)
        if self._curves is None or self._curves.height != len(texels):
            self._memory.release(self._curves)
            self._curves = self._memory.texture((N_SAMPLES, len(texels)), 4, "f4")
        self._curves.write(texels.tobytes())
        self.layers = layers
        return True

    def draw(
        self,
        fragment: str,
        target: moderngl.Framebuffer,
        box: Box,
        textures: Mapping[str, moderngl.Texture] | None = None,
        *,
        add: bool = False,
        **uniforms: Any,
    ) -> None:
        """Run `brdf/fragment` over a box of the target; see `Passes.draw`. Raises GraphicsError, Untranslatable."""
        assert self._curves is not None
        slots, tables = self._slots()
        made = {"generated/brdf.glsl": brdf_source(tuple(layer.model for layer in self.layers), slots)}
        program = self._passes.full_screen(f"brdf/{fragment}", made)
        numbers = uniforms | self._numbers()
        there = {name: value for name, value in numbers.items() if name in program}
        used: dict[str, moderngl.Texture | moderngl.TextureArray]
        used = {"curves": self._curves, **tables, **(textures or {})}
        self._passes.draw(program, target, box, {n: t for n, t in used.items() if n in program}, add=add, **there)

    def evaluate(self, wi: NDArray[np.floating], wo: NDArray[np.floating]) -> NDArray[np.float64]:
        """The BRDF of unit directions (N, 3) in the local frame, (N, 3) in 1/sr; waits for the GPU."""
        n = len(wi)
        size = (min(n, PAIRS_A_ROW), -(-n // PAIRS_A_ROW))
        directions = np.zeros((2, size[0] * size[1], 4), np.float32)
        directions[:, :n, :3] = wi, wo
        there = [self._memory.texture(size, 4, "f4", each) for each in directions]
        result = self._memory.texture(size, 4, "f4")
        target = self._memory.framebuffer([result])
        names = ("towards_light", "towards_eye")
        try:
            self.draw("pairs.frag.glsl", target, (0, 0, *size), dict(zip(names, there, strict=True)))
            return read_texture(result, np.float32).reshape(-1, 4)[:n, :3].astype(np.float64)
        finally:
            self._memory.release_framebuffer(target)
            for texture in (*there, result):
                self._memory.release(texture)

    def release(self) -> None:
        """Free the texture; programs stay with the passes."""
        self._memory.release(self._curves)
        if self._has_own_tables:
            self._tables.release()
        self._curves, self.layers = None, ()

    def _slots(self) -> tuple[tuple[int | None, ...], dict[str, moderngl.TextureArray]]:
        """Which table each layer reads, and the textures by their uniforms' names."""
        numbers = [table_number(layer) for layer in self.layers]
        there = list(dict.fromkeys(each for each in numbers if each is not None))
        slots = tuple(None if each is None else there.index(each) for each in numbers)
        return slots, {f"table_{slot}": self._tables.texture(each) for slot, each in enumerate(there)}

    def _numbers(self) -> dict[str, tuple[float, ...]]:
        """Uniforms of all layers."""
        numbers: dict[str, tuple[float, ...]] = {}
        for place, layer in enumerate(self.layers):
            numbers[f"strength_{place}"] = tuple(layer.scale().tolist())
            numbers[f"quotient_parameters_{place}"] = tuple(layer.quotient_parameters().tolist())
        return numbers


def _rows(layer: Layer) -> list[NDArray[np.float64]]:
    """The curves of a layer, and those that its quotient is computed from, (N_SAMPLES, 3) each."""
    curves = [layer.curve(factor.name)(SAMPLED_AT) for factor in curves_of(layer.model)]
    return curves + factor_rows(layer, SAMPLED_AT)
