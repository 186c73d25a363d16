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
        if not all(0.0 <= value <= 1e9 for value in self.colour):
            raise InsituError(f"colour = {self.colour}, expected three numbers from 0 to 1e9")


def _require(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InsituError(f"{name} = {value:g}, expected {least:g} to {most:g}")


def stroke_shares(
    frame: PictureFrame, i_object: int, places: Sequence[Place], brush: HighlightBrush
) -> NDArray[np.float32]:
    """The share (p,) by which a stroke through places (column, row) touches each point of an object; centres of pixels
    are at halves."""
    begin, end = frame.object_ranges[i_object]
    row, column = np.divmod(frame.pixel[begin:end], frame.width)
    at = np.stack([column + 0.5, row + 0.5], axis=1)
    distance = np.full(len(at), np.inf)
    line = list(places)
    for start, stop in zip(line, line[1:] or line, strict=False):
        distance = np.minimum(distance, _distance_to_line(at, np.array(start), np.array(stop)))
    inner = brush.hardness * brush.radius
    t = np.clip((brush.radius - distance) / max(brush.radius - inner, 1e-6), 0.0, 1.0)
    shares = t * t * (3.0 - 2.0 * t)
    shares[frame.share[begin:end] < _WHOLE] = 0.0
    return np.asarray(shares, np.float32)


def _distance_to_line(
    at: NDArray[np.floating], start: NDArray[np.floating], stop: NDArray[np.floating]
) -> NDArray[np.floating]:
    """The distances (p,) of places (p, 2) to the line from start to stop."""
    along = stop - start
    length = float(along @ along)
    t = np.clip((at - start) @ along / length, 0.0, 1.0) if length > 0.0 else np.zeros(len(at))
    return np.asarray(np.linalg.norm(at - start - t[:, None] * along, axis=1))


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
