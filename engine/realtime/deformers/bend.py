"""Bend: the vertical axis becomes an arc that leans towards +X; an angle of 0 changes nothing, 2 pi closes a ring."""

from __future__ import annotations

import numpy as np

from engine.realtime.deformers.kind import DeformerKind, Float64Array, in_plane


def _move(points: Float64Array, angle: float) -> tuple[Float64Array, Float64Array]:
    x, y, z = points.T
    turned = angle * y
    cosine, sine = np.cos(turned), np.sin(turned)
    half = np.sinc(turned / (2.0 * np.pi))  # of half the angle: y and 0 without a division by the angle
    moved = np.stack([x * cosine + 0.5 * turned * y * half**2, y * np.sinc(turned / np.pi) - x * sine, z], axis=1)
    stretched = 1.0 - angle * x
    return moved, in_plane(cosine, sine * stretched, -sine, cosine * stretched)


KIND = DeformerKind(
    "bend", "Bend", "degrees", (-720.0, 720.0), lambda points, amount: _move(points, np.radians(amount)), (0.0, 1.0)
)
