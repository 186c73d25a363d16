"""A light that is dragged in the window: `python -m benchmarks.programs.dragged_light SCENE OUT.json`.

A program of its own, as `renderer`: editor, worker process and renderer are the real ones. The sky is turned, or all
emitters are dimmed, in steps; the last picture of each drag is compared with the exact one that follows it.
"""

from __future__ import annotations

import contextlib
import itertools
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import moderngl
import numpy as np

from app.document.commands import EditCommand
from app.document.commands.light import SetEmission, SetRotation
from app.document.document import Document
from app.document.light_mix import emission_of
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.picture_events import PictureEvent
from app.modes.placement.placement_events import IndirectRadiance
from benchmarks.programs.command_line import Figures, command_line, resolution_of, write_found
from benchmarks.programs.renderer import EditorRig
from engine.core.errors import InsituError
from engine.render.picture_difference import errors
from ui.gl.display import DisplayView
from ui.modes.placement.gl.renderer import PlacementRenderer
from ui.modes.placement.placement_feed import PlacementFeed
from ui.picture_feed import PictureFeed

N_STEPS = 4
STIR = 1e-7
# Without a sky that could turn, nothing is prepared.
PREPARED_SECONDS = 240.0
# The commands of a drag at a fraction of its way.
Drag = Callable[[float], list[EditCommand]]


@dataclass(frozen=True, eq=False)
class _Pictures:
    """The linear picture (H, W, 3), its direct light, and the picture as the screen shows it."""

    whole: np.ndarray
    direct: np.ndarray
    shown: np.ndarray


class _RecordingFeed(PlacementFeed):
    """Remembers the indirect light of each layer."""

    def __init__(self, context: moderngl.Context, renderer: PlacementRenderer) -> None:
        super().__init__(context, renderer)
        self.indirect: dict[str, IndirectRadiance] = {}

    def take(self, editor: Editor, event: PictureEvent) -> None:
        if isinstance(event, IndirectRadiance):
            self.indirect[event.key] = event
        super().take(editor, event)


def measure(
    source: str, resolution: tuple[int, int] | None, n_bounces: int, turns: list[float], dims: list[float]
) -> Figures:
    """By drag: relRMSE of its last picture against the exact one (`error`), and of its indirect light over the exact
    direct light (`indirect`); the mean change (of 255) of what the screen shows between both; seconds of a step."""
    with contextlib.closing(EditorRig(source, resolution, wait=False)) as rig:
        rig.feed = PictureFeed(rig.context, rig.editor.mode, _RecordingFeed(rig.context, rig.renderer))
        rig.wait_until(lambda: rig.editor.scene_is_open)
        rig.editor.do(SetView.of(n_bounces=n_bounces))
        rig.wait_until_exact()
        _wait_until_prepared(rig)
        at_rest = rig.editor.document
        drags = {f"turned by {degrees:g}°": _turn(at_rest, degrees) for degrees in turns}
        drags |= {f"emitters at {factor:g}": _dim(at_rest, factor) for factor in dims}
        return {name: _measure_drag(rig, drag) for name, drag in drags.items()}


def _measure_drag(rig: EditorRig, drag: Drag) -> Figures:
    editor = rig.editor
    editor.begin_drag()
    seconds = []
    for step in range(1, N_STEPS + 1):
        seconds.append(_move(rig, drag, step / N_STEPS))
    last = _pictures(rig)
    editor.end_drag()
    rig.wait_until_exact()
    exact = _pictures(rig)
    _do(rig, drag(0.0))
    rig.wait_until_exact()
    _wait_until_prepared(rig)
    return {
        "error": errors(last.whole, exact.whole).rmse,
        "indirect": errors(exact.direct + last.whole - last.direct, exact.whole).rmse,
        "jump": 255.0 * float(np.abs(last.shown - exact.shown).mean()),
        "first_step_s": seconds[0],
        "step_s": statistics.median(seconds[1:]),
    }


def _move(rig: EditorRig, drag: Drag, share: float) -> float:
    """Drag the light there, and on by a little in each frame: for an idle one the exact picture would be requested.
    Seconds until the picture is there."""
    started = time.perf_counter()
    frames = itertools.count()

    def is_shown() -> bool:
        _do(rig, drag(share * (1.0 + STIR * next(frames))))
        wanted, drawn = (_light_values(each) for each in (rig.editor.document, rig.controller.picture.document))
        return np.allclose(drawn, wanted, rtol=1e-3) and not rig.feed.is_behind

    rig.wait_until(is_shown)
    return time.perf_counter() - started


def _light_values(document: Document) -> list[float]:
    """Rotation and emission as numbers."""
    return [document.light.rotation, *(value for _, radiance in emission_of(document) for value in radiance)]


def _turn(document: Document, degrees: float) -> Drag:
    return lambda share: [SetRotation(document.light.rotation + share * degrees)]


def _dim(document: Document, factor: float) -> Drag:
    def at(share: float) -> list[EditCommand]:
        gain = 1.0 + share * (factor - 1.0)
        return [
            SetEmission(name, (gain * radiance[0], gain * radiance[1], gain * radiance[2]))
            for name, radiance in emission_of(document)
        ]

    return at


def _do(rig: EditorRig, commands: list[EditCommand]) -> None:
    for command in commands:
        refused = rig.editor.do(command)
        if refused is not None:
            raise InsituError(refused)
    rig.frame()  # requests what is missing


def _pictures(rig: EditorRig) -> _Pictures:
    whole, shown = rig.renderer.linear_image(), rig.renderer.finished_image(DisplayView())
    feed = rig.feed.source
    assert isinstance(feed, _RecordingFeed)
    events = list(feed.indirect.values())
    for event in events:
        feed.take(rig.editor, IndirectRadiance(event.key))
    direct = rig.renderer.linear_image()
    for event in events:
        feed.take(rig.editor, event)
    return _Pictures(whole, direct, shown)


def _wait_until_prepared(rig: EditorRig) -> None:
    """Frames until the scene is ready for other light, or it is clear that it will not be."""
    end = time.monotonic() + PREPARED_SECONDS
    rig.wait_until(lambda: rig.controller.idle.relight.is_ready or time.monotonic() > end)


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = command_line("dragged_light", __doc__, "source")
    parser.add_argument("--resolution", nargs=2, type=int)
    parser.add_argument("--bounces", type=int, default=4)
    parser.add_argument("--turns", nargs="*", type=float, default=[])
    parser.add_argument("--dims", nargs="*", type=float, default=[])
    given = parser.parse_args(arguments)
    return write_found(
        given.output, lambda: measure(given.source, resolution_of(given), given.bounces, given.turns, given.dims)
    )


if __name__ == "__main__":
    sys.exit(main())
