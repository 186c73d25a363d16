"""The Cornell box from its published measurements [CornellBox98], in metres.

Published in millimetres, looked at along +Z. Here half a turn about Y puts the eye on +Z, looking along -Z, and the
box's middle on x = 0. The light hangs half a millimetre below the ceiling that it is published to lie in. Walls are
seen from inside.
"""

import numpy as np

from .mesh import Floats, Mesh
from .surfaces import quads

FLOOR = [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]
CEILING = [(556.0, 548.8, 0), (556.0, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]
BACK = [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556.0, 548.8, 559.2)]
RIGHT = [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]
LEFT = [(552.8, 0, 0), (549.6, 0, 559.2), (556.0, 548.8, 559.2), (556.0, 548.8, 0)]
LIGHT = [(343.0, 548.3, 227.0), (343.0, 548.3, 332.0), (213.0, 548.3, 332.0), (213.0, 548.3, 227.0)]
SHORT_BLOCK = [(130.0, 65.0), (82.0, 225.0), (240.0, 272.0), (290.0, 114.0)], 165.0
TALL_BLOCK = [(423.0, 247.0), (265.0, 296.0), (314.0, 456.0), (472.0, 406.0)], 330.0


def meshes() -> dict[str, Mesh]:
    walls = {"floor": FLOOR, "ceiling": CEILING, "back": BACK, "left": LEFT, "right": RIGHT, "light": LIGHT}
    inside = {name: _quads_facing(np.array([corners]), (278, 274, 279)) for name, corners in walls.items()}
    return inside | {"short_block": block(*SHORT_BLOCK), "tall_block": block(*TALL_BLOCK)}


def block(base: list[tuple[float, float]], height: float) -> Mesh:
    """A block of base corners (x, z) and height in millimetres, all six faces outward."""
    low = np.array([(x, 0.0, z) for x, z in base])
    high = low + (0, height, 0)
    sides = [[low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]] for i in range(4)]
    return _quads_facing(np.array([low, high, *sides]), (low.mean(axis=0) + high.mean(axis=0)) / 2, outward=True)


def _quads_facing(corners: Floats, middle: Floats | tuple[float, ...], outward: bool = False) -> Mesh:
    """Quadrilaterals (Q, 4, 3) in millimetres wound to face the middle (or away from it), in this scene's frame."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, np.asarray(middle) - corners.mean(axis=1)) > 0
    wound = np.where((inward == outward)[:, None, None], corners[:, ::-1], corners)
    return quads((wound - (278.0, 0.0, 279.6)) * (-1e-3, 1e-3, -1e-3))
