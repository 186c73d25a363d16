"""Cones of light: emitters whose radiance falls off with the angle to an axis, as that of spots does.

Towards a direction at the angle theta from its axis an emitter sends the share

    a²,   a = (cos theta - cos outer) / (cos inner - cos outer), from 0 to 1,

of its radiance (KHR_lights_punctual). A row (4,) of a cone holds the axis times s = 1 / (cos inner - cos outer), and
- s cos outer, so that for the unit direction d from a point *to* the emitter a = row[3] - row[:3] · d. An emitter
without a cone has the row `ALL_ROUND`, for which a is 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEAST_OUTER, MOST_ANGLE = 0.05, 90.0  # degrees from the axis
ALL_ROUND = (0.0, 0.0, 0.0, 1.0)
_SHARPEST = 1e-3  # of cos inner - cos outer, as the extension has it


@dataclass(frozen=True)
class Cone:
    """A cone by its half angles, degrees: within `inner` all of the radiance, beyond `outer` none. Raises
    ValueError."""

    inner: float
    outer: float

    def __post_init__(self) -> None:
        if not LEAST_OUTER <= self.outer <= MOST_ANGLE:
            raise ValueError(f"outer angle {self.outer:g}°, expected {LEAST_OUTER:g}° to {MOST_ANGLE:g}°")
        if not 0.0 <= self.inner <= self.outer:
            raise ValueError(f"inner angle {self.inner:g}°, expected 0° to {self.outer:g}°, the outer one")

    @property
    def is_identity(self) -> bool:
        """Never: it is told where it is not that of the file."""
        return False

    def with_inner(self, inner: float) -> Cone:
        """The cone with this inner angle; the outer one is at least as large. Raises ValueError."""
        return Cone(inner, max(self.outer, inner))

    def with_outer(self, outer: float) -> Cone:
        """The cone with this outer angle; the inner one is at most as large. Raises ValueError."""
        return Cone(min(self.inner, max(outer, 0.0)), outer)

    def row(self, axis: ArrayLike) -> NDArray[np.float32]:
        """The row (4,) of the cone about an axis (3,)."""
        return cone_row(axis, math.radians(self.inner), math.radians(self.outer))


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
