"""Accumulators, and the two passes that add terms to them.

`TermSum` first sums the chosen terms for groups of eight samples (increment.frag, eight targets), then adds each lane
to the accumulator with blending (scatter.frag). The sum of one step is rounded before it meets the picture, so small
edits to a bright picture lose nothing among themselves.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ui.gl.passes import Passes, uniform
from ui.gl.textures import TextureMemory, read_texture
from ui.modes.placement.gl.sample_layout import (
    GROUP_SIZE,
    GROUPS_PER_ROW,
    SAMPLES_PER_ROW,
    pack_samples,
    row_count,
    unpack_samples,
)
from ui.modes.placement.gl.transport import TransportTexture

TERMS_PER_PASS = 128  # four uniform components each: half of the 1,024 that OpenGL 4.1 promises


class Accumulator:
    """B at the p samples of one layer: RGBA32F texels in sample layout, with a framebuffer to add to."""

    def __init__(self, memory: TextureMemory, n_samples: int) -> None:
        self.n_samples, self.rows = n_samples, row_count(n_samples)
        self._memory = memory
        self.texture = memory.texture((SAMPLES_PER_ROW, self.rows), 4, "f4")
        self.framebuffer = memory.framebuffer([self.texture])

    def write(self, radiance: NDArray[np.floating]) -> None:
        """Replace all by radiance (p,3)."""
        self.texture.write(pack_samples(radiance.astype(np.float32, copy=False), 4))

    def read(self) -> NDArray[np.float32]:
        """The radiance (p,3); waits for the GPU."""
        return unpack_samples(read_texture(self.texture, np.float32), self.n_samples)[:, :3].astype(np.float32)

    def release(self) -> None:
        self._memory.release_framebuffer(self.framebuffer)
        self._memory.release(self.texture)


class TermSum:
    """Adds Σ_k m_k·(stored numbers of k) to accumulators. Its scratch targets grow to the largest layer."""

    def __init__(self, passes: Passes, memory: TextureMemory) -> None:
        self._passes, self._memory = passes, memory
        self._lanes: list[moderngl.Texture] = []
        self._target: moderngl.Framebuffer | None = None

    def reserve(self, rows: int) -> None:
        """Make room for layers of this many rows; raises GraphicsError when there is none."""
        if self._lanes and self._lanes[0].height >= rows:
            return
        self._release_lanes()
        for _ in range(GROUP_SIZE):
            self._lanes.append(self._memory.texture((GROUPS_PER_ROW, rows), 4, "f4"))
        self._target = self._memory.framebuffer(self._lanes)

    def add(
        self,
        transport: TransportTexture,
        indices: NDArray[np.intp],
        multipliers: NDArray[np.float32],
        accumulator: Accumulator,
        *,
        replace: bool = False,
    ) -> None:
        """Add the terms `indices` (K,) times `multipliers` (K,3); with `replace` what was there before is dropped."""
        self.reserve(transport.rows)
        for first in range(0, max(1, len(indices)), TERMS_PER_PASS):
            chunk = slice(first, first + TERMS_PER_PASS)
            self._sum(transport, indices[chunk], multipliers[chunk], add=first > 0)
        self._scatter(accumulator, add=not replace)

    def _sum(
        self, transport: TransportTexture, indices: NDArray[np.intp], multipliers: NDArray[np.float32], add: bool
    ) -> None:
        assert self._target is not None and transport.texture is not None
        program = self._passes.full_screen("placement/increment.frag.glsl", HALF=int(transport.precision == "half"))
        terms = np.zeros((TERMS_PER_PASS, 4), dtype=np.float32)
        terms[: len(indices), :3] = multipliers
        terms[: len(indices), 3] = indices
        uniform(program, "terms").write(terms)
        box = (0, 0, GROUPS_PER_ROW, transport.rows)
        textures = {"transport": transport.texture}
        self._passes.draw(program, self._target, box, textures, add=add, n_terms=len(indices))

    def _scatter(self, accumulator: Accumulator, add: bool) -> None:
        program = self._passes.full_screen("placement/scatter.frag.glsl")
        for lane, increments in enumerate(self._lanes):
            column = lane * GROUPS_PER_ROW
            box = (column, 0, GROUPS_PER_ROW, accumulator.rows)
            textures = {"increments": increments}
            self._passes.draw(program, accumulator.framebuffer, box, textures, add=add, first_column=column)

    def _release_lanes(self) -> None:
        self._memory.release_framebuffer(self._target)
        self._target = None
        for lane in self._lanes:
            self._memory.release(lane)
        self._lanes = []

    def release(self) -> None:
        self._release_lanes()
