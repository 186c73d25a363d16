"""False colours for errors: maps errors to light for which `false_colour` gives shades, one for each factor of 1.4."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIDDLE = 0.01  # the error whose colour is that of radiance 1
LEAST, MOST = MIDDLE / 16.0, MIDDLE * 16.0  # the ends of the colour scale


def error_to_radiance(share: ArrayLike) -> NDArray[np.float64]:
    """Radiance that represents a relative error: proportional to its square."""
    return np.asarray((np.asarray(share, np.float64) / MIDDLE) ** 2)
