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
from engine.realtime.core.gpu_parts import (
    AppearancePart,
    BackdropPart,
    CoverPart,
    DeformTerm,
    ExportedDetail,
    Numbers,
    PictureExport,
    PosedPart,
    ShapePart,
)
from engine.scene.description import Camera
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import BufferMemory, TextureMemory
from ui.gl.program import ProgramCache, map_uniforms, set_uniforms
from ui.gl.view_target import CornerArrays, ViewTarget, view_uniforms

ORDER = 6  # of `lobes.comp.glsl`
# Buffers by the numbers of their bindings in shaders: of points, and of maps on objects.
_OF_POINTS = {
    "lobes": 0, "posed": 1, "owners": 2, "light": 3, "gloss": 4, "objects": 5, "blockers": 6,
    "sent": 7,
}  # fmt: skip
_OF_SURFACE = {"posed": 1, "images": 5, "sent": 7, "objects": 8, "holes": 13, "opacities": 14}
_OF_COVER = {"details": 0, "posed": 1, "axes": 2, "light": 3, "gloss": 4, "images": 5, "strokes": 6, "sent": 7,
             "opacities": 14}  # fmt: skip
_COVERED = (("corner", 4, "i"), ("image_places", 4, "f"), ("position", 3, "f"), ("face", 3, "f"),
            ("packed_colour", 2, "i"))  # fmt: skip
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
        self._backdrop_part: BackdropPart | None = None
        self._backdrop: moderngl.Texture | None = None
        self._triangles = CornerArrays(context, [("corner", 4, "i")])
        self._covered = CornerArrays(context, _COVERED)

    @property
    def part_numbers(self) -> Numbers:
        """The numbers of the parts that are here."""
        parts = self._shape, self._appearance, self._cover, self._backdrop_part
        shape, appearance, cover, backdrop = (each.number if each else 0 for each in parts)
        return shape, appearance, cover, backdrop

    def warm_up(self) -> Iterator[None]:
        """Compile all shaders, one a step; raises GraphicsError."""
        yield
        self._programs.compute("deform/lobes.comp.glsl")
        yield
        self._surface(False)
        for has_maps, has_detail in product((False, True), repeat=2):
            yield
            self._term(has_maps, has_detail, False)
        yield
        self._target.warm_up()

    def draw(
        self, export: PictureExport, camera: Camera, size: tuple[int, int], transparent: bool = False
    ) -> moderngl.Texture:
        """The picture (width, height), row 0 at the top; transparent: without the environment, and with alpha. Raises
        GraphicsError, also where a part is missing."""
        if export.is_missing_parts(self.part_numbers):
            raise GraphicsError("a pose without its mesh or light")
        if export.shape is not None:
            self._take_shape(export.shape)
        if export.cover is not None:
            self._take_cover(export.cover)
        if export.appearance is not None:
            self._take_appearance(export.appearance)
        if export.backdrop is not None:
            self._take_backdrop(export.backdrop)
        shape, appearance, cover = self._shape, self._appearance, self._cover
        assert shape is not None and appearance is not None and cover is not None and self._backdrop is not None
        self._fill("posed", np.concatenate([export.posed.places.ravel(), export.posed.of_lamps.ravel()]))
        self._fill("axes", export.posed.axes)
        self._fill("blockers", np.concatenate([export.posed.blockers.ravel(), appearance.casts.ravel()]))
        self._target.begin(camera, size, self._backdrop, appearance.turn, appearance.scale, transparent)
        self._shade(shape, appearance, export.posed)
        self._draw_triangles(shape, appearance, cover, _view(camera, size, export.posed))
        return self._target.finish()

    def _take_shape(self, part: ShapePart) -> None:
        if part.order != ORDER:
            raise GraphicsError(f"transfer of order {part.order}, expected {ORDER}")
        self._shape = None
        self._fill("lobes", np.concatenate([part.lobes.ravel(), part.gloss_rows.ravel()]))
        self._fill("owners", part.owners)
        self._fill("sent", np.zeros((len(part.owners), 6), np.float32))
        self._fill("corners", part.corners)
        self._shape = part

    def _take_cover(self, part: CoverPart) -> None:
        self._cover = None
        for name, array in (
            ("covered", part.corners), ("details", part.lobes), ("images", part.images), ("strokes", part.strokes),
            ("opacities", part.opacities), ("holes", part.holes),
        ):  # fmt: skip
            self._fill(name, array)
        self._cover = part

    def _take_appearance(self, part: AppearancePart) -> None:
        self._appearance = None
        parts = part.harmonics, part.table, part.lights, part.added
        self._fill("light", np.concatenate([each.ravel() for each in parts]))
        self._fill("objects", part.objects)
        self._fill("gloss", np.concatenate([part.gloss.ravel(), part.row_layers.ravel(), part.views]))
        self._appearance = part

    def _take_backdrop(self, part: BackdropPart) -> None:
        self._backdrop_part = None
        texture = self._textures.latlong(part.radiance)
        self._textures.release(self._backdrop)
        self._backdrop, self._backdrop_part = texture, part

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

    def _shade(self, shape: ShapePart, appearance: AppearancePart, posed: PosedPart) -> None:
        self._bind(_OF_POINTS)
        program, n_points = self._programs.compute("deform/lobes.comp.glsl"), len(shape.owners)
        set_uniforms(
            program, n_points=n_points, n_lobes=shape.n_lobes, n_row_lobes=shape.n_row_lobes,
            first_row_layer=appearance.gloss.size, first_views=appearance.gloss.size + appearance.row_layers.size,
            table=appearance.table.shape[:2],
            camera_position=posed.camera_position, **_gloss(appearance), n_blockers=len(posed.blockers),
            added_light=1 + len(appearance.lights) if len(appearance.added) else -1,
            n_own_lights=len(appearance.lights) // 3,
            first_of_lamps=posed.places.size if len(posed.of_lamps) else -1,
            n_casters=appearance.casts.shape[1], spread=appearance.spread.tolist(), least=appearance.least,
        )  # fmt: skip
        program.run(-(-n_points // _GROUP))
        self._context.memory_barrier()

    def _draw_triangles(
        self, shape: ShapePart, appearance: AppearancePart, cover: CoverPart, view: dict[str, object]
    ) -> None:
        surface = self._surface(bool(len(cover.opacities)))
        self._bind(_OF_SURFACE)
        set_uniforms(surface, **view)
        self._triangles.draw(surface, self._buffers["corners"], (0, len(shape.corners) // 3))
        self._target.begin_terms()
        self._bind(_OF_COVER)
        for term in appearance.terms:
            self._draw_term(term, appearance, cover, view)

    def _draw_term(
        self, term: DeformTerm, appearance: AppearancePart, cover: CoverPart, view: dict[str, object]
    ) -> None:
        i, opacities = term.i_object, cover.opacities
        has_holes = bool(len(opacities)) and opacities[i, 0] > 0.0
        program = self._term(term.maps is not None, term.detail is not None, has_holes, term.emits)
        set_uniforms(program, **view, reflectance=term.reflectance, i_object=i)
        if term.maps is not None:
            set_uniforms(program, **map_uniforms(term.maps), n_strokes=cover.n_strokes)
        if term.detail is not None:
            set_uniforms(
                program, **_detail(term.detail), **_gloss(appearance), table=appearance.table.shape[:2],
                gloss_layer=term.gloss, own_light=int(appearance.objects[term.i_object, 8]),
                even=float(appearance.objects[term.i_object, 9]),
            )  # fmt: skip
        self._covered.draw(program, self._buffers["covered"], cover.ranges[term.i_object])

    def _bind(self, bindings: dict[str, int]) -> None:
        for name, binding in bindings.items():
            self._buffers[name].bind_to_storage_buffer(binding)

    def _term(self, has_maps: bool, has_detail: bool, has_holes: bool, emits: bool = False) -> moderngl.Program:
        switches = {"HAS_MAPS": int(has_maps), "HAS_DETAIL": int(has_detail), "HAS_HOLES": int(has_holes)}
        switches["EMITS"] = int(emits)
        return self._programs.get("deform/term.vert.glsl", "deform/term.frag.glsl", **switches)

    def _surface(self, has_holes: bool) -> moderngl.Program:
        return self._programs.get("deform/surface.vert.glsl", "deform/surface.frag.glsl", HAS_HOLES=int(has_holes))

    def forget(self) -> None:
        """Free the parts of a scene."""
        self._triangles.release()
        self._covered.release()
        for buffer in self._buffers.values():
            self._memory.release(buffer)
        self._buffers.clear()
        self._textures.release(self._backdrop)
        self._backdrop = self._shape = self._appearance = self._cover = self._backdrop_part = None

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
        "is_smooth": detail.is_smooth, "map_depth": detail.depth, "depth_image": detail.depth_image,
    }  # fmt: skip


def _gloss(appearance: AppearancePart) -> dict[str, object]:
    return {
        "n_angles": appearance.gloss.shape[1], "steepest": appearance.steepest, "cosine": appearance.cosine.tolist(),
    }  # fmt: skip


def _view(camera: Camera, size: tuple[int, int], posed: PosedPart) -> dict[str, object]:
    """The projection of triangles to the picture: uniforms of `surface.vert.glsl`."""
    forward = camera_frame(camera)[2]
    depths = posed.places[:, 9:] @ forward.astype(np.float32) - np.float32(np.dot(posed.camera_position, forward))
    farthest = max(float(depths.max(initial=0.0)), 1e-6) * 1.001
    return view_uniforms(
        camera, size, np.asarray(posed.camera_position), float(depths.min(initial=farthest)) * 0.999, farthest
    )
