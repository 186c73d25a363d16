"""Room: a living room closed on all sides but for two windows on its left, through which sun and sky come in.

Walls, floor and ceiling are slabs that reach into one another, so that no light leaks at an edge. The floor's planks
are two objects by tone: those of the common tone, and every third or so a darker one, whose oak the picture's frame
shares; each plank shows a board of the oak's image at a place of its own. Metres; the room is 4.2 × 2.6 × 5.
"""

import numpy as np
from numpy.typing import NDArray

from .furniture import block, cushion
from .mesh import Floats, Mesh, axis_rotation, merged, moved, transformed, with_coordinates
from .plate import oak
from .shapes import disc
from .surfaces import Profile, bezier, carried, circle, rounded_profile, tube

X, Y, Z = 2.1, 2.6, 2.5  # half width, height, half depth
THICK = 0.16
SILL, LINTEL = 0.30, 2.35
WINDOWS = ((-2.0, -0.4), (0.1, 1.7))  # spans of z in the left wall
RUG = 0.012  # its height
TABLE = 0.40
TABLE_AT = (-0.15, -0.45)
# The oak's image, of four boards one above the other, is so wide.
OAK_WIDTH, PLANK_WIDTH = 0.9, 0.15


def meshes() -> dict[str, Mesh]:
    common, darker = _planks()
    return {
        "walls": walls(),
        "planks": common,
        "dark_oak": _oaken([darker, *(_along_grain(part) for part in (_base(), *_picture()))]),
        "woodwork": woodwork(),
        "sofa": moved(sofa(), (0.0, 0.0, -1.98)),
        "table": moved(table(), (TABLE_AT[0], RUG, TABLE_AT[1])),
        "rug": cushion((-1.35, 0.0, -1.45), (1.15, RUG, 0.45), 0.005, 4),
        "vase": moved(vase(), (TABLE_AT[0] + 0.10, RUG + TABLE, TABLE_AT[1] + 0.08)),
    }


def images() -> dict[str, NDArray[np.uint8]]:
    return {"oak.jpg": oak()}


def walls() -> Mesh:
    """Four slabs, the left one built round its windows."""
    far = Z + THICK
    cuts = [-far, *(edge for span in WINDOWS for edge in span), far]
    piers = [block((-X - THICK, -THICK, cuts[i]), (-X, Y + THICK, cuts[i + 1])) for i in (0, 2, 4)]
    around = [
        block((-X - THICK, low, z0), (-X, high, z1))
        for z0, z1 in WINDOWS
        for low, high in ((-THICK, SILL), (LINTEL, Y + THICK))
    ]
    back = block((-X - 0.01, -THICK, -far), (X + 0.01, Y + THICK, -Z))
    front = block((-X - 0.01, -THICK, Z), (X + 0.01, Y + THICK, far))
    right = block((X, -THICK, -far), (X + THICK, Y + THICK, far))
    return merged([*piers, *around, back, front, right])


def _planks() -> tuple[Mesh, Mesh]:
    """Planks of one width and several lengths along z; the common ones and the darker ones.

    They touch: in a joint, a fraction of a pixel wide, one pixel's centre in ten would lie and make it a black dot.
    """
    rng = np.random.default_rng(8)
    tones: tuple[list[Mesh], list[Mesh]] = ([], [])
    places = np.random.default_rng(9)
    for row in range(30):
        x = -2.25 + PLANK_WIDTH * row
        z = -2.6 - rng.uniform(0, 1.2)
        while z < 2.6:
            end = z + rng.uniform(0.9, 1.8)
            low, high = (x, -0.02, max(z, -2.6)), (x + PLANK_WIDTH, 0.0, min(end, 2.6))
            if high[2] - low[2] > 0.02:
                plank = _along_grain(block(low, high), int(places.integers(4)), float(places.uniform()))
                tones[int(rng.uniform() < 0.34)].append(plank)
            z = end
    return _oaken(tones[0]), _oaken(tones[1])


def _along_grain(mesh: Mesh, board: int = 0, start: float = 0.0) -> Mesh:
    """With one board of the oak's image laid along z, its joints left out."""
    x, _, z = mesh.positions.T
    across = 0.08 + 0.84 * (x - x.min()) / np.ptp(x)
    return with_coordinates(mesh, np.stack([z / OAK_WIDTH + start, (board + across) / 4.0], axis=1))


def _oaken(parts: list[Mesh]) -> Mesh:
    """Parts that have texture coordinates as one mesh that has them."""
    return with_coordinates(merged(parts), np.concatenate([_coordinates(part) for part in parts]))


def _coordinates(mesh: Mesh) -> Floats:
    assert mesh.coordinates is not None
    return mesh.coordinates


def _base() -> Mesh:
    """What the planks lie in."""
    return block((-X - 0.1, -0.12, -Z - 0.1), (X + 0.1, -0.01, Z + 0.1))


def woodwork() -> Mesh:
    """What is painted white: ceiling, skirting, frames and sills of the windows, the picture's ground."""
    far = 0.1
    parts = [
        block((-X - far, Y, -Z - far), (X + far, Y + 0.1, Z + far)),
        block((-X - 0.01, 0.0, -Z - 0.01), (X + 0.01, 0.09, -Z + 0.014)),
        block((X - 0.014, 0.0, -Z + 0.014), (X + 0.01, 0.09, Z)),
        block((-X - 0.01, 0.0, -Z + 0.014), (-X + 0.014, 0.09, Z)),
    ]
    for z0, z1 in WINDOWS:
        parts += _window_frame(z0, z1)
    return merged([*parts, block((-0.52, 1.38, -Z - 0.01), (0.52, 2.02, -Z + 0.012))])


