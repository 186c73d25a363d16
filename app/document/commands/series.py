"""The user's choice of bands and bounces [BenArtzi07, sect. 5.2]; the plan gives what is not chosen.

J of the first bounce determines the transport, so it is part of the document, and undone; the number of bounces that
are shown and the bands of the second belong to the view.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from app.document.document import Document
from app.document.view_state import LIMITS, SetView
from engine.core.errors import LoadError

FIRST_BANDS = "series.first"
FirstBands = Literal[1, 2, 4, 8, 16, 32, 64, 128, 256, 512]
FIRST_BANDS_CHOICES: tuple[int, ...] = get_args(FirstBands)
SECOND_BANDS_CHOICES = (1, 8, 16)


@dataclass(frozen=True)
class SetFirstBands:
    """Choose J, the bands of the sharpest curves at the first bounce from the camera; None: as many as are planned."""

    bands: int | None

    @property
    def label(self) -> str:
        return "bands as planned" if self.bands is None else f"{self.bands} bands at the first bounce"

    def apply(self, document: Document) -> Document:
        return replace(document, first_bands=_checked(self.bands))


def set_first_bands(value: Any) -> SetFirstBands:
    """The command that gives ``series.first`` a value: a number of bands, or "auto"."""
    return SetFirstBands(None if value == "auto" else _checked(value))


def set_series(path: str, value: Any) -> SetView | None:
    """The change of view that gives ``series.bounces`` or ``series.second`` a value; None for any other path.

    Raises LoadError for a value that it cannot have.
    """
    if path == "series.bounces":
        low, high = map(int, LIMITS["n_bounces"])
        if isinstance(value, bool) or value not in range(low, high + 1):
            raise LoadError(path, "value", value, f"a whole number from {low} to {high}")
        return SetView.of(n_bounces=int(value))
    if path == "series.second":
        if isinstance(value, bool) or value not in (*SECOND_BANDS_CHOICES, "all"):
            raise LoadError(path, "value", value, f"{', '.join(map(str, SECOND_BANDS_CHOICES))} or all")
        return SetView.of(second_bands=None if value == "all" else int(value))
    return None


def _checked(bands: Any) -> int | None:
    """The number when it is one of bands, else LoadError."""
    if bands is None:
        return None
    if not isinstance(bands, bool) and bands in FIRST_BANDS_CHOICES:
        return int(bands)
    raise LoadError(FIRST_BANDS, "value", bands, f"one of {', '.join(map(str, FIRST_BANDS_CHOICES))}")
