"""Compiled: point location on the geodesic sphere, the solid angle of a triangle, and real spherical harmonics.

Harmonics have z as their axis and the Condon-Shortley sign, as in [Sloan05]: y_lm = sqrt(2) Q_lm(z) Re (x + iy)^m for
m > 0, Im for m < 0, and Q_l0(z) for m = 0, where Q_lm is the normalised associated Legendre function without its factor
sin^m. In this form, values and gradients are polynomials in x, y and z, nothing is divided by zero at the axis, and a
direction of length 0 is valid.

Kernels never validate: `engine.sphere.geodesic`, which builds the tables, and `engine.sphere.harmonics` do.
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


MAX_ORDER = 10


def _recurrence() -> tuple[Float64Array, Float64Array, Float64Array]:
    """Coefficients of Q_lm = up_lm (z Q_(l-1)m - back_lm Q_(l-2)m), from Q_mm = diagonal_m; no factorial, which would
    overflow."""
    diagonal = np.empty(MAX_ORDER)
    up, back = np.zeros((MAX_ORDER, MAX_ORDER)), np.zeros((MAX_ORDER, MAX_ORDER))
    diagonal[0] = math.sqrt(0.25 / math.pi)
    for m in range(1, MAX_ORDER):
        diagonal[m] = -diagonal[m - 1] * math.sqrt((2 * m + 1) / (2 * m))
    for l in range(1, MAX_ORDER):  # noqa: E741  # the field's name
        for m in range(l):
            up[l, m] = math.sqrt((4 * l * l - 1) / (l * l - m * m))
            back[l, m] = math.sqrt(((l - 1) ** 2 - m * m) / (4 * (l - 1) ** 2 - 1)) if l > 1 else 0.0
    return diagonal, up, back


_DIAGONAL, _UP, _BACK = _recurrence()
_SQRT2 = math.sqrt(2.0)


@njit(cache=True, nogil=True, error_model="numpy")
def basis_at(
    x: float, y: float, z: float, legendre: Float64Array, values: Float64Array, gradients: Float64Array
) -> None:
    """Writes values (n^2,), number l^2 + l + m, at one position; gradients (n^2, 3) by x, y and z unless they are (0,
    3).

    legendre: (n, n + 1) working memory, 0 above its diagonal.
    """
    n = legendre.shape[0]
    # The associated Legendre functions by recurrence in l.
    for m in range(n):
        legendre[m, m] = _DIAGONAL[m]
        for l in range(m + 1, n):  # noqa: E741
            before = legendre[l - 2, m] if l > m + 1 else 0.0
            legendre[l, m] = _UP[l, m] * (z * legendre[l - 1, m] - _BACK[l, m] * before)
    wants_gradients = gradients.shape[0] > 0
    cosine, sine, cosine_before, sine_before = 1.0, 0.0, 0.0, 0.0  # of m phi, times sin^m theta
    # Multiply by Re and Im of (x + iy)^m.
    for m in range(n):
        scale = _SQRT2 if m else 1.0
        for l in range(m, n):  # noqa: E741
            q, centre = scale * legendre[l, m], l * l + l
            values[centre + m] = q * cosine
            if m:
                values[centre - m] = q * sine
            if wants_gradients:
                # dQ_lm / dz: the derivative of a Legendre function is the next one in m.
                slope = -scale * math.sqrt((l - m) * (l + m + 1.0)) * legendre[l, m + 1]
                gradients[centre + m, 0] = q * m * cosine_before
                gradients[centre + m, 1] = -q * m * sine_before
                gradients[centre + m, 2] = slope * cosine
                if m:
                    gradients[centre - m, 0] = q * m * sine_before
                    gradients[centre - m, 1] = q * m * cosine_before
                    gradients[centre - m, 2] = slope * sine
        # (x + iy)^(m + 1).
        cosine_before, sine_before = cosine, sine
        cosine, sine = cosine * x - sine * y, sine * x + cosine * y


@njit(cache=True, nogil=True, error_model="numpy")
def basis_range(directions: Float64Array, n: int, start: int, stop: int, values: Float64Array) -> None:
    """Fills values[start:stop] (D, n^2)."""
    legendre, none = np.zeros((n, n + 1)), np.empty((0, 3))
    for i in range(start, stop):
        basis_at(directions[i, 0], directions[i, 1], directions[i, 2], legendre, values[i], none)
