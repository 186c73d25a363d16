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
from app.placement.transport_talk import TransportTalk
from engine.errors import plain_line
from engine.plan import Precision

PictureState = Literal["waiting", "preview", "refining", "finished", "exact"]
MEMORY_SECONDS = 1.0
# Noise of the whole picture below which it counts as none: a step of eight bits is four times as large.
NO_NOISE = 1e-3
FLOATS: dict[Precision, str] = {"half": "half floats", "float": "full floats"}
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Status:
    """One moment's state.

    ``picture``: "waiting" (nothing shaded yet), "preview" (coarse, few lights, or not yet the present light or
    roughness), "refining" (final transport; curve coefficients, indirect light or its noise still to come), "finished"
    (nothing more comes, but chance is left in the indirect light), "exact" (nothing is left).
    ``stage``, ``fraction`` (0 to 1), ``seconds_left`` and ``text`` tell how far the worker is; ``stage`` is empty when
    it has nothing to do. ``image_error`` is what is left to the exact picture, relative RMS: ``curve_error``, of curve
    coefficients that are not in it yet, and the noise of its indirect light; None while either is unknown.
    ``light_note``, ``material_note``, ``emitter_note`` and ``transport_note`` say what is shown for light, roughness,
    what emitters throw on the scene and precision, empty when there is nothing to say. ``gpu_mb`` is what the picture
    and the selected curve's transport take there.
    ``bands`` are those of each layer's transport by key, as asked of the worker; none of a layer that is fixed.
    ``indirect_noise`` is what chance is left in the indirect light, RMS relative to its own mean; None while unknown.
    ``bounces_note`` says what of the light so many bounces leave out, empty where that is little.
    ``compared_exact``: whether side A of a comparison is. ``stopped``: whether a person stopped what is missing.
    ``message`` is the last thing that happened, ``is_error`` whether it went wrong; ``message_number`` counts them.
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
    curve_error: float | None = None
    frame_ms: float = 0.0
    memory_mb: float = 0.0
    transport_mb: float = 0.0
    gpu_mb: float = 0.0
    bands: tuple[tuple[str, tuple[int, ...]], ...] = ()
    light_note: str = ""
    material_note: str = ""
    emitter_note: str = ""
    compared_exact: bool = True
    indirect_noise: float | None = None
    transport_note: str = ""
    message: str = ""
    is_error: bool = False
    message_number: int = 0
    notes: tuple[str, ...] = ()
    bounces_note: str = ""
    stopped: bool = False

    @property
    def is_finished(self) -> bool:
        """Whether nothing more comes: all that was asked for is in the picture."""
        return self.picture in ("finished", "exact")


@dataclass(frozen=True)
class RenderReport:
    """What the renderer tells after a frame about the selected curve ``key``, ``factor``.

    ``shown_coefficients`` of ``wanted_coefficients`` are in the picture, ``exact`` when all are;
    ``image_error`` is what the rest would still change, relative RMS. ``precision`` is that of the transport the
    picture is made with, None while there is none; ``gpu_mb`` the memory of all textures; ``mean_radiance`` that of the
    direct light.
    """

    shown_coefficients: int = 0
    wanted_coefficients: int = 0
    image_error: float | None = None
    frame_ms: float = 0.0
    exact: bool = False
    precision: Precision | None = None
    gpu_mb: float = 0.0
    mean_radiance: float = 0.0


@dataclass
class Gauges:
    """What a ``Status`` is read from, as far as it is not in the document or the talk with the worker. ``bounces``: a
    number of them, and what is to be said of it."""

    message: str = ""
    is_error: bool = False
    message_number: int = 0
    progress: Progress | None = None
    report: RenderReport = field(default_factory=RenderReport)
    has_picture: bool = False
    notes: tuple[str, ...] = ()
    bounces: tuple[int, str] = (0, "")
    transport_mb: float = 0.0
    memory_mb: float = 0.0
    stopped: bool = False
    _memory_at: float = -math.inf

    def notify(self, text: str, is_error: bool) -> None:
        """Something happened."""
        self.message, self.is_error, self.message_number = plain_line(text), is_error, self.message_number + 1

    def picture_changed(self) -> None:
        """Something the picture is made of changed: until the renderer reports again, it is not exact."""
        self.report = replace(self.report, exact=False)

    def measure_memory(self, now: float, worker: int | None) -> None:
        """Once a second: what the window and the worker hold."""
        if now - self._memory_at >= MEMORY_SECONDS:
            self._memory_at = now
            self.memory_mb = resident_megabytes(os.getpid(), worker)

    def status(
        self, talk: TransportTalk, worker_alive: bool, opening: bool, wanted: Precision,
        is_complete: bool = True, noise: float = 0.0,
    ) -> Status:  # fmt: skip
        """All gauges at this moment.

        ``wanted``: the precision that is asked for; ``is_complete``: whether all else that makes the picture, indirect
        light and images, is there; ``noise``: the chance in the whole picture.
        """
        progress, report = self.progress or Progress("", 0.0), self.report
        picture = self._picture_state(talk, opening, is_complete, noise)
        known = picture not in ("waiting", "preview")
        return Status(
            worker_alive=worker_alive,
            stage=progress.stage,
            fraction=progress.fraction,
            seconds_left=progress.seconds_left,
            text=progress.text,
            picture=picture,
            shown_coefficients=report.shown_coefficients,
            wanted_coefficients=report.wanted_coefficients,
            image_error=math.hypot(report.image_error or 0.0, noise) if known and is_complete else None,
            curve_error=report.image_error if known else None,
            frame_ms=report.frame_ms,
            memory_mb=self.memory_mb,
            transport_mb=self.transport_mb,
            gpu_mb=report.gpu_mb,
            bands=tuple((shape.key, shape.bands_kept) for shape in talk.layers_asked),
            light_note=_light_note(talk) if self.has_picture else "",
            material_note=_material_note(talk) if self.has_picture else "",
            emitter_note=_emitter_note(talk) if self.has_picture else "",
            transport_note=_transport_note(talk, report.precision, wanted),
            message=self.message,
            is_error=self.is_error,
            message_number=self.message_number,
            notes=self.notes,
            stopped=self.stopped,
        )

    def _picture_state(self, talk: TransportTalk, opening: bool, is_complete: bool, noise: float) -> PictureState:
        if not self.has_picture:
            return "waiting"
        if opening or not (talk.shows_final or talk.transport_is_current and talk.delivered_final):
            return "preview"
        if not (talk.finished and self.report.exact and is_complete):
            return "refining"
        return "exact" if noise <= NO_NOISE else "finished"


def _light_note(talk: TransportTalk) -> str:
    """What light the picture shows, in words."""
    if talk.asked_rotation is None:
        return ""
    asked = f"{talk.asked_rotation:.1f}°"
    if talk.drag_quality:
        return f"quick picture for {asked}; the final one follows when you let go"
    if not talk.light_is_current:
        return f"shown for {asked}; the new light follows when the hand rests"
    if talk.delivered_final:
        return ""
    return f"{'being refined' if talk.running else 'a preview'} for {asked}"


def _emitter_note(talk: TransportTalk) -> str:
    """Whose light the picture shows, in words, where emitters were changed."""
    if talk.drag_quality:
        return "a quick picture of the light it throws; the final one follows when you let go"
    if not talk.light_is_current:
        return "the light it throws follows when the hand rests"
    if talk.emitters_are_all:
        return "all the light there is: what it throws follows at once"
    return "" if talk.delivered_final else "the light it throws is being refined"


def _material_note(talk: TransportTalk) -> str:
    """What of the materials the picture does not show yet, in words."""
    if not talk.quotient_is_current:
        return "the curve is shown at once; self-shadowing follows when the hand rests"
    return "" if talk.fixed_is_current else "the curve of a fixed object follows when the hand rests"


def _transport_note(talk: TransportTalk, shown: Precision | None, wanted: Precision) -> str:
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
