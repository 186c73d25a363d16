"""What the status bar and the trade-off panel say: always the truth about what is on screen."""

from __future__ import annotations

import math
import os
import resource
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from app.jobs.messages import Progress
from app.negotiator import Negotiator
from engine.plan import Precision

PictureState = Literal["waiting", "preview", "refining", "exact"]
MEMORY_SECONDS = 1.0
FLOATS: dict[Precision, str] = {"half": "half floats", "float": "full floats"}
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Status:
    """One moment's state.

    ``picture``: "waiting" (nothing shaded yet), "preview" (coarse, few lights, or not yet the present light or
    roughness), "refining" (final transport, curve coefficients still being stepped in), "exact".
    ``stage``, ``fraction`` (0 to 1), ``seconds_left`` and ``text`` tell how far the worker is; ``stage`` is empty when
    it has nothing to do. ``image_error`` is what is left to the exact picture, relative RMS; None while unknown.
    ``light_note``, ``material_note`` and ``transport_note`` say what is shown for light, roughness and precision, empty
    when there is nothing to say. ``gpu_mb`` is what the picture and the selected curve's transport take there.
    ``bands`` are those of each layer's transport by key, as asked of the worker; none of a layer that is fixed.
    ``indirect_noise`` is what chance is left in the indirect light, relative RMS; None while unknown.
    ``compared_exact``: whether side A of a comparison is.
    ``message`` is the last thing that happened, ``is_error`` whether it went wrong.
    """

    worker_alive: bool = True
    stage: str = ""
    fraction: float = 0.0
    seconds_left: float | None = None
    text: str = ""
    picture: PictureState = "waiting"
    shown_coefficients: int = 0
    wanted_coefficients: int = 0
    image_error: float | None = None
    frame_ms: float = 0.0
    memory_mb: float = 0.0
    transport_mb: float = 0.0
    gpu_mb: float = 0.0
    bands: tuple[tuple[str, tuple[int, ...]], ...] = ()
    light_note: str = ""
    material_note: str = ""
    compared_exact: bool = True
    indirect_noise: float | None = None
    transport_note: str = ""
    message: str = ""
    is_error: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class RenderReport:
    """What the renderer tells after a frame about the selected curve ``key``, ``factor``.

    ``shown_coefficients`` of ``wanted_coefficients`` are in the picture, ``exact`` when all are;
    ``image_error`` is what the rest would still change, relative RMS. ``precision`` is that of the transport the
    picture is made with, None while there is none; ``gpu_mb`` the memory of all textures.
    """

    shown_coefficients: int = 0
    wanted_coefficients: int = 0
    image_error: float | None = None
    frame_ms: float = 0.0
    exact: bool = False
    precision: Precision | None = None
    gpu_mb: float = 0.0


@dataclass
class Gauges:
    """What a ``Status`` is read from, as far as it is not in the document or the talk with the worker."""

    message: str = ""
    is_error: bool = False
    progress: Progress | None = None
    report: RenderReport = field(default_factory=RenderReport)
    has_picture: bool = False
    notes: tuple[str, ...] = ()
    transport_mb: float = 0.0
    memory_mb: float = 0.0
    _memory_at: float = -math.inf

    def picture_changed(self) -> None:
        """Something the picture is made of changed: until the renderer reports again, it is not exact."""
        self.report = replace(self.report, exact=False)

    def measure_memory(self, now: float, worker: int | None) -> None:
        """Once a second: what the window and the worker hold."""
        if now - self._memory_at >= MEMORY_SECONDS:
            self._memory_at = now
            self.memory_mb = resident_megabytes(os.getpid(), worker)

    def status(
        self, talk: Negotiator, worker_alive: bool, opening: bool, wanted: Precision, indirect_is_complete: bool = True
    ) -> Status:
        """All gauges at this moment; ``wanted``: the precision that is asked for."""
        progress, report = self.progress or Progress("", 0.0), self.report
        return Status(
            worker_alive=worker_alive,
            stage=progress.stage,
            fraction=progress.fraction,
            seconds_left=progress.seconds_left,
            text=progress.text,
            picture=self._picture_state(talk, opening, indirect_is_complete),
            shown_coefficients=report.shown_coefficients,
            wanted_coefficients=report.wanted_coefficients,
            image_error=report.image_error,
            frame_ms=report.frame_ms,
            memory_mb=self.memory_mb,
            transport_mb=self.transport_mb,
            gpu_mb=report.gpu_mb,
            bands=tuple((shape.key, shape.bands_kept) for shape in talk.layers_asked),
            light_note=_light_note(talk) if self.has_picture else "",
            material_note=_material_note(talk) if self.has_picture else "",
            transport_note=_transport_note(talk, report.precision, wanted),
            message=self.message,
            is_error=self.is_error,
            notes=self.notes,
        )

    def _picture_state(self, talk: Negotiator, opening: bool, indirect_is_complete: bool) -> PictureState:
        if not self.has_picture:
            return "waiting"
        if opening or not (talk.shows_final or talk.transport_is_current and talk.delivered_final):
            return "preview"
        return "exact" if talk.finished and self.report.exact and indirect_is_complete else "refining"


def _light_note(talk: Negotiator) -> str:
    """What light the picture shows, in words."""
    if talk.asked_rotation is None:
        return ""
    asked = f"{talk.asked_rotation:.1f}°"
    if talk.drag_quality:
        return f"quick picture for {asked}; the exact one follows when you let go"
    if not talk.light_is_current:
        return f"shown for {asked}; the new light follows when the hand rests"
    return f"exact for {asked}" if talk.delivered_final else f"being refined for {asked}"


def _material_note(talk: Negotiator) -> str:
    """What of the materials the picture does not show yet, in words."""
    if not talk.quotient_is_current:
        return "the curve is shown at once; self-shadowing follows when the hand rests"
    return "" if talk.fixed_is_current else "the curve of a fixed object follows when the hand rests"


def _transport_note(talk: Negotiator, shown: Precision | None, wanted: Precision) -> str:
    """What of the transport is not yet as it is asked for, in words: bands, or the floats of the selected curve's."""
    if talk.becoming_editable:
        return f"{', '.join(talk.becoming_editable)}: shown as it was until its bands are here"
    if shown is None or shown == wanted:
        return ""
    return f"made with {FLOATS[shown]} until {FLOATS[wanted]} are here"


def resident_megabytes(*pids: int | None) -> float:
    """Memory that these processes hold in RAM, together, in MB; of this one alone where the system does not tell."""
    pages = 0
    for pid in pids:
        try:
            pages += int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        except (OSError, ValueError, IndexError):
            continue
    if pages:
        return pages * _PAGE / 1e6
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / 1e6 if sys.platform == "darwin" else most / 1e3
