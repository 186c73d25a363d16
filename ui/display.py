"""Whether a window can be opened here: a small one is, and closed again without being shown."""

from __future__ import annotations

import glfw

from ui.gl.context import create_window_context, describe_context
from ui.window import open_glfw_window


def describe_display() -> str:
    """The display's size and the OpenGL of a window on it. Raises NoDisplay or GraphicsError."""
    handle = open_glfw_window()
    try:
        glfw.hide_window(handle)
        context = create_window_context()
        monitor = glfw.get_primary_monitor()
        size = glfw.get_video_mode(monitor).size if monitor else None
        words = describe_context(context)
        context.release()
        return words if size is None else f"{size.width} x {size.height}, {words}"
    finally:
        glfw.destroy_window(handle)
        glfw.terminate()
