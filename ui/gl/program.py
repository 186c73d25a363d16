"""Shaders from the ``shaders`` folder, programs made of them once, and passes that draw with them.

``#include "common/x.glsl"`` is relative to the folder and taken once; switches become ``#define`` lines after
``#version``. ``#line`` keeps the compiler's line numbers those of the file. An include may also be a text that was made
for the program, in place of a file (`ui.gl.brdf_stack`).

A pass is full-screen or one list of points, and sets all the state that matters each time. The interface draws in the
same context, so no state is assumed to be as it was left. A pass changes framebuffer, viewport, scissor, blending,
program and the texture units it names; other code sets its own before it draws.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import moderngl

from engine.texture.gpu_export import ExportedMaps
from ui.gl.context import GraphicsError

SHADER_FOLDER = Path(__file__).resolve().parents[2] / "shaders"
_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')


def load_shader(
    name: str,
    defines: Mapping[str, int] | None = None,
    folder: Path = SHADER_FOLDER,
    made: Mapping[str, str] | None = None,
) -> str:
    """The source of ``folder/name`` with its includes and switches in place; GraphicsError when one is missing.

    ``made``: texts, by the name that includes them, that are in no file.
    """
    lines = _expanded(name, folder, set(), made or {}).splitlines()
    if not lines or not lines[0].startswith("#version"):
        raise GraphicsError(f"shader {name}: the first line must be #version")
    switches = [f"#define {key} {value}" for key, value in (defines or {}).items()]
    return "\n".join([lines[0], *switches, "#line 2", *lines[1:], ""])


def _expanded(name: str, folder: Path, seen: set[str], made: Mapping[str, str]) -> str:
    seen.add(name)
    try:
        text = made[name] if name in made else (folder / name).read_text(encoding="utf-8")
    except OSError as failure:
        raise GraphicsError(f"shader {name} cannot be read: {failure}") from failure
    out: list[str] = []
    for number, line in enumerate(text.splitlines(), start=1):
        found = _INCLUDE.match(line)
        if found is None:
            out.append(line)
        elif found[1] not in seen:
            out += ["#line 1", _expanded(found[1], folder, seen, made), f"#line {number + 1}"]
        else:
            out.append("")
    return "\n".join(out)


class ProgramCache:
    """Programs of one context, each compiled when it is first requested."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._programs: dict[tuple[object, ...], moderngl.Program] = {}
        self._compute: dict[str, moderngl.ComputeShader] = {}

    def get(
        self, vertex: str, fragment: str, made: Mapping[str, str] | None = None, /, **defines: int
    ) -> moderngl.Program:
        """The program of two shader files; raises GraphicsError with the compiler's message.

        ``made``: texts that the fragment shader includes and that are in no file.
        """
        made = made or {}
        key = (vertex, fragment, tuple(sorted(defines.items())), tuple(sorted(made.items())))
        if key not in self._programs:
            self._programs[key] = self._compiled(vertex, fragment, defines, made)
        return self._programs[key]

    def compute(self, name: str) -> moderngl.ComputeShader:
        """The program of a compute shader's file, OpenGL 4.3; raises GraphicsError with the compiler's message."""
        if name not in self._compute:
            try:
                self._compute[name] = self._context.compute_shader(load_shader(name))
            except moderngl.Error as failure:
                raise GraphicsError(f"shader {name}: {failure}") from failure
        return self._compute[name]

    def _compiled(
        self, vertex: str, fragment: str, defines: Mapping[str, int], made: Mapping[str, str]
    ) -> moderngl.Program:
        sources = load_shader(vertex, defines), load_shader(fragment, defines, made=made)
        try:
            return self._context.program(vertex_shader=sources[0], fragment_shader=sources[1])
        except moderngl.Error as failure:
            raise GraphicsError(f"shader {vertex} with {fragment} {dict(defines)}: {failure}") from failure

    def release(self) -> None:
        for program in self._programs.values():
            program.release()
        for compute in self._compute.values():
            compute.release()
        self._programs.clear()
        self._compute.clear()


