"""Stairwell: two flights of open treads round a well, lit by thirteen lamps from a window of 2.2 m² to a lit button.

What shines differs by 15,000 in area and by 100 in radiance, and no place sees all of it: light from near and from far,
large and small, with the shadows of treads, posts and rails. Metres; the well is 4 × 5.4 × 6.4, the eye stands in it.
"""

import numpy as np

from .furniture import block, cushion
from .mesh import Floats, Mesh, axis_rotation, merged, transformed
from .room import vase
from .surfaces import panel, tube

X, Y = 2.0, 5.4
FRONT, BACK = 2.6, -3.8
THICK = 0.2
RISE, GOING, N_STEPS = 0.17, 0.28, 12
FOOT = 0.6  # where the lower flight begins
LANDING = RISE * (N_STEPS + 1)
EDGE = FOOT - GOING * N_STEPS  # where the landing begins
WELL = 0.62  # half the width of the gap between the flights
HAND = 0.92  # height of the rail over the treads


def meshes() -> dict[str, Mesh]:
    return {
        "walls": walls(),
        "floor": block((-X - THICK, -0.1, BACK - THICK), (X + THICK, 0.0, FRONT + THICK)),
        "landings": landings(),
        "treads": treads(),
        "stringers": stringers(),
        "rails": rails(),
        "fittings": fittings(),
        "pot": transformed(vase(), np.eye(3), (1.35, 0.0, -1.5), scale=2.3),
        "skylights": skylights(),
        "window": panel((0.0, 3.75, BACK + 0.02), (0.6, 0.0, 0.0), (0.0, 0.92, 0.0)),
        "step_lights": merged([panel(at, *across(1, 0.045, 0.0125)) for at in step_lights()]),
        "sconces": merged([panel(at, *across(-1, 0.06, 0.13)) for at in sconces()]),
        "sign": panel((-1.2, 1.72, BACK + 0.03), (0.16, 0.0, 0.0), (0.0, 0.065, 0.0)),
        "buttons": merged([panel(at, *across(-1, 0.006, 0.006)) for at in buttons()]),
    }


def walls() -> Mesh:
    """Four walls and a ceiling that reach into one another."""
    x, z0, z1 = X + THICK, BACK - THICK, FRONT + THICK
    return merged([
        block((-x, -0.1, z0), (-X, Y + THICK, z1)),
        block((X, -0.1, z0), (x, Y + THICK, z1)),
        block((-X - 0.01, -0.1, z0), (X + 0.01, Y + THICK, BACK)),
        block((-X - 0.01, -0.1, FRONT), (X + 0.01, Y + THICK, z1)),
        block((-X - 0.01, Y, BACK - 0.01), (X + 0.01, Y + THICK, FRONT + 0.01)),
    ])  # fmt: skip


def landings() -> Mesh:
    """One between the flights, one at the end of the upper."""
    top = LANDING + RISE * (N_STEPS + 1)
    return merged([
        block((-X - 0.01, LANDING - 0.2, BACK - 0.01), (X + 0.01, LANDING, EDGE)),
        block((WELL, top - 0.2, FOOT), (X + 0.01, top, FRONT + 0.01)),
    ])  # fmt: skip


def treads() -> Mesh:
    """Boards of 45 mm: the lower flight along the left wall away from the eye, the upper one back along the right."""
    boards = []
    for x0, x1, y, z in steps():
        boards.append(cushion((x0, y - 0.045, z - GOING / 2 - 0.02), (x1, y, z + GOING / 2 + 0.02), 0.006, 3))
    return merged(boards)


def steps() -> list[tuple[float, float, float, float]]:
    """(from x, to x, height, middle in z) of every tread of both flights."""
    lower = [(-X, -WELL, RISE * (i + 1), FOOT - GOING * (i + 0.5)) for i in range(N_STEPS)]
    upper = [(WELL, X, LANDING + RISE * (i + 1), EDGE + GOING * (i + 0.5)) for i in range(N_STEPS)]
    return lower + upper


