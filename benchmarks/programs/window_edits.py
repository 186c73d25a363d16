"""The window behind a script of edits: `python -m benchmarks.programs.window_edits JOB.json OUT.npz`.

The job and the answer are those of `progressive`, with the scene's file as `source` and the `kind` of each edit. A
picture is kept when it differs from the last one kept, which was there for a quarter of the time since the edit, and
counts from when it is read, which is in the times. At an edit's end come the picture and that of one more frame. An
object is selected before its edit, outside the times: until the picture is finished, or for three seconds. Processor
time is that of window and worker.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from app.project.assignments import set_path
from benchmarks.programs.command_line import exit_status
from benchmarks.programs.renderer import EditorRig
from engine.core.errors import InsituError
from ui.gl.context import describe_context

SELECT_SECONDS = 3.0
APART = 1.25


class Watch:
    """Seconds, and seconds of processor time of window and worker, since it was made."""

    def __init__(self, rig: EditorRig) -> None:
        self._rig = rig
        self._started, self._used = time.perf_counter(), self._used_seconds()

    def read(self) -> tuple[float, float]:
        """(seconds, processor seconds)."""
        return time.perf_counter() - self._started, self._used_seconds() - self._used

    def _used_seconds(self) -> float:
        worker = psutil.Process(self._rig.client.pid).cpu_times()
        return time.process_time() + worker.user + worker.system


class Recorder:
    """The pictures that are kept, in the form of the answer."""

    def __init__(self, rig: EditorRig) -> None:
        self.rig = rig
        self.opened = rig.renderer.linear_image()
        self.found: dict[str, list[Any]] = {name: [] for name in ("edit", "seconds", "cpu_seconds", "pictures")}

    def keep(self, index: int, watch: Watch, picture: np.ndarray) -> None:
        for name, value in zip(self.found, (index, *watch.read(), picture), strict=True):
            self.found[name].append(value)

    def look(self, index: int, watch: Watch) -> None:
        """Keep the picture if it is a new one, see above."""
        of_edit = bool(self.found["edit"]) and self.found["edit"][-1] == index
        if of_edit and watch.read()[0] < APART * self.found["seconds"][-1]:
            return
        picture = self.rig.renderer.linear_image()
        if not np.array_equal(picture, self.found["pictures"][-1] if self.found["pictures"] else self.opened):
            self.keep(index, watch, picture)


def make(rig: EditorRig, edit: dict[str, Any]) -> None:
    """Carry out an edit as the window does, and draw a frame. The steps of a drag are one step of the history."""
    if edit["kind"] == "undo":
        rig.editor.undo()
        rig.frame()
        return
    if edit["kind"] == "drag":
        rig.editor.begin_drag()
    path = f"{edit['object']}.{edit['layer']}.{edit['parameter']}"
    if (refused := rig.editor.do(set_path(rig.editor.document, path, edit["value"]))) is not None:
        raise InsituError(refused)
    rig.frame()


def select(rig: EditorRig, edit: dict[str, Any]) -> float:
    """Select what is edited; draw for so long on both clocks, or until nothing more comes. Processor seconds."""
    if edit["kind"] == "undo" or rig.editor.history.dragging:
        return 0.0
    watch = Watch(rig)
    if (refused := rig.editor.select(edit["object"])) is not None:
        raise InsituError(refused)
    rig.wait_until(lambda: rig.editor.status.is_finished or min(watch.read()) > SELECT_SECONDS)
    return watch.read()[1]


def wait(recorder: Recorder, index: int, watch: Watch, edit: dict[str, Any]) -> None:
    """Draw until the edit's horizon has passed: on both clocks, unless nothing more comes or the drag goes on."""

    def rests() -> bool:
        recorder.look(index, watch)
        seconds, used = watch.read()
        is_over = used > edit["horizon_s"] or edit["kind"] == "drag" or recorder.rig.editor.status.is_finished
        return seconds > edit["horizon_s"] and is_over

    recorder.rig.wait_until(rests)


def follow(rig: EditorRig, edits: list[dict[str, Any]]) -> dict[str, Any]:
    """The pictures after each edit, as the window would show them."""
    recorder, selecting = Recorder(rig), []
    for index, edit in enumerate(edits):
        selecting.append(select(rig, edit))
        watch = Watch(rig)
        make(rig, edit)
        recorder.look(index, watch)
        if edit["kind"] == "release":
            rig.editor.end_drag()
        wait(recorder, index, watch, edit)
        for _ in range(2 if edit["kind"] != "drag" else 0):
            recorder.keep(index, watch, rig.renderer.linear_image())
            rig.frame()
    answer = {name: np.array(values) for name, values in recorder.found.items()}
    return answer | {"opened": recorder.opened, "selecting": np.array(selecting)}


def measure(job: dict[str, Any]) -> dict[str, Any]:
    """Open the scene, wait for its picture, follow the script."""
    with contextlib.closing(EditorRig(job["source"], tuple(job["resolution"]), wait=False)) as rig:
        watch = Watch(rig)
        rig.wait_until_exact()
        opening = np.array(watch.read())
        found = follow(rig, job["edits"])
        return {**found, "opening": opening, "made_with": np.array(describe_context(rig.context))}


def main() -> int:
    """The command line; its exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.programs.window_edits")
    parser.add_argument("job", type=Path)
    parser.add_argument("output", type=Path)
    given = parser.parse_args()
    return exit_status(lambda: np.savez(given.output, **measure(json.loads(given.job.read_text()))))


if __name__ == "__main__":
    sys.exit(main())
