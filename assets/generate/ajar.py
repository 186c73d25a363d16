"""Ajar: a room without a lamp, lit through a door left ajar from the bright passage behind it; three pots on a table.

Almost all that is seen is lit by walls alone: a strip of the passage's panel falls through the gap onto the floor, the
rest comes after two reflections and more. Metres; the room is 4 × 2.5 × 4.4, the passage 1.8 deep.
"""

import numpy as np

from .furniture import block, cushion
from .mesh import Floats, Mesh, axis_rotation, merged, moved, transformed
from .surfaces import carried, circle, panel, rounded_profile

X, Y, Z = 2.0, 2.5, 2.2  # half width, height, half depth of the room
THICK = 0.14
DOORWAY = (0.15, 1.05)
LINTEL = 2.05
AJAR = np.radians(38)
PASSAGE = 1.8
TABLE_AT, TABLE = (-0.55, -0.55), 0.74


def meshes() -> dict[str, Mesh]:
    pots = [
        ("matt_pot", matt_pot(), (-0.36, 0.06)),
        ("glossy_pot", glossy_pot(), (0.02, -0.06)),
        ("brushed_pot", brushed_pot(), (0.36, 0.08)),
    ]
    placed = {name: moved(pot, (TABLE_AT[0] + at[0], TABLE, TABLE_AT[1] + at[1])) for name, pot, at in pots}
    return placed | {
        "walls": walls(),
        "floor": block((-X - THICK, -0.1, -Z - THICK - PASSAGE - 0.1), (X + THICK, 0.0, Z + THICK)),
        "woodwork": woodwork(),
        "door": door(),
        "table": moved(table(), (TABLE_AT[0], 0.0, TABLE_AT[1])),
        "panel": panel((0.9, Y - 0.02, -Z - THICK - 0.9), (0.8, 0.0, 0.0), (0.0, 0.0, 0.45)),
    }


def walls() -> Mesh:
    """The room's, the passage's and the one between them with its doorway, and a ceiling over both."""
    x, back, front = X + THICK, -Z - THICK - PASSAGE, Z + THICK
    between = -Z - THICK, -Z
    left, right = DOORWAY
    return merged([
        block((-x, -0.1, back - THICK), (-X, Y + THICK, front)),
        block((X, -0.1, back - THICK), (x, Y + THICK, front)),
        block((-X - 0.01, -0.1, back - THICK), (X + 0.01, Y + THICK, back)),
        block((-X - 0.01, -0.1, Z), (X + 0.01, Y + THICK, front)),
        block((-X - 0.01, Y, back - 0.01), (X + 0.01, Y + THICK, Z + 0.01)),
        block((-X - 0.01, -0.1, between[0]), (left, Y + 0.01, between[1])),
        block((right, -0.1, between[0]), (X + 0.01, Y + 0.01, between[1])),
        block((left - 0.01, LINTEL, between[0]), (right + 0.01, Y + 0.01, between[1])),
    ])  # fmt: skip


def woodwork() -> Mesh:
    """The doorway's frame and the room's skirting."""
    (left, right), w = DOORWAY, 0.07
    z0, z1 = -Z - THICK - 0.015, -Z + 0.015
    parts = [
        block((left - w, -0.01, z0), (left + 0.012, LINTEL + w, z1)),
        block((right - 0.012, -0.01, z0), (right + w, LINTEL + w, z1)),
        block((left + 0.012, LINTEL - 0.012, z0), (right - 0.012, LINTEL + w, z1)),
        block((-X - 0.01, 0.0, -Z - 0.01), (left - w, 0.08, -Z + 0.014)),
        block((right + w, 0.0, -Z - 0.01), (X + 0.01, 0.08, -Z + 0.014)),
        block((-X - 0.01, 0.0, -Z + 0.014), (-X + 0.014, 0.08, Z)),
        block((X - 0.014, 0.0, -Z + 0.014), (X + 0.01, 0.08, Z)),
    ]
    return merged(parts)


def door() -> Mesh:
    """A leaf of 40 mm with two raised fields and a handle on either side, hinged on the right, open into the room."""
    width, high = DOORWAY[1] - DOORWAY[0] - 0.03, LINTEL - 0.02
    parts = [block((-width, 0.008, 0.0), (0.0, high, 0.04))]
    for low, top in ((0.18, 0.86), (1.06, high - 0.16)):
        parts += [
            cushion((0.14 - width, low, z0), (-0.14, top, z1), 0.005, 3) for z0, z1 in ((-0.01, 0.01), (0.03, 0.05))
        ]
    for z0, z1 in ((-0.055, 0.002), (0.038, 0.095)):
        parts.append(block((0.05 - width, 0.99, z0), (0.07 - width, 1.01, z1)))
    parts += [cushion((0.045 - width, 0.988, z), (0.175 - width, 1.012, z + 0.02), 0.006, 4) for z in (-0.06, 0.08)]
    return transformed(merged(parts), axis_rotation((0, 1, 0), AJAR), (DOORWAY[1] - 0.015, 0.0, -Z + 0.016))


def table() -> Mesh:
    """A top with rounded edges on four square legs, aprons between them."""
    x, z = 0.72, 0.36
    legs = [(sx * (x - 0.07), sz * (z - 0.07)) for sx in (-1, 1) for sz in (-1, 1)]
    parts = [cushion((-x, TABLE - 0.032, -z), (x, TABLE, z), 0.008, 4)]
    parts += [
        cushion((px - 0.026, 0.0, pz - 0.026), (px + 0.026, TABLE - 0.03, pz + 0.026), 0.005, 3) for px, pz in legs
    ]
    low, high = TABLE - 0.11, TABLE - 0.031
    parts += [
        block((0.09 - x, low, side * (z - 0.07) - 0.01), (x - 0.09, high, side * (z - 0.07) + 0.01)) for side in (-1, 1)
    ]
    parts += [
        block((side * (x - 0.07) - 0.01, low, 0.09 - z), (side * (x - 0.07) + 0.01, high, z - 0.09)) for side in (-1, 1)
    ]
    return merged(parts)


def matt_pot() -> Mesh:
    """A wide bowl of a pot."""
    return _pot([(0.075, 0, 0.006), (0.135, 0.10, 0.09), (0.105, 0.20, 0.05), (0.115, 0.225, 0)])


def glossy_pot() -> Mesh:
    """A tall bottle."""
    return _pot([(0.07, 0, 0.01), (0.10, 0.14, 0.10), (0.034, 0.26, 0.07), (0.040, 0.36, 0)])


def brushed_pot() -> Mesh:
    """A plain cylinder with a shoulder."""
    return _pot([(0.085, 0, 0.012), (0.085, 0.17, 0.035), (0.062, 0.20, 0.012), (0.062, 0.24, 0)])


def _pot(wall: list[tuple[float, float, float]], thick: float = 0.006) -> Mesh:
    """A vessel of an outer wall (o, y, fillet) turned on a wheel; its inside goes down a third of its height."""
    (lip, top, _), depth = wall[-1], 0.66 * wall[-1][1]
    inner = _radius_at(wall, depth) - thick
    profile = [
        (0, 0, 0),
        *wall[:-1],
        (lip, top, 0.3 * thick),
        (lip - thick, top, 0.3 * thick),
        (inner, depth, 0),
        (0, depth, 0),
    ]
    return carried(rounded_profile(profile, 7), circle(64))


def _radius_at(wall: list[tuple[float, float, float]], height: float) -> float:
    points: Floats = np.array(wall)
    return float(np.interp(height, points[:, 1], points[:, 0]))
