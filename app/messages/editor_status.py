"""What the status bar and the panels say: always the truth about what is on screen."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import Progress
from app.system.memory import resident_megabytes
from engine.core.errors import first_notes, plain_line
from engine.render.picture_error import ErrorEstimate

PictureState = Literal["waiting", "preview", "refining", "finished", "exact"]
MEMORY_SECONDS = 1.0


@dataclass(frozen=True)
class Status:
    """One moment's state; a mode may have more to say of its picture.

    ``picture``: "waiting" (nothing shaded yet), "preview" (coarse, few lights, or not yet the present light or
    roughness), "refining" (in final quality; some of it still to come), "finished" (nothing more comes, but chance is
    left in it), "exact" (all sums are complete). ``estimate`` is how far off the picture is though nothing more
    comes, once it is finished and that has been found out; only it can tell that nothing is left. ``error_colours``
    (H, W, 4) are where, as far as that was asked for.
    ``stage``, ``fraction`` (0 to 1), ``seconds_left`` and ``text`` tell how far the worker is; ``stage`` is empty when
    it has nothing to do. ``image_error`` is what is left to the exact picture, relative RMS, None while unknown.
    ``light_note``, ``material_note`` and ``emitter_note`` say what is shown for light, roughness, and what emitters
    throw on the scene, empty when there is nothing to say; ``missing_note`` what a picture that is being refined lacks,
    ``error_note`` what of its error is known by parts; ``no_estimate_reason`` why it will not be known at all.
    ``precomputed_mb`` is what the worker keeps for the picture, ``gpu_mb`` what the picture takes there.
    ``shown_by``: which mode's picture is seen, where a mode shows those of two; else empty.
    ``is_away``: whether the view has moved on from the one that was traced last.
    ``is_held``: whether the picture is still that of an earlier document, until one of the present is as good.
    ``compared_exact``: whether side A of a comparison is. ``stopped``: whether a person stopped what is missing.
    ``planned_edges`` are the rays through a pixel at an edge that the scene requires.
    ``message`` is the last thing that happened, ``is_error`` whether it went wrong; ``message_number`` counts them.
    """

    worker_alive: bool = True
    stage: str = ""
    fraction: float = 0.0
    seconds_left: float | None = None
    text: str = ""
    picture: PictureState = "waiting"
    image_error: float | None = None
    estimate: ErrorEstimate | None = None
    error_colours: NDArray[np.uint8] | None = field(default=None, compare=False)
    no_estimate_reason: str = ""
    frame_ms: float = 0.0
    memory_mb: float = 0.0
    precomputed_mb: float = 0.0
    gpu_mb: float = 0.0
    light_note: str = ""
    material_note: str = ""
    emitter_note: str = ""
    missing_note: str = ""
    error_note: str = ""
    shown_by: str = ""
    compared_exact: bool = True
    is_away: bool = False
    is_held: bool = False
    message: str = ""
    is_error: bool = False
    message_number: int = 0
    notes: tuple[str, ...] = ()
    stopped: bool = False
    planned_edges: int = 0

    @property
    def follows_input(self) -> bool:
        """Whether what is seen is of the view as it is, and not of the one that was traced last."""
        return False

    @property
    def draws_moving(self) -> bool:
        """Whether the mode draws pictures while something moves, though it may not have any yet."""
        return False

    @property
    def is_finished(self) -> bool:
        """Whether nothing more comes: all that was asked for is in the picture."""
        return self.picture in ("finished", "exact")

    @property
    def is_whole(self) -> bool:
        """Whether it is all that the mode itself shows, though another mode's picture may still follow."""
        return self.is_finished or self.follows_input and self.picture == "refining"


@dataclass
class StatusMetrics:
    """What of a ``Status`` is neither in the document nor the mode's to say. Messages and notes come in by `notify` and
    `note`, which make them plain lines, whatever names and values of somebody's files are in them."""

    message: str = ""
    is_error: bool = False
    message_number: int = 0
    progress: Progress | None = None
    notes: tuple[str, ...] = ()
    memory_mb: float = 0.0
    frame_ms: float = 0.0
    stopped: bool = False
    _memory_at: float = -math.inf

    def notify(self, text: str, is_error: bool) -> None:
        """Something happened."""
        self.message, self.is_error, self.message_number = plain_line(text), is_error, self.message_number + 1

    def note(self, *lines: str) -> None:
        """What is odd about the scene, besides what has been said."""
        self.notes = tuple(dict.fromkeys((*self.notes, *map(plain_line, lines))))

    def measure_memory(self, now: float, worker: int | None) -> None:
        """Once a second: what the window and the worker hold."""
        if now - self._memory_at >= MEMORY_SECONDS:
            self._memory_at = now
            self.memory_mb = resident_megabytes(os.getpid(), worker)

    def status(self, worker_alive: bool) -> Status:
        """All gauges at this moment."""
        progress = self.progress or Progress("", 0.0)
        return Status(
            worker_alive=worker_alive,
            stage=progress.stage,
            fraction=progress.fraction,
            seconds_left=progress.seconds_left,
            text=progress.text,
            frame_ms=self.frame_ms,
            memory_mb=self.memory_mb,
            message=self.message,
            is_error=self.is_error,
            message_number=self.message_number,
            notes=first_notes(self.notes),
            stopped=self.stopped,
        )


def duration(seconds: float) -> str:
    """Seconds as a person says them: "0.4 s", "12 s", "3 min"."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 119.5 else f"{seconds / 60.0:.0f} min"
