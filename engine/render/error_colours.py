"""How errors are shown in false colours: as light that `false_colour` gives shades, one a factor of 1.4."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIDDLE = 0.01  # of which the colour is that of radiance 1
LEAST, MOST = MIDDLE / 16.0, MIDDLE * 16.0  # where the colours end


def error_to_radiance(share: ArrayLike) -> NDArray[np.float64]:
    """The radiance that stands for an error, a share of what it is of: by its square."""
    return np.asarray((np.asarray(share, np.float64) / MIDDLE) ** 2)
