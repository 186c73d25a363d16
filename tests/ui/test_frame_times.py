"""Frame times and errors as they are remembered, and the milestones of a start as they are written."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path

import numpy as np

from app.messages.editor_status import Status
from ui.frame_times import RECORDED_SECONDS, RECORDED_STEP, PerformanceRecord, launch_times_from


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


def test_the_slowest_frame_of_a_moment_and_its_last_error_are_kept() -> None:
    record = PerformanceRecord()
    for now, ms, error in ((10.0, 5.0, None), (10.03, 40.0, 0.3), (10.06, 8.0, 0.2), (10.3, 6.0, None)):
        record.add_frame(now, ms, error)
    np.testing.assert_allclose(record.samples_at(11.0), [[1.0, 40.0, 0.2], [0.7, 6.0, math.nan]])


def test_nothing_older_than_two_minutes_is_reported_and_no_room_is_taken_for_it() -> None:
    record = PerformanceRecord()
    for i in range(round(3.0 * RECORDED_SECONDS / RECORDED_STEP)):
        record.add_frame(1.01 * RECORDED_STEP * i, 10.0, 0.1)
    end = 3.0 * RECORDED_SECONDS * 1.01
    found = record.samples_at(end)
    assert found[0, 0] <= RECORDED_SECONDS and found[0, 0] > 0.95 * RECORDED_SECONDS and np.isfinite(found).all()
    assert (np.diff(found[:, 0]) < 0.0).all()
    assert len(record.samples_at(end + 2.0 * RECORDED_SECONDS)) == 0 == len(PerformanceRecord().samples_at(0.0))


def test_a_pause_has_no_frames_and_keeps_its_error() -> None:
    record = PerformanceRecord()
    record.add_frame(1.0, 10.0, 0.1)
    record.add_frame(31.0, 20.0, 0.2)
    before, pause, after = record.samples_at(32.0)
    assert before.tolist() == [31.0, 10.0, 0.1] and after.tolist() == [1.0, 20.0, 0.2]
    assert math.isnan(pause[1]) and pause[0] == 1.0 + RECORDED_STEP and pause[2] == 0.1
