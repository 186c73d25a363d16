"""What a deformer is: a map of space with its Jacobian, within the bounding box of the object that it deforms.

The unit of length is the object's height. The object's axis is vertical, along +Y from y = 0 at its foot to y = 1 at
its top, at x = z = 0. One number gives the amount; at 0 nothing moves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Move = Callable[[Float64Array, float], tuple[Float64Array, Float64Array]]


class DeformerKind(NamedTuple):
    """A deformer: its name, the title and unit that the user sees, and the limits of its amount.

    move: maps points (V, 3) and an amount to new positions (V, 3) and Jacobians (V, 3, 3). grip: position of the
    handle, horizontally in half widths of the object and vertically in its height: a place that moves far with the
    amount.
    """

    name: str
    title: str
    unit: str
    limits: tuple[float, float]
    move: Move
    grip: tuple[float, float]


def in_plane(xx: Any, xy: Any, yx: Any, yy: Any) -> Float64Array:
    """Jacobians of maps of x and y that leave z unchanged: dx'/dx, dx'/dy, dy'/dx, dy'/dy, each (V,)."""
    jacobians = np.zeros((len(np.asarray(xx)), 3, 3))
    jacobians[:, 0, 0], jacobians[:, 0, 1], jacobians[:, 1, 0], jacobians[:, 1, 1] = xx, xy, yx, yy
    jacobians[:, 2, 2] = 1.0
    return jacobians


def scaled_across(points: Float64Array, scale: Float64Array, slope: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Scale the points' distances to the axis by a function of y with these values (V,) and derivatives (V,)."""
    x, y, z = points.T
    jacobians = np.zeros((len(points), 3, 3))
    jacobians[:, 0, 0] = jacobians[:, 2, 2] = scale
    jacobians[:, 0, 1], jacobians[:, 2, 1], jacobians[:, 1, 1] = x * slope, z * slope, 1.0
    return np.stack([x * scale, y, z * scale], axis=1), jacobians
