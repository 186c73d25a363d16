"""Props of our own as meshes: a backdrop, a pedestal, and a ball on a base that shows a material. Of unit size and
centred at the origin, as the shapes of `engine.scene.primitives`, with exact normals.

The backdrop is a seamless sweep: a floor, a quarter of a cylinder and a wall, open, its front up and along +Z; u runs
along X, v up the sweep. The pedestal is a round plinth with a rounded edge. The ball has a groove around its middle,
where the edges of a material show; its base is a foot with a bowl that the ball stands in. Both are closed.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import Mesh, join_meshes, place_copies
from engine.scene.surfaces_of_revolution import revolved

Float64Array = npt.NDArray[np.float64]
# Radius and height (N, 2), from below on the outside, and the normals there.
Outline = tuple[Float64Array, Float64Array]

# The backdrop's width and depth are 1.
SWEEP_HEIGHT, SWEEP_RADIUS = 0.6, 0.25
_SWEEP_STEPS = 48
# The pedestal's diameter is 1.
PLINTH_HEIGHT, PLINTH_EDGE = 0.4, 0.03
# The ball's diameter is 1; half the height of its groove as an angle in degrees, and the radius within it.
GROOVE, GROOVE_RADIUS = 5.0, 0.46
_ARC_STEPS = 48
# The base in diameters of its ball, whose middle is so high above the ground: radius and height of the foot, of the rim
# and of the bowl, which leaves a gap around the ball.
BALL_HEIGHT = 0.66
FOOT_RADIUS, FOOT_HEIGHT, RIM_RADIUS, BOWL_RADIUS, GAP = 0.4, 0.05, 0.3, 0.27, 0.01
_BASE_SIDE = 2.0 * FOOT_RADIUS
_UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # turns the axis Z into Y


def backdrop() -> Mesh:
    """The sweep, 1 wide and deep: its wall at the back, at Z = -½."""
    angle = np.linspace(0.0, 0.5 * math.pi, _SWEEP_STEPS + 1)
    # The arc about (SWEEP_RADIUS above the floor, SWEEP_RADIUS before the wall): y and z, and its normals.
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    arc = np.array([SWEEP_RADIUS, SWEEP_RADIUS - 0.5]) - SWEEP_RADIUS * normals
    line = np.concatenate([[[0.0, 0.5]], arc, [[SWEEP_HEIGHT, -0.5]]])
    normals = np.concatenate([normals[:1], normals, normals[-1:]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    n = len(line)
    vertices, directions, uv = np.zeros((2, n, 3)), np.zeros((2, n, 3)), np.zeros((2, n, 2))
    vertices[..., 0], vertices[..., 1], vertices[..., 2] = np.array([[-0.5], [0.5]]), line[:, 0], line[:, 1]
    directions[..., 1:], uv[1, :, 0], uv[..., 1] = normals, 1.0, along / along[-1]
    vertices[..., 1] -= SWEEP_HEIGHT / 2.0
    k = np.arange(n - 1)
    triangles = np.concatenate([np.stack([k, n + k, n + k + 1], 1), np.stack([k, n + k + 1, k + 1], 1)])
    uvs = uv.reshape(-1, 2)[triangles].astype(np.float32)
    return Mesh(vertices.reshape(-1, 3), triangles.astype(np.int32), directions.reshape(-1, 3), uvs)


def pedestal() -> Mesh:
    """The plinth of diameter 1 about the Y axis."""
    half, edge = PLINTH_HEIGHT / 2.0, PLINTH_EDGE
    return _upright([
        _line((0.0, -half), (0.5, -half)), _line((0.5, -half), (0.5, half - edge)),
        _arc((0.5 - edge, half - edge), edge, 0.0, 90.0), _line((0.5 - edge, half), (0.0, half)),
    ])  # fmt: skip


def shader_ball() -> Mesh:
    """The ball of diameter 1 with a groove around it, about the Y axis."""
    cos, sin = 0.5 * math.cos(math.radians(GROOVE)), 0.5 * math.sin(math.radians(GROOVE))
    return _upright([
        _arc((0.0, 0.0), 0.5, -90.0, -GROOVE), _line((cos, -sin), (GROOVE_RADIUS, -sin)),
        _line((GROOVE_RADIUS, -sin), (GROOVE_RADIUS, sin)), _line((GROOVE_RADIUS, sin), (cos, sin)),
        _arc((0.0, 0.0), 0.5, GROOVE, 90.0),
    ])  # fmt: skip


def shader_ball_base() -> Mesh:
    """The base of the ball about the Y axis, of diameter 1."""
    radius = 0.5 + GAP  # of the bowl
    rim = BALL_HEIGHT - math.sqrt(radius**2 - BOWL_RADIUS**2)
    lowest = math.degrees(math.asin(BOWL_RADIUS / radius))
    angle = np.radians(np.linspace(lowest, 0.0, _ARC_STEPS + 1))
    inwards = np.stack([-np.sin(angle), np.cos(angle)], axis=1)  # towards the middle of the ball
    bowl = np.array([0.0, BALL_HEIGHT]) - radius * inwards
    outlines = [
        _line((0.0, 0.0), (FOOT_RADIUS, 0.0)), _line((FOOT_RADIUS, 0.0), (FOOT_RADIUS, FOOT_HEIGHT)),
        _line((FOOT_RADIUS, FOOT_HEIGHT), (RIM_RADIUS, rim)), _line((RIM_RADIUS, rim), (BOWL_RADIUS, rim)),
        (bowl, inwards),
    ]  # fmt: skip
    middle = np.array([0.0, rim / 2.0])
    return _upright([((line - middle) / _BASE_SIDE, normals) for line, normals in outlines])


# How the base stands below its ball of diameter 1, whose middle is the origin: its scale, and the height of its middle.
BASE_SCALE = _BASE_SIDE
BASE_PLACE = (BALL_HEIGHT - math.sqrt((0.5 + GAP) ** 2 - BOWL_RADIUS**2)) / 2.0 - BALL_HEIGHT


def _line(start: tuple[float, float], end: tuple[float, float]) -> Outline:
    """A straight part of an outline; its normal is on the right."""
    radius, height = np.subtract(end, start) / math.dist(start, end)
    return np.array([start, end]), np.tile([height, -radius], (2, 1))


def _arc(centre: tuple[float, float], radius: float, first: float, last: float) -> Outline:
    """An arc about a centre, from one angle above the horizontal to another, degrees."""
    angle = np.radians(np.linspace(first, last, _ARC_STEPS + 1))
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    line = np.array(centre) + radius * normals
    line[:, 0] = np.maximum(line[:, 0], 0.0)
    return line, normals


def _upright(outlines: list[Outline]) -> Mesh:
    """The surface of these outlines, revolved about Y."""
    return place_copies(join_meshes([revolved(*outline) for outline in outlines]), _UPRIGHT[None])
