"""Checks whether a window can be opened here, by opening and closing one in a separate process.

A separate one, because a display that refuses ends the process inside Xlib, without an exception in Python.
"""

from __future__ import annotations

import subprocess
import sys

import glfw

from app.system.lazy_import import IMPORT_FOLDER, qualified
from engine.core.errors import InsituError
from ui.gl.context import create_window_context, describe_context
from ui.window import NoDisplay, open_glfw_window

PATIENCE_SECONDS = 30.0


def describe_display() -> str:
    """The display's size and the OpenGL of a window on it. Raises NoDisplay with the reason where there is none."""
    command = [sys.executable, "-m", qualified("ui.display")]
    try:
        done = subprocess.run(command, cwd=IMPORT_FOLDER, capture_output=True, text=True, timeout=PATIENCE_SECONDS)
    except subprocess.TimeoutExpired:
        raise NoDisplay(f"no window after {PATIENCE_SECONDS:.0f} s") from None
    if done.returncode == 0:
        return done.stdout.strip()
    said = done.stderr.strip().splitlines()
    raise NoDisplay(said[-1] if said else f"the process that opened a window ended with status {done.returncode}")


def try_window() -> str:
    """Open a window in this process, close it, and return what it had. Raises NoDisplay or GraphicsError."""
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


def main() -> int:
    """Print the description, or the reason on standard error."""
    try:
        print(try_window())
    except InsituError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
