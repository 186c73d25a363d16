"""Bulge: the middle becomes wider than foot and top, which stay, by this share, or narrower."""

from __future__ import annotations

from engine.realtime.deformers.kind import DeformerKind, Float64Array, scaled_across


def _move(points: Float64Array, amount: float) -> tuple[Float64Array, Float64Array]:
    y = points[:, 1]
    return scaled_across(points, 1.0 + 4.0 * amount * y * (1.0 - y), 4.0 * amount * (1.0 - 2.0 * y))


KIND = DeformerKind("bulge", "Bulge", "", (-1.0, 4.0), _move, (1.0, 0.5))
