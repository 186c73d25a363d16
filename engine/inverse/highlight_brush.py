"""A brush over the picture that says what an object's highlight is to look like: which pixels, and their radiance.

A stroke is a line through places of the picture. It touches the pixels of one object that see nothing else, each by a
share: 1 near the line, falling smoothly to 0 at the brush's radius. A stroke does not add to itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import InsituError
from engine.inverse.curve_fit import HOLDING
from engine.light.environment import LUMINANCE
from engine.scene.picture_frame import PictureFrame

Effect = Literal["brighter", "darker", "tint", "as_there"]
EFFECTS: tuple[Effect, ...] = get_args(Effect)
Place = tuple[float, float]
RGB = tuple[float, float, float]
MOST_STOPS, LEAST_RADIUS, MOST_RADIUS = 10.0, 1.0, 512.0
# A pixel whose point has less than this share of it sees something else as well.
_WHOLE = 0.999
# A line that is shorter, in pixels, is a point.
_LEAST_LENGTH = 1e-6


@dataclass(frozen=True)
class HighlightBrush:
    """effect: what touched pixels are to become; stops: how much brighter or darker; radius, pixels; hardness: the
    share of it in which a stroke has its full effect; hold: how much all of the rest of the object counts, which is to
    stay as it is, beside what is touched; colour: linear, of the effects "tint", which keeps each pixel's
    luminance, and "as_there", which does not. Raises InsituError."""

    effect: Effect = "brighter"
    stops: float = 1.0
    radius: float = 16.0
    hardness: float = 0.5
    hold: float = HOLDING
    colour: RGB = (1.0, 1.0, 1.0)

    @property
    def keeps_hues(self) -> bool:
        """Whether it changes how bright a highlight is, and not its colour."""
        return self.effect in ("brighter", "darker")

    def __post_init__(self) -> None:
        if self.effect not in EFFECTS:
            raise InsituError(f"effect = {self.effect!r}, expected {', '.join(EFFECTS)}")
        _require("stops", self.stops, 0.0, MOST_STOPS)
        _require("radius", self.radius, LEAST_RADIUS, MOST_RADIUS)
        _require("hardness", self.hardness, 0.0, 1.0)
        _require("hold", self.hold, 0.0, 1.0)
        if len(self.colour) != 3 or not all(0.0 <= value <= 1e9 for value in self.colour):
            raise InsituError(f"colour = {self.colour}, expected three numbers from 0 to 1e9")


def _require(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InsituError(f"{name} = {value:g}, expected {least:g} to {most:g}")


class StrokeShares:
    """shares (p,): by how much a stroke touches each point of an object; none of those that see something else as well,
    and of those where `seen` (p, 3), the radiance in the picture, is not finite."""

    def __init__(self, frame: PictureFrame, i_object: int, brush: HighlightBrush, seen: NDArray[np.floating]) -> None:
        begin, end = frame.object_ranges[i_object]
        self._brush = brush
        self._row, self._column = frame.places(i_object)
        self._counts = (frame.share[begin:end] >= _WHOLE) & np.isfinite(seen[:, 0] + seen[:, 1] + seen[:, 2])
        self.shares: NDArray[np.float32] = np.zeros(end - begin, np.float32)

    def add(self, places: Sequence[Place]) -> None:
        """Lead the stroke through places (column, row); centres of pixels are at halves."""
        for start, stop in zip(places, places[1:] or places, strict=False):
            near = self._near(start, stop)
            distance = self._distances(near, start, stop)
            inner = self._brush.hardness * self._brush.radius
            t = np.clip((self._brush.radius - distance) / max(self._brush.radius - inner, 1e-6), 0.0, 1.0)
            self.shares[near] = np.maximum(self.shares[near], t * t * (3.0 - 2.0 * t))

    def _near(self, start: Place, stop: Place) -> NDArray[np.integer]:
        """The points (k,) in the box around the brush on its way between two places."""
        radius = self._brush.radius
        (left, right), (top, bottom) = (sorted(pair) for pair in zip(start, stop, strict=True))
        first, last = np.searchsorted(self._row, [top - radius - 0.5, bottom + radius])
        column = self._column[first:last]
        is_near = (column > left - radius - 1.0) & (column < right + radius) & self._counts[first:last]
        return np.asarray(first + np.flatnonzero(is_near))

    def _distances(self, near: NDArray[np.integer], start: Place, stop: Place) -> NDArray[np.float32]:
        """The distances (k,) of these points to the line between two places."""
        x = self._column[near].astype(np.float32) + np.float32(0.5 - start[0])
        y = self._row[near].astype(np.float32) + np.float32(0.5 - start[1])
        across, down = stop[0] - start[0], stop[1] - start[1]
        length = across * across + down * down
        if length > _LEAST_LENGTH**2:
            t = np.clip((x * np.float32(across) + y * np.float32(down)) / np.float32(length), 0.0, 1.0)
            x, y = x - t * np.float32(across), y - t * np.float32(down)
        return np.asarray(np.hypot(x, y))


def evenly(points: NDArray[np.integer], most: int) -> NDArray[np.integer]:
    """At most so many of the points (n,), evenly chosen."""
    return points[:: max(-(-len(points) // max(most, 1)), 1)]


def wanted_radiance(
    brush: HighlightBrush, seen: NDArray[np.floating], shares: NDArray[np.floating]
) -> NDArray[np.float64]:
    """What pixels of radiance (n, 3) are to become where the brush touches them by these shares (n,)."""
    seen, share = np.maximum(np.nan_to_num(seen, posinf=0.0), 0.0).astype(np.float64), shares[:, None]
    if brush.keeps_hues:
        stops = brush.stops if brush.effect == "brighter" else -brush.stops
        return np.asarray(seen * np.exp2(stops * share))
    colour = np.asarray(brush.colour)
    if brush.effect == "tint":
        luminance = float(colour @ LUMINANCE)
        colour = colour / luminance if luminance > 0.0 else np.ones(3)
        colour = (seen @ LUMINANCE)[:, None] * colour
    return np.asarray(seen + share * (colour - seen))
