"""How a stack of layers looks, computed on the GPU: a lobe in a plane, the slice of measured BRDFs, albedos, and a
small sphere under a fixed set of lights.

Values of plots are read back: they are lines and numbers, and the panel shows the value under the mouse. Each is small
enough to be waited for in a frame (some ms on a software rasterizer). The sphere is drawn in steps that add to one
another, each with its own directions: after the first it is there, after `n_steps` it is smooth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from ui.gl.brdf_stack import BrdfStack
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Passes
from ui.gl.view_transform import DrawnView, ToneMapper

Float64Array = NDArray[np.float64]

SLICE_SIDE = 128
N_ANGLES, N_ROWS = 32, 32
EVEN_ANGLES, NEAR_ANGLES = 241, 48
NEAREST = 1e-4


@dataclass(frozen=True)
class BrdfSlice:
    """BRDF values (N, 3), 1/sr, at angles (N,) of the camera from the normal, radians, those on the light's side
    negative.

    `theta_i` is the light's; both are in the plane that is `azimuth` from the tangent.
    """

    theta_i: float
    azimuth: float
    angles: Float64Array
    values: Float64Array


@dataclass(frozen=True)
class Albedo:
    """Directional albedo (N, 3) by the angle of the light (N,), and the equivalent albedo (3,) [BenArtzi07, 5.2.4]."""

    angles: Float64Array
    values: Float64Array
    equivalent: Float64Array

    @property
    def largest(self) -> Float64Array:
        """The largest share of light from one direction that is reflected, per channel (3,)."""
        return np.asarray(self.values.max(axis=0))


def lobe(stack: BrdfStack, theta_i: float, azimuth: float = 0.0) -> BrdfSlice:
    """The lobe about light from `theta_i`, with more angles where its highlight may be narrow."""
    near = np.geomspace(NEAREST, 0.5, NEAR_ANGLES)
    angles = np.concatenate([np.linspace(-1.0, 1.0, EVEN_ANGLES) * (0.5 * math.pi - 1e-3), theta_i + near,
                             theta_i - near, [theta_i]])  # fmt: skip
    angles = np.unique(angles[np.abs(angles) < 0.5 * math.pi])
    wo = _in_plane(angles, azimuth)
    wi = np.broadcast_to(_in_plane(np.array([-theta_i]), azimuth), wo.shape)
    return BrdfSlice(theta_i, azimuth, angles, stack.evaluate(wi, wo))


def _in_plane(angles: Float64Array, azimuth: float) -> Float64Array:
    """Directions (N, 3) at angles from the normal towards an azimuth."""
    sine = np.sin(angles)
    return np.stack([sine * math.cos(azimuth), sine * math.sin(azimuth), np.cos(angles)], axis=1)


class Slice:
    """The image over theta_h and theta_d: `texture`, RGBA8 for the screen, row 0 at the top, and its `values`."""

    def __init__(self, passes: Passes, memory: TextureMemory) -> None:
        self._passes, self._memory = passes, memory
        size = (SLICE_SIDE, SLICE_SIDE)
        self._numbers = memory.texture(size, 4, "f4")
        self.texture = memory.texture(size, 4, "f1")
        self._targets = [memory.framebuffer([each]) for each in (self._numbers, self.texture)]
        self.values: NDArray[np.float32] = np.zeros((SLICE_SIDE, SLICE_SIDE, 3), np.float32)

    def draw(self, stack: BrdfStack, azimuth: float = 0.0) -> None:
        """Evaluate and show; waits for the GPU."""
        box = (0, 0, SLICE_SIDE, SLICE_SIDE)
        side = float(SLICE_SIDE)
        stack.draw("slice.frag.glsl", self._targets[0], box, size=(side, side), azimuth=azimuth)
        program = self._passes.full_screen("brdf/slice_shown.frag.glsl")
        self._passes.draw(program, self._targets[1], box, {"values": self._numbers})
        self.values = read_texture(self._numbers, np.float32)[..., :3].astype(np.float32)

    def value(self, theta_h: float, theta_d: float) -> tuple[float, float, float]:
        """The image's value at two angles, radians."""
        column, row = (int(min(max(a / (0.5 * math.pi), 0.0), 0.9999) * SLICE_SIDE) for a in (theta_h, theta_d))
        red, green, blue = (float(value) for value in self.values[SLICE_SIDE - 1 - row, column])
        return red, green, blue

    def release(self) -> None:
        """Free textures."""
        for target in self._targets:
            self._memory.release_framebuffer(target)
        for texture in (self._numbers, self.texture):
            self._memory.release(texture)


class AlbedoShares:
    """Both albedos, over all azimuths: of 1,024 directions per angle, within 1 % for lobes down to 1e-3 rad.

    Drawn some of `N_ROWS` rows at a time, because many layers and tables take longer than a frame may.
    """

    def __init__(self, memory: TextureMemory) -> None:
        self._memory = memory
        self._texture: moderngl.Texture = memory.texture((N_ANGLES, N_ROWS), 4, "f4")
        self._target = memory.framebuffer([self._texture])
        self._row = 0

    @property
    def is_begun(self) -> bool:
        """Whether some rows are there, and not all."""
        return self._row > 0

    def step(self, stack: BrdfStack, rows: int = N_ROWS) -> Albedo | None:
        """Draw so many rows more; returns the albedo once all are there. Waits for the GPU then."""
        rows = min(rows, N_ROWS - self._row)
        box = (0, self._row, N_ANGLES, rows)
        stack.draw("albedo.frag.glsl", self._target, box, size=(float(N_ANGLES), float(N_ROWS)))
        self._row = (self._row + rows) % N_ROWS
        if self._row:
            return None
        shares = read_texture(self._texture, np.float32)[..., :3].astype(np.float64)
        angles = np.linspace(0.0, 0.5 * math.pi, 2 * N_ANGLES + 1)[1::2]
        values, weights = shares.mean(axis=0), np.sin(2.0 * angles)  # 2 cos sin, of the solid angle and the cosine
        return Albedo(angles, values, weights @ values / weights.sum())

    def release(self) -> None:
        """Free the texture."""
        self._memory.release_framebuffer(self._target)
        self._memory.release(self._texture)


def albedo(stack: BrdfStack, memory: TextureMemory) -> Albedo:
    """Both albedos at once."""
    shares = AlbedoShares(memory)
    try:
        found = shares.step(stack)
        assert found is not None
        return found
    finally:
        shares.release()


# ------------------------------------------------------------------------------------------------------- the lit sphere


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

    def step(self, stack: BrdfStack, tone_mapping: DrawnView = "filmic", rows: int | None = None) -> bool:
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

    def show(self, tone_mapping: DrawnView) -> None:
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
