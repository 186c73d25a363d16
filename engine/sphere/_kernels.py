"""Compiled point location on the geodesic sphere, and the solid angle of a triangle seen from a point.

Kernels never validate: `engine.sphere.geodesic` does, and it builds their tables.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def locate_one(x: float, y: float, z: float, level: int, roots: Float64Array, planes: Float64Array) -> int:
    """The triangle of `level` that contains direction (x, y, z): nearest root face, then one plane test per level.

    The nearest of the 20 face centres belongs to the face that contains the direction, because the Voronoi cells of the
    face centres are the faces. On finer levels the direction lies in corner child k if it is beyond plane k, otherwise
    in the centre child. The largest of the three values decides, so rounding on an edge can only choose between the
    triangles that share it.
    """
    # The root face with the nearest centre.
    triangle = 0
    best = -math.inf
    for face in range(20):
        along = x * roots[face, 0] + y * roots[face, 1] + z * roots[face, 2]
        if along > best:
            best = along
            triangle = face
    first = 0
    count = 20
    # Descend one level at a time: corner child k beyond plane k, otherwise the centre child.
    for _ in range(level):
        row = first + triangle
        child = 3
        beyond = 0.0
        for k in range(3):
            value = x * planes[row, k, 0] + y * planes[row, k, 1] + z * planes[row, k, 2]
            if value > beyond:
                beyond = value
                child = k
        first += count
        count *= 4
        triangle = 4 * triangle + child
    return triangle


@njit(cache=True, nogil=True, error_model="numpy")
def locate_range(
    directions: Float64Array,
    level: int,
    roots: Float64Array,
    planes: Float64Array,
    start: int,
    stop: int,
    found: NDArray[np.int32],
) -> int:
    """Fills found[start:stop]; returns the first direction that is zero or not finite, or -1."""
    first_bad = -1
    for i in range(start, stop):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        size = abs(x) + abs(y) + abs(z)
        if not (0.0 < size < math.inf):
            if first_bad < 0:
                first_bad = i
            found[i] = -1
            continue
        found[i] = locate_one(x, y, z, level, roots, planes)
    return first_bad


@njit(cache=True, nogil=True, error_model="numpy")
def solid_angle_from(px: float, py: float, pz: float, corners: Float64Array) -> float:
    """Signed solid angle of the triangle corners (3, 3) seen from p: positive where its normal points towards p.

    tan(Omega / 2) = -a.(b x c) / (|a||b||c| + (a.b)|c| + (b.c)|a| + (c.a)|b|), a, b, c from p  [VanOosterom83]. It is 0
    from any point in the plane of the triangle, including its corners and edges.
    """
    ax, ay, az = corners[0, 0] - px, corners[0, 1] - py, corners[0, 2] - pz
    bx, by, bz = corners[1, 0] - px, corners[1, 1] - py, corners[1, 2] - pz
    cx, cy, cz = corners[2, 0] - px, corners[2, 1] - py, corners[2, 2] - pz
    la = math.sqrt(ax * ax + ay * ay + az * az)
    lb = math.sqrt(bx * bx + by * by + bz * bz)
    lc = math.sqrt(cx * cx + cy * cy + cz * cz)
    volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    if volume == 0.0:
        return 0.0
    ab = ax * bx + ay * by + az * bz
    bc = bx * cx + by * cy + bz * cz
    ca = cx * ax + cy * ay + cz * az
    return 2.0 * math.atan2(-volume, la * lb * lc + ab * lc + bc * la + ca * lb)
