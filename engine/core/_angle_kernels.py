"""Compiled: the angle of a direction, as fast as a few multiplications.

The C library's atan2 is a call that compilers cannot vectorize, and takes half the time of a look-up in an environment.
"""

from __future__ import annotations

import math

from numba import njit

from engine.core.fast_math import FAST

_EIGHTH = math.tan(math.pi / 8.0)
# atan(r) / r by powers of r², for |r| ≤ tan(π/8): interpolated at Chebyshev's nodes, within 1e-14.
_C0, _C1, _C2, _C3, _C4, _C5, _C6, _C7, _C8 = (
    0.9999999999999746, -0.3333333333087442, 0.19999999613531533, -0.14285690825435746, 0.11110394228517657,
    -0.0907850620968723, 0.0756449008044768, -0.05877329377900753, 0.030703640350633773,
)  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def arc_tangent(y: float, x: float) -> float:
    """The angle of (x, y) from +x, −π to π, within 1e-13; 0 for (0, 0). Without branches, so that loops vectorize."""
    height, width = abs(y), abs(x)
    longer, shorter = max(height, width), min(height, width)
    # An angle above π/8 is measured from π/4: tan(a − π/4) = (tan a − 1) / (tan a + 1).
    is_steep = shorter > _EIGHTH * longer
    ratio = (shorter - longer if is_steep else shorter) / max(shorter + longer if is_steep else longer, 1e-300)
    s = ratio * ratio
    q = s * s
    # Estrin's scheme: short chains of dependent operations.
    low = (_C0 + _C1 * s) + q * (_C2 + _C3 * s)
    high = (_C4 + _C5 * s) + q * (_C6 + _C7 * s)
    angle = ratio * (low + q * q * (high + q * q * _C8)) + (0.25 * math.pi if is_steep else 0.0)
    angle = 0.5 * math.pi - angle if height > width else angle
    angle = math.pi - angle if x < 0.0 else angle
    return math.copysign(angle, y)