def stringers() -> Mesh:
    """Two slanted beams under each flight, their tops at the undersides of the treads."""
    length = np.hypot(RISE, GOING) * N_STEPS
    beam = block((-0.03, -0.22, -length / 2), (0.03, 0.0, length / 2))
    parts = []
    for middle, base, foot, towards in ((-(X + WELL) / 2, 0.0, FOOT, -1), ((X + WELL) / 2, LANDING, EDGE, 1)):
        turned = axis_rotation((1, 0, 0), -towards * np.arctan2(RISE, GOING))
        at = (base + RISE * N_STEPS / 2 - 0.04, foot + towards * GOING * N_STEPS / 2)
        parts += [transformed(beam, turned, (middle + side * 0.42, *at)) for side in (-1, 1)]
    return merged(parts)


def rails() -> Mesh:
    """A post on every second tread at the well's side, a rail over them, and one along the landing."""
    parts = []
    for flight in (steps()[:N_STEPS], steps()[N_STEPS:]):
        x = -WELL - 0.05 if flight[0][0] < 0 else WELL + 0.05
        tops = np.array([(x, y + HAND, z) for _, _, y, z in flight])
        parts += [_post(x, y, z) for _, _, y, z in flight[::2]]
        parts.append(_bar(np.array([tops[0] + (tops[0] - tops[1]) * 0.4, tops[-1] + (tops[-1] - tops[-2]) * 0.4])))
    across = np.array([(x, LANDING + HAND, EDGE - 0.06) for x in (-WELL + 0.02, WELL - 0.02)])
    parts += [_post(x, LANDING, EDGE - 0.06) for x in np.linspace(across[0, 0] + 0.05, across[1, 0] - 0.05, 4)]
    return merged([*parts, _bar(across)])


def _post(x: float, y: float, z: float) -> Mesh:
    return _bar(np.array([(x, y - 0.01, z), (x, y + HAND, z)]), 0.011)


def _bar(ends: Floats, radius: float = 0.021) -> Mesh:
    path = ends[0] + np.linspace(0, 1, 3)[:, None] * (ends[1] - ends[0])
    return tube(path, np.full(3, radius), 20, 4)


def skylights() -> Mesh:
    return merged([panel((-0.9, Y - 0.01, z), (0.75, 0.0, 0.0), (0.0, 0.0, 0.5)) for z in (-1.6, 1.0)])


def step_lights() -> list[tuple[float, float, float]]:
    """In the left wall over every other of the lower treads."""
    return [(-X + 0.012, y + 0.20, z) for _, _, y, z in steps()[:N_STEPS:2]][:5]


def sconces() -> list[tuple[float, float, float]]:
    return [(X - 0.05, 1.75, z) for z in (-2.9, -0.3)]


def buttons() -> list[tuple[float, float, float]]:
    return [(X - 0.014, 1.15, z) for z in (-1.0, -0.94)]


def across(side: int, half_width: float, half_height: float) -> tuple[Floats, Floats]:
    """Half edges of a panel that faces +X (side 1) or -X."""
    return np.array([0.0, 0.0, -side * half_width]), np.array([0.0, half_height, 0.0])


def fittings() -> Mesh:
    """What lamps are let into: plates on the side walls, a little larger and a little behind, and two frames."""
    parts = [_plate(at, 0.06, 0.024) for at in step_lights()] + [_plate(at, 0.075, 0.145) for at in sconces()]
    parts.append(_plate((X - 0.014, 1.15, -0.97), 0.075, 0.05))
    parts.append(block((-1.38, 1.64, BACK - 0.01), (-1.02, 1.80, BACK + 0.026)))
    parts += [block((x - 0.03, 2.80, BACK - 0.01), (x + 0.03, 4.70, BACK + 0.06)) for x in (-0.6, 0.0, 0.6)]
    parts += [block((-0.63, y, BACK - 0.01), (0.63, y + 0.06, BACK + 0.058)) for y in (2.79, 4.65)]
    return merged(parts)


def _plate(at: tuple[float, float, float], half_width: float, half_height: float) -> Mesh:
    x, y, z = at
    low, high = sorted((x + np.copysign(0.002, x), np.copysign(X + 0.01, x)))
    return block((low, y - half_height, z - half_width), (high, y + half_height, z + half_width))
