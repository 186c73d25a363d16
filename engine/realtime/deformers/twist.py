"""Twist: rotates about the axis in proportion to height; the foot stays."""

from __future__ import annotations

import numpy as np

from engine.realtime.deformers.kind import DeformerKind, Float64Array


def _move(points: Float64Array, angle: float) -> tuple[Float64Array, Float64Array]:
    x, y, z = points.T
    cosine, sine = np.cos(angle * y), np.sin(angle * y)
    across, along = x * cosine + z * sine, z * cosine - x * sine
    jacobians = np.zeros((len(points), 3, 3))
    jacobians[:, 0, 0] = jacobians[:, 2, 2] = cosine
    jacobians[:, 0, 2], jacobians[:, 2, 0] = sine, -sine
    jacobians[:, 0, 1], jacobians[:, 2, 1], jacobians[:, 1, 1] = angle * along, -angle * across, 1.0
    return np.stack([across, y, along], axis=1), jacobians


KIND = DeformerKind(
    "twist", "Twist", "degrees", (-1440.0, 1440.0), lambda points, amount: _move(points, np.radians(amount)), (1.0, 1.0)
)
