"""Programs that are started to be measured: the window as a person starts it, and the renderer's own measurements.

The window is opened under Xvfb where that is installed, else on the display there is, else without one (the same
frames in a framebuffer). It writes its milestones to the file that `INSITU_TIMES` names, in times of the steady clock.
Each launch gets folders of its own for state and cache, so that nothing is known of the scene; compiled kernels are
there or not, as asked. Each program is a process group of its own and ends with all that it started, also when the
measurement is ended in the middle.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from app.system.lazy_import import IMPORT_FOLDER
from app.system.system import kill_group
from benchmarks.figures import NotMeasured

Milestone = Literal["first_frame", "scene", "first_layer", "first_picture", "exact"]
RENDERER = "benchmarks.programs.renderer"
INDIRECT = "benchmarks.programs.indirect"
ORBIT = "benchmarks.programs.orbit"
DRAGGED_LIGHT = "benchmarks.programs.dragged_light"
SCREEN = "1440x900x24"
LOOK_SECONDS = 0.02
GRACE_SECONDS = 5.0
WORDS = "stderr.txt"


@dataclass(frozen=True)
class Launch:
    """One start: seconds after the launch of each milestone, and the longest block (s) of the window's thread."""

    milestones: Mapping[str, float]
    longest_block_s: float | None


@dataclass(frozen=True)
class Screen:
    """Where windows open: the environment for them and the command in front of the scene; `name` in words."""

    name: str
    environment: Mapping[str, str]
    command: tuple[str, ...]


@contextlib.contextmanager
def open_screen() -> Iterator[Screen]:
    """Xvfb while the block lasts, or what there is in its place."""
    program = (sys.executable, "-m", "app")
    if shutil.which("Xvfb") is not None:
        with _xvfb() as display:
            yield Screen("Xvfb", {"DISPLAY": display}, program)
    elif os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        yield Screen("the display", {}, program)
    else:
        yield Screen("a framebuffer without display", {}, (sys.executable, "-m", RENDERER, "--start"))


@contextlib.contextmanager
def _xvfb() -> Iterator[str]:
    """A virtual display that is ready; its name."""
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", SCREEN, "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as pipe:
            ready, _, _ = select.select([pipe], [], [], 20.0)
            number = pipe.readline().strip() if ready else ""
        if not number:
            raise NotMeasured("Xvfb did not start")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


def launch(
    screen: Screen, source: str, folder: Path, until: Milestone, timeout_s: float, kernels: Path | None = None
) -> Launch:
    """Start the program on a scene, wait for a milestone, end it.

    folder: for the transport cache, state and the times, made when it is not there; kernels: where compiled kernels
    are kept, None for their usual place. Raises NotMeasured when the program ends or is too slow.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "times.json"
    environment = {
        **os.environ,
        **screen.environment,
        "INSITU_TIMES": str(file),
        "INSITU_CACHE": str(folder / "cache"),
        "INSITU_STATE": str(folder / "state"),
    }
    if kernels is not None:
        environment["NUMBA_CACHE_DIR"] = str(kernels)
    if screen.environment:
        environment.pop("WAYLAND_DISPLAY", None)
    started = time.monotonic()
    with _program([*screen.command, source], environment, folder) as process:
        try:
            return _relative(_wait_for(process, file, until, started + timeout_s), started)
        except NotMeasured as error:
            said = _last_words(folder)
            raise NotMeasured(f"{error}{': ' + said if said else ''}") from None


def _wait_for(process: subprocess.Popen[bytes], file: Path, until: Milestone, deadline: float) -> dict[str, float]:
    while True:
        times = json.loads(file.read_text()) if file.exists() else {}
        if until in times:
            return dict(times)
        if process.poll() is not None:
            raise NotMeasured(f"the program ended with status {process.returncode} before {until}")
        if time.monotonic() > deadline:
            raise NotMeasured(f"{until} did not come in time")
        time.sleep(LOOK_SECONDS)


def _relative(times: dict[str, float], started: float) -> Launch:
    block = times.pop("longest_block_s", None)
    return Launch({name: at - started for name, at in times.items()}, block)


@contextlib.contextmanager
def _program(command: Sequence[str], environment: Mapping[str, str], folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A program that runs while the block lasts at most, in a group of its own; its words go to a file in `folder`."""
    with open(folder / WORDS, "wb") as words:
        process = subprocess.Popen(
            command, cwd=IMPORT_FOLDER, env=environment, stdout=subprocess.DEVNULL, stderr=words, start_new_session=True
        )
        try:
            yield process
        finally:
            _end(process)


