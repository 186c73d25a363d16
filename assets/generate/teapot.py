"""Newell's teapot from its Bezier patches, with the patches' exact normals.

The lid's control points are spread by 7.7 % so that its edge meets the rim, as is usual; nothing else is changed.
"""

from importlib.resources import files

import numpy as np

from .mesh import Floats, Mesh, cleaned, merged
from .surfaces import grid_faces

LID_SPREAD = 1.077
HEIGHT = 3.15  # of the patches, in their own unit


def load_patches() -> tuple[list[str], Floats]:
    """Each patch's part (rim, body, handle, spout, lid, bottom) and control points (32, 4, 4, 3), Z up."""
    lines = files(__package__).joinpath("newell_teapot.txt").read_text(encoding="ascii").splitlines()
    rows = [line.split() for line in lines if not line.startswith("#")]
    points = np.array([row[1:] for row in rows if row[0] == "point"], dtype=float)
    parts = [row[1] for row in rows if row[0] == "patch"]
    indices = np.array([row[2:] for row in rows if row[0] == "patch"], dtype=int)
    patches = points[indices].reshape(-1, 4, 4, 3)
    patches[[part == "lid" for part in parts], ..., :2] *= LID_SPREAD
    return parts, patches


def bernstein(t: Floats) -> Floats:
    """The four cubic Bernstein polynomials at t (N,): (N, 4)."""
    s = 1 - t
    return np.stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3], axis=-1)


def bernstein_slope(t: Floats) -> Floats:
    """Their derivatives at t (N,): (N, 4)."""
    s = 1 - t
    return 3 * np.stack([-(s**2), s**2 - 2 * s * t, 2 * s * t - t**2, t**2], axis=-1)


def patch_mesh(patch: Floats, n: int) -> Mesh:
    """One patch (4, 4, 3) as an (n+1)² grid. The normal is d/dv x d/du, outward in Newell's data.

    Where a row of control points is one point (the lid's top, the bottom's middle) d/dv vanishes: the normal is Z.
    """
    t = np.linspace(0, 1, n + 1)
    value, slope = bernstein(t), bernstein_slope(t)
    positions, du, dv = (
        np.einsum("ui,vj,ijk->uvk", a, b, patch).reshape(-1, 3)
        for a, b in ((value, value), (slope, value), (value, slope))
    )
    normals = np.cross(dv, du)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    pole = np.array([0.0, 0.0, np.sign(positions[:, 2].mean() - HEIGHT / 2)])
    normals = np.where(length > 1e-9, normals / np.maximum(length, 1e-9), pole)
    return Mesh(positions, normals, grid_faces(n + 1, n + 1))


def teapot(scale: float, n: int = 20) -> Mesh:
    """The whole teapot standing on y = 0, spout toward +X; `scale` is the length in metres of the patches' unit."""
    _, patches = load_patches()
    mesh = merged(patch_mesh(patch, n) for patch in patches)
    to_y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return cleaned(Mesh(scale * mesh.positions @ to_y_up.T, mesh.normals @ to_y_up.T, mesh.faces))
