"""The real window: GLFW around `ui.shell`, drawn when something changed and asleep otherwise.

The order of a start: the worker begins to import, the window shows its first frame, and only then the renderer is made
and warms up. While nothing happens the loop waits for events and polls the worker's responses twenty times a second
without drawing (more often before the first picture), so that the processors are the worker's. A response is processed,
drawn into the picture and shown in three steps, with events processed between them.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import glfw
import numpy as np
from imgui_bundle import imgui

from app.editor.editor import Editor
from app.files.journal import Journal, Recovery, recoverable_sessions
from app.files.preferences import PreferenceFile, RecentFiles
from app.messages.worker_messages import WorkerClient
from app.system.atomic import save_file
from app.system.barrier import Barrier
from app.system.paths import layout_file, preference_file, recent_file
from app.worker.client import Client
from engine.core.colour import ConfigView
from engine.core.errors import InsituError
from engine.render.display import pixels_png
from engine.scene.builtin import builtin_environments, builtin_scenes
from ui.frame_times import FrameResult, launch_times_from
from ui.gl.context import (
    REQUIRED_VERSION,
    GraphicsError,
    create_window_context,
    spare_full_disk,
    versions_to_ask,
)
from ui.glfw_keys import KEYS, as_printed, held, key_changes
from ui.layout import LEAST_SIZE
from ui.panels.actions import Quit
from ui.panels.maps import image_at
from ui.picture_feed import CURVE_POLL_SECONDS, PictureFeed
from ui.shell import TITLE, Shell

WORKER_POLL_SECONDS = 0.05
# While the first picture is awaited.
EAGER_POLL_SECONDS = 0.015
NO_DISPLAY = (
    "insitu: no display to open a window on ({reason}); without one, `insitu render SCENE -o OUT.exr` and "
    "`insitu screenshot SCENE -o UI.png` work"
)
Cursor = imgui.MouseCursor_
CURSORS = {
    int(Cursor.arrow): glfw.ARROW_CURSOR,
    int(Cursor.text_input): glfw.IBEAM_CURSOR,
    int(Cursor.resize_ew): glfw.HRESIZE_CURSOR,
    int(Cursor.resize_ns): glfw.VRESIZE_CURSOR,
    int(Cursor.resize_all): glfw.CROSSHAIR_CURSOR,
    int(Cursor.hand): glfw.HAND_CURSOR,
}


_clipboard: Any = glfw  # its type stubs require a window, the library warns when given one


class NoDisplay(InsituError):
    """There is no screen to open a window on."""


def run(
    source: str,
    *,
    resolution: tuple[int, int] | None = None,
    require: int = REQUIRED_VERSION,
    client: WorkerClient | None = None,
    view: ConfigView | None = None,
    on_frame: Callable[[Window], bool] | None = None,
) -> int:
    """Open the editor on a scene and run until it is closed; returns the exit status: 0, 1 (no GL) or 2 (no display).

    view: that of an OpenColorIO configuration to begin with. `on_frame` is called after each frame and returns whether
    to close (tests, measurements).
    """
    try:
        handle = open_glfw_window(require)
    except NoDisplay as error:
        print(NO_DISPLAY.format(reason=error), file=sys.stderr)
        return 2
    except GraphicsError as error:
        print(f"insitu: {error}", file=sys.stderr)
        return 1
    recoveries = recoverable_sessions()
    barrier = Barrier(holds=True)
    editor = Editor(client or Client(), source, resolution=resolution, journal=Journal(), barrier=barrier)
    if view is not None:
        editor.colours.open(view)
    editor.scenes.watch.start()
    try:
        window = Window(handle, editor, require, recoveries)
        gc.freeze()  # the libraries' objects stay: collecting among them would block the window for 30 ms at a time
        try:
            window.loop(on_frame)
        finally:
            window.close()
    except GraphicsError as error:
        print(f"insitu: {error}", file=sys.stderr)
        return 1
    finally:
        editor.close()
        glfw.terminate()
    return 0


def open_glfw_window(require: int = REQUIRED_VERSION) -> Any:
    """A window with a GL core context, current in this thread. Raises NoDisplay or GraphicsError."""
    problems: list[str] = []
    spare_full_disk()
    glfw.ERROR_REPORTING = "ignore"
    glfw.set_error_callback(lambda code, text: problems.append(_text(text)))
    if not glfw.init():
        raise NoDisplay(problems[-1] if problems else "GLFW could not start")
    for version in versions_to_ask(require):
        _core_hints(version)
        handle = glfw.create_window(*_first_size(), TITLE, None, None)
        if handle:
            break
    else:
        reason = problems[-1] if problems else "no reason given"
        found = _version_there_is()
        glfw.terminate()
        raise GraphicsError(
            f"OpenGL {require // 100}.{require // 10 % 10} core is needed, found {found} ({reason}); install a newer "
            "graphics driver or Mesa (Debian: libgl1-mesa-dri)"
        )
    glfw.make_context_current(handle)
    glfw.swap_interval(1)
    return handle


def _text(value: Any) -> str:
    """GLFW's message, which arrives as bytes."""
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _core_hints(require: int) -> None:
    glfw.default_window_hints()
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, require // 100)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, require // 10 % 10)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
    glfw.window_hint(glfw.DEPTH_BITS, 0)  # nothing here is tested for depth; clearing it took a tenth of a frame
    glfw.window_hint(glfw.STENCIL_BITS, 0)
    glfw.window_hint(glfw.SCALE_TO_MONITOR, True)