def _window_frame(z0: float, z1: float) -> list[Mesh]:
    """A frame in the opening with a post and a bar, and a sill."""
    x0, x1, w = -X - 0.11, -X - 0.05, 0.055
    middle, bar = (z0 + z1) / 2, SILL + 0.66 * (LINTEL - SILL)
    return [
        block((x0, SILL - 0.01, z0 - 0.01), (x1, LINTEL + 0.01, z0 + w)),
        block((x0, SILL - 0.01, z1 - w), (x1, LINTEL + 0.01, z1 + 0.01)),
        block((x0, SILL - 0.01, z0 + w), (x1, SILL + w, z1 - w)),
        block((x0, LINTEL - w, z0 + w), (x1, LINTEL + 0.01, z1 - w)),
        block((x0 + 0.004, SILL + w, middle - 0.03), (x1 - 0.004, LINTEL - w, middle + 0.03)),
        block((x0 + 0.008, bar - 0.02, z0 + w), (x1 - 0.008, bar + 0.02, z1 - w)),
        cushion((-X - 0.05, SILL - 0.012, z0 - 0.05), (-X + 0.06, SILL + 0.018, z1 + 0.05), 0.006, 3),
    ]


def _picture() -> list[Mesh]:
    """The frame of the picture over the sofa, and the round that it shows."""
    x, low, high, w = 0.55, 1.35, 2.05, 0.035
    back, front = -Z - 0.01, -Z + 0.03
    return [
        block((-x, low, back), (x, low + w, front)),
        block((-x, high - w, back), (x, high, front)),
        block((-x, low + w, back), (w - x, high - w, front)),
        block((x - w, low + w, back), (x, high - w, front)),
        transformed(disc(0.16, 0.012), axis_rotation((1, 0, 0), np.pi / 2), (0.13, 1.72, -Z + 0.006)),
    ]


def sofa() -> Mesh:
    """A two-seater on block feet, its back toward -Z."""
    half = 0.98
    parts = [
        cushion((-half + 0.02, 0.10, -0.42), (half - 0.02, 0.27, 0.42), 0.03),
        cushion((-half + 0.02, 0.12, -0.45), (half - 0.02, 0.80, -0.25), 0.06),
    ]
    for side in (-1, 1):
        inner, outer = side * (half - 0.17), side * half
        parts.append(cushion((min(inner, outer), 0.10, -0.44), (max(inner, outer), 0.60, 0.44), 0.055))
        seat = (min(0.003 * side, side * (half - 0.175)), max(0.003 * side, side * (half - 0.175)))
        parts.append(cushion((seat[0], 0.26, -0.28), (seat[1], 0.43, 0.44), 0.05, 7))
        back = cushion((seat[0], 0.0, -0.085), (seat[1], 0.46, 0.085), 0.07, 7)
        parts.append(transformed(back, axis_rotation((1, 0, 0), -0.2), (0.0, 0.42, -0.13)))
        parts += [
            cushion((side * 0.88 - 0.03, 0.0, z - 0.03), (side * 0.88 + 0.03, 0.12, z + 0.03), 0.006, 3)
            for z in (-0.36, 0.36)
        ]
    pillow = cushion((-0.2, -0.2, -0.06), (0.2, 0.2, 0.06), 0.055, 7)
    leaning = axis_rotation((0, 1, 0), 0.35) @ axis_rotation((1, 0, 0), -0.42)
    parts.append(transformed(pillow, leaning, (-0.56, 0.63, 0.10)))
    return merged(parts)


def table() -> Mesh:
    """A low round table on three splayed legs."""
    legs = []
    for k in range(3):
        angle = 2 * np.pi * k / 3 + 0.5
        out = np.array([np.cos(angle), 0.0, np.sin(angle)])
        path = 0.20 * out + np.linspace(0, 1, 9)[:, None] * (0.13 * out - (0, TABLE - 0.029, 0)) + (0, TABLE - 0.02, 0)
        legs.append(tube(path, np.linspace(0.020, 0.011, 9), 20, 3))
    return merged([moved(disc(0.42, 0.026), (0.0, TABLE - 0.026, 0.0)), *legs])


def vase() -> Mesh:
    """A bottle vase, 34 cm high, closed at its neck's bottom."""
    t = np.linspace(0, 1, 21)
    curves = [
        [(0.060, 0.0), (0.125, 0.020), (0.125, 0.130), (0.060, 0.190)],
        [(0.060, 0.190), (0.030, 0.218), (0.024, 0.26), (0.032, 0.336)],
    ]
    wall = np.concatenate([bezier(np.array(curve), t[1 if i else 0 :]) for i, curve in enumerate(curves)])
    slope = np.gradient(wall, axis=0)
    normals = np.column_stack([slope[:, 1], -slope[:, 0]]) / np.linalg.norm(slope, axis=1, keepdims=True)
    lip = rounded_profile([(0.032, 0.336, 0), (0.0322, 0.340, 0.001), (0.0292, 0.340, 0.001), (0.024, 0.25, 0)], 5)
    return carried(
        Profile(
            np.concatenate([[(0.0, 0.0), (0.060, 0.0)], wall, lip.points[1:]]),
            np.concatenate([[(0.0, -1.0), (0.0, -1.0)], normals, lip.normals[1:]]),
        ),
        circle(72),
    )
