"""When the window's next frame is due: at once after input, soon while tooltips may appear, else when there is news.

Frames take processor time from the worker: mere progress of the worker can wait.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from app.messages.editor_status import Status

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
    return replace(status, frame_ms=0.0, memory_mb=0.0, seconds_left=None, fraction=round(status.fraction, 2))
