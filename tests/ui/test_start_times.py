"""The milestones of a start, as they are written for whoever measures it."""

from __future__ import annotations

import json
import time
from pathlib import Path

from app.messages.editor_status import Status
from ui.launch_times import launch_times_from


def test_nothing_is_noted_unless_it_is_asked_for() -> None:
    assert launch_times_from({}) is None


def test_milestones_are_noted_once_and_in_steady_time(tmp_path: Path) -> None:
    file = tmp_path / "times.json"
    times = launch_times_from({"INSITU_TIMES": str(file)})
    assert times is not None
    before = time.monotonic()
    times.frame_shown(False, Status())
    assert set(json.loads(file.read_text())) == {"first_frame"}
    times.blocked(9.0, streaming=False)  # before the worker has a scene: not counted
    times.blocked(0.25, streaming=True)
    times.blocked(0.125, streaming=True)
    times.frame_shown(True, Status(picture="preview"))  # one layer is shaded, the stage is not complete
    assert set(json.loads(file.read_text())) == {"first_frame", "scene", "first_layer", "longest_block_s"}
    times.frame_shown(True, Status(picture="preview", precomputed_mb=1.0))
    first = json.loads(file.read_text())
    times.frame_shown(True, Status(picture="exact", precomputed_mb=1.0))
    last = json.loads(file.read_text())
    assert last["longest_block_s"] == 0.25
    assert {name: last[name] for name in first} == first  # what was noted stays
    assert before <= last["first_frame"] <= last["first_picture"] <= last["exact"] <= time.monotonic()
