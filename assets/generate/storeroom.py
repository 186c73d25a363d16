"""Storeroom: one lamp off the middle, a thin post, shelves of boxes, and two metal balls on a table.

The mirror-like ball shows the lamp and the whole room at its lobe's own sharpness; the post casts a narrow shadow.
Metres; the room is 3.2 × 2.4 × 3.8.
"""

import numpy as np

from .furniture import block, cushion
from .mesh import Mesh, axis_rotation, merged, moved, transformed
from .shapes import sphere
from .surfaces import carried, circle, panel, rounded_profile, rounded_rectangle, tube

X, Y, Z = 1.6, 2.4, 1.9  # half width, height, half depth
THICK = 0.12
LAMP = (-0.45, 2.02, 0.30)
POST = (0.14, -0.42)
TABLE_AT, TABLE = (0.82, -0.95), 0.72
SHELVES = (0.30, 0.78, 1.26, 1.74)
# Boxes on the shelves: shelf, from x, width, height, depth, turn in degrees.
BOXES = (
    (0, -1.38, 0.42, 0.30, 0.34, 3), (0, -0.88, 0.30, 0.22, 0.30, -5), (1, -1.40, 0.30, 0.24, 0.28, -3),
    (1, -1.02, 0.26, 0.33, 0.30, 4), (1, -0.66, 0.22, 0.16, 0.26, 9), (2, -1.30, 0.48, 0.20, 0.32, 2),
    (3, -1.38, 0.34, 0.26, 0.30, 6), (3, -0.95, 0.36, 0.18, 0.30, -4),
)  # fmt: skip


def meshes() -> dict[str, Mesh]:
    return {
        "walls": walls(),
        "floor": block((-X - THICK, -0.1, -Z - THICK), (X + THICK, 0.0, Z + THICK)),
        "post": tube(np.array([(POST[0], y, POST[1]) for y in (-0.05, Y / 2, Y + 0.05)]), np.full(3, 0.022), 28, 3),
        "shelves": shelves(),
        "boxes": boxes(),
        "tins": tins(),
        "table": moved(table(), (TABLE_AT[0], 0.0, TABLE_AT[1])),
        "mirror_ball": moved(sphere(0.15, 57, 112), (TABLE_AT[0] - 0.20, TABLE + 0.15, TABLE_AT[1] + 0.02)),
        "gold_ball": moved(sphere(0.095, 41, 80), (TABLE_AT[0] + 0.17, TABLE + 0.095, TABLE_AT[1] + 0.14)),
        "shade": moved(shade(), LAMP),
        "lamp": panel((LAMP[0], LAMP[1] - 0.004, LAMP[2]), (0.17, 0.0, 0.0), (0.0, 0.0, 0.11)),
    }


def walls() -> Mesh:
    """Four walls and a ceiling that reach into one another."""
    x, z = X + THICK, Z + THICK
    return merged([
        block((-x, -0.1, -z), (-X, Y + THICK, z)),
        block((X, -0.1, -z), (x, Y + THICK, z)),
        block((-X - 0.01, -0.1, -z), (X + 0.01, Y + THICK, -Z)),
        block((-X - 0.01, -0.1, Z), (X + 0.01, Y + THICK, z)),
        block((-X - 0.01, Y, -Z - 0.01), (X + 0.01, Y + THICK, Z + 0.01)),
    ])  # fmt: skip


def shelves() -> Mesh:
    """Four boards between uprights in the left corner at the back."""
    x0, x1, z0, z1 = -1.52, -0.36, -Z + 0.02, -Z + 0.44
    parts = [block((x0 + 0.002, y - 0.025, z0 + 0.002), (x1 - 0.002, y, z1 - 0.004)) for y in SHELVES]
    parts += [block((x, 0.0, z), (x + 0.035, 2.05, z + 0.035)) for x in (x0, x1 - 0.035) for z in (z0, z1 - 0.035)]
    return merged(parts)


def boxes() -> Mesh:
    """Cartons on the shelves, and two on the floor by the table."""
    parts = []
    for shelf, x, width, height, depth, turn in BOXES:
        box = cushion((-width / 2, 0.0, -depth / 2), (width / 2, height, depth / 2), 0.004, 3)
        at = (x + width / 2, SHELVES[shelf] + 0.0005, -Z + 0.23)
        parts.append(transformed(box, axis_rotation((0, 1, 0), np.radians(turn)), at))
    low = cushion((-0.24, 0.0, -0.19), (0.24, 0.30, 0.19), 0.005, 3)
    high = cushion((-0.15, 0.0, -0.13), (0.15, 0.20, 0.13), 0.005, 3)
    parts.append(transformed(low, axis_rotation((0, 1, 0), np.radians(-24)), (-1.02, 0.0, -0.72)))
    parts.append(transformed(high, axis_rotation((0, 1, 0), np.radians(15)), (-1.04, 0.3005, -0.74)))
    return merged(parts)


def tins() -> Mesh:
    """Paint tins on the third shelf and on the table."""
    places = ((-0.72, SHELVES[2], -Z + 0.20), (-0.52, SHELVES[2], -Z + 0.27), (1.12, TABLE, -1.16))
    return merged([moved(_tin(0.075, 0.17), (x, y + 0.0005, z)) for x, y, z in places])


def _tin(radius: float, height: float) -> Mesh:
    profile = [(0, 0, 0), (radius, 0, 0.004), (radius, height, 0.004), (radius - 0.008, height, 0.001),
               (radius - 0.008, height - 0.006, 0.001), (0, height - 0.006, 0)]  # fmt: skip
    return carried(rounded_profile(profile, 4), circle(48))


def table() -> Mesh:
    """A workbench: a thick top on four legs, and a board between them."""
    x, z = 0.62, 0.38
    parts = [cushion((-x, TABLE - 0.045, -z), (x, TABLE, z), 0.006, 3)]
    for px in (0.07 - x, x - 0.07):
        parts += [
            block((px - 0.032, 0.0, pz - 0.032), (px + 0.032, TABLE - 0.044, pz + 0.032)) for pz in (0.07 - z, z - 0.07)
        ]
    return merged([*parts, block((0.06 - x, 0.16, 0.06 - z), (x - 0.06, 0.185, z - 0.06))])


def shade() -> Mesh:
    """A tray over the lamp, hung from the ceiling by a rod; its opening is downward."""
    corners = [(0.014, 0.001, 0), (0.07, -0.035, 0), (0.073, -0.035, 0), (0.02, 0.02, 0.004), (0.0, 0.02, 0)]
    profile = rounded_profile(corners, 3)
    rod = tube(np.array([(0.0, y, 0.0) for y in (0.015, 0.2, Y - LAMP[1] + 0.02)]), np.full(3, 0.007), 16, 3)
    return merged([carried(profile, rounded_rectangle(0.15, 0.09, 5)), rod])
