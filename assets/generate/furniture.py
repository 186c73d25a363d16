"""What rooms are built of: plain blocks, rounded blocks, boards side by side."""

from collections.abc import Sequence

import numpy as np

from .mesh import Mesh, merged, moved
from .surfaces import carried, quads, rounded_profile, rounded_rectangle

Corner = tuple[float, float, float]


def block(low: Corner, high: Corner) -> Mesh:
    """The axis-aligned box between two corners, faces outward."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    sides = [
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        [(x0, y1, z0), (x0, y1, z1), (x1, y1, z1), (x1, y1, z0)],
        [(x0, y0, z0), (x0, y1, z0), (x1, y1, z0), (x1, y0, z0)],
        [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
        [(x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)],
        [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
    ]
    return quads(np.array(sides))


def cushion(low: Corner, high: Corner, bevel: float, points: int = 5) -> Mesh:
    """The box between two corners, all its edges rounded by `bevel`."""
    half_x, height, half_z = (high[0] - low[0]) / 2, high[1] - low[1], (high[2] - low[2]) / 2
    profile = rounded_profile([(0, 0, 0), (bevel, 0, bevel), (bevel, height, bevel), (0, height, 0)], points)
    box = carried(profile, rounded_rectangle(half_x - bevel, half_z - bevel, points))
    return moved(box, (low[0] + half_x, low[1], low[2] + half_z))


def boards(spans: Sequence[tuple[float, float]], z: tuple[float, float], y: tuple[float, float], bevel: float) -> Mesh:
    """Boards along z over the spans of x, from y[0] up to y[1]."""
    return merged([cushion((x0, y[0], z[0]), (x1, y[1], z[1]), bevel, 3) for x0, x1 in spans])
