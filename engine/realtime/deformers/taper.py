"""Taper: the top becomes wider than the foot by this share, or narrower; at -1 it is a point."""

from __future__ import annotations

import numpy as np

from engine.realtime.deformers.kind import DeformerKind, Float64Array, scaled_across


def _move(points: Float64Array, amount: float) -> tuple[Float64Array, Float64Array]:
    y = points[:, 1]
    return scaled_across(points, 1.0 + amount * y, np.full_like(y, amount))


KIND = DeformerKind("taper", "Taper", "", (-1.0, 4.0), _move, (1.0, 1.0))
