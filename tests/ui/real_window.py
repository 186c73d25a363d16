"""The real GLFW window under Xvfb, worked by synthetic events: what a hand and a keyboard do, the whole way.

    test ─► pipe ─► the window's process: GLFW's callbacks ─► Window._on_* ─► imgui ─► panels ─► editor

Events enter where GLFW would bring them: while the window polls or waits, through the C callbacks that it registered.
What is sent together (`events`, `quick`) comes in together, between two frames, as from a queue that filled while a
frame was long; `slow(70)` makes every frame that long. All other calls wait until the window has drawn what it heard.

One Xvfb and one process serve modules in a row that want the same window; `fresh()` reopens the scene between tests:

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
and `np` are known; what it returns must pickle. `wait_until` asks until it is true. `shot` saves the window's pixels;
frames of which there is none are drawn, but into a single pixel: to fill them would take most of a test's time.
A test that opened another scene, or made the window slow, need not tidy up: `fresh` does, and a module begins with it.
What a test puts in the place of the program's own functions it takes out again.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
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
PATIENCE = 60.0
SMALL = (48, 32)  # the resolution of the small scene in a window
UNTIL = 0.02  # seconds between two questions of `wait_until`
PAUSE = 0.1  # seconds that a frame takes meanwhile


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
        """Wait for an expression to become true; AssertionError with what the window says when it does not.

        The window draws seldom meanwhile: no display holds its frames up, and the worker steps back for it.
        """
        end = time.monotonic() + timeout
        if self.ask(expression):
            return
        self._call("pause", PAUSE)
        while not self.ask(expression):
            if time.monotonic() > end:
                said = self.ask("(editor.status, state.message)")
                raise AssertionError(f"in {timeout:.0f} s it did not come to {expression}; {said}")
            time.sleep(UNTIL)
        self._call("pause", 0.0)

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
        return self.ask("state.message.text if state.message else ''")

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

    @property
    def has_ended(self) -> bool:
        """Whether the window's process is gone."""
        return self._process.poll() is not None

    def wait_for_end(self, timeout: float) -> int:
        """The status with which the window's process ends by itself."""
        return self._process.wait(timeout)

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


def real_window_fixture(*, small_scene: bool = False) -> Any:
    """A fixture of a whole module: a window on the stand-in worker, or on a real one that has the small scene. Modules
    that want the same share it. Skips, saying so, where there is no Xvfb."""

    @pytest.fixture(scope="module")
    def window(real_windows: RealWindows) -> RealWindow:
        return real_windows.get(small_scene)

    return window


class RealWindows:
    """The window that the modules of a run share: on the stand-in worker, or on a real one. One at a time is open: one
    that nobody looks at takes its share of the processor, too."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stack = ExitStack()
        self._open: tuple[bool, RealWindow, object] | None = None

    def get(self, small_scene: bool) -> RealWindow:
        """The window on the small scene, or the stand-in's: that which is open, unless it is another, has ended, or has
        its panels elsewhere than at its start."""
        if self._open is not None:
            is_small, window, start = self._open
            if is_small == small_scene and not window.has_ended and _layout(window) == start:
                return window
        self.close()
        window = self._stack.enter_context(self._opened(small_scene))
        self._open = small_scene, window, _layout(window)
        return window

    def close(self) -> None:
        """End it."""
        self._stack.close()
        self._open = None

    def _opened(self, small_scene: bool) -> AbstractContextManager[RealWindow]:
        folder = Path(tempfile.mkdtemp(dir=self._folder))
        if not small_scene:
            return opened(folder)
        from tests.ui.small_scene import write_small_scene

        return opened(folder, str(write_small_scene(folder)), resolution=SMALL)


def _layout(window: RealWindow) -> object:
    """Where all handles of a window are that begins anew, to a pixel."""
    window.fresh(None)
    return window.ask("{name: tuple(map(round, shell.handle_position(name))) for name in shell.handles.names()}")


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
                [sys.executable, "-m", "tests.ui.real_window_stage", words],
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
