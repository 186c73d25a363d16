"""Dominoes, after [BenArtzi07, ch. 8]: a curved row on a table, one end of it falling; many things and small shadows.

A domino that leans by phi holds up the one behind it, at pitch p, at theta = phi + asin((p cos(phi) - d) / h), for
height h and thickness d: the front upper edge of that one touches the other's back. The row is solved from the last
one that still stands.
"""

import numpy as np

from .mesh import Floats, Mesh, axis_rotation, merged, transformed
from .shapes import disc
from .surfaces import carried, circle, rounded_profile, rounded_rectangle

HEIGHT, WIDTH, THICKNESS = 0.048, 0.024, 0.0085
PITCH = 0.0205
COUNT, FALLING = 29, 11
BEVEL = 0.0011
PIP = 0.0019


def meshes() -> dict[str, Mesh]:
    frames = [_pose(i) for i in range(COUNT)]
    stone = _stone()
    values = np.random.default_rng(3).integers(1, 7, (COUNT, 2))
    pips = [_placed(_pips(int(top), int(bottom)), frame) for (top, bottom), frame in zip(values, frames, strict=True)]
    table = disc(0.6, 0.02)
    return {
        "falling": merged([_placed(stone, frame) for frame in frames[:FALLING]]),
        "standing": merged([_placed(stone, frame) for frame in frames[FALLING:]]),
        "pips": merged(pips),
        "table": Mesh(table.positions - (0, 0.02, 0), table.normals, table.faces),
    }


def leans() -> Floats:
    """Each domino's angle from upright in radians, the first one falling first."""
    angles = np.zeros(COUNT)
    for i in reversed(range(FALLING)):
        after = angles[i + 1]
        angles[i] = after + np.arcsin((PITCH * np.cos(after) - THICKNESS) / HEIGHT)
    return angles


def _path(distance: Floats) -> tuple[Floats, Floats]:
    """Points (N, 2) in (x, z) and headings (N,) on a winding path, the row's middle at distance 0.

    The heading turns evenly and its turn fades: an S with one long and one short bow.
    """
    fine = np.linspace(-0.4, 0.4, 1601)
    heading = 0.15 + 1.65 * np.sin(8.0 * fine + 0.35)
    steps = np.column_stack([np.cos(heading), np.sin(heading)]) * (fine[1] - fine[0])
    points = np.cumsum(steps, axis=0)
    points -= points[len(points) // 2]
    x, z = (np.interp(distance, fine, points[:, k]) for k in range(2))
    return np.stack([x, z], axis=-1), np.interp(distance, fine, heading)


def _pose(index: int) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and place (3,) of a domino: its own X points ahead, its front lower edge is the pivot."""
    distance = np.array([(index - (COUNT - 1) / 2) * PITCH])
    (point,), (heading,) = _path(distance)
    turned = axis_rotation((0, 1, 0), -float(heading))
    fallen = axis_rotation((0, 0, 1), -float(leans()[index]))
    return turned @ fallen, np.array([point[0], 0.0, point[1]])


def _placed(mesh: Mesh, pose: tuple[Floats, Floats]) -> Mesh:
    return transformed(mesh, pose[0], pose[1])


def _stone() -> Mesh:
    """One domino upright, its front face in the plane x = 0, standing on y = 0."""
    profile = rounded_profile([(0, 0, 0), (BEVEL, 0, BEVEL), (BEVEL, HEIGHT, BEVEL), (0, HEIGHT, 0)], arc_points=4)
    box = carried(profile, rounded_rectangle(THICKNESS / 2 - BEVEL, WIDTH / 2 - BEVEL, 4))
    return Mesh(box.positions - (THICKNESS / 2, 0, 0), box.normals, box.faces)


def _pips(top: int, bottom: int) -> Mesh:
    """The pips and the dividing bar on the back face (the side that faces backward along the row), raised by a hair."""
    button = carried(rounded_profile([(0, 0, 0), (PIP, 0, 0), (PIP, 0.0002, 0.00015), (0, 0.0002, 0)], 3), circle(16))
    bar = carried(
        rounded_profile([(0, 0, 0), (0.0004, 0, 0), (0.0004, 0.0002, 0.00015), (0, 0.0002, 0)], 3),
        rounded_rectangle(0.008, 0.0001, 3),
    )
    # On the face: local Y of a button looks along -X, its X along Z.
    facing = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    back = -THICKNESS + 0.00002
    places = [(z, HEIGHT * 0.25 + y) for z, y in _pattern(bottom)] + [(z, HEIGHT * 0.75 + y) for z, y in _pattern(top)]
    buttons = [transformed(button, facing, (back, y, z)) for z, y in places]
    return merged([*buttons, transformed(bar, facing, (back, HEIGHT / 2, 0.0))])


def _pattern(value: int) -> list[tuple[float, float]]:
    """The places (across, up) of 1 to 6 pips on a half face, in metres from its middle."""
    a, b = 0.0062, 0.0066
    corners = [(-a, -b), (a, b), (a, -b), (-a, b)]
    return (
        ([(0.0, 0.0)] if value % 2 else [])
        + corners[: value - value % 2][:4]
        + ([(-a, 0.0), (a, 0.0)] if value == 6 else [])
    )
