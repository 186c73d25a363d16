"""The status that the status bar and the panels show: always the true state of what is on screen."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.document.node_layers import NodeCount
from app.messages.worker_messages import Progress
from app.system.memory import resident_megabytes
from engine.core.errors import first_notes, plain_line
from engine.render.picture_error import ErrorEstimate

PictureState = Literal["waiting", "preview", "refining", "finished", "exact"]
MEMORY_SECONDS = 1.0


@dataclass(frozen=True)
class Status:
    """The status at one moment; a mode may add its own.

    ``picture``: "waiting" (nothing shaded yet), "preview" (coarse, few lights, or not yet the present light or
    roughness), "refining" (in final quality; some of it still to come), "finished" (nothing more comes, but it has
    noise), "exact" (all sums are complete). ``estimate`` is the error of the finished picture, once it has been
    estimated; only it can tell that nothing is left. ``error_colours`` (H, W, 4) is the error map, as far as requested.
    ``stage``, ``fraction`` (0 to 1), ``seconds_left`` and ``text`` are the worker's progress; ``stage`` is empty when
    it is idle. ``image_error`` is the difference to the exact picture, relative RMS, None while unknown.
    ``light_note``, ``material_note`` and ``emitter_note`` tell which light, roughness and emission are shown, empty
    when they are the present ones; ``missing_note`` what a picture that is being refined lacks, or in few words what a
    preview does, with ``missing_hint`` in whole sentences; ``error_note`` the
    known parts of its error; ``no_estimate_reason`` why its error will not be estimated. ``precomputed_mb`` is the
    worker's memory for the picture, ``gpu_mb`` that of the picture on the GPU. ``shown_by``: which mode's picture is
    shown, where a mode shows those of two; else empty. ``is_away``: whether the view has moved on from the one that was
    traced last. ``is_held``: whether the picture is still that of an earlier document, until one of the present is as
    good. ``compared_exact``: whether side A of a comparison is. ``stopped``: whether the user stopped what is missing.
    ``planned_edges`` are the rays through a pixel at an edge that the scene requires, ``map_nodes`` the nodes of its
    parameter maps. ``catcher_note`` says why shadow catchers are shown as objects, empty where they are not.
    ``changed_files`` are files of the scene that other programs have written since they were read. ``looks_mb`` is the
    memory of looks side by side, with the process that draws them, ``looks_gpu_mb`` that of their textures.
    ``material_match`` says how far the match of a material is, ``material_match_note`` on which object the last one is,
    and its errors.
    ``message`` is the last event, ``is_error`` whether it is an error; ``message_number`` counts them.
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
    missing_hint: str = ""
    error_note: str = ""
    catcher_note: str = ""
    shown_by: str = ""
    compared_exact: bool = True
    is_away: bool = False
    is_held: bool = False
    map_nodes: tuple[NodeCount, ...] = ()
    message: str = ""
    is_error: bool = False
    message_number: int = 0
    notes: tuple[str, ...] = ()
    stopped: bool = False
    planned_edges: int = 0
    changed_files: tuple[str, ...] = ()
    looks_mb: float = 0.0
    looks_gpu_mb: float = 0.0
    material_match: str = ""
    material_match_note: tuple[str, str] = ("", "")

    @property
    def follows_input(self) -> bool:
        """Whether the picture is of the present view, and not of the one that was traced last."""
        return False

    @property
    def draws_moving(self) -> bool:
        """Whether the mode draws pictures while something moves, though it may not have any yet."""
        return False

    @property
    def is_finished(self) -> bool:
        """Whether nothing more comes: all that was requested is in the picture."""
        return self.picture in ("finished", "exact")

    @property
    def is_whole(self) -> bool:
        """Whether the mode's own picture is complete, though another mode's may still follow."""
        return self.is_finished or self.follows_input and self.picture == "refining"


@dataclass(frozen=True)
class HeldByLooks:
    """What pictures of looks side by side hold: the processes that draw them, bytes of pictures in the window's own
    memory, and of textures."""

    processes: tuple[int, ...] = ()
    picture_bytes: int = 0
    texture_bytes: int = 0


@dataclass
class StatusMetrics:
    """The part of a ``Status`` that is neither in the document nor a mode's. `notify` and `note` add messages and
    notes, which become plain lines, whatever names and values of files are in them."""

    message: str = ""
    is_error: bool = False
    message_number: int = 0
    progress: Progress | None = None
    notes: tuple[str, ...] = ()
    memory_mb: float = 0.0
    frame_ms: float = 0.0
    stopped: bool = False
    looks: HeldByLooks = HeldByLooks()
    _memory_at: float = -math.inf
    _looks_process_mb: float = 0.0

    def notify(self, text: str, is_error: bool) -> None:
        """Note an event."""
        self.message, self.is_error, self.message_number = plain_line(text), is_error, self.message_number + 1

    def note(self, *lines: str) -> None:
        """Add warnings about the scene that are not among the notes yet."""
        self.notes = tuple(dict.fromkeys((*self.notes, *map(plain_line, lines))))

    def measure_memory(self, now: float, worker: int | None) -> None:
        """Measure the memory of the window, the worker and what draws looks; once a second."""
        if now - self._memory_at >= MEMORY_SECONDS:
            self._memory_at = now
            self._looks_process_mb = resident_megabytes(*self.looks.processes)
            self.memory_mb = resident_megabytes(os.getpid(), worker) + self._looks_process_mb

    def status(self, worker_alive: bool) -> Status:
        """All metrics at this moment."""
        progress = self.progress or Progress("", 0.0)
        return Status(
            worker_alive=worker_alive,
            stage=progress.stage,
            fraction=progress.fraction,
            seconds_left=progress.seconds_left,
            text=progress.text,
            frame_ms=self.frame_ms,
            memory_mb=self.memory_mb,
            looks_mb=self._looks_process_mb + self.looks.picture_bytes / 1e6,
            looks_gpu_mb=self.looks.texture_bytes / 1e6,
            message=self.message,
            is_error=self.is_error,
            message_number=self.message_number,
            notes=first_notes(self.notes),
            stopped=self.stopped,
        )


def duration(seconds: float) -> str:
    """Seconds in words: "0.4 s", "12 s", "3 min"."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 119.5 else f"{seconds / 60.0:.0f} min"
