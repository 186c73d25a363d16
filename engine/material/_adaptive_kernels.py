"""Compiled look-up of anisotropic measurements in their adaptive parameterization [Dupuy18], whose numpy form is
`engine.measured.adaptive`: what is stored is read as it is, without a table of all pairs of directions, which would
take a hundred times the memory and blur narrow streaks.

The measurement is one array of float32 (`AdaptiveReflection.packed`): sizes, azimuths and angles of wi, distributions,
the visible densities with their integrals, and colours.
"""

from __future__ import annotations

import math

from numba import njit

from engine.material._addressed_kernels import float_at
from engine.material._kernels import HALF_PI, _compile
from engine.measured.adaptive import LEAST_COSINES, N_SIZES


@njit(inline="always", **_compile)
def _around(address: int, first: int, n: int, value: float) -> tuple[int, float]:
    """The node below a value among n ascending ones, at least two, and the share of the next."""
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if float_at(address, first + middle) <= value:  # type: ignore[call-arg]
            low = middle
        else:
            high = middle
    at, after = float_at(address, first + low), float_at(address, first + low + 1)  # type: ignore[call-arg]
    return low, min(max((value - at) / (after - at), 0.0), 1.0)


@njit(inline="always", **_compile)
def _patch(place: float, n: int) -> tuple[int, float]:
    """The patch of a place in [0, 1] among n nodes, and where in it."""
    position = min(max(place, 0.0), 1.0) * (n - 1)
    index = min(int(position), n - 2)
    return index, position - index


@njit(inline="always", **_compile)
def _bilinear(address: int, at: int, right: int, up: int, t: float, s: float) -> float:
    """Interpolated between four values: at an index, and steps to the right and up from there."""
    low = (1.0 - t) * float_at(address, at) + t * float_at(address, at + right)  # type: ignore[call-arg]
    at += up
    high = (1.0 - t) * float_at(address, at) + t * float_at(address, at + right)  # type: ignore[call-arg]
    return (1.0 - s) * low + s * high  # type: ignore[no-any-return]


@njit(**_compile)
def _tabulated(
    table: int, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> tuple[float, float, float]:
    """E(wi, wo) = rho cos_o of each colour, for directions above the horizon."""
    n_phi, n_theta = int(float_at(table, 0)), int(float_at(table, 1))  # type: ignore[call-arg]
    ndf_rows, ndf_columns = int(float_at(table, 2)), int(float_at(table, 3))  # type: ignore[call-arg]
    area_rows, area_columns = int(float_at(table, 4)), int(float_at(table, 5))  # type: ignore[call-arg]
    rows, columns = int(float_at(table, 6)), int(float_at(table, 7))  # type: ignore[call-arg]
    colour_rows, colour_columns = int(float_at(table, 8)), int(float_at(table, 9))  # type: ignore[call-arg]
    n_symmetric, is_divided = int(float_at(table, 10)), int(float_at(table, 11))  # type: ignore[call-arg]
    phis = N_SIZES
    thetas = phis + n_phi
    ndf = thetas + n_theta
    areas = ndf + ndf_rows * ndf_columns
    densities = areas + area_rows * area_columns
    n_slice = rows * columns
    alongs = densities + n_phi * n_theta * n_slice
    ups = alongs + n_phi * n_theta * n_slice
    colours = ups + n_phi * n_theta * rows
    # Rotate or mirror wi into the azimuths that were measured.
    if n_symmetric > 1:
        flip_y = -1.0 if iy > 0.0 else 1.0
        flip_x = flip_y
        if n_symmetric == 4:
            flip_x = -1.0 if ix > 0.0 else 1.0
        ix, ox, iy, oy = ix * flip_x, ox * flip_x, iy * flip_y, oy * flip_y
    hx, hy, hz = ix + ox, iy + oy, iz + oz
    theta_i, phi_i = math.atan2(math.sqrt(ix * ix + iy * iy), iz), math.atan2(iy, ix)
    u = math.sqrt(min(math.atan2(math.sqrt(hx * hx + hy * hy), hz) / HALF_PI, 1.0))
    v = math.atan2(hy, hx) / (2.0 * math.pi) + 0.5
    v -= math.floor(v)
    # Where the visible density of wi maps wm: density at both sides of the patch, and integrals up to it.
    k, a = _around(table, phis, n_phi, phi_i)
    j, b = _around(table, thetas, n_theta, theta_i)
    (row, s), (column, t) = _patch(v, rows), _patch(u, columns)
    low, high, before, whole, after, below = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for corner in range(4):
        weight = (a if corner & 1 else 1.0 - a) * (b if corner & 2 else 1.0 - b)
        number = (k + (corner & 1)) * n_theta + j + (corner >> 1)
        at = number * n_slice + row * columns
        d, c, up = densities + at + column, alongs + at, ups + number * rows + row
        low += weight * _bilinear(table, d, 0, columns, 0.0, s)
        high += weight * _bilinear(table, d + 1, 0, columns, 0.0, s)
        before += weight * _bilinear(table, c + column, 0, columns, 0.0, s)
        whole += weight * float_at(table, c + columns - 1)  # type: ignore[call-arg]
        after += weight * float_at(table, c + 2 * columns - 1)  # type: ignore[call-arg]
        below += weight * float_at(table, up)  # type: ignore[call-arg]
    total = (1.0 - s) * whole + s * after
    x = (before + t * (low + 0.5 * t * (high - low))) / total if total > 0.0 else 0.0
    y = below + s * (whole + 0.5 * s * (after - whole))
    # Colours there.
    (row, s), (column, t) = _patch(y, colour_rows), _patch(x, colour_columns)
    red, green, blue = 0.0, 0.0, 0.0
    for corner in range(4):
        weight = (a if corner & 1 else 1.0 - a) * (b if corner & 2 else 1.0 - b)
        number = (k + (corner & 1)) * n_theta + j + (corner >> 1)
        at = colours + 3 * ((number * colour_rows + row) * colour_columns + column)
        red += weight * _bilinear(table, at, 3, 3 * colour_columns, t, s)
        green += weight * _bilinear(table, at + 1, 3, 3 * colour_columns, t, s)
        blue += weight * _bilinear(table, at + 2, 3, 3 * colour_columns, t, s)
    if is_divided == 0:
        return red, green, blue
    (row, s), (column, t) = _patch(v, ndf_rows), _patch(u, ndf_columns)
    facets = _bilinear(table, ndf + row * ndf_columns + column, 1, ndf_columns, t, s)
    row, s = _patch(phi_i / (2.0 * math.pi) + 0.5, area_rows)
    column, t = _patch(math.sqrt(min(theta_i / HALF_PI, 1.0)), area_columns)
    area = _bilinear(table, areas + row * area_columns + column, 1, area_columns, t, s)
    scale = facets / max(4.0 * area, 1e-12)
    return red * scale, green * scale, blue * scale


@njit(**_compile)
def adaptive_reflection(
    table: int, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> tuple[float, float, float]:
    """rho of each colour, 1/sr: (E(wi, wo) + E(wo, wi)) / (cos_i + cos_o); 0 where both graze."""
    cosines = iz + oz
    if cosines <= LEAST_COSINES:
        return 0.0, 0.0, 0.0
    one = _tabulated(table, ix, iy, iz, ox, oy, oz)
    two = _tabulated(table, ox, oy, oz, ix, iy, iz)
    return (
        max((one[0] + two[0]) / cosines, 0.0),
        max((one[1] + two[1]) / cosines, 0.0),
        max((one[2] + two[2]) / cosines, 0.0),
    )
