"""Whether the graphics card draws the moving pictures of Orbit and Deform, or the worker, where OpenGL is software."""

from __future__ import annotations

import os

import moderngl

from ui.gl.buffers import most_buffer_bytes
from ui.gl.context import GraphicsError, describe_context, is_software

# "shader" or "worker" overrides the choice by the renderer.
VARIABLE = "INSITU_MOVING"
_VERSION = 430
# Buffers that the shaders of one stage read.
_LIMITS = {
    "GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS": 5,
    "GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS": 4,
    "GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS": 8,
}  # fmt: skip


def shader_bytes(context: moderngl.Context) -> int:
    """The largest size of one buffer in bytes, where shaders draw; 0 where the worker does.

    Raises GraphicsError where shaders are requested and not available, or the variable has another value.
    """
    requested = os.environ.get(VARIABLE, "")
    if requested not in ("", "shader", "worker"):
        raise GraphicsError(f'{VARIABLE} = "{requested}", expected "shader" or "worker"')
    if requested == "worker" or not requested and is_software(context):
        return 0
    has_shaders = context.version_code >= _VERSION
    if not has_shaders or any(context.info.get(name, 0) < needed for name, needed in _LIMITS.items()):
        if requested:
            raise GraphicsError(f"compute shaders of OpenGL 4.3 are needed, found {describe_context(context)}")
        return 0
    return most_buffer_bytes(context)
