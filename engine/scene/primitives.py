"""Built-in shapes of unit size, centred at the origin.

quad: 1×1 in the XY plane, front along +Z; cube: edge 1; sphere: diameter 1, with its exact normals; disc: diameter 1 in
the XY plane, front along +Z; cylinder, cone: diameter and height 1 along Y, the tip up; torus: outer diameter 1, in the
XZ plane. A texture fills the quad, each side of the cube, the square about the disc and, as a map in longitude and
latitude, the sphere. Seen from the front, u grows to the right and v upwards.
"""

from __future__ import annotations

import numpy as np

from engine.scene.mesh import Mesh, join_meshes, place_copies
from engine.scene.props import backdrop, pedestal, shader_ball, shader_ball_base
from engine.scene.surfaces_of_revolution import revolved, truncated_cone

_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], np.float32)  # (u, v) of a side's four corners
_RINGS, _SEGMENTS = 64, 128
_SIDES = 64  # of discs
_TUBE, _TUBE_SEGMENTS = 0.15, 48  # radius of the torus' tube
_UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # turns the axis Z into Y


def quad() -> Mesh:
    """The unit square of the XY plane, normal +Z."""
    vertices = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(vertices, triangles, np.tile([0.0, 0.0, 1.0], (4, 1)), _SQUARE[triangles])


def cube() -> Mesh:
    """The cube [-½, ½]³ with flat faces: four vertices a face, normals outward."""
    x, y, z = np.eye(3)
    sides = [(x, y, z), (y, z, x), (z, x, y), (-x, z, y), (-y, x, z), (-z, y, x)]  # (normal, s, t), s × t = normal
    corners = [0.5 * (n + a * s + b * t) for n, s, t in sides for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    triangles = (np.arange(6)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    normals = np.repeat([n for n, _, _ in sides], 4, axis=0)
    return Mesh(np.array(corners), triangles.astype(np.int32), normals, _SQUARE[triangles % 4])


def sphere() -> Mesh:
    """The sphere of diameter 1 in 64 × 128 latitude and longitude cells, with the true sphere's normals."""
    theta = np.linspace(0.0, np.pi, _RINGS + 1)[1:-1, None]
    phi = np.arange(_SEGMENTS) * (2 * np.pi / _SEGMENTS)
    ring = np.stack(np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), -1)
    normals = np.concatenate([[[0.0, 1.0, 0.0]], ring.reshape(-1, 3), [[0.0, -1.0, 0.0]]])
    triangles = _sphere_triangles()
    return Mesh(0.5 * normals, triangles, normals, _sphere_uvs(triangles))


def _sphere_triangles() -> np.ndarray:
    """Two fans at the poles and bands of quads between the rings, counter-clockwise from outside."""
    n = _SEGMENTS
    here, there = np.arange(n), (np.arange(n) + 1) % n
    last = 1 + (_RINGS - 2) * n
    faces = [np.stack([np.zeros(n, int), 1 + here, 1 + there], 1)]
    for ring in range(_RINGS - 2):
        up, down = 1 + ring * n, 1 + (ring + 1) * n
        faces.append(np.stack([up + here, down + here, down + there], 1))
        faces.append(np.stack([up + here, down + there, up + there], 1))
    faces.append(np.stack([np.full(n, last + n), last + there, last + here], 1))
    return np.concatenate(faces).astype(np.int32)


def _sphere_uvs(triangles: np.ndarray) -> np.ndarray:
    """(u, v) = (φ / 2π, 1 − θ / π) of the corners, (T, 3, 2): u continues to 1 at the seam, and at a pole is the mean
    of the other two corners'."""
    n = _SEGMENTS
    pole = (triangles == 0) | (triangles == triangles.max())
    ring, column = np.divmod(triangles - 1, n)
    u = np.where(pole, 0.0, column / n)
    u = np.where(~pole & (u == 0.0) & (u.max(axis=1, keepdims=True) > 0.5), 1.0, u)
    middle = u.sum(axis=1, keepdims=True) / 2.0
    v = np.where(pole, triangles == 0, 1.0 - (ring + 1) / _RINGS)
    return np.stack([np.where(pole, middle, u), v], axis=2).astype(np.float32)


def sphere_places(uv: np.ndarray) -> np.ndarray:
    """The places (N, 3) on the true sphere of texture coordinates (N, 2) of `sphere`."""
    phi, theta = 2.0 * np.pi * uv[:, 0].astype(float), np.pi * (1.0 - uv[:, 1].astype(float))
    return 0.5 * np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=1)


def disc() -> Mesh:
    """The disc of diameter 1 in the XY plane, normal +Z, as a regular polygon."""
    phi = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    rim = 0.5 * np.stack([np.cos(phi), np.sin(phi), np.zeros(_SIDES)], axis=1)
    vertices = np.concatenate([np.zeros((1, 3)), rim])
    around = np.arange(_SIDES)
    triangles = np.stack([np.zeros(_SIDES, int), 1 + around, 1 + (around + 1) % _SIDES], axis=1).astype(np.int32)
    uvs = (vertices[triangles][..., :2] + 0.5).astype(np.float32)
    return Mesh(vertices, triangles, np.tile([0.0, 0.0, 1.0], (len(vertices), 1)), uvs)


def cylinder() -> Mesh:
    """The cylinder of diameter and height 1 about the Y axis, with its ends."""
    return _upright(truncated_cone(0.5, 0.5, 1.0))


def cone() -> Mesh:
    """The cone of diameter and height 1 about the Y axis, its tip up, with its base."""
    return _upright(truncated_cone(0.0, 0.5, 1.0))


def torus() -> Mesh:
    """The torus of outer diameter 1 about the Y axis, its tube of radius `_TUBE`."""
    angle = np.linspace(-np.pi, np.pi, _TUBE_SEGMENTS + 1)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return _upright([(_TUBE * normals + (0.5 - _TUBE, 0.0), normals)])


def _upright(outlines: list[tuple[np.ndarray, np.ndarray]]) -> Mesh:
    """The surface of these outlines of radius and height, revolved about Y."""
    return place_copies(join_meshes([revolved(*outline) for outline in outlines]), _UPRIGHT[None])


PRIMITIVES = {
    "quad": quad, "cube": cube, "sphere": sphere, "disc": disc, "cylinder": cylinder, "cone": cone, "torus": torus,
    "backdrop": backdrop, "pedestal": pedestal, "shader_ball": shader_ball, "shader_ball_base": shader_ball_base,
}  # fmt: skip
