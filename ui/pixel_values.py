"""The values of a pixel of the shown picture, or of a square of pixels about it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from engine.light.environment import LUMINANCE
from ui.gl.display import ShownPicture
from ui.gl.gpu_memory import read_texels

MIDDLE_GREY = 0.18


class PixelValues(NamedTuple):
    """A pixel of the shown picture, or the mean of several. radiance: linear, of the whole pixel, including the light's
    intensity, without exposure; alpha: the share of it that something covers; shown: its colour on screen, from 0 to
    255, as one of 8 bits."""

    radiance: tuple[float, float, float]
    alpha: float
    shown: tuple[int, int, int]

    @property
    def luminance(self) -> float:
        """Of the radiance, linear."""
        return float(np.dot(self.radiance, LUMINANCE))

    @property
    def stops(self) -> float:
        """Luminance in stops above middle grey, 0.18; minus infinity of black."""
        return math.log2(self.luminance / MIDDLE_GREY) if self.luminance > 0.0 else -math.inf

    def lines(self) -> tuple[str, ...]:
        """What is said of it, a line for each kind of value."""
        red, green, blue = self.shown
        return (
            "linear  " + "  ".join(f"{value:.4g}" for value in self.radiance),
            f"luminance  {self.luminance:.4g}   {self.stops:+.2f} stops",
            *((f"alpha   {self.alpha:.3g}",) if self.alpha < 1.0 else ()),
            f"screen  {red}  {green}  {blue}   #{red:02x}{green:02x}{blue:02x}",
        )


def pixel_values(picture: ShownPicture, column: int, row: int, side: int = 1) -> PixelValues:
    """The values of a pixel, or the mean of a square of an odd number of pixels about it, without those beside the
    picture; waits for the GPU."""
    (width, height), half = picture.linear.size, side // 2
    x, y = max(column - half, 0), max(row - half, 0)
    box = x, y, min(column + half + 1, width) - x, min(row + half + 1, height) - y
    linear = read_texels(picture.target, box, "f4").reshape(-1, 4).mean(axis=0)
    shown = picture.display.sampled(picture.linear, picture.view, box, box[2:], "f4").reshape(-1, 4)[:, :3].mean(axis=0)
    red, green, blue = np.rint(255.0 * shown).astype(int).tolist()
    r, g, b = (linear[:3] * picture.intensity).tolist()
    return PixelValues((r, g, b), float(linear[3]), (red, green, blue))