def set_uniforms(program: moderngl.Program | moderngl.ComputeShader, **values: object) -> None:
    """Set those that the program has: a compiler drops what a switch leaves out."""
    for name, value in values.items():
        member = program.get(name, None)
        if isinstance(member, moderngl.Uniform):
            member.value = value


# --------------------------------------------------------------------------------------------------------------- passes


Box = tuple[int, int, int, int]  # x, y, width, height in texels
Textures = Mapping[str, moderngl.Texture | moderngl.TextureArray | moderngl.Texture3D]


class Passes:
    """Programs, the empty vertex array and draw calls of one context."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._programs = ProgramCache(context)
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def full_screen(self, fragment: str, made: Mapping[str, str] | None = None, /, **defines: int) -> moderngl.Program:
        """The program of a fragment shader that runs once for each texel of the target's box.

        `made`: texts that it includes and that are in no file.
        """
        return self._programs.get("common/full_screen.vert.glsl", fragment, made, **defines)

    def points(self, name: str, **defines: int) -> moderngl.Program:
        """The program of ``placement/name`` that draws points."""
        return self._programs.get(f"placement/{name}.vert.glsl", f"placement/{name}.frag.glsl", **defines)

    def draw(
        self,
        program: moderngl.Program,
        target: moderngl.Framebuffer,
        box: Box,
        textures: Textures,
        *,
        add: bool = False,
        over: bool = False,
        **uniforms: Any,
    ) -> None:
        """Run `program` over `box` of `target`, replacing its content; with `add`, adding to it; with `over`, laid over
        it, its alpha multiplied into its colour."""
        self._prepare(target, box, add, over)
        _assign(program, textures, uniforms)
        if program.glo not in self._arrays:
            self._arrays[program.glo] = self.context.vertex_array(program, [])
        self._arrays[program.glo].render(moderngl.TRIANGLES, vertices=3)

    def draw_points(
        self,
        array: moderngl.VertexArray,
        target: moderngl.Framebuffer,
        textures: Textures,
        **uniforms: Any,
    ) -> None:
        """Draw each vertex of `array` as one pixel over the whole target."""
        self._prepare(target, (0, 0, target.width, target.height), add=False)
        _assign(array.program, textures, uniforms)
        array.render(moderngl.POINTS)

    def _prepare(self, target: moderngl.Framebuffer, box: Box, add: bool, over: bool = False) -> None:
        target.scissor = None  # type: ignore[assignment]  # off
        target.viewport = box
        target.use()
        target.color_mask = _ALL_CHANNELS[len(target.color_attachments)]  # type: ignore[assignment]
        self.context.enable_only(moderngl.PROGRAM_POINT_SIZE | (moderngl.BLEND if add or over else 0))
        self.context.wireframe = False
        if add or over:
            below = moderngl.ONE_MINUS_SRC_ALPHA if over else moderngl.ONE
            self.context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
            self.context.blend_func = moderngl.ONE, below  # type: ignore[assignment]

    def release(self) -> None:
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self._programs.release()


_ALL_CHANNELS = {n: ((True,) * 4,) * n if n > 1 else (True,) * 4 for n in range(1, 9)}


def uniform(program: moderngl.Program, name: str) -> moderngl.Uniform:
    """The uniform of that name, which the program must use."""
    member = program[name]
    assert isinstance(member, moderngl.Uniform)
    return member


def _assign(
    program: moderngl.Program,
    textures: Textures,
    uniforms: Mapping[str, Any],
) -> None:
    for unit, (name, texture) in enumerate(textures.items()):
        texture.use(unit)
        uniform(program, name).value = unit
    for name, value in uniforms.items():
        uniform(program, name).value = value


def map_uniforms(maps: ExportedMaps) -> dict[str, object]:
    return {
        "tint": maps.texture, "tint_repeats": maps.scale, "tint_strength": maps.strength,
        "other_tint": maps.other_texture, "other_tint_repeats": maps.other_scale,
        "has_vertex_colours": maps.vertex_colours, "weight": maps.weight, "weight_start": maps.start,
        "inverts": maps.inverts, "strokes": maps.strokes,
    }  # fmt: skip
