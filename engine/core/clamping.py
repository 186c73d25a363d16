"""Clamps radiance beyond single precision to a large finite value.

Curves of 1e18 on surfaces that see each other give radiance of 1e54 in three bounces. Sums of it are infinite, and NaN
where multiplied by black; both are clamped to the largest value, and the window shows a warning. In units of the
light's own brightness radiance is clamped to `SQUARABLE`, which leaves room for later factors. This module imports
little, because the window's process uses it too.
"""

import numpy as np
from numpy.typing import NDArray

BRIGHTEST, SQUARABLE = 1e36, 1e30
# The limit where squares are summed.
SQUARED = 1e15
# Values within this fraction of the limit were clamped, and multiplied since.
_CLAMP_TOLERANCE = 1e-3
TOO_BRIGHT = "light between surfaces is brighter than numbers hold, and shown as white: lower a curve or the light"


def clamp_radiance(light: NDArray[np.floating], most: float = SQUARABLE) -> NDArray[np.float32]:
    """Light clamped to `most`; NaN becomes `most` as well."""
    with np.errstate(invalid="ignore"):
        is_sound = bool(light.max(initial=0.0) <= most)  # false for NaN too
    if not is_sound:
        light = np.minimum(np.nan_to_num(light, nan=most, posinf=most), most)
    return np.asarray(light, np.float32)


def unscaled(light: NDArray[np.floating], unit: float) -> NDArray[np.float32]:
    """Converts light from its own units to radiance; clamped values become the largest radiance, whatever the unit."""
    within = clamp_radiance(light)
    return clamp_radiance(
        np.where(within > _CLAMP_TOLERANCE * SQUARABLE, BRIGHTEST, within * np.float64(unit)), BRIGHTEST
    )


def is_clamped(light: NDArray[np.floating]) -> bool:
    """Whether any value was clamped."""
    return bool(light.max(initial=0.0) >= _CLAMP_TOLERANCE * BRIGHTEST)
