"""Edits, curve switches and frames on the real renderer: `python -m benchmarks.programs.renderer SCENE OUT.json`.

Every time ends with glFinish. With `--start SCENE` it is a start without a display: the window's frames in a
framebuffer until the picture is exact, milestones to `INSITU_TIMES`.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from app.document.commands.curves import SetOperators
from app.document.document import Document, Selection
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.modes.placement.curves import Curves
from app.modes.placement.placement_controller import PlacementController
from app.modes.registry import PLACEMENT
from app.worker.client import Client
from benchmarks.programs.command_line import exit_status, resolution_of, write_found
from engine.core.errors import InsituError
from engine.curve.operators import HALF_PI, Operator
from engine.curve.wavelet import forward
from engine.material.layer import object_of, place_of
from engine.settings import Precision
from ui.frame_times import launch_times_from
from ui.gl.context import create_headless_context, describe_context
from ui.gl.display import DisplayView
from ui.headless import POLL_SECONDS, HeadlessWindow
from ui.modes.placement.gl.renderer import PlacementRenderer, UpdateReport
from ui.modes.placement.placement_feed import PlacementFeed
from ui.picture_feed import CURVE_POLL_SECONDS, PictureFeed

EXACT_SECONDS = 3600.0
ALL_TERMS = (1, 2, 4, 8, 16, 32, 64, 128)
TERMS_A_FRAME = 30
WIDE = 128
WARM_UP = 5


class EditorRig:
    """An editor on a scene, its worker, and a renderer that follows, until the picture is exact."""

    def __init__(
        self, source: str, resolution: tuple[int, int] | None, n_lights: int | None = None,
        curves: Curves | None = None, wait: bool = True,
    ) -> None:  # fmt: skip
        """wait: until the picture is exact."""
        self.context = create_headless_context()
        self.client = Client()
        self.editor = Editor(self.client, source, resolution=resolution, modes=(PLACEMENT,))
        if curves is not None:
            self.editor.controller = PlacementController(self.editor, curves)  # before the scene is open
        if n_lights is not None:
            self.editor.do(SetView.of(n_lights=n_lights))
        self.renderer = PlacementRenderer(self.context)
        self.feed = PictureFeed(self.context, self.editor.mode, PlacementFeed(self.context, self.renderer))
        self._frame_ms = 0.0
        if wait:
            self.wait_until_exact()

    @property
    def controller(self) -> PlacementController:
        """The editor's."""
        assert isinstance(self.editor.controller, PlacementController)
        return self.editor.controller

    def wait_until_exact(self) -> None:
        """Frames until the picture is exact; raises InsituError when it does not come."""
        self.wait_until(lambda: self.editor.status.is_finished)

    def wait_until(self, done: Callable[[], bool]) -> None:
        """Frames until `done()` after one of them; raises InsituError when that does not come."""
        end = time.monotonic() + EXACT_SECONDS
        busy = self.frame()
        while not done():
            if self.editor.status.is_error or time.monotonic() > end:
                raise InsituError(self.editor.status.message or "the picture does not become exact")
            if busy or self.feed.take(self.editor, time.monotonic()):
                busy = self.frame()
            elif not self.editor.response_arriving:  # the window rests as well: the processors are the worker's
                time.sleep(CURVE_POLL_SECONDS)

    def frame(self) -> bool:
        """One frame as the window draws it; whether another would show more."""
        started = time.perf_counter()
        self.feed.take(self.editor, time.monotonic())
        busy = self.feed.draw(self.editor, self._frame_ms)
        self.context.finish()
        self._frame_ms = 1e3 * (time.perf_counter() - started)
        return busy

    def switch(self, path: str) -> float:
        """Select a curve; seconds until its transport is uploaded and the picture drawn from it."""
        started = time.perf_counter()
        refused = self.editor.select(path)
        if refused is not None:
            raise InsituError(refused)
        self.wait_until_exact()
        return time.perf_counter() - started

    def edit(self, operators: tuple[Operator, ...], terms: int | None) -> UpdateReport:
        """One edit of the selected curve and the frame that follows it, with so many coefficients."""
        key, factor = self.selected
        self.editor.do(SetOperators(key, factor, operators))
        self.renderer.want(key, forward(self.controller.picture.wanted_coefficients(key)[factor]), factor)
        return self.draw(terms)

    def draw(self, terms: int | None) -> UpdateReport:
        report = self.renderer.update(max_coefficients=terms)
        self.renderer.composite(DisplayView())
        self.context.finish()
        return report

    @property
    def selected(self) -> tuple[str, str]:
        """(layer key, factor) of the selected curve."""
        selected = self.editor.view.selected
        assert selected is not None and selected.factor is not None
        return selected.key, selected.factor

    @property
    def n_coefficients(self) -> int:
        """Of the selected curve."""
        key, factor = self.selected
        return len(self.controller.picture.wanted_coefficients(key)[factor])

    def curves(self) -> dict[str, tuple[int, int, bool]]:
        """(coefficients, samples, whether its layer's first) of every curve with transport, in the scene's order."""
        found: dict[str, tuple[int, int, bool]] = {}
        for key, _ in self.editor.document.layers():
            name, index = object_of(key), place_of(key)
            if key not in self.renderer.layer_keys:
                continue
            n_samples = len(self.renderer.layer_radiance(key))
            for place, (factor, values) in enumerate(self.controller.picture.wanted_coefficients(key).items()):
                found[Selection(name, index, factor).path] = (len(values), n_samples, place == 0)
        return found

    def close(self) -> None:
        self.feed.close()
        self.editor.close()


