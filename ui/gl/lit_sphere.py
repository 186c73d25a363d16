"""A small sphere of a material under a fixed set of lights: it shows what the material looks like.

Drawn in steps that add to one another, each with its own directions: after the first it is there, after `n_steps` it is
smooth.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.core.colour import ToneMapping
from engine.material.layer import Layer
from ui.gl.brdf_stack import BrdfStack
from ui.gl.passes import Passes
from ui.gl.textures import TextureMemory, read_texture
from ui.gl.tone_mapper import ToneMapper

N_STEPS = 8
# Offset of the directions from one step to the next [Roberts' R2 sequence, the plastic number].
TURNS = np.array([0.7548776662466927, 0.5698402909980532])


class LitSphere:
    """One sphere of `side` texels; `texture` is RGBA8, sRGB with straight alpha, row 0 at the top."""

    def __init__(self, passes: Passes, memory: TextureMemory, side: int, n_steps: int = N_STEPS) -> None:
        self._passes, self._memory, self.side = passes, memory, side
        self._mapper = ToneMapper(passes, memory)
        self._sum = memory.texture((side, side), 4, "f4")
        self._sum_target = memory.framebuffer([self._sum])
        self.texture = memory.texture((side, side), 4, "f1")
        self._target = memory.framebuffer([self.texture])
        self.n_steps, self.steps, self._row = n_steps, 0, 0

    @property
    def finished(self) -> bool:
        """Whether it is as smooth as it gets."""
        return self.steps >= self.n_steps

    @property
    def is_within_step(self) -> bool:
        """Whether a part of the present step has been drawn."""
        return self._row > 0

    @property
    def rows_left(self) -> int:
        """How many rows of the present step are still to be drawn."""
        return self.side - self._row

    def restart(self) -> None:
        """Start over: the material has changed."""
        self.steps = self._row = 0

    def step(self, stack: BrdfStack, tone_mapping: ToneMapping = "filmic", rows: int | None = None) -> bool:
        """Draw one step more, or so many rows of it, and after it the picture so far; returns whether there are more.

        Raises GraphicsError, Untranslatable.
        """
        if not self.finished:
            rows = min(self.side - self._row, self.side if rows is None else rows)
            turn = tuple(float(value) for value in (0.5 + self.steps * TURNS) % 1.0)
            box, add = (0, self._row, self.side, rows), self.steps > 0
            stack.draw("sphere.frag.glsl", self._sum_target, box, add=add, side=float(self.side), turn=turn)
            self._row = (self._row + rows) % self.side
            self.steps += self._row == 0
        if not self.is_within_step:
            self.show(tone_mapping)
        return not self.finished

    def show(self, tone_mapping: ToneMapping) -> None:
        """Tone map the picture so far."""
        program = self._mapper.full_screen("brdf/sphere_shown.frag.glsl", tone_mapping)
        textures = {"summed": self._sum, **self._mapper.textures(tone_mapping)}
        self._passes.draw(program, self._target, (0, 0, self.side, self.side), textures, side=float(self.side))

    def release(self) -> None:
        """Free textures."""
        self._mapper.release()
        for target in (self._sum_target, self._target):
            self._memory.release_framebuffer(target)
        for texture in (self._sum, self.texture):
            self._memory.release(texture)


def sphere_picture(
    context: moderngl.Context, layers: Sequence[Layer], side: int, steps: int = N_STEPS
) -> NDArray[np.uint8]:
    """A lit sphere of visible layers, (side, side, 4) sRGB with straight alpha, row 0 at the top: thumbnails.

    Made at once, and waits for the GPU: a few ms on one, some 10 ms a step for 96 texels without. Where many are made,
    keep a `LitSphere` and a `BrdfStack`, and make a step of one a frame. Raises GraphicsError, Untranslatable.
    """
    passes, memory = Passes(context), TextureMemory(context)
    stack, sphere = BrdfStack(passes, memory), LitSphere(passes, memory, side, steps)
    try:
        stack.set_layers(tuple(layer for layer in layers if layer.visible))
        for _ in range(steps):
            sphere.step(stack)
        return read_texture(sphere.texture, np.uint8).astype(np.uint8)
    finally:
        sphere.release()
        stack.release()
        passes.release()
