"""A rectangle of a picture that is computed or saved without the rest, as pbrt's crop window and Blender's render
region: in fractions of the picture's sides, from its upper left corner, so that it stays where it is in any resolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import InsituError

Box = tuple[int, int, int, int]


class Crop(NamedTuple):
    """Its left, upper, right and lower sides, fractions of the picture's width and height in [0, 1]."""

    left: float
    upper: float
    right: float
    lower: float

    @classmethod
    def checked(cls, sides: Sequence[float], name: str = "crop") -> Crop:
        """The crop of four numbers, which an error calls by a name. Raises InsituError."""
        if len(sides) != 4:
            raise InsituError(f"{name}: {len(sides)} numbers, expected X0 Y0 X1 Y1")
        crop = cls(*(float(side) for side in sides))
        if not (0.0 <= crop.left < crop.right <= 1.0 and 0.0 <= crop.upper < crop.lower <= 1.0):
            said = " ".join(f"{side:g}" for side in crop)
            raise InsituError(f"{name} {said}: expected fractions 0 <= X0 < X1 <= 1 and 0 <= Y0 < Y1 <= 1")
        return crop

    @classmethod
    def between(cls, start: tuple[float, float], end: tuple[float, float]) -> Crop | None:
        """The part of the picture between two corners, also beside it; None where that is nothing."""
        (left, right), (upper, lower) = (
            sorted(min(max(float(place), 0.0), 1.0) for place in pair) for pair in zip(start, end, strict=True)
        )
        return cls(left, upper, right, lower) if right > left and lower > upper else None

    def box(self, size: tuple[int, int]) -> Box:
        """Column, row, width and height of its pixels in a picture (width, height); at least one pixel."""
        (x0, x1), (y0, y1) = (
            _pixels(low, high, n)
            for low, high, n in ((self.left, self.right, size[0]), (self.upper, self.lower, size[1]))
        )
        return x0, y0, x1 - x0, y1 - y0

    def rows(self, pixel: NDArray[np.integer], size: tuple[int, int]) -> NDArray[np.intp]:
        """Which of some pixels (row times width plus column) are in it, ascending."""
        x, y, width, height = self.box(size)
        row, column = np.divmod(pixel, size[0])
        return np.flatnonzero((column >= x) & (column < x + width) & (row >= y) & (row < y + height))


def cropped(values: NDArray[Any], crop: Crop | None) -> NDArray[Any]:
    """The part of a picture (H, W, ...) in a crop; the whole where there is none."""
    if crop is None:
        return values
    x, y, width, height = crop.box((values.shape[1], values.shape[0]))
    return np.ascontiguousarray(values[y : y + height, x : x + width])


def _pixels(low: float, high: float, n: int) -> tuple[int, int]:
    """The first pixel of a side's span and that after its last: those whose centres are within, at least one."""
    first = min(int(np.ceil(low * n - 0.5)), n - 1)
    return first, min(max(int(np.ceil(high * n - 0.5)), first + 1), n)
