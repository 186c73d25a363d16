"""The real GLFW window under Xvfb, worked by synthetic events: what a hand and a keyboard do, the whole way.

    test ─► pipe ─► the window's process: GLFW's callbacks ─► Window._on_* ─► imgui ─► panels ─► editor

Events enter where GLFW would bring them: while the window polls or waits, through the C callbacks that it registered.
What is sent together (`events`, `quick`) comes in together, between two frames, as from a queue that filled while a
frame was long; `slow(70)` makes every frame that long. All other calls wait until the window has drawn what it heard.

One Xvfb and one process serve a whole test module; `fresh()` reopens the scene between tests:

    real = real_window_fixture()                                # the stand-in worker: made-up arrays, at once
    small = real_window_fixture(small_scene=True)               # a real worker on tests/ui/small_scene.py

    @pytest.mark.window
    def test_six_quick_undos_are_six(real: RealWindow) -> None:
        real.fresh()                                            # teapot.1.theta_h selected, picture exact
        for _ in range(6):
            real.drag("curve.magnitude", by=(0, -20))
        real.slow(70)
        real.quick("ctrl+z", 6)
        assert real.ask("len(editor.history.undo_steps)") == 0

Places are handles by name ("curve.b"; `handles()` lists those on screen) or (x, y) in framebuffer pixels. `ask`
evaluates Python in the window's process, where `editor`, `shell`, `window`, `client`, `state` (the panels'), `imgui`
and `np` are known; what it returns must pickle. `wait_until` asks until it is true. `shot` saves the window's pixels.
A test that opened another scene, or made the window slow, need not tidy up: `fresh` does.

Started by hand, `python -m tests.ui.real_window` is the window's process and is of no use by itself.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import pickle
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
Place = str | tuple[float, float]
Event = tuple[Any, ...]
SHIFT, CTRL, ALT = 1, 2, 4
MODIFIERS = {"shift": (340, SHIFT), "ctrl": (341, CTRL), "alt": (342, ALT)}
KEYS = {
    "space": 32, "escape": 256, "esc": 256, "enter": 257, "tab": 258, "backspace": 259, "insert": 260, "delete": 261,
    "right": 262, "left": 263, "down": 264, "up": 265, "page_up": 266, "page_down": 267, "home": 268, "end": 269,
    **{f"f{n}": 289 + n for n in range(1, 13)},
}  # fmt: skip
RELEASE, PRESS, REPEAT = 0, 1, 2
LAYOUT_FRAMES = 6
VIEW_OF_THE_START = (
    "hovered", "exposure", "tone_mapping", "compare", "compare_divider", "fit", "zoom", "centre", "log_y", "curve_zoom",
    "channel", "active_tool", "regions", "operator", "solo", "lobe_pixel", "brdf_plot", "brdf_whole", "brdf_across",
    "panels", "show_shortcuts",
)  # fmt: skip
CALLBACKS = ("Key", "Char", "CursorPos", "MouseButton", "Scroll", "Drop", "WindowFocus")
PATIENCE = 60.0
UNTIL = 0.02  # seconds between two questions of `wait_until`


class RealWindow:
    """The test's side: a hand at the window that another process shows."""

    def __init__(self, process: subprocess.Popen[bytes], pipe: Connection, log: Path) -> None:
        self._process = process
        self._pipe = pipe
        self._log = log

    # ------------------------------------------------------------------------------------------------------ the hand

    def events(self, *events: Event, frames: int = LAYOUT_FRAMES) -> None:
        """Let events come in between two frames: ("move", x, y), ("button", button, pressed, modifiers), ("scroll",
        dx, dy), ("key", GLFW key, pressed, modifiers), ("char", code point), ("drop", names), ("focus", gained).

        frames: how many are waited for where a picture goes on being refined."""
        self._call("events", events)
        self.settle(frames)

    def move(self, place: Place) -> None:
        """Move the mouse there."""
        self.events(("move", *self.at(place)))

    def press(self, button: int = 0, modifiers: int = 0) -> None:
        """Press a mouse button where the mouse is: 0 left, 1 right, 2 middle."""
        self.events(("button", button, PRESS, modifiers))

    def release(self, button: int = 0, modifiers: int = 0) -> None:
        """Let it go."""
        self.events(("button", button, RELEASE, modifiers))

    def click(self, place: Place, button: int = 0, held: str = "") -> None:
        """Click, with keys held ("shift", "ctrl+alt"); the mouse rests there first, as a hand's does."""
        self.move(place)
        before, after, modifiers = _holding(held)
        self.events(*before, ("button", button, PRESS, modifiers))
        self.events(("button", button, RELEASE, modifiers), *after)

    def quick_clicks(self, place: Place, times: int = 2, button: int = 0) -> None:
        """So many clicks between two frames, double and threefold ones."""
        self.move(place)
        with self._doubling():
            self.events(*[("button", button, pressed, 0) for _ in range(times) for pressed in (PRESS, RELEASE)])

    def double_click(self, place: Place) -> None:
        """Two clicks, each with its frames."""
        self.move(place)
        with self._doubling():
            for pressed in (PRESS, RELEASE, PRESS, RELEASE):
                self.events(("button", 0, pressed, 0))

    @contextmanager
    def _doubling(self) -> Iterator[None]:
        """Clicks at one place are double ones, however slow the machine; else never, however quick it is."""
        self._call("double_within", 60.0)
        yield
        self._call("double_within", 0.0)

    def drag(
        self,
        start: Place,
        to: Place | None = None,
        by: tuple[float, float] = (0.0, 0.0),
        *,
        button: int = 0,
        steps: int = 6,
        held: str = "",
        let_go: bool = True,
    ) -> None:
        """Press, move in steps that each get their frame, let go (or hold on, `let_go` False)."""
        x, y = self.at(start)
        end = (x + by[0], y + by[1]) if to is None else self.at(to)
        self.move((x, y))
        before, after, modifiers = _holding(held)
        self.events(*before, ("button", button, PRESS, modifiers))
        for step in range(1, steps + 1):
            share = step / steps
            self.events(("move", x + share * (end[0] - x), y + share * (end[1] - y)), frames=2)
        if let_go:
            self.events(("button", button, RELEASE, modifiers), *after)

    def wheel(self, amount: float, place: Place | None = None, held: str = "", times: int = 1) -> None:
        """Turn the wheel, positive away from the hand; `times` notches between two frames."""
        if place is not None:
            self.move(place)
        before, after, _ = _holding(held)
        self.events(*before)
        self.events(*[("scroll", 0.0, amount)] * times)
        self.events(*after)

    def key(self, *chords: str) -> None:
        """Press and let go of chords one after the other: "ctrl+shift+z", "a", "escape", "?"."""
        for chord in chords:
            self.events(*chord_events(chord))

    def quick(self, chord: str, times: int) -> None:
        """So many presses between two frames; modifiers are let go first each time, as hurried fingers do."""
        self.events(*[event for _ in range(times) for event in chord_events(chord, modifiers_first=True)])

    def hold(self, key: str, down: bool) -> None:
        """Press a key and keep it, or let it go."""
        self.events(("key", _code(key), PRESS if down else RELEASE, 0))

    def held(self, chord: str, times: int) -> None:
        """Hold a chord for so long that the system repeats it so often, all between two frames."""
        (*before, pressed), (released, *after) = _parted(chord_events(chord))
        again = ("key", pressed[1], REPEAT, pressed[3])
        self.events(*before, pressed, *[again] * times, released, *after)

    def text(self, text: str) -> None:
        """Type characters, quickly."""
        keys = ["space" if character == " " else character for character in text]
        self.events(*[event for key in keys for event in chord_events(key)])

    # ------------------------------------------------------------------------------------------------- what there is

    def ask(self, expression: str) -> Any:
        """What a Python expression is in the window's process, when all that came in has been drawn."""
        return self._call("ask", expression)

    def do(self, statements: str) -> None:
        """Run Python statements in the window's thread, between two frames, and let it draw what came of them."""
        self._call("do", statements)
        self.settle()

    def wait_until(self, expression: str, timeout: float = PATIENCE) -> None:
        """Wait for an expression to become true; AssertionError with what the window says when it does not."""
        end = time.monotonic() + timeout
        while not self.ask(expression):
            if time.monotonic() > end:
                said = self.ask("(editor.status, state.notice)")
                raise AssertionError(f"in {timeout:.0f} s it did not come to {expression}; {said}")
            time.sleep(UNTIL)

    def settle(self, frames: int = LAYOUT_FRAMES, timeout: float = 20.0) -> None:
        """Wait until the window has heard and drawn all that came in, with no help: it must do so by itself."""
        end = time.monotonic() + timeout
        while not self._call("settled", frames):
            assert time.monotonic() < end, "the window leaves events lying that came in"
            time.sleep(0.002)

    def at(self, place: Place) -> tuple[float, float]:
        """A place in framebuffer pixels; KeyError lists the handles there are."""
        self._last = self._call("place", place) if isinstance(place, str) else place
        return self._last

    def handles(self) -> list[str]:
        """Names of the handles on screen."""
        return self.ask("shell.handles.names()")

    def notice(self) -> str:
        """The line that the window shows last, "" where there is none."""
        return self.ask("state.notice.text if state.notice else ''")

    def n_steps(self) -> int:
        """Steps that undo could take back."""
        return self.ask("len(editor.history.undo_steps)")

    def shot(self, file: Path) -> Path:
        """Save the window's pixels, as the coming frame draws them, to a PNG."""
        file.parent.mkdir(parents=True, exist_ok=True)
        self._call("shot_to", str(file))
        end = time.monotonic() + PATIENCE
        while not self._call("taken"):
            assert time.monotonic() < end, "no frame was drawn"
            time.sleep(UNTIL)
        return file

    # ------------------------------------------------------------------------------------------------------ the stage

    def slow(self, milliseconds: float) -> None:
        """Make every frame take so much longer; 0: as quick as it is."""
        self._call("slow_by", milliseconds)

    def resize(self, width: int, height: int) -> None:
        """Give the window another size."""
        self.do(f"glfw.set_window_size(window.handle, {width}, {height})")
        self.wait_until(f"glfw.get_framebuffer_size(window.handle) == ({width}, {height})")
        self.settle()

    def fresh(self, select: str | None = "teapot.1.theta_h") -> None:
        """The scene as it was opened, selected so, its picture exact, panels and view as at the start."""
        self.slow(0)
        self.events(*[("button", button, RELEASE, 0) for button in range(3)], ("move", -1.0, -1.0))
        self.events(*[("key", code, RELEASE, 0) for code, _ in MODIFIERS.values()])
        self.key("escape", "escape")  # a list or a field that was left open
        self._call("reopen")
        self.wait_until("stage.is_reopened")
        self.do(f"stage.as_at_the_start({select!r})")
        self.wait_until("editor.status.picture == 'exact'")

    def restart(self, source: str) -> None:
        """Open another scene and wait until its picture is exact."""
        self.do(f"editor.open({source!r})")
        self.wait_until("editor.status.picture == 'exact'")

    def close(self) -> None:
        """End the window's process."""
        try:
            self._pipe.send(("close", ()))
            self._process.wait(20.0)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        self._pipe.close()

    def _call(self, name: str, *arguments: Any) -> Any:
        try:
            self._pipe.send((name, arguments))
            if not self._pipe.poll(PATIENCE):
                raise AssertionError(f"the window does not answer\n{self.log()}")
            kind, answer = self._pipe.recv()
        except (EOFError, OSError) as error:
            self._process.wait(20.0)
            raise AssertionError(f"the window ended ({self._process.returncode})\n{self.log()}") from error
        if kind == "error":
            raise answer
        return answer

    def log(self) -> str:
        """What the window's process printed."""
        return self._log.read_text(errors="replace")[-4000:]


