"""Compiled: the share of its radiance that an emitter with a cone sends to a point (`engine.light.cones`)."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def cone_share(cones: Float32Array, i: int, x: float, y: float, z: float) -> np.float32:
    """The share of emitter i, which lies towards the unit direction (x, y, z)."""
    row = cones[i]
    along = min(max(row[3] - (row[0] * x + row[1] * y + row[2] * z), _ZERO), _ONE)
    return along * along


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def cone_range(
    cones: Float32Array, i: int, unit: Float32Array, size: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """The same for a triangle with unit corners `unit` (3, 3) and longest edge `size`, as seen from the point: the
    share of its centre, and bounds of it from below and above over the triangle."""
    x, y, z = (
        unit[0, 0] + unit[1, 0] + unit[2, 0], unit[0, 1] + unit[1, 1] + unit[2, 1], unit[0, 2] + unit[1, 2] + unit[2, 2]
    )  # fmt: skip
    inverse = _ONE / np.sqrt(max(x * x + y * y + z * z, np.float32(1e-30)))
    row = cones[i]
    along = row[3] - (row[0] * x + row[1] * y + row[2] * z) * inverse
    reach = size * np.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2])
    low, high = min(max(along - reach, _ZERO), _ONE), min(max(along + reach, _ZERO), _ONE)
    along = min(max(along, _ZERO), _ONE)
    return along * along, low * low, high * high
