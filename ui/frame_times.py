"""When the window's next frame is due, and how long frames and a launch took.

A frame is due at once after input, soon while tooltips may appear, else when there is news. Frames take processor time
from the worker: mere progress of the worker can wait. The accuracy panel shows frame times and errors of the last two
minutes.

The milestones of a launch, and the longest time that its thread was blocked, are written to a file for `make measure`:
the environment variable `INSITU_TIMES` names it; without it nothing is written. Times are of the system's steady clock,
which all processes of a machine share, so that the launching process can subtract its own.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.messages.editor_status import Status
from app.system.atomic import replacing

# After an event tooltips and hover need frames for this long, one every `REDRAW_SECONDS`.
SETTLE_SECONDS = 0.9
REDRAW_SECONDS = 0.1
# For this long frames follow each other at once.
AT_ONCE_SECONDS = 0.05
# Frames that the layout takes to settle after the start.
FIRST_FRAMES = 3
# After an event, however long they take: the first processes it, the second shows its effect on panels drawn earlier.
INPUT_FRAMES = 2
# How often the worker's progress alone is drawn.
PROGRESS_SECONDS = 0.1


@dataclass(frozen=True)
class FrameResult:
    """`busy`: another frame should follow at once; `redraw_in`: else after this many seconds, None when nothing is due.

    `screenshot`: the file for this frame's pixels, if the user asked for one; `quit`: whether the window was asked to
    close; `drawn`: whether there is a picture of the window at all: the last one stays where a frame failed.
    """

    busy: bool
    redraw_in: float | None = None
    screenshot: Path | None = None
    quit: bool = False
    drawn: bool = True


class FramePacing:
    """`inputs` counts what requested a frame. clock: steady, in seconds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.inputs = 0
        self._n_frames = 0
        self._last_input, self._input_frame = -math.inf, 0
        self._drawn_status: Status | None = None
        self._drawn_at = -math.inf

    def note_input(self) -> None:
        """An event came: tooltips and hover need frames for a short time."""
        self.inputs += 1
        self._last_input, self._input_frame = self._clock(), self._n_frames

    def note_change(self) -> None:
        """The window itself changed: it needs a frame."""
        self.inputs += 1

    def begin_frame(self, now: float, status: Status) -> None:
        """A frame that shows this status is being drawn."""
        self._n_frames += 1
        self._drawn_status, self._drawn_at = _relevant_status(status), now

    @property
    def has_started(self) -> bool:
        """Whether the first frames have been drawn."""
        return self._n_frames > FIRST_FRAMES

    def has_news(self, now: float, status: Status) -> bool:
        """Whether the status differs from what was drawn; progress alone counts after a tenth of a second."""
        current, drawn = _relevant_status(status), self._drawn_status
        if drawn is None or current == drawn:
            return drawn is None
        only_progress = replace(current, fraction=drawn.fraction, text=drawn.text) == drawn
        return not only_progress or now - self._drawn_at >= PROGRESS_SECONDS

    @property
    def is_settling(self) -> bool:
        """Whether the next frame is due at once."""
        n_wanted = max(FIRST_FRAMES, self._input_frame + INPUT_FRAMES)
        return self._since_input < AT_ONCE_SECONDS or self._n_frames < n_wanted

    @property
    def redraw_in(self) -> float | None:
        """Seconds until the next frame is due after an event; None where none is."""
        return REDRAW_SECONDS if self._since_input < SETTLE_SECONDS else None

    @property
    def _since_input(self) -> float:
        return self._clock() - self._last_input


def _relevant_status(status: Status) -> Status:
    """The part of the status that requires a frame when it changes."""
    return replace(
        status, frame_ms=0.0, memory_mb=0.0, looks_mb=0.0, seconds_left=None, fraction=round(status.fraction, 2)
    )


RECORDED_SECONDS = 120.0
RECORDED_STEP = 0.25  # samples within it are merged
# After a pause this long without a frame nothing was drawn, and the record has a gap.
_PAUSE = 1.0


class PerformanceRecord:
    """A ring of samples: when, the time of the slowest frame in ms, and the last relative RMS error (NaN where
    unknown)."""

    def __init__(self) -> None:
        self._samples = np.full((round(RECORDED_SECONDS / RECORDED_STEP), 3), np.nan)
        self._samples[:, 0] = -math.inf
        self._newest = 0

    def add_frame(self, now: float, frame_ms: float, error: float | None) -> None:
        """Record a frame. now: seconds of a steady clock."""
        sample = self._samples[self._newest]
        if now - sample[0] >= RECORDED_STEP:
            self._newest = (self._newest + 1) % len(self._samples)
            sample = self._samples[self._newest]
            sample[:] = now, frame_ms, np.nan
        sample[1] = max(sample[1], frame_ms)
        sample[2] = np.nan if error is None else error

    def samples_at(self, now: float) -> NDArray[np.float64]:
        """Samples (n, 3), oldest first: age in s, slowest frame in ms, and error. Before a sample that follows a pause
        there is a row without a time, with the error that held during the pause."""
        samples = np.roll(self._samples, -self._newest - 1, axis=0)
        samples = samples[now - samples[:, 0] <= RECORDED_SECONDS]
        ages = now - samples[:, 0]
        breaks = np.flatnonzero(-np.diff(ages) > _PAUSE)
        found = np.column_stack([ages, samples[:, 1:]])
        still = np.column_stack([ages[breaks + 1] + RECORDED_STEP, np.full(len(breaks), np.nan), found[breaks, 2]])
        return np.asarray(np.insert(found, breaks + 1, still, axis=0))


TIMES_VARIABLE = "INSITU_TIMES"


class LaunchTimes:
    """The milestones of one start, and the longest block while the worker streams.

    first_frame; scene (opened); first_layer (something is shaded); first_picture (every layer is, if coarsely); exact.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._content: dict[str, float] = {}

    def blocked(self, seconds: float, streaming: bool) -> None:
        """Note that the window's thread was busy for so long; it counts while the worker has a scene to stream."""
        if streaming:
            self._content["longest_block_s"] = max(self._content.get("longest_block_s", 0.0), seconds)

    def frame_shown(self, scene_is_open: bool, status: Status) -> None:
        """Note that a frame is on screen, and which milestones it is the first to show."""
        reached = {
            "first_frame": True,
            "scene": scene_is_open,
            "first_layer": status.picture != "waiting",
            "first_picture": status.picture != "waiting" and status.precomputed_mb > 0.0,
            "exact": status.is_finished,
        }
        news = [name for name, is_so in reached.items() if is_so and name not in self._content]
        if news:
            now = time.monotonic()
            self._content |= dict.fromkeys(news, now)
            with replacing(self._file, durable=False) as file:
                file.write(json.dumps(self._content).encode())


def launch_times_from(environment: Mapping[str, str] = os.environ) -> LaunchTimes | None:
    """The object that notes the times, where the variable is set."""
    file = environment.get(TIMES_VARIABLE)
    return LaunchTimes(Path(file)) if file else None
