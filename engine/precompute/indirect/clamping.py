"""Light beyond single precision: held at a number that pictures have room for, rather than lost.

Curves of 1e18 on surfaces that see each other make light of 1e54 in three bounces. Sums of it are infinite, and no
number at all where black is multiplied by it; either stands for the brightest there is, and whoever shows it says so.
While light is in units of its own it is held at `SQUARABLE`, which leaves room for what multiplies it.
Light to import: the window's process does the same.
"""

import numpy as np
from numpy.typing import NDArray

BRIGHTEST, SQUARABLE = 1e36, 1e30
# Where squares are summed.
SQUARED = 1e15
# What is within so much of them was held, and multiplied since.
_CLAMP_TOLERANCE = 1e-3
TOO_BRIGHT = "light between surfaces is brighter than numbers hold, and shown as white: lower a curve or the light"


def clamp_radiance(light: NDArray[np.floating], most: float = SQUARABLE) -> NDArray[np.float32]:
    """Light as it is, but `most` where it went beyond that or has lost its number there."""
    with np.errstate(invalid="ignore"):
        is_sound = bool(light.max(initial=0.0) <= most)  # false for NaN too
    if not is_sound:
        light = np.minimum(np.nan_to_num(light, nan=most, posinf=most), most)
    return np.asarray(light, np.float32)


def unscaled(light: NDArray[np.floating], unit: float) -> NDArray[np.float32]:
    """Light that was in units of its own; what was held is the brightest there is, whatever the unit."""
    within = clamp_radiance(light)
    return clamp_radiance(
        np.where(within > _CLAMP_TOLERANCE * SQUARABLE, BRIGHTEST, within * np.float64(unit)), BRIGHTEST
    )


def is_clamped(light: NDArray[np.floating]) -> bool:
    """Whether some of it was held."""
    return bool(light.max(initial=0.0) >= _CLAMP_TOLERANCE * BRIGHTEST)