def chord_events(chord: str, modifiers_first: bool = False) -> list[Event]:
    """What GLFW tells of one press of a chord. A character without Ctrl or Alt is typed, too."""
    *held, name = chord.split("+") if chord != "+" else ["+"]
    before, after, modifiers = _holding("+".join(held))
    code = _code(name)
    pressed: list[Event] = [*before, ("key", code, PRESS, modifiers)]
    if len(name) == 1 and not modifiers & (CTRL | ALT):
        pressed.append(("char", ord(name.upper() if modifiers & SHIFT else name)))
    elif name == "space" and not modifiers & (CTRL | ALT):
        pressed.append(("char", ord(" ")))
    released: Event = ("key", code, RELEASE, 0 if modifiers_first else modifiers)
    return [*pressed, *after, released] if modifiers_first else [*pressed, released, *after]


def _parted(events: list[Event]) -> tuple[list[Event], list[Event]]:
    """Up to the press of a chord's last key, and from its release on."""
    released = next(i for i, event in enumerate(events) if event[0] == "key" and event[2] == RELEASE)
    return [event for event in events[:released] if event[0] == "key"], events[released:]


def _holding(held: str) -> tuple[list[Event], list[Event], int]:
    """Events that press modifiers, that let them go, and their bits. As on X11 each names those held before it."""
    before: list[Event] = []
    after: list[Event] = []
    bits = 0
    for name in filter(None, held.split("+")):
        code, bit = MODIFIERS[name]
        before.append(("key", code, PRESS, bits))
        bits |= bit
        after.insert(0, ("key", code, RELEASE, bits))
    return before, after, bits


