"""Teatray, after [BenArtzi07, fig. 4.4]: the teapot on a rimmed tray with a curved handle at either end."""

import numpy as np

from .mesh import Mesh, axis_rotation, merged, transformed
from .surfaces import arc_profile, bezier, carried, circle, rounded_profile, rounded_rectangle, tube
from .teapot import teapot

CORNER = 0.07  # radius of the tray's corners at its outer edge
HALF_X, HALF_Z = 0.25, 0.20  # half the tray's outer sides
FLOOR = 0.005  # height of the tray's inside


def meshes() -> dict[str, Mesh]:
    return {"teapot": _teapot(), "tray": tray(), "handles": handles()}


def _teapot() -> Mesh:
    """A litre's worth: the body 22 cm wide; turned a little so that the spout comes toward the eye."""
    return transformed(teapot(scale=0.055), axis_rotation((0, 1, 0), np.radians(-25)), (0.0, FLOOR, 0.0))


def tray() -> Mesh:
    profile = rounded_profile(
        [
            (0.0, 0.0, 0.0),
            (CORNER - 0.020, 0.0, 0.012),
            (CORNER - 0.004, 0.020, 0.006),
            (CORNER, 0.0215, 0.0012),
            (CORNER, 0.024, 0.0012),
            (CORNER - 0.006, 0.0245, 0.006),
            (CORNER - 0.020, FLOOR, 0.016),
            (0.0, FLOOR, 0.0),
        ],
        arc_points=9,
    )
    return carried(profile, rounded_rectangle(HALF_X - CORNER, HALF_Z - CORNER, 17))


def handles() -> Mesh:
    """A bow from foot to foot over each end of the tray, leaning outward, on two button feet."""
    bow = bezier(np.array([(0.0, -0.07), (0.082, -0.078), (0.082, 0.078), (0.0, 0.07)]), np.linspace(0, 1, 49))
    lean = np.radians(38)
    out, along = bow[:, 0], bow[:, 1]
    path = np.column_stack([HALF_X - 0.006 + out * np.cos(lean), 0.0265 + out * np.sin(lean), along])
    radii = 0.0042 + 0.0014 * np.sin(np.pi * np.linspace(0, 1, 49)) ** 2
    right = merged([tube(path, radii, 24), *(_foot(path[end]) for end in (0, -1))])
    left = transformed(right, axis_rotation((0, 1, 0), np.pi))
    return merged([right, left])


def _foot(at: np.ndarray) -> Mesh:
    """A flattened ball (semi-axes 8, 5, 8 mm) that the bow's end stands in."""
    ball = carried(arc_profile(1.0, (0, 0), -np.pi / 2, np.pi / 2, 15), circle(24))
    axes = np.array([0.008, 0.005, 0.008])
    normals = ball.normals / axes
    return Mesh(ball.positions * axes + at, normals / np.linalg.norm(normals, axis=1, keepdims=True), ball.faces)
