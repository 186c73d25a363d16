"""What the status bar and the trade-off panel say: always the truth about what is on screen."""

from __future__ import annotations

import os
import resource
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

PictureState = Literal["waiting", "preview", "refining", "exact"]
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Status:
    """One moment's state.

    ``picture``: "waiting" (nothing shaded yet), "preview" (coarse, few lights, or not yet the present light or
    roughness), "refining" (final transport, curve coefficients still being stepped in), "exact".
    ``stage``, ``fraction`` (0 to 1), ``seconds_left`` and ``text`` tell how far the worker is; ``stage`` is empty when
    it has nothing to do. ``image_error`` is what is left to the exact picture, relative RMS; None while unknown.
    ``light_note`` and ``material_note`` say what is shown for light and roughness, empty when there is nothing to say.
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
    light_note: str = ""
    material_note: str = ""
    message: str = ""
    is_error: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class RenderReport:
    """What the renderer tells after a frame about the selected curve ``key``, ``factor``.

    ``shown_coefficients`` of ``wanted_coefficients`` are in the picture, ``exact`` when all are;
    ``image_error`` is what the rest would still change, relative RMS.
    """

    shown_coefficients: int = 0
    wanted_coefficients: int = 0
    image_error: float | None = None
    frame_ms: float = 0.0
    exact: bool = False


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
