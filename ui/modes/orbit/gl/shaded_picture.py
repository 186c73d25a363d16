"""Moving pictures drawn on a graphics card from functions at points: the triple product in a compute shader.

    backdrop ─► emission, and depth ─► marks on the visible points
    for each term: gloss of the marked points towards the camera (gloss.comp) ─► its object's triangles, times its maps

Sharp gloss is not interpolated between points: each pixel asks the three points around it, and its layers' formulas
(sharp.glsl).

As `engine.realtime.triple_product.view_radiance` draws moving pictures, but with several samples per pixel: edges are
smooth. All is in buffers, filled part by part (`engine.realtime.core.gpu_parts`); in a frame only the camera is
sent.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.realtime.core.gpu_parts import (
    N_HEAD,
    BouncedPart,
    LightPart,
    MeshPart,
    OrbitPart,
    OrbitTerm,
    Range,
    SkyPart,
    TablePart,
    TermsPart,
    n_sharp,
)
from engine.scene.description import Camera
from engine.texture.gpu_export import ExportedMaps
from ui.gl.gpu_memory import BufferMemory, TextureMemory
from ui.gl.program import ProgramCache, map_uniforms, set_uniforms
from ui.gl.view_target import CornerArrays, ViewTarget, view_uniforms
from ui.modes.orbit.gl.sharp_gloss import SharpGloss

# ----------------------------------------------------------------------------------------------------------- the points


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
        self.terms: tuple[OrbitTerm, ...] = ()
        self.emission, self.cones = np.zeros((0, 3), np.float32), np.zeros((0, 4), np.float32)
        self.emission_maps: Mapping[int, ExportedMaps] = {}
        self.has_holes = np.zeros(0, bool)  # which objects
        self.tables: dict[int, Tables] = {}
        self.sky: moderngl.Texture | None = None
        self.turn, self.scale = 0.0, 1.0
        self.peak_ranges: tuple[Range, ...] = ()
        self.n_strokes = 0
        self._named: dict[str, moderngl.Buffer] = {}

    @property
    def is_ready(self) -> bool:
        """Whether there is something to draw."""
        return self.mesh is not None and self.sky is not None and "strokes" in self._named

    def __getitem__(self, name: str) -> moderngl.Buffer:
        return self._named[name]

    def take(self, part: OrbitPart) -> None:
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
        self.turn, self.scale, self.peak_ranges = part.turn, part.scale, part.peak_ranges
        self._replace("peaks", self._memory.filled(np.concatenate([part.peaks, np.zeros((1, 8), np.float32)])))
        if part.image is not None:
            made = self._textures.latlong(part.image)
            self._textures.release(self.sky)
            self.sky = made

    def _take_terms(self, part: TermsPart) -> None:
        self.terms, self.emission, self.cones = part.terms, part.emission, part.cones
        self.emission_maps = part.emission_maps
        self.has_holes = part.opacities[:, 0] > 0.0 if len(part.opacities) else np.zeros(len(part.emission), bool)
        self._replace("opacities", self._memory.filled(part.opacities))
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


# ---------------------------------------------------------------------------------------------------------- the picture


_CORNER = (("position", 3, "f"), ("face", 3, "f"), ("image_places", 4, "f"), ("sides", 2, "i"), ("first_way", 3, "f"),
           ("second_way", 3, "f"), ("packed_colour", 2, "i"))  # fmt: skip
_GROUPS = 32768  # of a compute shader, in one row
FIRST_SLICES = 8  # binding of the slices' four buffers
_NO_FORMULA = {"generated/brdf.glsl": ""}


def _slice_uniforms(shape: TablePart) -> dict[str, object]:
    """The layout of slices: uniforms of `slices.glsl`."""
    n_slices = shape.n_polar * shape.n_columns
    return {
        "grid": (shape.n_polar, shape.n_columns), "steepest": shape.steepest, "n_symmetries": len(shape.images),
        "n_entries": (len(shape.coefficients) // n_slices, len(shape.values) // n_slices),
        "n_images": (shape.images.shape[1], shape.places.shape[1]),
    }  # fmt: skip


class ShadedPicture:
    """The linear picture, from any camera."""

    def __init__(self, context: moderngl.Context, n_samples: int = 4) -> None:
        """n_samples: per pixel, for smooth edges; 0: only its centre."""
        self._context, self._programs = context, ProgramCache(context)
        self._target = ViewTarget(context, n_samples)
        self.buffers = PointBuffers(context, self._programs)
        self._arrays = CornerArrays(context, _CORNER)
        self._sharp = SharpGloss(context)
        self._number = 0
        self._query: moderngl.Query | None = None

    def warm_up(self) -> Iterator[None]:
        """Compile all shaders, one a step; raises GraphicsError."""
        for name in ("put", "gloss"):
            yield
            self._programs.compute(f"orbit/{name}.comp.glsl")
        for fragment in ("emitted", "seen"):
            yield
            self._program("emitted", fragment, HAS_HOLES=0, HAS_MAPS=0)
        for is_bumpy, has_maps in product((False, True), repeat=2):
            yield
            self._term_program(is_bumpy, has_maps, False)
        yield
        self._target.warm_up()

    def draw(
        self, camera: Camera, size: tuple[int, int], n_coefficients: int, transparent: bool = False
    ) -> moderngl.Texture:
        """The picture (width, height), row 0 at the top, with so many coefficients per point; transparent: without the
        environment, and with alpha. Raises GraphicsError."""
        buffers, mesh = self.buffers, self.buffers.mesh
        assert mesh is not None and buffers.sky is not None
        self._number += 1
        self._query = self._query or self._context.query(time=True)
        with self._query:
            self._target.begin(camera, size, buffers.sky, buffers.turn, buffers.scale, transparent)
            self._draw_surfaces(mesh, _view(camera, size, mesh), n_coefficients)
            return self._target.finish()

    def finish(self) -> None:
        """Wait until it is drawn."""
        self._context.finish()

    @property
    def seconds(self) -> float:
        """Seconds that the last picture took on the graphics card; waits for it."""
        return 0.0 if self._query is None else self._query.elapsed / 1e9

    def _draw_surfaces(self, mesh: MeshPart, view: dict[str, object], n_coefficients: int) -> None:
        buffers = self.buffers
        for binding, name in ((5, "images"), (6, "strokes"), (14, "opacities")):
            buffers[name].bind_to_storage_buffer(binding)
        for i, (emission, cone) in enumerate(zip(buffers.emission.tolist(), buffers.cones.tolist(), strict=True)):
            maps = buffers.emission_maps.get(i)
            holes, textured = int(buffers.has_holes[i]), int(maps is not None)
            emitted = self._program("emitted", "emitted", HAS_HOLES=holes, HAS_MAPS=textured)
            set_uniforms(emitted, **view, emission=tuple(emission), cone=tuple(cone), i_object=i)
            if maps is not None:
                set_uniforms(emitted, **map_uniforms(maps), n_strokes=buffers.n_strokes)
            self._draw_object(emitted, mesh, i)
        self._target.begin_terms()
        self._mark(mesh, view)
        self._sharp.follow(buffers.terms)
        for i, term in enumerate(buffers.terms):
            if term.tables in buffers.tables and not term.sharp:
                self._shade(mesh, term.i_object, buffers.tables[term.tables], view, n_coefficients)
            self._draw_term(mesh, i, view, n_coefficients)

    def _mark(self, mesh: MeshPart, view: dict[str, object]) -> None:
        """Mark the visible points of objects with blunt gloss."""
        program, buffers = self._program("emitted", "seen", HAS_HOLES=0, HAS_MAPS=0), self.buffers
        buffers["corners"].bind_to_storage_buffer(7)
        buffers["seen"].bind_to_storage_buffer(8)
        for i in sorted({term.i_object for term in buffers.terms if term.tables and not term.sharp}):
            set_uniforms(program, **view, picture=self._number)
            self._draw_object(program, mesh, i)

    def _shade(
        self, mesh: MeshPart, i_object: int, tables: Tables, view: dict[str, object], n_coefficients: int
    ) -> None:
        """The triple product at an object's visible points."""
        buffers, shape = self.buffers, tables.shape
        program = self._programs.compute("orbit/gloss.comp.glsl")
        named = [(0, buffers["points"]), (3, buffers["rows"]), (12, buffers["seen"]), (13, buffers["gloss"])]
        for binding, buffer in (*named, *enumerate(tables.buffers, FIRST_SLICES)):
            buffer.bind_to_storage_buffer(binding)
        set_uniforms(
            program, picture=self._number, camera_position=view["camera_position"], n_most=n_coefficients,
            row_words=buffers.row_words, **_slice_uniforms(shape),
        )  # fmt: skip
        self._context.memory_barrier()
        for first, last in mesh.point_ranges[i_object]:
            set_uniforms(program, range=(first, last))
            n_rows = -(-(last - first) // _GROUPS)
            program.run(min(last - first, _GROUPS), n_rows)
        self._context.memory_barrier()

    def _draw_term(self, mesh: MeshPart, i_term: int, view: dict[str, object], n_coefficients: int) -> None:
        buffers, term = self.buffers, self.buffers.terms[i_term]
        maps, bumps = term.maps, term.bumps
        # The program of sharp gloss is compiled in the first picture with layers of its models, while the window waits:
        # which they will be is not known before, and no edit of theirs compiles another.
        is_sharp, stack = bool(term.sharp) and term.tables in buffers.tables, self._sharp.stack(i_term)
        source = stack.source if is_sharp and stack is not None else None
        has_holes = bool(buffers.has_holes[term.i_object])
        program = self._term_program(bumps is not None, maps is not None, has_holes, is_sharp, source)
        for binding, name in enumerate(("points", "irradiance", "indirect", "rows", "gloss", "images", "strokes")):
            buffers[name].bind_to_storage_buffer(binding)
        set_uniforms(
            program, **view, row_words=buffers.row_words, reflectance=term.reflectance, sends_on=term.albedo,
            has_gloss=float(term.tables in buffers.tables), i_object=term.i_object,
        )  # fmt: skip
        if is_sharp:
            self._set_sharp(program, i_term, n_coefficients)
        if maps is not None:
            set_uniforms(program, **map_uniforms(maps), n_strokes=buffers.n_strokes)
        if bumps is not None:
            set_uniforms(
                program, slopes=bumps.slopes, slope_repeats=bumps.repeats, slope_scale=bumps.scale,
                is_normal_map=bumps.is_normal_map,
            )  # fmt: skip
        self._draw_object(program, mesh, term.i_object)

    def _term_program(
        self, is_bumpy: bool, has_maps: bool, has_holes: bool, is_sharp: bool = False,
        formula: Mapping[str, str] | None = None,
    ) -> moderngl.Program:  # fmt: skip
        """The program of terms; formula: the text of its layers' BRDF, see `BrdfStack.source`."""
        return self._programs.get(
            "orbit/term.vert.glsl", "orbit/term.frag.glsl", formula or _NO_FORMULA, IS_BUMPY=int(is_bumpy),
            HAS_MAPS=int(has_maps), HAS_HOLES=int(has_holes), IS_SHARP=int(is_sharp),
            HAS_FORMULA=int(formula is not None),
        )  # fmt: skip

    def _set_sharp(self, program: moderngl.Program, i_term: int, n_coefficients: int) -> None:
        """What a program of sharp gloss reads beside the rest."""
        buffers, stack = self.buffers, self._sharp.stack(i_term)
        term = buffers.terms[i_term]
        tables, (first, last) = buffers.tables[term.tables], buffers.peak_ranges[term.i_object]
        named = [(7, buffers["corners"]), (12, buffers["peaks"])]
        for binding, buffer in (*named, *enumerate(tables.buffers, FIRST_SLICES)):
            buffer.bind_to_storage_buffer(binding)
        set_uniforms(
            program, n_most=n_sharp(n_coefficients), first_peak=first, n_peaks=last - first,
            **_slice_uniforms(tables.shape),
        )  # fmt: skip
        if stack is not None:
            set_uniforms(program, **stack.numbers())
            for unit, (name, texture) in enumerate(stack.textures().items()):
                texture.use(unit)
                set_uniforms(program, **{name: unit})

    def _program(self, vertex: str, fragment: str, **switches: int) -> moderngl.Program:
        return self._programs.get(f"orbit/{vertex}.vert.glsl", f"orbit/{fragment}.frag.glsl", **switches)

    def _draw_object(self, program: moderngl.Program, mesh: MeshPart, i_object: int) -> None:
        self._arrays.draw(program, self.buffers["corners"], mesh.triangle_ranges[i_object])

    def forget(self) -> None:
        """Free the parts of a scene."""
        self.buffers.release()

    def release(self) -> None:
        """Free all."""
        self._target.release()
        self._sharp.release()
        self._arrays.release()
        self.buffers.release()
        self._programs.release()
        self._query = None

    @property
    def memory_bytes(self) -> int:
        """Bytes of buffers and textures, without the targets' several samples per pixel."""
        return self.buffers.memory_bytes + self._target.memory_bytes + self._sharp.memory_bytes


def _view(camera: Camera, size: tuple[int, int], mesh: MeshPart) -> dict[str, object]:
    """The projection of triangles to the picture: uniforms of `surface.glsl`."""
    camera_position = np.subtract(camera.position, mesh.origin)
    distance = float(np.linalg.norm(camera_position - mesh.centre))
    return view_uniforms(camera, size, camera_position, distance - mesh.radius, distance + mesh.radius)
