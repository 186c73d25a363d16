"""Draws one full-screen pass or one list of points, with all the state that matters set each time.

The interface draws in the same context, so no state is assumed to be as it was left. A pass changes framebuffer,
viewport, scissor, blending, program and the texture units it names; other code sets its own before it draws.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import moderngl

from ui.gl.program import ProgramCache

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
        **uniforms: Any,
    ) -> None:
        """Run `program` over `box` of `target`, replacing its content or, with `add`, adding to it."""
        self._prepare(target, box, add)
        _assign(program, textures, uniforms)
        self._triangle(program).render(moderngl.TRIANGLES, vertices=3)

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

    def _prepare(self, target: moderngl.Framebuffer, box: Box, add: bool) -> None:
        target.scissor = None  # type: ignore[assignment]  # off
        target.viewport = box
        target.use()
        target.color_mask = _ALL_CHANNELS[len(target.color_attachments)]  # type: ignore[assignment]
        self.context.enable_only(moderngl.PROGRAM_POINT_SIZE | (moderngl.BLEND if add else 0))
        self.context.wireframe = False
        if add:
            self.context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
            self.context.blend_func = moderngl.ONE, moderngl.ONE  # type: ignore[assignment]

    def _triangle(self, program: moderngl.Program) -> moderngl.VertexArray:
        if program.glo not in self._arrays:
            self._arrays[program.glo] = self.context.vertex_array(program, [])
        return self._arrays[program.glo]

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