def _code(name: str) -> int:
    """GLFW's number of a key; of a character, that of the key it stands on (an American keyboard's)."""
    if name in MODIFIERS:
        return MODIFIERS[name][0]
    if name in KEYS:
        return KEYS[name]
    shifted = dict(zip('~!@#$%^&*()_+{}|:"<>?', "`1234567890-=[]\\;',./", strict=True))
    return ord(shifted.get(name, name).upper())


# -------------------------------------------------------------------------------------------------------- the fixtures


def real_window_fixture(
    *, small_scene: bool = False, source: str = "stand-in", size: tuple[int, int] = (1380, 860),
    resolution: tuple[int, int] | None = None,
) -> Any:  # fmt: skip
    """A fixture of a whole module: a window on the stand-in worker, or on a real one (`small_scene`, or any other
    `source` at a `resolution`). Skips, saying so, where there is no Xvfb."""

    @pytest.fixture(scope="module")
    def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealWindow]:
        folder = tmp_path_factory.mktemp("real-window")
        scene = source
        if small_scene:
            from tests.ui.small_scene import write_small_scene

            scene = str(write_small_scene(folder))
        with opened(folder, scene, size, resolution) as real:
            yield real

    return window


@contextmanager
def opened(
    folder: Path, source: str = "stand-in", size: tuple[int, int] = (1380, 860),
    resolution: tuple[int, int] | None = None,
) -> Iterator[RealWindow]:  # fmt: skip
    """A display with a window on a scene, its first picture exact; state and caches are kept in `folder`."""
    with display() as name:
        mine, its = socket.socketpair()
        log = folder / "window.log"
        words = json.dumps({"source": source, "size": size, "resolution": resolution, "pipe": its.fileno()})
        outside = {key: value for key, value in os.environ.items() if key != "WAYLAND_DISPLAY"}
        with log.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", "tests.ui.real_window", words],
                cwd=ROOT,
                env=outside | {"DISPLAY": name, "INSITU_STATE": str(folder / "state"), "LIBGL_ALWAYS_SOFTWARE": "1"},
                pass_fds=[its.fileno()],
                stdout=output,
                stderr=output,
            )
        its.close()
        real = RealWindow(process, Connection(mine.detach()), log)
        try:
            real.wait_until("editor.status.picture == 'exact'", timeout=150.0)
            yield real
        finally:
            real.close()


