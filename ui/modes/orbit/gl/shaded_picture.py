"""Moving pictures drawn on a graphics card from functions at points: the triple product in a compute shader.

    backdrop ─► emission, and depth ─► marks on the visible points
    for each term: gloss of the marked points towards the camera (gloss.comp) ─► its object's triangles, times its maps

As `engine.realtime.triple_product.view_radiance` draws moving pictures, but with several samples per pixel: edges are
smooth. All is in buffers (`point_buffers`); in a frame only the camera is sent.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import moderngl
import numpy as np

from engine.realtime.triple_product.gpu_parts import ExportedTerm, MeshPart
from engine.scene.description import Camera
from ui.gl.layer_maps import map_uniforms
from ui.gl.program import ProgramCache, set_uniforms
from ui.gl.view_target import ViewTarget, view_uniforms
from ui.modes.orbit.gl.point_buffers import PointBuffers, Tables

_CORNER = (("position", 3, "f"), ("face", 3, "f"), ("image_place", 2, "f"), ("sides", 2, "i"), ("first_way", 3, "f"),
           ("second_way", 3, "f"))  # fmt: skip
_GROUPS = 32768  # of a compute shader, in one row


class ShadedPicture:
    """The linear picture, from any camera."""

    def __init__(self, context: moderngl.Context, n_samples: int = 4) -> None:
        """n_samples: per pixel, for smooth edges; 0: only its centre."""
        self._context, self._programs = context, ProgramCache(context)
        self._target = ViewTarget(context, n_samples)
        self.buffers = PointBuffers(context, self._programs)
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._corners: moderngl.Buffer | None = None
        self._number = 0
        self._query: moderngl.Query | None = None

    def warm_up(self) -> Iterator[None]:
        """Compile all shaders, one a step; raises GraphicsError."""
        for name in ("put", "gloss"):
            yield
            self._programs.compute(f"orbit/{name}.comp.glsl")
        for fragment in ("emitted", "seen"):
            yield
            self._program("emitted", fragment)
        for is_bumpy, has_maps in product((0, 1), repeat=2):
            yield
            self._program("term", "term", IS_BUMPY=is_bumpy, HAS_MAPS=has_maps)
        yield
        self._target.warm_up()

    def draw(self, camera: Camera, size: tuple[int, int], n_coefficients: int) -> moderngl.Texture:
        """The picture (width, height), row 0 at the top, with so many coefficients per point; raises GraphicsError."""
        buffers, mesh = self.buffers, self.buffers.mesh
        assert mesh is not None and buffers.sky is not None
        self._number += 1
        self._query = self._query or self._context.query(time=True)
        with self._query:
            target = self._target.begin(camera, size, buffers.sky, buffers.turn, buffers.scale)
            self._draw_surfaces(target, mesh, _view(camera, size, mesh), n_coefficients)
            return self._target.finish()

    def finish(self) -> None:
        """Wait until it is drawn."""
        self._context.finish()

    @property
    def seconds(self) -> float:
        """Seconds that the last picture took on the graphics card; waits for it."""
        return 0.0 if self._query is None else self._query.elapsed / 1e9

    def _draw_surfaces(
        self, target: moderngl.Framebuffer, mesh: MeshPart, view: dict[str, object], n_coefficients: int
    ) -> None:
        context, buffers = self._context, self.buffers
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"
        emitted = self._program("emitted", "emitted")
        for i, emission in enumerate(buffers.emission):
            set_uniforms(emitted, **view, emission=tuple(map(float, emission)))
            self._draw_object(emitted, mesh, i)
        target.depth_mask, context.depth_func = False, "<="
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        context.blend_func = moderngl.ONE, moderngl.ONE  # type: ignore[assignment]
        self._mark(mesh, view)
        for term in buffers.terms:
            if term.tables in buffers.tables:
                self._shade(mesh, term.i_object, buffers.tables[term.tables], view, n_coefficients)
            self._draw_term(mesh, term, view)
        target.depth_mask = True
        context.enable_only(moderngl.NOTHING)

    def _mark(self, mesh: MeshPart, view: dict[str, object]) -> None:
        """Mark the visible points of objects with gloss."""
        program, buffers = self._program("emitted", "seen"), self.buffers
        buffers["corners"].bind_to_storage_buffer(7)
        buffers["seen"].bind_to_storage_buffer(8)
        for i in sorted({term.i_object for term in buffers.terms if term.tables}):
            set_uniforms(program, **view, picture=self._number)
            self._draw_object(program, mesh, i)

    def _shade(
        self, mesh: MeshPart, i_object: int, tables: Tables, view: dict[str, object], n_coefficients: int
    ) -> None:
        """The triple product at an object's visible points."""
        buffers, shape = self.buffers, tables.shape
        program = self._programs.compute("orbit/gloss.comp.glsl")
        named = [(0, buffers["points"]), (3, buffers["rows"]), (8, buffers["seen"]), (9, buffers["gloss"])]
        for binding, buffer in (*named, *enumerate(tables.buffers, 4)):
            buffer.bind_to_storage_buffer(binding)
        n_slices = shape.n_polar * shape.n_columns
        set_uniforms(
            program, picture=self._number, eye=view["eye"], n_most=n_coefficients, row_words=buffers.row_words,
            grid=(shape.n_polar, shape.n_columns), steepest=shape.steepest, n_symmetries=len(shape.images),
            n_entries=(len(shape.coefficients) // n_slices, len(shape.values) // n_slices),
            n_images=(shape.images.shape[1], shape.places.shape[1]),
        )  # fmt: skip
        self._context.memory_barrier()
        for first, last in mesh.point_ranges[i_object]:
            set_uniforms(program, range=(first, last))
            n_rows = -(-(last - first) // _GROUPS)
            program.run(min(last - first, _GROUPS), n_rows)
        self._context.memory_barrier()

    def _draw_term(self, mesh: MeshPart, term: ExportedTerm, view: dict[str, object]) -> None:
        buffers, maps, bumps = self.buffers, term.maps, term.bumps
        program = self._program("term", "term", IS_BUMPY=int(bumps is not None), HAS_MAPS=int(maps is not None))
        for binding, name in enumerate(("points", "irradiance", "indirect", "rows", "gloss", "images", "strokes")):
            buffers[name].bind_to_storage_buffer(binding)
        set_uniforms(
            program, **view, row_words=buffers.row_words, reflectance=term.reflectance, sends_on=term.albedo,
            has_gloss=float(term.tables in buffers.tables),
        )  # fmt: skip
        if maps is not None:
            set_uniforms(program, **map_uniforms(maps), n_strokes=buffers.n_strokes)
        if bumps is not None:
            set_uniforms(
                program, slopes=bumps.slopes, slope_repeats=bumps.repeats, slope_scale=bumps.scale,
                is_normal_map=bumps.is_normal_map,
            )  # fmt: skip
        self._draw_object(program, mesh, term.i_object)

    def _program(self, vertex: str, fragment: str, **switches: int) -> moderngl.Program:
        return self._programs.get(f"orbit/{vertex}.vert.glsl", f"orbit/{fragment}.frag.glsl", **switches)

    def _draw_object(self, program: moderngl.Program, mesh: MeshPart, i_object: int) -> None:
        first, last = mesh.triangle_ranges[i_object]
        if last > first:
            self._array(program).render(moderngl.TRIANGLES, vertices=3 * (last - first), first=3 * first)

    def _array(self, program: moderngl.Program) -> moderngl.VertexArray:
        corners = self.buffers["corners"]
        if corners is not self._corners:
            self._release_arrays()
            self._corners = corners
        if program.glo not in self._arrays:
            used = [name for name, _, _ in _CORNER if name in program]
            layout = " ".join(f"{n}{kind if name in program else 'x'}4" for name, n, kind in _CORNER)
            self._arrays[program.glo] = self._context.vertex_array(program, [(corners, layout, *used)])
        return self._arrays[program.glo]

    def _release_arrays(self) -> None:
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self._corners = None

    def forget(self) -> None:
        """Free the parts of a scene."""
        self.buffers.release()

    def release(self) -> None:
        """Free all."""
        self._target.release()
        self._release_arrays()
        self.buffers.release()
        self._programs.release()
        self._query = None

    @property
    def memory_bytes(self) -> int:
        """Bytes of buffers and textures, without the targets' several samples per pixel."""
        return self.buffers.memory_bytes + self._target.memory_bytes


def _view(camera: Camera, size: tuple[int, int], mesh: MeshPart) -> dict[str, object]:
    """The projection of triangles to the picture: uniforms of `surface.glsl`."""
    eye = np.subtract(camera.position, mesh.origin)
    distance = float(np.linalg.norm(eye - mesh.centre))
    return view_uniforms(camera, size, eye, distance - mesh.radius, distance + mesh.radius)
