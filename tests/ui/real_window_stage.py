"""The window's process of `tests.ui.real_window`: brings events in, and answers what is asked between frames.

Started by hand, `python -m tests.ui.real_window_stage` is of no use by itself.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from typing import Any

Event = tuple[Any, ...]
VIEW_OF_THE_START = (
    "hovered", "exposure", "tone_mapping", "compare", "compare_divider", "fit", "zoom", "centre", "log_y", "curve_zoom",
    "channel", "active_tool", "regions", "operator", "solo", "lobe_pixel", "brdf_plot", "brdf_whole", "brdf_across",
    "panels", "show_shortcuts", "mode", "gamma", "picture_channel", "zebra", "stored", "difference", "crop", "probes",
    "looks_shown",
)  # fmt: skip
CALLBACKS = ("Key", "Char", "CursorPos", "MouseButton", "Scroll", "Drop", "WindowFocus")


class Stage:
    """The window's side: brings events in while GLFW takes its own, answers questions between frames."""

    def __init__(self, pipe: Connection, client: Any, size: tuple[int, int]) -> None:
        self.window: Any = None
        self._pipe, self._client, self._size = pipe, client, size
        self._calls: list[tuple[str, tuple[Any, ...]]] = []
        self._lock = threading.Lock()
        self._frames = self._heard_in = 0
        self._slow = self._paused = 0.0
        self._busy = True
        self._shot: str | None = None
        self._mouse = (0.0, 0.0)
        self._source: str | None = None
        self._left: Any = None
        self._callbacks: dict[str, Callable[..., None]] = {}
        self._is_filled = True
        self._hook()

    def on_frame(self, window: Any) -> bool:
        """After each frame of the window's loop."""
        import glfw

        self._frames += 1
        if self.window is None:
            glfw.set_window_size(window.handle, *self._size)
            self.window = window
            self._watch(window)
            self._spare_pixels(window)
            self._double_within(0.0)
            self._callbacks = {name: self._c_callback(name) for name in CALLBACKS}
            threading.Thread(target=self._listen, daemon=True).start()
        return False

    def _watch(self, window: Any) -> None:
        """Notice whether each frame asks for another at once."""
        frame = window._frame

        def watched() -> Any:
            result = frame()
            self._busy = result.busy
            return result

        window._frame = watched

    def _spare_pixels(self, window: Any) -> None:
        """Draw frames that nobody looks at into a single pixel, and show none of them."""
        draw, save, pixel = window.shell.draw_interface, window._save, window._context.simple_framebuffer((1, 1))

        def drawn(target: Any) -> None:
            self._is_filled = self._shot is not None
            draw(target if self._is_filled else pixel)

        def saved(file: Any, size: tuple[int, int]) -> None:
            draw(window._context.screen)
            save(file, size)

        window.shell.draw_interface, window._save = drawn, saved

    def _hook(self) -> None:
        """Stand between the window and GLFW where time passes and events come in."""
        import glfw

        poll, wait, swap = glfw.poll_events, glfw.wait_events_timeout, glfw.swap_buffers

        def polled() -> None:
            poll()
            self._serve()

        def waited(seconds: float) -> None:
            if not self._calls:
                wait(seconds)
            self._serve()

        def swapped(handle: Any) -> None:
            self._take_shot()
            if self._is_filled:
                swap(handle)
            time.sleep(max(self._slow, self._paused))

        glfw.poll_events, glfw.wait_events_timeout, glfw.swap_buffers = polled, waited, swapped
        glfw.get_cursor_pos = lambda handle: self._mouse

    def _listen(self) -> None:
        """What the test sends, from a thread: it wakes the window as an event of the system would."""
        import glfw

        while True:
            try:
                call = self._pipe.recv()
            except (EOFError, OSError):
                os._exit(1)  # the test is gone
            with self._lock:
                self._calls.append(call)
            glfw.post_empty_event()

    def _serve(self) -> None:
        with self._lock:
            calls, self._calls = self._calls, []
        for name, arguments in calls:
            if name == "close":
                import glfw

                glfw.set_window_should_close(self.window.handle, True)
                return
            try:
                answer = ("answer", getattr(self, f"_{name}")(*arguments))
                pickle.dumps(answer)
            except Exception as error:
                answer = ("error", AssertionError(f"{name}{arguments}: {type(error).__name__}: {error}"))
            self._pipe.send(answer)

    # ------------------------------------------------------------------------------------------------ what is asked for

    def _events(self, events: Sequence[Event]) -> None:
        self._heard_in = self._frames
        for event in events:
            self._bring(event)

    def _bring(self, event: Event) -> None:
        """Call what the window registered with GLFW, in C."""
        kind, *rest = event
        call, handle = self._callbacks, self.window.handle
        if kind == "key":
            call["Key"](handle, rest[0], 0, rest[1], rest[2])
        elif kind == "char":
            call["Char"](handle, rest[0])
        elif kind == "move":
            self._mouse = (rest[0], rest[1])
            call["CursorPos"](handle, *self._mouse)
        elif kind == "button":
            call["MouseButton"](handle, *rest)
        elif kind == "scroll":
            call["Scroll"](handle, *rest)
        elif kind == "focus":
            call["WindowFocus"](handle, rest[0])
        elif kind == "drop":
            raw = [name.encode("utf-8", "surrogateescape") for name in rest[0]]
            call["Drop"](handle, len(raw), (ctypes.c_char_p * len(raw))(*raw))
        else:
            raise ValueError(f"an event {kind!r}")

    def _c_callback(self, name: str) -> Callable[..., None]:
        """The function in C that the window gave GLFW: taken out, called, and left in its place."""
        import glfw

        setter = getattr(glfw._glfw, f"glfwSet{name}Callback")
        registered = setter(self.window.handle, setter.restype(0))
        setter(self.window.handle, registered)
        return registered

    def _names(self) -> dict[str, Any]:
        import glfw
        import numpy as np
        from imgui_bundle import imgui

        shell = self.window.shell
        return {"window": self.window, "shell": shell, "editor": shell.editor, "state": shell.state, "imgui": imgui,
                "client": self._client, "np": np, "glfw": glfw, "stage": self}  # fmt: skip

    def _ask(self, expression: str) -> Any:
        return eval(expression, self._names())

    def _do(self, statements: str) -> None:
        exec(statements, self._names())
        self.window.shell.pacing.note_input()  # which is good for the two frames that `settle` waits for
        self._heard_in = self._frames

    def _settled(self, frames: int) -> bool:
        """Whether what came in was drawn, and nothing of it is left lying."""
        drawn = self._frames - self._heard_in
        # A layout that changes takes a few frames of its own; a picture that refines would take any number.
        at_rest = drawn >= 2 and (not self._busy or drawn >= frames)
        return at_rest and self.window.shell.events.is_empty

    def _place(self, name: str) -> tuple[float, float]:
        return self.window.shell.handle_position(name)

    def _double_within(self, seconds: float) -> None:
        io = self.window.shell.io
        io.mouse_double_click_time, io.mouse_single_click_delay = seconds, seconds + 1.0
        io.mouse_clicked_time[0] = -1e9  # no click before counts

    def _slow_by(self, milliseconds: float) -> None:
        self._slow = 1e-3 * milliseconds

    def _pause(self, seconds: float) -> None:
        self._paused = seconds

    def _reopen(self) -> None:
        editor = self.window.editor
        self._source, self._left = self._source or editor.document.source, editor.document
        editor.open(self._source)

    @property
    def is_reopened(self) -> bool:
        """Whether the document is that of the scene opened anew."""
        return self.window.editor.document is not self._left

    def as_at_the_start(self, select: str | None) -> None:
        """Panels and view as at the start, this selected."""
        from app.document.view_state import SetView, ViewState
        from ui.panels.window_state import PanelState

        start = ViewState()
        shell = self.window.shell
        shell.state = PanelState()
        shell.actor.preferences.choose(mouse="blender", scroll="dolly")
        shell.editor.select(None)
        settings = {name: getattr(start.settings, name) for name in ("n_lights", "n_bounces")}
        shell.editor.do(SetView.of(**settings, **{name: getattr(start, name) for name in VIEW_OF_THE_START}))
        shell.editor.select(select)

    def _shot_to(self, file: str) -> None:
        self._shot = file
        self.window.shell.pacing.note_change()

    def _taken(self) -> bool:
        return self._shot is None

    def _take_shot(self) -> None:
        if self._shot is None or self.window is None:
            return
        import glfw
        from PIL import Image

        size = glfw.get_framebuffer_size(self.window.handle)
        data = self.window._context.screen.read(viewport=(0, 0, *size), components=3, alignment=1)
        Image.frombytes("RGB", size, data).transpose(Image.Transpose.FLIP_TOP_BOTTOM).save(self._shot)
        self._shot = None


def main() -> int:
    """The window's process."""
    from app.modes.placement import relight_controller
    from app.worker.client import Client
    from tests.ui.quick_worker import HANDLERS
    from tests.ui.stand_in import StandInClient
    from ui import window

    relight_controller.IDLE_SECONDS = (
        math.inf
    )  # its rows take as long as the picture; no test of the window waits for them
    words = json.loads(sys.argv[1])
    client = StandInClient() if words["source"] == "stand-in" else Client(HANDLERS)
    stage = Stage(Connection(words["pipe"]), client, words["size"])
    resolution = words["resolution"] and tuple(words["resolution"])
    return window.run(words["source"], resolution=resolution, client=client, on_frame=stage.on_frame)


if __name__ == "__main__":
    sys.exit(main())
