"""What the moving pictures of Orbit and Deform share where a graphics card draws them.

begin: sky behind all else ─► triangles with depth ─► begin_terms: sums over the same triangles ─► finish: resolve
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_frame, camera_plane
from engine.scene.description import Camera
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes

# A fraction of the farthest depth: what is nearer to the camera is not drawn.
_NEAREST = 3e-4
_BACKDROP = "orbit/backdrop.frag.glsl"


class ViewTarget:
    """A framebuffer with depth, of the size that was requested last, and the resolved linear picture."""

    def __init__(self, context: moderngl.Context, n_samples: int) -> None:
        """n_samples: per pixel, for smooth edges; 0: only its centre."""
        self._context, self._n_samples = context, n_samples
        self._passes, self._textures = Passes(context), TextureMemory(context)
        self._size = (0, 0)
        self._target: moderngl.Framebuffer | None = None
        self._resolved: moderngl.Framebuffer | None = None
        self._texture: moderngl.Texture | None = None

    def warm_up(self) -> None:
        """Compile the shader of the sky; raises GraphicsError."""
        self._passes.full_screen(_BACKDROP)

    def begin(
        self, camera: Camera, size: tuple[int, int], sky: moderngl.Texture, turn: float, scale: float,
        transparent: bool = False,
    ) -> None:  # fmt: skip
        """Clear the target and draw the sky, rotated by radians and scaled, as a camera sees it in a picture (width,
        height), or leave it transparent; then the nearest of all triangles that are drawn stays. Raises GraphicsError
        where there is no room."""
        target = self._room(size)
        target.depth_mask = True
        target.color_mask = (True,) * 4  # type: ignore[assignment]
        target.clear(depth=1.0)
        program = self._passes.full_screen(_BACKDROP)
        axes = tuple(camera_plane(camera, size).ravel().tolist())
        box = (0, 0, *size)
        self._passes.draw(
            program, target, box, {"environment": sky}, axes=axes, rotation=turn, intensity=scale,
            transparent=int(transparent),
        )  # fmt: skip
        target.use()
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "<"

    def begin_terms(self) -> None:
        """From here on, what is drawn of the nearest triangles is added to the picture."""
        assert self._target is not None
        context = self._context
        self._target.depth_mask, context.depth_func = False, "<="
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        context.blend_func = moderngl.ONE, moderngl.ONE  # type: ignore[assignment]

    def finish(self) -> moderngl.Texture:
        """The linear picture, row 0 at the top, of what was drawn since `begin`; alpha: what covers the sky."""
        assert self._target is not None and self._resolved is not None and self._texture is not None
        self._target.depth_mask = True
        self._context.enable_only(moderngl.NOTHING)
        self._context.copy_framebuffer(self._resolved, self._target)
        return self._texture

    @property
    def memory_bytes(self) -> int:
        """Bytes of the picture, without the framebuffer's several samples per pixel."""
        return self._textures.bytes_in_use

    def release(self) -> None:
        """Free all."""
        self._release_target()
        self._passes.release()

    def _room(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._target is not None and size == self._size:
            return self._target
        self._release_target()
        self._texture = self._textures.texture(size, 4, "f4")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._resolved = self._textures.framebuffer([self._texture])
        samples = min(self._n_samples, self._context.max_samples)
        colour = self._context.renderbuffer(size, 4, samples=samples, dtype="f4")
        self._target = self._context.framebuffer([colour], self._context.depth_renderbuffer(size, samples=samples))
        self._size = size
        return self._target

    def _release_target(self) -> None:
        if self._target is not None:
            attached = *self._target.color_attachments, self._target.depth_attachment
            self._textures.release_framebuffer(self._target)
            for each in attached:
                each.release()
        self._textures.release_framebuffer(self._resolved)
        self._textures.release(self._texture)
        self._target = self._resolved = self._texture = None
        self._size = (0, 0)


class CornerArrays:
    """Vertex arrays over one buffer of triangles' corners, one for each program; what a program does not read of a
    corner is skipped."""

    def __init__(self, context: moderngl.Context, attributes: Sequence[tuple[str, int, str]]) -> None:
        """attributes: name, number of components, and kind of each (f: float, i: integer), in the buffer's order."""
        self._context, self._attributes = context, tuple(attributes)
        self._corners: moderngl.Buffer | None = None
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def draw(self, program: moderngl.Program, corners: moderngl.Buffer, triangles: tuple[int, int]) -> None:
        """Draw triangles, the first and last (excluded), of a buffer of corners."""
        first, last = triangles
        if last > first:
            self._array(program, corners).render(moderngl.TRIANGLES, vertices=3 * (last - first), first=3 * first)

    def _array(self, program: moderngl.Program, corners: moderngl.Buffer) -> moderngl.VertexArray:
        if corners is not self._corners:
            self.release()
            self._corners = corners
        if program.glo not in self._arrays:
            used = [name for name, _, _ in self._attributes if name in program]
            layout = " ".join(f"{n}{kind if name in program else 'x'}4" for name, n, kind in self._attributes)
            self._arrays[program.glo] = self._context.vertex_array(program, [(corners, layout, *used)])
        return self._arrays[program.glo]

    def release(self) -> None:
        """Free all arrays; the buffer stays."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self._corners = None


def view_uniforms(
    camera: Camera, size: tuple[int, int], camera_position: NDArray[np.floating], nearest: float, farthest: float
) -> dict[str, object]:
    """The projection of vertices to a picture (width, height): the uniforms of `view.glsl`.

    camera_position (3,): in the vertices' own coordinates; nearest, farthest: depths between which they are, in their
    units.
    """
    (width, height), half = size, math.tan(math.radians(camera.fov_y) / 2.0)
    right, up, forward = camera_frame(camera)
    towards = np.stack([right * height / (half * width), -up / half, forward])
    near, far = max(nearest, _NEAREST * farthest), farthest
    depth = (far + near) / (far - near), -2.0 * far * near / (far - near)
    return {
        "camera_position": tuple(map(float, camera_position)),
        "towards": tuple(towards.T.ravel().tolist()),
        "depth": depth,
    }
