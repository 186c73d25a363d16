"""Moving pictures of bent meshes that the graphics card draws: lobes turned and summed point by point in a compute
shader, then the triangles between points [Sloan05, 5].

    backdrop ─► what points send, on either side (lobes.comp) ─► triangles (surface)

As `engine.deform.live` draws moving pictures, and with several samples a pixel. Shape and look lie in buffers; in a
frame places and axes are sent alone, for the deformers are Python's.
"""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.deform.parts import LookPart, PosedPart, ShapePart, Told
from engine.scene.camera import camera_frame
from engine.scene.description import Camera
from ui.gl.buffers import BufferMemory
from ui.gl.context import GraphicsError
from ui.gl.program import ProgramCache, set_uniforms
from ui.gl.textures import TextureMemory
from ui.gl.view_target import ViewTarget, seen_from

ORDER = 6  # of `lobes.comp.glsl`
# Buffers by the numbers that shaders know them by.
_BINDINGS = {"lobes": 0, "posed": 1, "owners": 2, "light": 3, "objects": 4, "gloss": 5, "sent": 6}
_GROUP = 64  # points


class PosedPicture:
    """The linear picture, in any pose and from any camera."""

    def __init__(self, context: moderngl.Context, n_samples: int = 4) -> None:
        """n_samples: of a pixel, where edges are smoothed; 0: its middle alone."""
        self._context, self._programs = context, ProgramCache(context)
        self._target = ViewTarget(context, n_samples)
        self._memory, self._textures = BufferMemory(context), TextureMemory(context)
        self._buffers: dict[str, moderngl.Buffer] = {}
        self._shape: ShapePart | None = None
        self._look: LookPart | None = None
        self._sky: moderngl.Texture | None = None
        self._array: moderngl.VertexArray | None = None

    @property
    def known(self) -> tuple[int, int]:
        """The numbers of the shape and the look that are here, 0 for none."""
        return self._shape.number if self._shape else 0, self._look.number if self._look else 0

    def rehearse(self) -> Iterator[None]:
        """Compile all shaders, one a step; raises GraphicsError."""
        yield
        self._programs.compute("deform/lobes.comp.glsl")
        yield
        self._surface()
        yield
        self._target.rehearse()

    def draw(self, told: Told, camera: Camera, size: tuple[int, int]) -> moderngl.Texture:
        """The picture (width, height), row 0 at the top; raises GraphicsError, also where a part is missing."""
        if told.shape is not None:
            self._take_shape(told.shape)
        if told.look is not None:
            self._take_look(told.look)
        if self._shape is None or self._look is None or self._sky is None:
            raise GraphicsError("a pose without a mesh or light")
        self._fill("posed", told.posed.places)
        self._target.begin(camera, size, self._sky, self._look.turn, self._look.scale)
        for name, binding in _BINDINGS.items():
            self._buffers[name].bind_to_storage_buffer(binding)
        self._shade(self._shape, self._look, told.posed)
        self._draw_triangles(told.posed, camera, size)
        return self._target.finish()

    def _take_shape(self, part: ShapePart) -> None:
        if part.order != ORDER:
            raise GraphicsError(f"transfer of order {part.order}, expected {ORDER}")
        self._shape = None
        self._fill("lobes", part.lobes)
        self._fill("owners", part.owners)
        self._fill("sent", np.zeros((len(part.owners), 6), np.float32))
        if self._array is not None:
            self._array.release()
        if "corners" in self._buffers:
            self._memory.release(self._buffers.pop("corners"))
        self._fill("corners", part.corners)
        self._array = self._context.vertex_array(self._surface(), [(self._buffers["corners"], "4i4", "corner")])
        self._shape = part

    def _take_look(self, part: LookPart) -> None:
        self._look = None
        self._fill("light", np.concatenate([part.harmonics.ravel(), part.table.ravel()]))
        self._fill("objects", part.objects)
        self._fill("gloss", part.gloss)
        height, width = part.sky.shape[:2]
        sky = self._textures.texture((width, height), 3, "f4", part.sky)
        sky.filter, sky.repeat_x = (moderngl.LINEAR, moderngl.LINEAR), True
        self._textures.release(self._sky)
        self._sky, self._look = sky, part

    def _fill(self, name: str, array: NDArray[np.generic]) -> None:
        """A buffer of that name with these numbers: the one that is there where it has their size."""
        before = self._buffers.get(name)
        if before is not None and 0 < array.nbytes == before.size:
            before.write(np.ascontiguousarray(array))
            return
        made = self._memory.filled(array)
        if before is not None:
            self._memory.release(before)
        self._buffers[name] = made

    def _shade(self, shape: ShapePart, look: LookPart, posed: PosedPart) -> None:
        program, n_points = self._programs.compute("deform/lobes.comp.glsl"), len(shape.owners)
        set_uniforms(
            program, n_points=n_points, n_lobes=shape.n_lobes, table=look.table.shape[:2], eye=posed.eye,
            n_angles=look.gloss.shape[1], steepest=look.steepest, cosine=look.cosine.tolist(),
        )  # fmt: skip
        program.run(-(-n_points // _GROUP))
        self._context.memory_barrier()

    def _draw_triangles(self, posed: PosedPart, camera: Camera, size: tuple[int, int]) -> None:
        assert self._array is not None
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "<"
        set_uniforms(self._surface(), **_view(camera, size, posed))
        self._array.render(moderngl.TRIANGLES)
        self._context.enable_only(moderngl.NOTHING)

    def _surface(self) -> moderngl.Program:
        return self._programs.get("deform/surface.vert.glsl", "deform/surface.frag.glsl")

    def forget(self) -> None:
        """Free what was told of a scene."""
        if self._array is not None:
            self._array.release()
        for buffer in self._buffers.values():
            self._memory.release(buffer)
        self._buffers.clear()
        self._textures.release(self._sky)
        self._array = self._sky = self._shape = self._look = None

    @property
    def memory_bytes(self) -> int:
        """Of buffers and textures, without the target's several samples a pixel."""
        return self._memory.bytes_in_use + self._textures.bytes_in_use + self._target.memory_bytes

    def release(self) -> None:
        """Free all."""
        self.forget()
        self._target.release()
        self._programs.release()


def _view(camera: Camera, size: tuple[int, int], posed: PosedPart) -> dict[str, object]:
    """Where triangles come to lie in the picture: uniforms of `surface.vert.glsl`."""
    forward = camera_frame(camera)[2]
    depths = posed.places[:, 9:] @ forward.astype(np.float32) - np.float32(np.dot(posed.eye, forward))
    farthest = max(float(depths.max(initial=0.0)), 1e-6) * 1.001
    return seen_from(camera, size, np.asarray(posed.eye), float(depths.min(initial=farthest)) * 0.999, farthest)