def _first_size() -> tuple[int, int]:
    """1440 x 900 where the screen has room for it, else most of the screen."""
    monitor = glfw.get_primary_monitor()
    if not monitor:
        return 1440, 900
    _, _, width, height = glfw.get_monitor_workarea(monitor)
    return min(1440, max(width - 40, 640)), min(900, max(height - 60, 480))


def _version_there_is() -> str:
    """The OpenGL version that this display has, in words."""
    glfw.default_window_hints()
    glfw.window_hint(glfw.VISIBLE, False)
    probe = glfw.create_window(64, 64, TITLE, None, None)
    if not probe:
        return "none"
    major = glfw.get_window_attrib(probe, glfw.CONTEXT_VERSION_MAJOR)
    minor = glfw.get_window_attrib(probe, glfw.CONTEXT_VERSION_MINOR)
    glfw.destroy_window(probe)
    return f"OpenGL {major}.{minor}"


class Window:
    """One GLFW window with its shell. `first_frame_at` is when its first frame was on screen (steady clock)."""

    def __init__(self, handle: Any, editor: Editor, require: int, recoveries: list[Recovery]) -> None:
        self.handle = handle
        self.editor = editor
        self.first_frame_at: float | None = None
        self.longest_frame = 0.0
        self._times = launch_times_from()
        self._context = create_window_context(require)
        recent, preferences = RecentFiles(recent_file()), PreferenceFile(preference_file())
        self.shell = Shell(
            self._context, editor, scale=self._scale(), layout_file=layout_file(), recent=recent,
            preferences=preferences,
        )  # fmt: skip
        self.shell.environments = tuple(builtin_environments())
        self.shell.scenes = tuple(builtin_scenes())
        self.shell.actor.recoveries = tuple(recoveries)
        self._feed: PictureFeed | None = None
        self._cursors = {shape: glfw.create_standard_cursor(shape) for shape in set(CURSORS.values())}
        self._shown_cursor = -1
        self._shown_title = ""
        self._connect()
        self._limit_size()

    def loop(self, on_frame: Callable[[Window], bool] | None = None) -> None:
        """Draw and wait until the window is closed."""
        draw_at = 0.0
        while not glfw.window_should_close(self.handle):
            result = self._frame()
            if result.quit or (on_frame is not None and on_frame(self)):
                return
            if self._feed is None:
                self._make_renderer()
                continue
            if result.busy:
                self._take_events(glfw.poll_events)
                self._poll(time.monotonic())
                self._prepare()
                continue
            draw_at = time.monotonic() + (result.redraw_in if result.redraw_in is not None else 1e9)
            self._sleep(draw_at)

    def close(self) -> None:
        """Free GL objects and the window."""
        if self._feed is not None:
            self._feed.close()
        self.shell.close()
        for cursor in self._cursors.values():
            glfw.destroy_cursor(cursor)
        glfw.destroy_window(self.handle)

    def _make_renderer(self) -> None:
        self._feed = PictureFeed(self._context, self.editor.mode)
        self.shell.source = self._feed
        self._take_events(glfw.poll_events)

    def _frame(self) -> FrameResult:
        started = time.monotonic()
        size = glfw.get_framebuffer_size(self.handle)
        result = self.shell.frame(self._context.screen, size)
        if result.screenshot is not None:
            self._save(result.screenshot, size)
        self._show_cursor()
        self._show_title()
        if result.drawn:
            glfw.swap_buffers(self.handle)
        took = time.monotonic() - started
        self.longest_frame = max(self.longest_frame, took)
        self.shell.note_frame_time(1e3 * took)
        if self.first_frame_at is None:
            self.first_frame_at = time.monotonic()
        if self._times is not None:
            self._times.blocked(took, self.editor.scene_is_open)
            self._times.frame_shown(self.editor.scene_is_open, self.editor.status)
        return result

    def _sleep(self, draw_at: float) -> None:
        """Sleep until there is something to draw: an event, a response of the worker, or a tooltip that is due."""
        inputs = self.shell.pacing.inputs
        while self.shell.pacing.inputs == inputs and not glfw.window_should_close(self.handle):
            now = time.monotonic()
            if now >= draw_at:
                return
            if self._poll(now):
                self._prepare()
                return
            self._take_events(glfw.wait_events_timeout, max(min(self._pause(), draw_at - now), 0.001))

    def _pause(self) -> float:
        """Seconds between two polls for the worker's responses: short while the user waits for one, none within one."""
        if self.editor.response_arriving:
            return 0.0
        if self.editor.controller.awaits_response:
            return CURVE_POLL_SECONDS
        return EAGER_POLL_SECONDS if self.editor.status.picture == "waiting" else WORKER_POLL_SECONDS

    def _take_events(self, take: Callable[..., None], *arguments: float) -> None:
        """Let GLFW call the handlers; its Python side cannot read every file name that a desktop can drop."""
        self.editor.barrier.run("An event", partial(self._call_handler, take, *arguments), None)

    def _call_handler(self, take: Callable[..., None], *arguments: float) -> None:
        try:
            take(*arguments)
        except UnicodeDecodeError:
            self.editor.notify("the dropped file's name is not UTF-8; rename it to open it here", True)

    def _poll(self, now: float) -> bool:
        """Process the worker's responses between frames; returns whether there is something new to draw."""
        found = self.shell.idle(now)
        if self._times is not None:
            self._times.blocked(time.monotonic() - now, self.editor.scene_is_open)
        return found

    def _prepare(self) -> None:
        """Update the picture before the frame that shows it; events are processed before and after."""
        self._take_events(glfw.poll_events)
        started = time.monotonic()
        self.shell.prepare()
        if self._times is not None:
            self._times.blocked(time.monotonic() - started, self.editor.scene_is_open)
        self._take_events(glfw.poll_events)

    def _save(self, file: Path, size: tuple[int, int]) -> None:
        data = self._context.screen.read(viewport=(0, 0, *size), components=3, alignment=1)
        pixels = np.frombuffer(data, np.uint8).reshape(size[1], size[0], 3)[::-1]
        try:
            save_file(file, pixels_png(pixels))
        except InsituError as error:
            self.editor.notify(str(error), True)
            return
        self.editor.notify(f"saved {file}")

    # ----------------------------------------------------------------------------------------------------------- events

    def _connect(self) -> None:
        """Pass GLFW's events to imgui."""
        glfw.set_cursor_pos_callback(self.handle, self._on_move)
        glfw.set_mouse_button_callback(self.handle, self._on_button)
        glfw.set_scroll_callback(self.handle, self._on_scroll)
        glfw.set_key_callback(self.handle, self._on_key)
        glfw.set_char_callback(self.handle, self._on_char)
        glfw.set_drop_callback(self.handle, self._on_drop)  # type: ignore[arg-type]
        glfw.set_window_close_callback(self.handle, self._on_close)
        glfw.set_window_focus_callback(self.handle, self._on_focus)
        glfw.set_window_refresh_callback(self.handle, lambda handle: self.shell.pacing.note_change())
        glfw.set_framebuffer_size_callback(self.handle, lambda handle, width, height: self.shell.pacing.note_change())
        glfw.set_window_content_scale_callback(self.handle, lambda handle, x, y: self.shell.set_scale(self._scale()))
        platform = imgui.get_platform_io()
        platform.platform_get_clipboard_text_fn = lambda context: _text(_clipboard.get_clipboard_string(None) or "")
        platform.platform_set_clipboard_text_fn = lambda context, text: _clipboard.set_clipboard_string(None, text)

    def _scale(self) -> float:
        """The scale of the screen that the window is on; 1 at 96 dpi."""
        return float(max(glfw.get_window_content_scale(self.handle)))

    def _limit_size(self) -> None:
        """Make the window no smaller than the panels can be, in screen units."""
        (wide, _), (pixels, _) = glfw.get_window_size(self.handle), glfw.get_framebuffer_size(self.handle)
        unit = self._scale() * wide / max(pixels, 1)
        width, height = (round(side * unit) for side in LEAST_SIZE)
        glfw.set_window_size_limits(self.handle, width, height, glfw.DONT_CARE, glfw.DONT_CARE)

    def _on_move(self, handle: Any, x: float, y: float) -> None:
        """Positions come in screen units; the shell works in framebuffer pixels."""
        if (place := self._pixel(handle, x, y)) is not None:
            self.shell.pacing.note_input()
            self.shell.events.move(*place)

    def _pixel(self, handle: Any, x: float, y: float) -> tuple[float, float] | None:
        """A position in screen units in framebuffer pixels; None while the window has no size."""
        window, pixels = glfw.get_window_size(handle), glfw.get_framebuffer_size(handle)
        if window[0] <= 0 or window[1] <= 0:
            return None
        return x * pixels[0] / window[0], y * pixels[1] / window[1]

    def _on_button(self, handle: Any, button: int, action: int, modifiers: int) -> None:
        if button < 3:
            self.shell.pacing.note_input()
            for role, down in held(modifiers):
                self.shell.events.key(role, down)
            self.shell.events.button(button, action == glfw.PRESS)

    def _on_scroll(self, handle: Any, x: float, y: float) -> None:
        self.shell.pacing.note_input()
        self.shell.events.wheel(x, y)

    def _on_key(self, handle: Any, key: int, code: int, action: int, modifiers: int) -> None:
        self.shell.pacing.note_input()
        key = as_printed(key, _text(glfw.get_key_name(key, code) or ""))
        if action == glfw.REPEAT:
            for part in KEYS.get(key, ()):
                self.shell.events.repeat(part)
            return
        for part, down in key_changes(key, action == glfw.PRESS, modifiers):
            self.shell.events.key(part, down)

    def _on_char(self, handle: Any, character: int) -> None:
        self.shell.pacing.note_input()
        self.shell.events.character(character)

    def _on_drop(self, handle: Any, paths: list[str]) -> None:
        self.shell.pacing.note_input()
        place = self._pixel(handle, *glfw.get_cursor_pos(handle))
        shell = self.shell
        shell.drop(paths, None if place is None else image_at(shell.handles, shell.theme, *place))

    def _on_focus(self, handle: Any, focused: int) -> None:
        self.shell.pacing.note_change()
        self.shell.events.focus(bool(focused))

    def _on_close(self, handle: Any) -> None:
        """The user closes the window: edits that are not saved open a question, once; then the journal stores them."""
        glfw.set_window_should_close(handle, False)
        self.shell.request(Quit(keep_journal=isinstance(self.shell.state.pending_action, Quit)))

    def _show_title(self) -> None:
        if self.shell.title != self._shown_title:
            self._shown_title = self.shell.title
            glfw.set_window_title(self.handle, self._shown_title)

    def _show_cursor(self) -> None:
        wanted = CURSORS.get(int(imgui.get_mouse_cursor()), glfw.ARROW_CURSOR)
        if wanted != self._shown_cursor:
            self._shown_cursor = wanted
            glfw.set_cursor(self.handle, self._cursors[wanted])
