"""Draws the interface's triangle lists (imgui) into the bound framebuffer.

    imgui draw data ──► vertex + index buffer ──► one draw call a command, clipped ──► screen or framebuffer
    imgui textures (glyph atlas) ──► created, updated, destroyed when imgui requests it

Written on moderngl so that one library makes every GL call of the process, in the window and without one (rejected:
imgui-bundle's PyOpenGL backend, whose platform must be set before its import, and which saves and restores some thirty
pieces of state a frame).
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import moderngl
import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

INDEX_BYTES = 4
SHADERS = Path(__file__).resolve().parents[2] / "shaders" / "interface"


class InterfaceRenderer:
    """Owns the interface's program, buffers and textures, for one imgui context and one GL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = context.program(
            vertex_shader=(SHADERS / "interface_vertex.glsl").read_text(encoding="utf-8"),
            fragment_shader=(SHADERS / "interface_fragment.glsl").read_text(encoding="utf-8"),
        )
        self._textures: dict[int, moderngl.Texture] = {}
        self._vertices = context.buffer(reserve=1 << 18, dynamic=True)
        self._indices = context.buffer(reserve=1 << 17, dynamic=True)
        self._array = self._vertex_array()
        io = imgui.get_io()
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
        limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        imgui.get_platform_io().renderer_texture_max_width = limit
        imgui.get_platform_io().renderer_texture_max_height = limit

    def register(self, texture: moderngl.Texture) -> imgui.ImTextureRef:
        """Make `texture` drawable by panels; its GL name is the reference. Registering again is free."""
        self._textures[texture.glo] = texture
        return imgui.ImTextureRef(texture.glo)

    def substitute(self, reference: int, texture: moderngl.Texture | None) -> None:
        """Draw `texture` where panels of this frame refer to `reference`, which has been released meanwhile."""
        if texture is None:
            self._textures.pop(reference, None)
        else:
            self._textures[reference] = texture

    def render(self, target: moderngl.Framebuffer) -> None:
        """Draw what imgui.render() collected into `target`, which must be the size of imgui's display."""
        data = imgui.get_draw_data()
        self._update_textures()
        width, height = int(data.display_size.x), int(data.display_size.y)
        if width <= 0 or height <= 0:
            return
        target.use()
        context = self._context
        context.viewport = (0, 0, width, height)
        context.enable_only(moderngl.BLEND)
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._program["display_size"] = (float(width), float(height))
        lists = list(data.cmd_lists)
        for commands, first_index in zip(lists, self._upload(lists) if lists else (), strict=True):
            self._draw(commands, first_index, height)
        context.scissor = None
        context.disable(moderngl.BLEND)

    def release(self) -> None:
        """Free all GL objects made here."""
        for texture in imgui.get_platform_io().textures:
            if texture.tex_id:
                self._destroy(texture)
        for thing in (self._array, self._vertices, self._indices, self._program):
            thing.release()
        imgui.get_io().backend_flags &= ~imgui.BackendFlags_.renderer_has_textures

    def _vertex_array(self) -> moderngl.VertexArray:
        return self._context.vertex_array(
            self._program,
            [(self._vertices, "2f 2f 4f1", "in_position", "in_uv", "in_colour")],
            index_buffer=self._indices,
            index_element_size=INDEX_BYTES,
        )

    def _draw(self, commands: imgui.ImDrawList, first_index: int, height: int) -> None:
        """The commands of one list, whose indices begin at `first_index` of the shared buffer."""
        for command in commands.cmd_buffer:
            x0, y0, x1, y1 = command.clip_rect
            texture = self._textures.get(command.get_tex_id())
            if command.elem_count == 0 or x1 <= x0 or y1 <= y0 or texture is None:
                continue
            texture.use(0)
            self._context.scissor = (int(x0), int(height - y1), int(x1 - x0), int(y1 - y0))
            self._array.render(moderngl.TRIANGLES, vertices=command.elem_count, first=first_index + command.idx_offset)

    def _upload(self, lists: list[imgui.ImDrawList]) -> list[int]:
        """Upload all lists into one pair of buffers, which is cheaper than a pair each; returns where each list's
        indices begin."""
        vertices = [_bytes_of(each.vtx_buffer, imgui.VERTEX_SIZE) for each in lists]
        kind = np.uint16 if imgui.INDEX_SIZE == 2 else np.uint32
        indices = [_bytes_of(each.idx_buffer, imgui.INDEX_SIZE).view(kind) for each in lists]
        first_vertices = np.cumsum([0, *(len(part) // imgui.VERTEX_SIZE for part in vertices)])
        first_indices = np.cumsum([0, *map(len, indices)])
        vertex_data = np.concatenate(vertices)
        index_data = np.concatenate(
            [part.astype(np.uint32) + np.uint32(first) for part, first in zip(indices, first_vertices, strict=False)]
        )
        if vertex_data.nbytes > self._vertices.size or index_data.nbytes > self._indices.size:
            self._grow(vertex_data.nbytes, index_data.nbytes)
        self._vertices.orphan()
        self._indices.orphan()
        self._vertices.write(vertex_data)
        self._indices.write(index_data)
        return [int(first) for first in first_indices[:-1]]

    def _grow(self, vertex_bytes: int, index_bytes: int) -> None:
        for thing in (self._array, self._vertices, self._indices):
            thing.release()
        self._vertices = self._context.buffer(reserve=2 * vertex_bytes, dynamic=True)
        self._indices = self._context.buffer(reserve=2 * index_bytes, dynamic=True)
        self._array = self._vertex_array()

    def _update_textures(self) -> None:
        for texture in imgui.get_platform_io().textures:
            if texture.status == imgui.ImTextureStatus.want_create:
                self._create(texture)
            elif texture.status == imgui.ImTextureStatus.want_updates:
                self._update(texture)
            elif texture.status == imgui.ImTextureStatus.want_destroy and texture.unused_frames > 0:
                self._destroy(texture)

    def _create(self, texture: imgui.ImTextureData) -> None:
        pixels = texture.get_pixels_array()
        made = self._context.texture((texture.width, texture.height), 4, pixels.tobytes())
        made.filter = (moderngl.LINEAR, moderngl.LINEAR)
        made.repeat_x = made.repeat_y = False
        self._textures[made.glo] = made
        texture.set_tex_id(made.glo)
        texture.status = imgui.ImTextureStatus.ok

    def _update(self, texture: imgui.ImTextureData) -> None:
        made = self._textures[texture.tex_id]
        pixels = texture.get_pixels_array().reshape(texture.height, texture.width, 4)
        for box in texture.updates:
            part = pixels[box.y : box.y + box.h, box.x : box.x + box.w]
            made.write(part.tobytes(), viewport=(box.x, box.y, box.w, box.h))
        texture.status = imgui.ImTextureStatus.ok

    def _destroy(self, texture: imgui.ImTextureData) -> None:
        self._textures.pop(texture.tex_id).release()
        texture.set_tex_id(0)
        texture.status = imgui.ImTextureStatus.destroyed


def _bytes_of(vector: imgui.ImVector_ImDrawVert | imgui.ImVector_ImDrawIdx, size: int) -> NDArray[np.uint8]:
    """A view of the memory of one of imgui's arrays, valid until its next frame."""
    n_bytes = vector.size() * size
    if n_bytes == 0:
        return np.zeros(0, np.uint8)
    return np.ctypeslib.as_array((ctypes.c_uint8 * n_bytes).from_address(vector.data_address()))
