"""Which objects of a scene are its ground or backdrop, by their boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# A ground's thickness is at most this share of its length; it is at least so many times as large as the objects on it.
FLAT, GROUND_SIZE = 0.05, 2.0


def find_ground_boxes(boxes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the boxes (N, 2, 3) that are floors or backdrops (N,): flat, and in their plane around all that is not flat
    and at least `GROUND_SIZE` times as large as that. A tray, a wing or the wall of a room is none."""
    extents = boxes[:, 1] - boxes[:, 0]
    thin = extents.argmin(axis=1)
    flat = extents.min(axis=1) <= FLAT * extents.max(axis=1)
    grounds = np.zeros(len(boxes), np.bool_)
    if flat.all():
        return grounds
    low, high = boxes[~flat, 0].min(axis=0), boxes[~flat, 1].max(axis=0)
    for i in np.flatnonzero(flat):
        plane = np.arange(3) != thin[i]
        is_around = (boxes[i, 0] <= low) & (boxes[i, 1] >= high) & (extents[i] >= GROUND_SIZE * (high - low))
        grounds[i] = is_around[plane].all()
    return grounds
