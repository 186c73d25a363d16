"""4×4 transforms of the scene file: 16 numbers, row-major, for column vectors (p' = M p)."""

from __future__ import annotations

import math
from collections.abc import Sequence

MAX_ENTRY = 1e9
_FLATTEST = 1e-9


def check_transform(entries: Sequence[float]) -> str | None:
    """What was expected instead of the 16 numbers, or None if they are an invertible affine transform.

    Invertible means |det A| > 1e-9 · |a_x| |a_y| |a_z| with the columns a of the linear part A (Hadamard's inequality:
    the ratio is 1 for orthogonal axes, 0 for axes in one plane), at any scale.
    """
    if not all(math.isfinite(e) and abs(e) <= MAX_ENTRY for e in entries):
        return f"finite numbers of at most {MAX_ENTRY:g}"
    if any(abs(e - one) > 1e-9 for e, one in zip(entries[12:], (0.0, 0.0, 0.0, 1.0), strict=True)):
        return "a last row 0 0 0 1"
    volume = math.prod(math.hypot(*entries[i:12:4]) for i in range(3))
    if not abs(determinant(entries)) > _FLATTEST * volume or volume < 1e-27:
        return "an invertible matrix"
    return None


def determinant(entries: Sequence[float]) -> float:
    """Determinant of the linear part (upper left 3×3)."""
    a, b, c, _, d, e, f, _, g, h, i = entries[:11]
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
