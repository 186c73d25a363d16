"""Triangles cut at the midpoints of their edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def quarters(corners: NDArray[np.float64], on_sphere: bool = False) -> NDArray[np.float64]:
    """The four parts (T, 4, 3, k) of triangles with values (T, 3, k) at their corners: those at the three corners, then
    the middle one; all wind as the whole does. on_sphere: corners are unit vectors, and midpoints are made such."""
    a, b, c = np.moveaxis(corners, 1, 0)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    if on_sphere:
        ab, bc, ca = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (ab, bc, ca))
    parts = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1)
    return parts.reshape(-1, 4, *corners.shape[1:])
