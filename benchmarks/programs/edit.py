"""One edit of a BRDF in the window, timed: `python -m benchmarks.programs.edit SCENE PATH=VALUE OUT.json`.

A program of its own, as `renderer`. The edit is made and taken back again and again; each time the first frame after
it and the exact picture are timed, in seconds and in seconds of processor time of the window and its worker together.
The pictures after the last edit go to OUT.npz.
"""

from __future__ import annotations

import contextlib
import sys
import time
from typing import Any

import numpy as np
import psutil

from app.project.project import parse_assignment, set_path
from benchmarks.programs.command_line import Figures, Pictures, command_line, resolution_of, write_found
from benchmarks.programs.renderer import EditorRig
from engine.core.errors import InsituError
from ui.gl.context import describe_context

WARM_UP = 1


def measure(
    source: str, path: str, value: Any, resolution: tuple[int, int] | None, repetitions: int
) -> tuple[Figures, Pictures]:
    """Times, and the pictures (H, W, 3) `before`, `framed` (the first frame after the edit) and `exact`."""
    with contextlib.closing(EditorRig(source, resolution)) as rig:
        rig.switch(path.partition(".")[0])
        pictures = {"before": rig.renderer.linear_image()}
        times: dict[str, list[float]] = {"frame_s": [], "frame_cpu_s": [], "exact_s": [], "exact_cpu_s": []}
        for i in range(WARM_UP + repetitions):
            found, edited = _edit(rig, path, value)
            pictures |= edited
            for name, seconds in found.items() if i >= WARM_UP else ():
                times[name].append(seconds)
            rig.editor.undo()
            rig.wait_until_exact()
        return {
            "renderer": describe_context(rig.context),
            "n_bounces": rig.editor.view.settings.n_bounces,
            **times,
        }, pictures


def _edit(rig: EditorRig, path: str, value: Any) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    command = set_path(rig.editor.document, path, value)
    started, used = time.perf_counter(), _used_seconds(rig)
    if (refused := rig.editor.do(command)) is not None:
        raise InsituError(refused)
    rig.frame()
    found = {"frame_s": time.perf_counter() - started, "frame_cpu_s": _used_seconds(rig) - used}
    framed = rig.renderer.linear_image()
    looked, look_used = time.perf_counter() - started, _used_seconds(rig) - used
    rig.wait_until_exact()
    spent, spent_used = time.perf_counter() - started - looked, _used_seconds(rig) - used - look_used
    found |= {"exact_s": found["frame_s"] + spent, "exact_cpu_s": found["frame_cpu_s"] + spent_used}
    return found, {"framed": framed, "exact": rig.renderer.linear_image()}


def _used_seconds(rig: EditorRig) -> float:
    """Processor time of this process and the worker's."""
    worker = psutil.Process(rig.client.pid).cpu_times()
    return time.process_time() + worker.user + worker.system


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = command_line("edit", __doc__, "source", "edit")
    parser.add_argument("--resolution", nargs=2, type=int)
    parser.add_argument("--repetitions", type=int, default=5)
    given = parser.parse_args(arguments)
    return write_found(
        given.output,
        lambda: measure(given.source, *parse_assignment(given.edit), resolution_of(given), given.repetitions),
    )


if __name__ == "__main__":
    sys.exit(main())
