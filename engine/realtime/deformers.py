"""Deformers: maps of space with their Jacobians, within the bounding box of the object that they deform.

The unit of length is the object's height. The object's axis is vertical, along +Y from y = 0 at its foot to y = 1 at
its top, at x = z = 0. One number gives the amount; at 0 nothing moves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.material.parameters import Parameter

Float64Array = NDArray[np.float64]
Move = Callable[[Float64Array, float], tuple[Float64Array, Float64Array]]

_WAVE_NUMBER = 4.0 * np.pi


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

    @property
    def amount(self) -> Parameter:
        """The amount as a panel shows it: an angle as a number, because two turns are too much for a slider, of which a
        few pixels would be a right angle."""
        (low, high), is_angle = self.limits, self.unit == "degrees"
        return Parameter(
            "amount", "scalar", 0.0, self.title, "Amount; 0 leaves the object undeformed.", minimum=low, maximum=high,
            step=0.5 if is_angle else None, form="%.1f°" if is_angle else "%.3f",
        )  # fmt: skip


def bend(points: Float64Array, degrees: float) -> tuple[Float64Array, Float64Array]:
    """The vertical axis becomes an arc that leans towards +X; 360 degrees close a ring."""
    angle = np.radians(degrees)
    x, y, z = points.T
    turned = angle * y
    cosine, sine = np.cos(turned), np.sin(turned)
    half = np.sinc(turned / (2.0 * np.pi))  # of half the angle: y and 0 without a division by the angle
    moved = np.stack([x * cosine + 0.5 * turned * y * half**2, y * np.sinc(turned / np.pi) - x * sine, z], axis=1)
    stretched = 1.0 - angle * x
    return moved, _in_plane(cosine, sine * stretched, -sine, cosine * stretched)


def twist(points: Float64Array, degrees: float) -> tuple[Float64Array, Float64Array]:
    """Rotates about the axis in proportion to height; the foot stays."""
    angle = np.radians(degrees)
    x, y, z = points.T
    cosine, sine = np.cos(angle * y), np.sin(angle * y)
    across, along = x * cosine + z * sine, z * cosine - x * sine
    jacobians = np.zeros((len(points), 3, 3))
    jacobians[:, 0, 0] = jacobians[:, 2, 2] = cosine
    jacobians[:, 0, 2], jacobians[:, 2, 0] = sine, -sine
    jacobians[:, 0, 1], jacobians[:, 2, 1], jacobians[:, 1, 1] = angle * along, -angle * across, 1.0
    return np.stack([across, y, along], axis=1), jacobians


def taper(points: Float64Array, amount: float) -> tuple[Float64Array, Float64Array]:
    """The top becomes wider than the foot by this share, or narrower; at -1 it is a point."""
    y = points[:, 1]
    return _scaled_across(points, 1.0 + amount * y, np.full_like(y, amount))


def bulge(points: Float64Array, amount: float) -> tuple[Float64Array, Float64Array]:
    """The middle becomes wider than foot and top, which stay, by this share, or narrower."""
    y = points[:, 1]
    return _scaled_across(points, 1.0 + 4.0 * amount * y * (1.0 - y), 4.0 * amount * (1.0 - 2.0 * y))


def wave(points: Float64Array, amplitude: float) -> tuple[Float64Array, Float64Array]:
    """The axis becomes two periods of a sine with this share of the height as amplitude; the foot stays."""
    x, y, z = points.T
    one, none = np.ones_like(y), np.zeros_like(y)
    moved = np.stack([x + amplitude * np.sin(_WAVE_NUMBER * y), y, z], axis=1)
    return moved, _in_plane(one, amplitude * _WAVE_NUMBER * np.cos(_WAVE_NUMBER * y), none, one)


def _in_plane(xx: Any, xy: Any, yx: Any, yy: Any) -> Float64Array:
    """Jacobians of maps of x and y that leave z unchanged: dx'/dx, dx'/dy, dy'/dx, dy'/dy, each (V,)."""
    jacobians = np.zeros((len(np.asarray(xx)), 3, 3))
    jacobians[:, 0, 0], jacobians[:, 0, 1], jacobians[:, 1, 0], jacobians[:, 1, 1] = xx, xy, yx, yy
    jacobians[:, 2, 2] = 1.0
    return jacobians


def _scaled_across(points: Float64Array, scale: Float64Array, slope: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Scale the points' distances to the axis by a function of y with these values (V,) and derivatives (V,)."""
    x, y, z = points.T
    jacobians = np.zeros((len(points), 3, 3))
    jacobians[:, 0, 0] = jacobians[:, 2, 2] = scale
    jacobians[:, 0, 1], jacobians[:, 2, 1], jacobians[:, 1, 1] = x * slope, z * slope, 1.0
    return np.stack([x * scale, y, z * scale], axis=1), jacobians


KINDS = {
    kind.name: kind
    for kind in (
        DeformerKind("bend", "Bend", "degrees", (-720.0, 720.0), bend, (0.0, 1.0)),
        DeformerKind("twist", "Twist", "degrees", (-1440.0, 1440.0), twist, (1.0, 1.0)),
        DeformerKind("taper", "Taper", "", (-1.0, 4.0), taper, (1.0, 1.0)),
        DeformerKind("bulge", "Bulge", "", (-1.0, 4.0), bulge, (1.0, 0.5)),
        DeformerKind("wave", "Wave", "", (-0.5, 0.5), wave, (0.0, 0.625)),
    )
}
