"""The window without a display: the same frames in a framebuffer, the same events as a mouse and a keyboard make.

`insitu screenshot` and the tests run this. The pointer moves in steps, one frame each, because the effect of a drag may
depend on the frames between. The pixels of most frames are never read, and to fill them is two thirds of a frame's work
where OpenGL is software: each is drawn into a single pixel, and into all of them when they are read.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from app.editor.editor import Editor
from app.system.atomic import make_folder_of, save_file
from engine.render.display import pixels_png
from ui.frame_times import FrameResult
from ui.gl.context import create_headless_context
from ui.shell import Shell

FRAME_SECONDS = 1.0 / 60.0
# The time between two checks for the worker's responses while nothing is drawn: the processors are the worker's.
POLL_SECONDS = 0.01
DRAG_STEPS = 6
DEFAULT_SIZE = (1280, 800)


class HeadlessWindow:
    """A window of `size` framebuffer pixels at `scale`; each frame and poll advances its own clock."""

    def __init__(
        self,
        editor: Editor,
        *,
        size: tuple[int, int] = DEFAULT_SIZE,
        scale: float = 1.0,
        context: moderngl.Context | None = None,
        layout_file: Path | None = None,
    ) -> None:
        self.context = context or create_headless_context()
        self.size = size
        self._make_target()
        self._pixel = self.context.simple_framebuffer((1, 1))
        self._is_filled = False
        self.shell = Shell(self.context, editor, scale=scale, layout_file=layout_file, clock=self._now)
        self._time = 0.0

    def _now(self) -> float:
        return getattr(self, "_time", 0.0)

    def resize(self, size: tuple[int, int]) -> None:
        """Give the window another size, in framebuffer pixels."""
        old = self._target, self._texture
        self.size = size
        self._make_target()
        self._target.use()  # a framebuffer that is bound cannot be released
        for thing in old:
            thing.release()
        self.shell.pacing.note_change()

    def frame(self) -> FrameResult:
        """Process the worker's responses and draw one frame; saves a picture if a button requested one."""
        self.poll()
        return self.draw()

    def poll(self, telling: bool = False) -> bool:
        """Process the worker's responses; returns whether the picture, or with `telling` anything, has to be drawn
        again."""
        self._time += FRAME_SECONDS
        return self.shell.idle(self._time) if telling else self.shell.take(self._time)

    def prepare(self) -> None:
        """Update the picture, as a window does before it draws what the worker sent."""
        self.shell.prepare()

    def draw(self) -> FrameResult:
        """Draw a frame without processing responses."""
        started = time.perf_counter()
        result = self.shell.frame(self._pixel, self.size, self._time)
        self._is_filled = self._is_filled and not result.drawn
        self.context.finish()  # as the swap of a window's buffers does: frames never pile up
        self.shell.note_frame_time(1e3 * (time.perf_counter() - started))
        if result.screenshot is not None:
            self.save(result.screenshot)
        return result

    def frames(self, count: int) -> None:
        """Draw several frames."""
        for _ in range(count):
            self.frame()

    def run_until(self, done: Callable[[], bool], timeout: float) -> bool:
        """Wait until `done()`, at most `timeout` seconds of real time; returns whether it came true.

        A frame is drawn when the picture is to change, not for progress, which nothing reads; the first at once.
        """
        end = time.monotonic() + timeout
        busy = True
        while not done():
            if time.monotonic() > end:
                return False
            busy = self.step(busy)
        return True

    def step(self, busy: bool) -> bool:
        """One step of waiting: a poll, and a frame if it is needed or the last was `busy`; returns whether this one
        is."""
        if self.poll() or busy:
            self.prepare()
            return self.draw().busy
        time.sleep(POLL_SECONDS)
        return False

    # ------------------------------------------------------------------------------------------------------------ input

    def move(self, x: float, y: float) -> None:
        """Move the mouse there, in framebuffer pixels."""
        self.shell.pacing.note_input()
        self.shell.events.move(x, y)
        self.frame()

    def leave(self) -> None:
        """Move the mouse out of the window, so that no tooltip or hover colour stays."""
        self.shell.events.move(-sys.float_info.max, -sys.float_info.max)
        self.frames(2)

    def press(self, button: int = 0) -> None:
        """Press a mouse button: 0 left, 1 right, 2 middle."""
        self.shell.events.button(button, True)
        self.frame()

    def release(self, button: int = 0) -> None:
        """Release the button."""
        self.shell.events.button(button, False)
        self.frame()
        self.frame()

    def click(self, x: float, y: float, button: int = 0) -> None:
        """Press and release at a place."""
        self.move(x, y)
        self.frame()
        self.press(button)
        self.release(button)

    def wheel(self, amount: float) -> None:
        """Turn the wheel, positive forward, away from the user."""
        self.shell.events.wheel(0.0, amount)
        self.frames(2)

    def drag(
        self, start: tuple[float, float], end: tuple[float, float], *, button: int = 0, steps: int = DRAG_STEPS
    ) -> None:
        """Press at `start`, move to `end` in steps, release."""
        self.move(*start)
        self.frame()
        self.press(button)
        for step in range(1, steps + 1):
            share = step / steps
            self.move(start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
        self.release(button)

    def drag_handle(self, name: str, by: tuple[float, float], *, steps: int = DRAG_STEPS) -> None:
        """Drag a named handle by so many pixels; KeyError lists the handles there are."""
        self.frame()
        x, y = self.shell.handle_position(name)
        self.drag((x, y), (x + by[0], y + by[1]), steps=steps)

    def click_handle(self, name: str) -> None:
        """Click a named control."""
        self.frame()
        self.click(*self.shell.handle_position(name))

    def key(self, key: imgui.Key, *modifiers: imgui.Key) -> None:
        """Press and release a key together with modifiers (`imgui.Key.mod_ctrl`, ...)."""
        self.shell.pacing.note_input()
        for part in (*modifiers, key):
            self.shell.events.key(part, True)
        self.frame()
        for part in (key, *modifiers):
            self.shell.events.key(part, False)
        self.frame()
        self.frame()

    def hold(self, key: imgui.Key, down: bool) -> None:
        """Hold a modifier down, or release it."""
        self.shell.events.key(key, down)
        self.frame()

    def type(self, text: str) -> None:
        """Type characters."""
        for character in text:
            self.shell.events.character(ord(character))
        self.frames(2)

    # ------------------------------------------------------------------------------------------------------ the picture

    def pixels(self) -> NDArray[np.uint8]:
        """The window's pixels (H,W,3), row 0 at the top."""
        if not self._is_filled:
            self.shell.draw_interface(self._target)
            self._is_filled = True
        data = np.frombuffer(self._target.read(components=3, alignment=1), dtype=np.uint8)
        return data.reshape(self.size[1], self.size[0], 3)[::-1].copy()

    def save(self, file: Path) -> None:
        """Write the window's pixels to a PNG. Raises InsituError."""
        make_folder_of(file)
        save_file(file, pixels_png(self.pixels()))

    def close(self) -> None:
        """Free what was made here; a context that was passed in stays."""
        self.shell.close()
        for thing in (self._pixel, self._target, self._texture):
            thing.release()

    def _make_target(self) -> None:
        self._texture = self.context.texture(self.size, 4)
        self._target = self.context.framebuffer([self._texture])
