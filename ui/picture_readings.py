"""What panels read of the shown picture, the values of pixels and scopes. The GPU is read once for each picture, not in
each frame, of which many show the same one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from engine.render.crop import Crop
from engine.render.scopes import Scopes
from ui.gl.display import ShownPicture
from ui.pixel_values import PixelValues, pixel_values
from ui.scopes import scopes_of

# Of pixels that the mouse went over, where the picture stays the same.
MOST_READINGS = 256


class PictureReadings:
    """The readings of one picture in one view. stamp: rises with each picture that differs; None where it is not known
    whether this one does, which is then read."""

    def __init__(self) -> None:
        self._of: object = None
        self._found: dict[object, Any] = {}

    def values(self, stamp: int | None, picture: ShownPicture, column: int, row: int, side: int) -> PixelValues:
        """The values of a pixel, or the mean of a square about it."""
        found = self._readings_of(stamp, picture)
        if (column, row, side) not in found:
            found[column, row, side] = pixel_values(picture, column, row, side)
        return found[column, row, side]  # type: ignore[no-any-return]

    def scopes(self, stamp: int | None, picture: ShownPicture, crop: Crop | None) -> Scopes:
        """The scopes of the picture, or of a part of it."""
        found = self._readings_of(stamp, picture)
        if crop not in found:
            found[crop] = scopes_of(picture, crop)
        return found[crop]  # type: ignore[no-any-return]

    def _readings_of(self, stamp: int | None, picture: ShownPicture) -> dict[object, Any]:
        """What is known of the picture."""
        # Outlines and the comparison are drawn over it, and not read.
        view = replace(
            picture.view.plain, selected=None, others=(), hovered=None, compare_divider=None, compare_exposure=None
        )
        of = stamp, picture.target.glo, view, picture.intensity
        if stamp is None or of != self._of or len(self._found) >= MOST_READINGS:
            self._of, self._found = of, {}
        return self._found
