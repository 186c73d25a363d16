"""Moving pictures of deformed meshes drawn on a graphics card: lobes are rotated and summed point by point in a compute
shader, then the triangles between points drawn [Sloan05, 5].

    backdrop ─► radiance of points, on either side (lobes.comp) ─► triangles (surface)
    ─► where there are images or detail, diffuse layers once more, pixel by pixel (term)

As `engine.realtime.zonal_harmonics.picture_renderer` draws moving pictures, but with several samples per pixel. Shape,
materials, cover and sky are in buffers; in a frame only positions and axes are sent, because deformers are in Python.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_frame
from engine.realtime.zonal_harmonics.gpu_parts import (
    AppearancePart,
    CoverPart,
    ExportedDetail,
    ExportedTerm,
    Numbers,
    PictureExport,
    PosedPart,
    ShapePart,
    SkyPart,
)
from engine.scene.description import Camera
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import BufferMemory, TextureMemory
from ui.gl.program import ProgramCache, map_uniforms, set_uniforms
from ui.gl.view_target import ViewTarget, view_uniforms

ORDER = 6  # of `lobes.comp.glsl`
# Buffers by the numbers of their bindings in shaders: of points, and of maps on objects.
_OF_POINTS = {
    "lobes": 0, "posed": 1, "owners": 2, "light": 3, "objects": 4, "gloss": 5, "blockers": 6,
    "sent": 7,
}  # fmt: skip
_OF_COVER = {"details": 0, "posed": 1, "axes": 2, "light": 3, "images": 5, "strokes": 6, "sent": 7}
_COVERED = ("4i4 2f4 3f4 3f4", ("corner", "image_place", "position", "face"))
_GROUP = 64  # points


class PosedPicture:
    """The linear picture, in any pose and from any camera."""

    def __init__(self, context: moderngl.Context, n_samples: int = 4) -> None:
        """n_samples: per pixel, for smooth edges; 0: only its centre."""
        self._context, self._programs = context, ProgramCache(context)
        self._target = ViewTarget(context, n_samples)
        self._memory, self._textures = BufferMemory(context), TextureMemory(context)
        self._buffers: dict[str, moderngl.Buffer] = {}
        self._shape: ShapePart | None = None
        self._appearance: AppearancePart | None = None
        self._cover: CoverPart | None = None
        self._sky: SkyPart | None = None
        self._backdrop: moderngl.Texture | None = None
        self._array: moderngl.VertexArray | None = None
        self._cover_arrays: dict[int, moderngl.VertexArray] = {}

    @property
    def part_numbers(self) -> Numbers:
        """The numbers of the parts that are here."""
        parts = self._shape, self._appearance, self._cover, self._sky
        shape, look, cover, sky = (each.number if each else 0 for each in parts)
        return shape, look, cover, sky

    def warm_up(self) -> Iterator[None]:
        """Compile all shaders, one a step; raises GraphicsError."""
        yield
        self._programs.compute("deform/lobes.comp.glsl")
        yield
        self._surface()
        for has_maps, has_detail in product((False, True), repeat=2):
            yield
            self._term(has_maps, has_detail)
        yield
        self._target.warm_up()

    def draw(self, export: PictureExport, camera: Camera, size: tuple[int, int]) -> moderngl.Texture:
        """The picture (width, height), row 0 at the top; raises GraphicsError, also where a part is missing."""
        if export.is_missing_parts(self.part_numbers):
            raise GraphicsError("a pose without its mesh or light")
        if export.shape is not None:
            self._take_shape(export.shape)
        if export.cover is not None:
            self._take_cover(export.cover)
        if export.appearance is not None:
            self._take_appearance(export.appearance)
        if export.sky is not None:
            self._take_sky(export.sky)
        shape, look, cover = self._shape, self._appearance, self._cover
        assert shape is not None and look is not None and cover is not None and self._backdrop is not None
        self._fill("posed", export.posed.places)
        self._fill("axes", export.posed.axes)
        self._fill("blockers", np.concatenate([export.posed.blockers.ravel(), look.casts.ravel()]))
        target = self._target.begin(camera, size, self._backdrop, look.turn, look.scale)
        self._shade(shape, look, export.posed)
        self._draw_triangles(target, look, cover, _view(camera, size, export.posed))
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

    def _take_cover(self, part: CoverPart) -> None:
        self._cover = None
        self._release_cover_arrays()
        for name, array in (
            ("covered", part.corners), ("details", part.lobes), ("images", part.images), ("strokes", part.strokes)
        ):  # fmt: skip
            self._fill(name, array)
        self._cover = part

    def _take_appearance(self, part: AppearancePart) -> None:
        self._appearance = None
        self._fill("light", np.concatenate([part.harmonics.ravel(), part.table.ravel()]))
        self._fill("objects", part.objects)
        self._fill("gloss", part.gloss)
        self._appearance = part

    def _take_sky(self, part: SkyPart) -> None:
        self._sky = None
        height, width = part.radiance.shape[:2]
        texture = self._textures.texture((width, height), 3, "f4", part.radiance)
        texture.filter, texture.repeat_x = (moderngl.LINEAR, moderngl.LINEAR), True
        self._textures.release(self._backdrop)
        self._backdrop, self._sky = texture, part

    def _fill(self, name: str, array: NDArray[np.generic]) -> None:
        """A buffer of that name with these numbers: the present one where it has their size."""
        before = self._buffers.get(name)
        if before is not None and 0 < array.nbytes == before.size:
            before.write(np.ascontiguousarray(array))
            return
        made = self._memory.filled(array)
        if before is not None:
            self._memory.release(before)
        self._buffers[name] = made

    def _shade(self, shape: ShapePart, look: AppearancePart, posed: PosedPart) -> None:
        self._bind(_OF_POINTS)
        program, n_points = self._programs.compute("deform/lobes.comp.glsl"), len(shape.owners)
        set_uniforms(
            program, n_points=n_points, n_lobes=shape.n_lobes, table=look.table.shape[:2], eye=posed.camera_position,
            n_angles=look.gloss.shape[1], steepest=look.steepest, cosine=look.cosine.tolist(), even=look.even,
            n_blockers=len(posed.blockers), n_casters=look.casts.shape[1], spread=look.spread.tolist(),
            least=look.least,
        )  # fmt: skip
        program.run(-(-n_points // _GROUP))
        self._context.memory_barrier()

    def _draw_triangles(
        self, target: moderngl.Framebuffer, look: AppearancePart, cover: CoverPart, view: dict[str, object]
    ) -> None:
        assert self._array is not None
        context = self._context
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"
        set_uniforms(self._surface(), **view)
        self._array.render(moderngl.TRIANGLES)
        target.depth_mask, context.depth_func = False, "<="
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        context.blend_func = moderngl.ONE, moderngl.ONE  # type: ignore[assignment]
        self._bind(_OF_COVER)
        for term in look.terms:
            self._draw_term(term, look, cover, view)
        target.depth_mask = True
        context.enable_only(moderngl.NOTHING)

    def _draw_term(self, term: ExportedTerm, look: AppearancePart, cover: CoverPart, view: dict[str, object]) -> None:
        program = self._term(term.maps is not None, term.detail is not None)
        set_uniforms(program, **view, reflectance=term.reflectance)
        if term.maps is not None:
            set_uniforms(program, **map_uniforms(term.maps), n_strokes=cover.n_strokes)
        if term.detail is not None:
            set_uniforms(program, **_detail(term.detail), table=look.table.shape[:2])
        first, last = cover.ranges[term.i_object]
        self._cover_array(program).render(moderngl.TRIANGLES, vertices=3 * (last - first), first=3 * first)

    def _cover_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        if program.glo not in self._cover_arrays:
            kinds, names = _COVERED
            used = [name for name in names if name in program]
            layout = " ".join(
                kind if name in program else kind.replace("f", "x")
                for kind, name in zip(kinds.split(), names, strict=True)
            )
            made = self._context.vertex_array(program, [(self._buffers["covered"], layout, *used)])
            self._cover_arrays[program.glo] = made
        return self._cover_arrays[program.glo]

    def _bind(self, bindings: dict[str, int]) -> None:
        for name, binding in bindings.items():
            self._buffers[name].bind_to_storage_buffer(binding)

    def _term(self, has_maps: bool, has_detail: bool) -> moderngl.Program:
        switches = {"HAS_MAPS": int(has_maps), "HAS_DETAIL": int(has_detail)}
        return self._programs.get("deform/term.vert.glsl", "deform/term.frag.glsl", **switches)

    def _surface(self) -> moderngl.Program:
        return self._programs.get("deform/surface.vert.glsl", "deform/surface.frag.glsl")

    def forget(self) -> None:
        """Free the parts of a scene."""
        if self._array is not None:
            self._array.release()
        self._release_cover_arrays()
        for buffer in self._buffers.values():
            self._memory.release(buffer)
        self._buffers.clear()
        self._textures.release(self._backdrop)
        self._array = self._backdrop = self._shape = self._appearance = self._cover = self._sky = None

    def _release_cover_arrays(self) -> None:
        for array in self._cover_arrays.values():
            array.release()
        self._cover_arrays.clear()

    @property
    def memory_bytes(self) -> int:
        """Bytes of buffers and textures, without the target's several samples per pixel."""
        return self._memory.bytes_in_use + self._textures.bytes_in_use + self._target.memory_bytes

    def release(self) -> None:
        """Free all."""
        self.forget()
        self._target.release()
        self._programs.release()


def _detail(detail: ExportedDetail) -> dict[str, object]:
    return {
        "map_first": detail.first, "map_shape": detail.shape, "n_lobes": detail.n_lobes, "repeats": detail.repeats,
        "is_smooth": detail.is_smooth,
    }  # fmt: skip


def _view(camera: Camera, size: tuple[int, int], posed: PosedPart) -> dict[str, object]:
    """The projection of triangles to the picture: uniforms of `surface.vert.glsl`."""
    forward = camera_frame(camera)[2]
    depths = posed.places[:, 9:] @ forward.astype(np.float32) - np.float32(np.dot(posed.camera_position, forward))
    farthest = max(float(depths.max(initial=0.0)), 1e-6) * 1.001
    return view_uniforms(
        camera, size, np.asarray(posed.camera_position), float(depths.min(initial=farthest)) * 0.999, farthest
    )
