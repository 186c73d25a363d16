"""What is remembered of frames and errors."""

from __future__ import annotations

import math

import numpy as np

from app.editor.performance_record import SECONDS, STEP, PerformanceRecord


def test_the_slowest_frame_of_a_moment_and_its_last_error_are_kept() -> None:
    record = PerformanceRecord()
    for now, ms, error in ((10.0, 5.0, None), (10.03, 40.0, 0.3), (10.06, 8.0, 0.2), (10.3, 6.0, None)):
        record.add_frame(now, ms, error)
    np.testing.assert_allclose(record.samples_at(11.0), [[1.0, 40.0, 0.2], [0.7, 6.0, math.nan]])


def test_nothing_older_than_two_minutes_is_reported_and_no_room_is_taken_for_it() -> None:
    record = PerformanceRecord()
    for i in range(round(3.0 * SECONDS / STEP)):
        record.add_frame(1.01 * STEP * i, 10.0, 0.1)
    end = 3.0 * SECONDS * 1.01
    found = record.samples_at(end)
    assert found[0, 0] <= SECONDS and found[0, 0] > 0.95 * SECONDS and np.isfinite(found).all()
    assert (np.diff(found[:, 0]) < 0.0).all()
    assert len(record.samples_at(end + 2.0 * SECONDS)) == 0 == len(PerformanceRecord().samples_at(0.0))


def test_a_pause_has_no_frames_and_keeps_its_error() -> None:
    record = PerformanceRecord()
    record.add_frame(1.0, 10.0, 0.1)
    record.add_frame(31.0, 20.0, 0.2)
    before, pause, after = record.samples_at(32.0)
    assert before.tolist() == [31.0, 10.0, 0.1] and after.tolist() == [1.0, 20.0, 0.2]
    assert math.isnan(pause[1]) and pause[0] == 1.0 + STEP and pause[2] == 0.1
