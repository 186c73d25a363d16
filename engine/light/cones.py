"""Cones of light: emitters whose radiance falls off with the angle to an axis, as that of spots does.

Towards a direction at the angle theta from its axis an emitter sends the share

    a²,   a = (cos theta - cos outer) / (cos inner - cos outer), from 0 to 1,

of its radiance (KHR_lights_punctual). A row (4,) of a cone holds the axis times s = 1 / (cos inner - cos outer), and
- s cos outer, so that for the unit direction d from a point *to* the emitter a = row[3] - row[:3] · d. An emitter
without a cone has the row `ALL_ROUND`, for which a is 1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

ALL_ROUND = (0.0, 0.0, 0.0, 1.0)
_SHARPEST = 1e-3  # of cos inner - cos outer, as the extension has it


def cone_row(axis: ArrayLike, inner: float, outer: float) -> NDArray[np.float32]:
    """The row (4,) of a cone about an axis (3,), which need not be unit; inner and outer half angles in radians."""
    direction = np.asarray(axis, np.float64)
    direction = direction / np.linalg.norm(direction)
    steepness = 1.0 / max(math.cos(inner) - math.cos(outer), _SHARPEST)
    return np.append(steepness * direction, -steepness * math.cos(outer)).astype(np.float32)


def all_round(n: int) -> NDArray[np.float32]:
    """Rows (n, 4) of emitters without cones."""
    return np.tile(np.array(ALL_ROUND, np.float32), (n, 1))


def cone_shares(rows: NDArray[np.floating], towards: NDArray[np.floating]) -> NDArray[np.floating]:
    """The shares (...) of their radiance that emitters with cones rows (..., 4) send to a point, from which they lie
    towards (..., 3), unit."""
    along = rows[..., 3] - np.einsum("...i,...i->...", rows[..., :3], towards)
    return np.clip(along, 0.0, 1.0) ** 2
