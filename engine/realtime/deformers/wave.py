"""Wave: the axis becomes two periods of a sine with this share of the height as amplitude; the foot stays."""

from __future__ import annotations

import numpy as np

from engine.realtime.deformers.kind import DeformerKind, Float64Array, in_plane

_WAVE_NUMBER = 4.0 * np.pi


def _move(points: Float64Array, amplitude: float) -> tuple[Float64Array, Float64Array]:
    x, y, z = points.T
    one, none = np.ones_like(y), np.zeros_like(y)
    moved = np.stack([x + amplitude * np.sin(_WAVE_NUMBER * y), y, z], axis=1)
    return moved, in_plane(one, amplitude * _WAVE_NUMBER * np.cos(_WAVE_NUMBER * y), none, one)


KIND = DeformerKind("wave", "Wave", "", (-0.5, 0.5), _move, (0.0, 0.625))
