"""Ring, after [BenArtzi07, fig. 6.5]: a metal ring lying on a plane; a lamp beside it draws the caustic inside.

A finger ring of 21 mm: its inside is all but a cylinder, which gathers low light into the cusp known from coffee cups.
"""

import numpy as np

from .mesh import Floats, Mesh, axis_rotation, moved, transformed
from .shapes import disc
from .surfaces import carried, circle, quads, rounded_profile

INNER, OUTER, HEIGHT = 0.0095, 0.0119, 0.0062
LAMP = np.array([-0.085, 0.072, -0.080])
LAMP_RADIUS = 0.006


def meshes() -> dict[str, Mesh]:
    return {"ring": ring(), "plane": moved(disc(0.5, 0.01), (0.0, -0.01, 0.0)), "lamp": lamp()}


def ring() -> Mesh:
    """A band lying on y = 0, bowed outside so that it mirrors more than the plane; the profile closes in itself."""
    middle, edge = HEIGHT / 2, 0.00055
    shoulder = OUTER - 0.0014
    corners = [
        (INNER, middle, 0), (INNER, 0.0, edge), (shoulder, 0.0, edge), (OUTER, middle, 0.0066),
        (shoulder, HEIGHT, edge), (INNER, HEIGHT, edge), (INNER, middle, 0),
    ]  # fmt: skip
    return carried(rounded_profile(corners, arc_points=7), circle(160), caps=False)


def lamp() -> Mesh:
    """A small octagon that faces the ring."""
    angle = np.pi / 4 * np.arange(8)
    rim = LAMP_RADIUS * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(8)])
    fans = np.array([[np.zeros(3), rim[i], rim[i + 1], rim[(i + 2) % 8]] for i in (0, 2, 4, 6)])
    return transformed(quads(fans), _facing(-LAMP), LAMP)


def _facing(direction: Floats) -> Floats:
    """The rotation (3, 3) that turns +Z to the direction."""
    d = direction / np.linalg.norm(direction)
    return axis_rotation((0, 1, 0), float(np.arctan2(d[0], d[2]))) @ axis_rotation((1, 0, 0), -float(np.arcsin(d[1])))
