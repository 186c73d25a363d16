"""A stroke on a highlight while it is painted and solved for: where it went, what it asks of the picture, and what has
come of that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.modes.placement.painted_curves import MOST_PIXELS
from engine.curve.tables import Float64Array, TabulatedCurve
from engine.inverse.highlight_brush import HighlightBrush, Place, StrokeShares, evenly, wanted_radiance
from engine.scene.picture_frame import PictureFrame

# Pixels that decide while the button is held.
LIVE_PIXELS = 512


@dataclass(frozen=True, eq=False)
class PaintedOutcome:
    """What a stroke has reached. reached: the share of the wanted change, 0 to 1, by root mean square; pixel (n,):
    row-major indices of the pixels that decided; missing (n, 3): the radiance that no change of the curves adds; size:
    the root mean square of the wanted change."""

    reached: float
    size: float
    pixel: NDArray[np.integer]
    missing: NDArray[np.floating]


@dataclass(eq=False)
class HighlightStroke:
    """key: of the selected layer; names: of the curves to solve for; before: the document at the press, and seen (p, 3)
    the picture then, at the points of the object of this number.

    continued: the operators of strokes before, by layer and curve, that this one goes on with; base: the document that
    is solved from, and base_change what its curves are more than those of `before`, by name;
    change: the same of the last answer.
    """

    key: str
    names: tuple[str, ...]
    brush: HighlightBrush
    before: Document
    frame: PictureFrame
    i_object: int
    seen: NDArray[np.floating]
    place: Place
    base: Document
    continued: dict[tuple[str, str], TabulatedCurve] = field(default_factory=dict)
    base_change: dict[str, Float64Array] = field(default_factory=dict)
    change: dict[str, Float64Array] = field(default_factory=dict)
    is_held: bool = True
    is_recorded: bool = False  # an answer is in the history
    n_compared: int = 0
    decided: NDArray[np.integer] = field(default_factory=lambda: np.zeros(0, int))
    _version: int = 0
    _answered: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        self._touched = StrokeShares(self.frame, self.i_object, self.brush, self.seen)
        self._touched.add([self.place])

    def extend(self, places: Sequence[Place]) -> None:
        """Go on through places of the picture."""
        self._touched.add([self.place, *places])
        self.place = places[-1]
        self._version += 1

    @property
    def form(self) -> tuple[int, int]:
        """What decides its answer: how often it went on, and how many pixels count."""
        return self._version, LIVE_PIXELS if self.is_held else MOST_PIXELS

    @property
    def is_answered(self) -> bool:
        """Whether its present form has been solved for."""
        return self._answered == self.form

    def note_answer(self, form: tuple[int, int], decided: NDArray[np.integer]) -> None:
        """An answer to this form of it has come, by these points."""
        self._answered, self.decided = form, decided

    def touched(self) -> NDArray[np.integer]:
        """The numbers (n,) of the object's points that it touches, ascending."""
        return np.flatnonzero(self._touched.shares > 0.0)

    def points(self, touched: NDArray[np.integer]) -> NDArray[np.integer]:
        """Those of them that decide its present form."""
        return evenly(touched, self.form[1])

    def wanted(self, points: NDArray[np.integer]) -> NDArray[np.float64]:
        """The radiance (n, 3) that points are to have."""
        return wanted_radiance(self.brush, self.seen[points], self._touched.shares[points])

    def outcome(self, missing: NDArray[np.floating]) -> PaintedOutcome:
        """What is reached where this radiance (n, 3) is missing at the points that decided."""
        size = _rms(self.wanted(self.decided) - self.seen[self.decided])
        reached = 1.0 - _rms(missing) / size if size > 0.0 else 1.0
        pixel = self.frame.pixel[self.frame.object_ranges[self.i_object, 0] + self.decided]
        return PaintedOutcome(float(np.clip(reached, 0.0, 1.0)), size, pixel, missing)


def _rms(radiance: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(radiance)))) if radiance.size else 0.0