@contextmanager
def display() -> Iterator[str]:
    """The name of a display of its own, ":N", that Xvfb chooses."""
    if shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed")
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1600x1000x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as told:
            number = told.readline().strip()
        if not number:
            pytest.skip("Xvfb could not start")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait(20.0)


# ------------------------------------------------------------------------------------------------ the window's process


class Stage:
    """The window's side: brings events in while GLFW takes its own, answers questions between frames."""

    def __init__(self, pipe: Connection, client: Any, size: tuple[int, int]) -> None:
        self.window: Any = None
        self._pipe, self._client, self._size = pipe, client, size
        self._calls: list[tuple[str, tuple[Any, ...]]] = []
        self._lock = threading.Lock()
        self._frames = self._heard_in = 0
        self._slow = 0.0
        self._busy = True
        self._shot: str | None = None
        self._mouse = (0.0, 0.0)
        self._source: str | None = None
        self._left: Any = None
        self._callbacks: dict[str, Callable[..., None]] = {}
        self._hook()

    def on_frame(self, window: Any) -> bool:
        """After each frame of the window's loop."""
        import glfw

        self._frames += 1
        if self.window is None:
            glfw.set_window_size(window.handle, *self._size)
            self.window = window
            self._watch(window)
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
            swap(handle)
            time.sleep(self._slow)

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
        self.window.shell.note_input()  # which is good for the two frames that `settle` waits for
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
        from app.view_state import SetView, ViewState
        from ui.panels.state import PanelState

        start = ViewState()
        shell = self.window.shell
        shell.state = PanelState()
        shell.actor.preferences.choose(mouse="blender", scroll="dolly")
        shell.editor.select(None)
        shell.editor.do(SetView.of(**{name: getattr(start, name) for name in VIEW_OF_THE_START}))
        shell.editor.select(select)

    def _shot_to(self, file: str) -> None:
        self._shot = file
        self.window.shell.note_change()

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
    from app.jobs.client import Client
    from app.placement import relight_talk
    from tests.ui.stand_in import StandInClient
    from ui import window

    relight_talk.REST_SECONDS = math.inf  # its rows take as long as the picture; no test of the window waits for them
    words = json.loads(sys.argv[1])
    client = StandInClient() if words["source"] == "stand-in" else Client()
    stage = Stage(Connection(words["pipe"]), client, words["size"])
    resolution = words["resolution"] and tuple(words["resolution"])
    return window.run(words["source"], resolution=resolution, client=client, on_frame=stage.on_frame)


if __name__ == "__main__":
    sys.exit(main())