def random_edits(seed: int = 5) -> Iterator[tuple[Operator, ...]]:
    """Edits that change a curve everywhere, and so every coefficient, each channel by itself."""
    rng = np.random.default_rng(seed)
    while True:
        low, high = sorted(rng.uniform(0.0, HALF_PI, 2).tolist())
        red_only = (True, False, False)
        yield (
            Operator("amplify", "y", 0.0, 0.0, HALF_PI, HALF_PI, float(rng.uniform(0.7, 1.4))),
            Operator("translate", "x", 0.0, low, high, HALF_PI, float(rng.uniform(0.0, 0.05))),
            Operator("amplify", "y", 0.0, low, high, HALF_PI, float(rng.uniform(0.8, 1.2)), 0.0, red_only),
        )


class WideCurves(Curves):
    """The planned bands, but 128 for one layer's first curve."""

    def __init__(self, wide_key: str) -> None:
        super().__init__()
        self.wide_key = wide_key

    def bands(self, document: Document, key: str) -> dict[str, int]:
        counts = super().bands(document, key)
        return counts | {next(iter(counts)): WIDE} if key == self.wide_key else counts


def measure_planned(rig: EditorRig, repetitions: int) -> dict[str, Any]:
    """Figures with the bands that the editor plans.

    Edits are of the curve with the most coefficients, of these of the one with the most samples.
    """
    curves = rig.curves()
    widest = max((path for path in curves if curves[path][2]), key=lambda path: curves[path][:2])
    switches = measure_switches(rig, list(curves), max(3, repetitions // 10))
    rig.switch(widest)
    return {
        "renderer": describe_context(rig.context),
        "curve": widest,
        "n_coefficients": curves[widest][0],
        "edit_ms_30": measure_edits(rig, TERMS_A_FRAME, repetitions),
        "exact_ms": measure_exact(rig, max(3, repetitions // 3)),
        "curve_switch_s": switches,
        "texture_mib": rig.renderer.memory_bytes / 2**20,
    }


def measure_wide(rig: EditorRig, widest: str, repetitions: int) -> dict[str, Any]:
    """Figures of that curve with 128 coefficients."""
    rig.switch(widest)
    found: dict[str, Any] = {
        "n_wide": rig.n_coefficients,
        "edit_ms_128": measure_edits(rig, None, repetitions),
        "exact_wide_ms": measure_exact(rig, max(3, repetitions // 3)),
    }
    found["frame_s"] = {"half": measure_terms(rig, repetitions)}
    found["frame_s"]["float"] = measure_float(rig, widest, repetitions)
    return found


def measure(source: str, resolution: tuple[int, int] | None, n_lights: int | None, repetitions: int) -> dict[str, Any]:
    """All figures of the renderer."""
    with contextlib.closing(EditorRig(source, resolution, n_lights)) as rig:
        found = measure_planned(rig, repetitions)
    wide = WideCurves(found["curve"].rpartition(".")[0])
    with contextlib.closing(EditorRig(source, resolution, n_lights, wide)) as rig:
        return found | measure_wide(rig, found["curve"], repetitions)


def measure_edits(rig: EditorRig, terms: int | None, repetitions: int) -> list[float]:
    """Milliseconds from a curve's change to the finished frame."""
    edits = random_edits()
    for _ in range(WARM_UP):
        rig.edit(next(edits), terms)
    return [1e3 * _timed(lambda: rig.edit(next(edits), terms)) for _ in range(repetitions)]


def measure_exact(rig: EditorRig, repetitions: int) -> list[float]:
    """Milliseconds from an edit of everything to the exact picture, 30 coefficients a frame, all frames drawn."""
    edits = random_edits(6)

    def refine() -> None:
        report = rig.edit(next(edits), TERMS_A_FRAME)
        while not report.exact:
            report = rig.draw(TERMS_A_FRAME)

    refine()
    return [1e3 * _timed(refine) for _ in range(repetitions)]


def measure_switches(rig: EditorRig, paths: list[str], rounds: int) -> dict[str, list[float]]:
    """Seconds of switching to each curve from the one before it."""
    seconds: dict[str, list[float]] = {path: [] for path in paths}
    if len(paths) < 2:
        return {}
    for path in paths:
        rig.switch(path)
    for _ in range(rounds):
        for path in paths:
            seconds[path].append(rig.switch(path))
    return seconds


def measure_terms(rig: EditorRig, repetitions: int) -> dict[str, float]:
    """Seconds of a frame by the number of coefficients, medians."""
    counts = [k for k in ALL_TERMS if k <= rig.n_coefficients]
    return {str(k): float(np.median(measure_edits(rig, k, max(5, repetitions // 3)))) / 1e3 for k in counts}


def measure_float(rig: EditorRig, widest: str, repetitions: int) -> dict[str, float]:
    """The same with transport in single precision on the GPU."""
    precision: Precision = "float"
    rig.editor.do(SetView.of(precision=precision))
    for other in [path for path in rig.curves() if path != widest][:1]:
        rig.switch(other)
        rig.switch(widest)
    return measure_terms(rig, repetitions)


def start(source: str) -> None:
    """The frames of a window that opens, without a display, until the picture is exact."""
    editor = Editor(Client(), source)
    window = HeadlessWindow(editor)
    times = launch_times_from()
    feed: PictureFeed | None = None
    busy = True
    while not editor.status.is_finished and not editor.status.is_error:
        began = time.monotonic()
        drawn = window.poll(telling=True) or busy
        if times is not None:
            times.blocked(time.monotonic() - began, editor.scene_is_open)
        if not drawn:
            time.sleep(POLL_SECONDS)
            continue
        began = time.monotonic()
        window.prepare()
        prepared = time.monotonic()
        busy = window.draw().busy
        if times is not None:
            times.blocked(prepared - began, editor.scene_is_open)
            times.blocked(time.monotonic() - prepared, editor.scene_is_open)
            times.frame_shown(editor.scene_is_open, editor.status)
        if feed is None:
            feed = PictureFeed(window.context, editor.mode)
            window.shell.source = feed
    if feed is not None:
        feed.close()
    window.close()
    editor.close()


def _timed(work: Any) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.programs.renderer", description=__doc__.splitlines()[0])
    parser.add_argument("source")
    parser.add_argument("output", nargs="?", type=Path)
    parser.add_argument("--start", action="store_true")
    parser.add_argument("--resolution", nargs=2, type=int)
    parser.add_argument("--lights", type=int)
    parser.add_argument("--repetitions", type=int, default=50)
    given = parser.parse_args(arguments)
    if given.start:
        return exit_status(lambda: start(given.source))
    if given.output is None:
        parser.error("OUT.json is missing")
    return write_found(
        given.output, lambda: measure(given.source, resolution_of(given), given.lights, given.repetitions)
    )


if __name__ == "__main__":
    sys.exit(main())
