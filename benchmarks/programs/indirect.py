"""Indirect light in the window, timed: `python -m benchmarks.programs.indirect SCENE OUT.json`.

A program of its own, as `renderer`: the editor, the worker process and the renderer are the real ones, every time
ends with glFinish. The first picture with indirect light and the exact one go to OUT.npz, to be compared.
"""

from __future__ import annotations

import contextlib
import sys
import time

import numpy as np

from app.document.commands.curves import SetOperators
from benchmarks.programs.command_line import Figures, Pictures, command_line, resolution_of, write_found
from benchmarks.programs.renderer import EditorRig, random_edits
from engine.core.errors import InsituError
from engine.curve.operators import Operator
from engine.material.layer import object_of
from ui.gl.context import describe_context

WARM_UP = 2


def measure(source: str, resolution: tuple[int, int] | None, repetitions: int, rounds: int) -> tuple[Figures, Pictures]:
    """All figures, and the pictures (H,W,3) `first`, `fine` and which pixels see a reflecting object, `seen`."""
    with contextlib.closing(EditorRig(source, resolution, wait=False)) as rig:
        first_seconds = measure_first(rig)
        first, shown = rig.renderer.linear_image(), time.perf_counter()
        rig.wait_until_exact()
        exact_seconds = first_seconds + time.perf_counter() - shown
        pictures = {"first": first, "fine": rig.renderer.linear_image(), "seen": seen_pixels(rig)}
        following, whole = measure_freezing(rig, rounds)
        edited = reflecting(rig, editable=True) if repetitions else []
        edits = {name: measure_edits(rig, name, repetitions) for name in edited}
        return {
            "renderer": describe_context(rig.context),
            "resolution": list(first.shape[1::-1]),
            "n_bounces": rig.editor.view.settings.n_bounces,
            "first_s": first_seconds,
            "finest_s": exact_seconds,
            "freeze_s": following,
            "freeze_whole_s": whole,
            "edit_ms": {name: framed for name, (framed, _) in edits.items()},
            "exact_ms": {name: exact for name, (_, exact) in edits.items()},
            "memory_mb": rig.editor.status.precomputed_mb,
        }, pictures


def measure_first(rig: EditorRig) -> float:
    """Seconds from the frame that asks for the opened scene's light to the first picture with indirect light."""
    asked = time.perf_counter()
    while not rig.editor.scene_is_open:
        asked = time.perf_counter()
        rig.frame()
        if rig.editor.status.is_error:
            raise InsituError(rig.editor.status.message)
    if rig.editor.view.settings.n_bounces == 1:
        raise InsituError("the scene is meant to be seen without indirect light")
    rig.wait_until(lambda: rig.controller.indirect.picture.is_shown and not rig.feed.is_behind)
    return time.perf_counter() - asked


def measure_freezing(rig: EditorRig, rounds: int) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Seconds from selecting each object, another being selected, until its frozen light is in the picture and follows
    edits; and until what its gloss sends on does so, too.

    The curve's transport, which is asked for as well, comes in the meantime or afterwards. Light frozen for the last
    few objects is kept: there must be more of them for the second round to measure anything.
    """
    names = reflecting(rig)
    seconds: dict[str, list[float]] = {name: [] for name in names}
    whole: dict[str, list[float]] = {name: [] for name in names}
    rig.switch(names[-1])
    for _ in range(rounds if len(names) > 1 else 0):
        for name in names:
            started = time.perf_counter()
            refused = rig.editor.select(name)
            if refused is not None:
                raise InsituError(refused)
            rig.wait_until(lambda: rig.controller.indirect.follows_edits and not rig.feed.is_behind)
            seconds[name].append(time.perf_counter() - started)
            rig.wait_until(lambda: rig.controller.indirect.is_complete and not rig.feed.is_behind)
            whole[name].append(time.perf_counter() - started)
            rig.wait_until_exact()
    return seconds, whole


def measure_edits(rig: EditorRig, name: str, repetitions: int) -> tuple[list[float], list[float]]:
    """Milliseconds from a change of an object's curve to the frame with all its indirect light, and to the exact one.

    The frame holds as many increments of direct light as its budget allows, like every frame of the window.
    """
    rig.switch(name)
    edits = random_edits()
    for _ in range(WARM_UP):
        edit(rig, next(edits))
    found = [edit(rig, next(edits)) for _ in range(repetitions)]
    return [1e3 * framed for framed, _ in found], [1e3 * exact for _, exact in found]


def edit(rig: EditorRig, operators: tuple[Operator, ...]) -> tuple[float, float]:
    """One edit of the selected curve: seconds to the frame and to the exact picture."""
    started = time.perf_counter()
    refused = rig.editor.do(SetOperators(*rig.selected, operators))
    if refused is not None:
        raise InsituError(refused)
    rig.wait_until(lambda: not rig.feed.is_behind)
    framed = time.perf_counter() - started
    if not rig.editor.status.is_finished:
        rig.wait_until_exact()
    return framed, time.perf_counter() - started


def reflecting(rig: EditorRig, editable: bool = False) -> list[str]:
    """The objects that are seen and reflect; of these those that may be edited."""
    seen = {object_of(key) for key in rig.renderer.layer_keys}
    return [
        state.name
        for state in rig.editor.document.objects
        if state.name in seen and not state.is_lamp and (state.editable or not editable)
    ]


def seen_pixels(rig: EditorRig) -> np.ndarray:
    """Which pixels see an object that does not shine, (H,W)."""
    frame = rig.renderer.frame
    assert frame is not None
    return np.asarray((frame.object_image >= 0) & ~frame.emission_image.any(axis=2))


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = command_line("indirect", __doc__, "source")
    parser.add_argument("--resolution", nargs=2, type=int)
    parser.add_argument("--repetitions", type=int, default=30)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args(arguments)
    return write_found(
        given.output, lambda: measure(given.source, resolution_of(given), given.repetitions, given.rounds)
    )


if __name__ == "__main__":
    sys.exit(main())
