"""Opening OpenGL 4.1 core or later, with or without a window.

4.1 is the last version of Macs; nothing on the required path needs more. The shaders of moving pictures need 4.3,
which is asked for first: Mesa gives the latest version that it has, NVIDIA's driver the very version that is asked for.
A typed error says what was found, what is needed and what to install.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import moderngl
import platformdirs

from engine.core.errors import InsituError

REQUIRED_VERSION = 410
_SHADER_VERSION = 430
_ROOM_FOR_SHADERS = 64 << 20
# Parts of the names of renderers that have no graphics card.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader", "software", "gdi generic", "microsoft basic render")
_INSTALL = "install a driver or Mesa (Debian: libegl1 libgl1 libgl1-mesa-dri)"
# What the passes rely on; each is within the minimum that OpenGL 4.1 promises, but old drivers are checked.
_REQUIRED_LIMITS = {
    "GL_MAX_COLOR_ATTACHMENTS": 8,
    "GL_MAX_ARRAY_TEXTURE_LAYERS": 512,
    "GL_MAX_TEXTURE_SIZE": 4096,
    "GL_MAX_FRAGMENT_UNIFORM_COMPONENTS": 1024,
}


class GraphicsError(InsituError):
    """OpenGL is missing, too old, out of memory, or a shader does not compile."""


def spare_full_disk() -> None:
    """Before the first context: Mesa maps the file of its shader cache without reserving space, so that a full disk
    ends the process by SIGBUS. Without that cache shaders are compiled at each start."""
    folder = Path(platformdirs.user_cache_dir()).absolute()
    there = next(each for each in (folder, *folder.parents) if each.is_dir())
    if shutil.disk_usage(there).free < _ROOM_FOR_SHADERS:
        os.environ["MESA_SHADER_CACHE_DISABLE"] = "true"


def create_headless_context(require: int = REQUIRED_VERSION) -> moderngl.Context:
    """A context without window or display, through EGL; raises GraphicsError where there is none."""
    spare_full_disk()
    failures: list[Exception] = []
    for version in versions_to_ask(require):
        try:
            context = moderngl.create_context(standalone=True, require=version, backend="egl")  # type: ignore[arg-type]
        except Exception as failure:
            failures.append(failure)
        else:
            return _checked(context, require)
    raise GraphicsError(_cannot_open(require, failures[-1])) from failures[-1]


def versions_to_ask(require: int) -> tuple[int, ...]:
    """The versions that a driver is asked for in turn, until it has one: that of all shaders, and the required one."""
    return (_SHADER_VERSION, require) if require < _SHADER_VERSION else (require,)


def create_window_context(require: int = REQUIRED_VERSION) -> moderngl.Context:
    """The context that is current in this thread (a window's); raises GraphicsError when it is too old."""
    try:
        context = moderngl.create_context(require=require)
    except Exception as failure:
        raise GraphicsError(_cannot_open(require, failure)) from failure
    return _checked(context, require)


def describe_context(context: moderngl.Context) -> str:
    """Renderer and version on one line."""
    return f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"


def is_software(context: moderngl.Context) -> bool:
    """Whether its OpenGL runs on the processor."""
    renderer = context.info["GL_RENDERER"].lower()
    return any(name in renderer for name in _SOFTWARE)


def _checked(context: moderngl.Context, require: int) -> moderngl.Context:
    if context.version_code < require:
        raise GraphicsError(f"OpenGL {_dotted(require)} core is needed, found {describe_context(context)}; {_INSTALL}")
    for name, needed in _REQUIRED_LIMITS.items():
        found = context.info[name]
        if found < needed:
            raise GraphicsError(f"{name} = {found}, at least {needed} is needed ({describe_context(context)})")
    return context


def _cannot_open(require: int, failure: Exception) -> str:
    return f"OpenGL {_dotted(require)} core is needed, none could be opened ({failure}); {_INSTALL}"


def _dotted(version: int) -> str:
    return f"{version // 100}.{version // 10 % 10}"


# ---------------------------------- whether the graphics card draws moving pictures, or the worker where it is software

# "shader" or "worker" overrides the choice by the renderer.
MOVING_VARIABLE = "INSITU_MOVING"
# Buffers that the shaders of one stage read.
_SHADER_LIMITS = {
    "GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS": 5,
    "GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS": 4,
    "GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS": 8,
}  # fmt: skip


def shader_bytes(context: moderngl.Context) -> int:
    """The largest size of one buffer in bytes, where shaders draw; 0 where the worker does.

    Raises GraphicsError where shaders are requested and not available, or the variable has another value.
    """
    requested = os.environ.get(MOVING_VARIABLE, "")
    if requested not in ("", "shader", "worker"):
        raise GraphicsError(f'{MOVING_VARIABLE} = "{requested}", expected "shader" or "worker"')
    if requested == "worker" or not requested and is_software(context):
        return 0
    has_shaders = context.version_code >= _SHADER_VERSION
    if not has_shaders or any(context.info.get(name, 0) < needed for name, needed in _SHADER_LIMITS.items()):
        if requested:
            raise GraphicsError(f"compute shaders of OpenGL 4.3 are needed, found {describe_context(context)}")
        return 0
    return most_buffer_bytes(context)


def most_buffer_bytes(context: moderngl.Context) -> int:
    """The largest size of one buffer that shaders can read; 0 where they can read none."""
    return int(context.info.get("GL_MAX_SHADER_STORAGE_BLOCK_SIZE", 0))
