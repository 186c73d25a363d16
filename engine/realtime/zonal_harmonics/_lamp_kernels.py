"""What points see of a part of a lamp, for compiled code; `scene_lamps.towards_lamp` is its slow twin."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def towards_part(part: NDArray[np.float64], x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """The direction from a place (x, y, z) to a part (14,) of a lamp, see `scene_lamps.Lamp.rows`, and the solid angle
    of its front there times the share of its light that its cone sends there."""
    x, y, z = part[0] - x, part[1] - y, part[2] - z
    square = max(x * x + y * y + z * z, 1e-24)
    distance = math.sqrt(square)
    x, y, z = x / distance, y / distance, z / distance
    facing = max(-(x * part[3] + y * part[4] + z * part[5]) * part[6], 0.0)
    share = min(max(part[10] - part[7] * x - part[8] * y - part[9] * z, 0.0), 1.0)
    # As of a disc, at most half of all directions.
    return x, y, z, 2.0 * math.pi * facing / (2.0 * math.pi * square + facing) * share * share