def _last_words(folder: Path) -> str:
    """The last line that a program wrote to standard error, or nothing."""
    said = (folder / WORDS).read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return said[-1] if said else ""


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ask the program to end, then end what is left of its group, which may be writing to its folder."""
    if process.poll() is None:
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GRACE_SECONDS)
    deadline = time.monotonic() + GRACE_SECONDS
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() < deadline:
            kill_group(process.pid)
            process.poll()
            time.sleep(LOOK_SECONDS)


def measure_renderer(
    source: str, resolution: tuple[int, int] | None, n_lights: int, repetitions: int, folder: Path, timeout_s: float
) -> dict[str, Any]:
    """What `benchmarks.programs.renderer` finds; transport comes from the cache in `folder` where it is there.

    Raises NotMeasured with its words.
    """
    output = folder / "renderer.json"
    options = ["--lights", str(n_lights), "--repetitions", str(repetitions), *_resolution(resolution)]
    run_program([sys.executable, "-m", RENDERER, source, str(output), *options], folder, timeout_s)
    found: dict[str, Any] = json.loads(output.read_text())
    return found


def measure_indirect(
    source: str, resolution: tuple[int, int] | None, repetitions: int, rounds: int, folder: Path, timeout_s: float
) -> tuple[dict[str, Any], Path]:
    """What `benchmarks.programs.indirect` finds from an empty cache in `folder`, and the file with its pictures.

    repetitions of edits, rounds of selections. Raises NotMeasured with its words.
    """
    output = folder / "indirect.json"
    options = ["--repetitions", str(repetitions), "--rounds", str(rounds), *_resolution(resolution)]
    run_program([sys.executable, "-m", INDIRECT, source, str(output), *options], folder, timeout_s)
    return json.loads(output.read_text()), output.with_suffix(".npz")


def measure_orbit(source: str, options: Sequence[str], folder: Path, timeout_s: float) -> dict[str, Any]:
    """What `benchmarks.programs.orbit` finds. Raises NotMeasured with its words, as where OpenGL is software."""
    output = folder / "orbit.json"
    run_program([sys.executable, "-m", ORBIT, source, str(output), *options], folder, timeout_s)
    found: dict[str, Any] = json.loads(output.read_text())
    return found


def measure_dragged_light(
    source: str, resolution: tuple[int, int], n_bounces: int, turns: Sequence[float], dims: Sequence[float],
    folder: Path, timeout_s: float,
) -> dict[str, dict[str, float]]:  # fmt: skip
    """What `benchmarks.programs.dragged_light` finds. Raises NotMeasured with its words."""
    output = folder / "dragged_light.json"
    options = [*_resolution(resolution), "--bounces", str(n_bounces)]
    options += ["--turns", *map(str, turns), "--dims", *map(str, dims)]
    run_program([sys.executable, "-m", DRAGGED_LIGHT, source, str(output), *options], folder, timeout_s)
    found: dict[str, dict[str, float]] = json.loads(output.read_text())
    return found


def run_program(command: Sequence[str], folder: Path, timeout_s: float) -> None:
    """Run a program to its end, with cache and state in `folder`; raises NotMeasured with its last words."""
    folder.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "INSITU_CACHE": str(folder / "cache"), "INSITU_STATE": str(folder / "state")}
    try:
        with _program(command, environment, folder) as process:
            status = process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        raise NotMeasured(f"not done after {timeout_s:.0f} s") from None
    except OSError as error:
        raise NotMeasured(f"{command[0]}: {error.strerror or error}") from None
    if status != 0:
        raise NotMeasured(_last_words(folder) or f"{command[0]} ended with status {status}")


def _resolution(resolution: tuple[int, int] | None) -> list[str]:
    return [] if resolution is None else ["--resolution", *map(str, resolution)]
