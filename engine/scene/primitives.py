"""Meshes of unit size for `primitive = ...` in a scene file, centred at the origin.

quad: 1×1 in the XY plane, front along +Z; cube: edge 1; sphere: diameter 1, with its exact normals.
"""

from __future__ import annotations

import numpy as np

from engine.scene.mesh import Mesh

_RINGS, _SEGMENTS = 64, 128


def quad() -> Mesh:
    """The unit square of the XY plane, normal +Z."""
    vertices = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(vertices, triangles, np.tile([0.0, 0.0, 1.0], (4, 1)))


def cube() -> Mesh:
    """The cube [-½, ½]³ with flat faces: four vertices a face, normals outward."""
    x, y, z = np.eye(3)
    sides = [(x, y, z), (y, z, x), (z, x, y), (-x, z, y), (-y, x, z), (-z, y, x)]  # (normal, s, t), s × t = normal
    corners = [0.5 * (n + a * s + b * t) for n, s, t in sides for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    triangles = (np.arange(6)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return Mesh(np.array(corners), triangles.astype(np.int32), np.repeat([n for n, _, _ in sides], 4, axis=0))


def sphere() -> Mesh:
    """The sphere of diameter 1 in 64 × 128 latitude and longitude cells, normals those of the true sphere."""
    theta = np.linspace(0.0, np.pi, _RINGS + 1)[1:-1, None]
    phi = np.arange(_SEGMENTS) * (2 * np.pi / _SEGMENTS)
    ring = np.stack(np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), -1)
    normals = np.concatenate([[[0.0, 1.0, 0.0]], ring.reshape(-1, 3), [[0.0, -1.0, 0.0]]])
    return Mesh(0.5 * normals, _sphere_triangles(), normals)


def _sphere_triangles() -> np.ndarray:
    """Two fans at the poles and bands of quads between the rings, outward by right hand."""
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


PRIMITIVES = {"quad": quad, "cube": cube, "sphere": sphere}
