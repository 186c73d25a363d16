"""Compiled look-up of a measurement's quotients: once for each pixel and light, like all of `engine.material._kernels`.

The functions are called by address. The quotient parameters give the addresses of the table and the factors' curves
(`engine.measured.tables`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.material import kinds
from engine.material._adaptive_kernels import adaptive_reflection
from engine.material._addressed_kernels import float_at
from engine.material._kernels import _angle, _compile, gamma, phi_d, theta_d, theta_h
from engine.measured.measurement import CURVES as NAMES
from engine.measured.measurement import N_NODES, SHAPE
from engine.measured.measurement import PARTS as PART_NAMES

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

TABLE, CURVES, CHANNEL, PART, ADAPTIVE = kinds.TABLE, kinds.SMOOTHING, kinds.CHANNEL, kinds.PART, kinds.ADAPTIVE
MEAN, GRAZING = kinds.MEAN, kinds.GRAZING
DIFFUSE, SPECULAR, WHOLE = kinds.DIFFUSE, kinds.SPECULAR, kinds.WHOLE
AROUND, TWIST, BRUSHED = kinds.AROUND, kinds.TWIST, kinds.BRUSHED
PHI_H, PHI_D, SLOPE_U, SLOPE_V = kinds.PHI_H, kinds.PHI_D, kinds.SLOPE_U, kinds.SLOPE_V
N_H, N_D, N_PHI = SHAPE
LAST = N_NODES - 1
PER_RADIAN = LAST / (math.pi / 2)
# Offsets of each factor in their array, behind the strengths.
_OFFSETS = {name: 3 * (len(PART_NAMES) + N_NODES * place) for place, name in enumerate(NAMES)}
ON_I, ON_O, ON_D, ON_H, ON_S = (_OFFSETS[name] for name in ("theta_i", "theta_o", "theta_d", "theta_h", "s"))
ON_PHI_H, ON_PHI_D, ON_U, ON_V = (_OFFSETS[name] for name in ("phi_h", "phi_d", "theta_u", "theta_v"))
P, Q = _OFFSETS["p"], _OFFSETS["q"]


@njit(inline="always", **_compile)
def _node(position: float) -> tuple[int, float]:
    """The node below a position on a curve, as an offset in the array of the factors, and the distance from it, 0 to
    1."""
    node = min(int(position), LAST - 1)
    return 3 * node, position - node


@njit(inline="always", **_compile)
def _between(address: int, at: int, t: float) -> float:
    """A curve of one colour, interpolated at t between two nodes."""
    return (1.0 - t) * float_at(address, at) + t * float_at(address, at + 3)  # type: ignore[call-arg,no-any-return]


@njit(inline="always", **_compile)
def _strength(address: int, part: int, colour: int) -> float:
    """Strength of a part, by its row in the array of the factors."""
    return float_at(address, 3 * part + colour)  # type: ignore[call-arg,no-any-return]


@njit(inline="always", **_compile)
def _slant(cosine: float) -> float:
    """An angle to the normal in units of nodes."""
    return _angle(cosine, max(1.0 - cosine * cosine, 0.0)) * PER_RADIAN


@njit(inline="always", **_compile)
def _cell(address: int, at: int, next_d: int, next_phi: int, v: float, w: float) -> float:
    """Interpolate between four samples of one theta_h."""
    near = (1.0 - w) * float_at(address, at) + w * float_at(address, at + next_phi)  # type: ignore[call-arg]
    at += next_d
    far = (1.0 - w) * float_at(address, at) + w * float_at(address, at + next_phi)  # type: ignore[call-arg]
    return (1.0 - v) * near + v * far


@njit(inline="always", **_compile)
def _place(
    ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> tuple[int, int, float, float, float, float, float]:
    """The position of a pair of directions in the table: offset of the first of the eight samples around it, offset
    from there to the next in phi_d, weights between them in theta_h, theta_d and phi_d, and theta_d and theta_h in
    nodes of the factors."""
    # The grid is uniform in theta_d and phi_d, and in the square root of theta_h [Matusik03].
    at_d = min(theta_d(ix, iy, iz, ox, oy, oz) * PER_RADIAN, LAST)
    at_h = min(math.sqrt(theta_h(ix, iy, iz, ox, oy, oz) * (PER_RADIAN * LAST)), LAST)
    a, b, c = min(at_h, N_H - 1.0), min(at_d, N_D - 1.0), phi_d(ix, iy, iz, ox, oy, oz) * (N_PHI / math.pi)
    i, j, k = min(int(a), N_H - 2), min(int(b), N_D - 2), int(c)
    # phi_d wraps around.
    w = c - k
    k %= N_PHI
    next_phi = 3 if k < N_PHI - 1 else 3 - 3 * N_PHI
    return 3 * ((i * N_D + j) * N_PHI + k), next_phi, a - i, b - j, w, at_d, at_h


@njit(inline="always", **_compile)
def _sample(table: int, at: int, next_phi: int, u: float, v: float, w: float) -> float:
    """Trilinear interpolation of one colour of the measurement."""
    next_h, next_d = 3 * N_D * N_PHI, 3 * N_PHI
    value = _cell(table, at, next_d, next_phi, v, w)
    return value + u * (_cell(table, at + next_h, next_d, next_phi, v, w) - value)


@njit(**_compile)
def _curve_positions(
    part: int, at_h: float, q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> tuple[float, float]:
    """Positions on the two curves of a highlight that are not over theta_h and theta_d, in nodes."""
    if part == AROUND:
        return at_h, gamma(PHI_H, q, ix, iy, iz, ox, oy, oz) * PER_RADIAN
    if part == TWIST:
        return at_h, gamma(PHI_D, q, ix, iy, iz, ox, oy, oz) * PER_RADIAN
    along = gamma(SLOPE_U, q, ix, iy, iz, ox, oy, oz)
    across = gamma(SLOPE_V, q, ix, iy, iz, ox, oy, oz)
    return math.sqrt(along * (PER_RADIAN * LAST)), math.sqrt(across * (PER_RADIAN * LAST))


@njit(inline="always", **_compile)
def _curve_offsets(part: int) -> tuple[int, int]:
    """The two curves of a highlight, as offsets in the array of the factors."""
    on_b = ON_PHI_H if part == AROUND else ON_PHI_D if part == TWIST else ON_V if part == BRUSHED else ON_D
    return ON_U if part == BRUSHED else ON_H, on_b


@njit(inline="always", **_compile)
def _part_of(
    value: float, curves: int, part: int, colour: int, slant_i: float, slant_o: float,
    on_a: int, on_b: int, at_a: float, at_b: float,
) -> tuple[float, float]:  # fmt: skip
    """The part's share of a sample, and the product of the part's factors; one colour."""
    (node_i, t_i), (node_o, t_o) = _node(slant_i), _node(slant_o)
    (node_a, t_a), (node_b, t_b) = _node(at_a), _node(at_b)
    # Factors over the angles of both directions: P, or G and H of the diffuse part.
    of_i, of_o = (P + node_i, P + node_o) if part == WHOLE else (ON_I + node_i, ON_O + node_o)
    slant = _between(curves, of_i + colour, t_i) * _between(curves, of_o + colour, t_o)
    if part == WHOLE:
        return value, _strength(curves, WHOLE, colour) * _between(curves, Q + node_a + colour, t_a) * slant
    # The diffuse part is the measurement, but at most the product D of its factors.
    diffuse = _strength(curves, DIFFUSE, colour) * slant
    if part == DIFFUSE:
        return min(value, diffuse), diffuse
    # The specular part is the remainder; its factors are over theta_h and theta_d, or two others.
    highlight = _strength(curves, part, colour) * _between(curves, on_a + node_a + colour, t_a)
    highlight *= _between(curves, on_b + node_b + colour, t_b)
    if part == SPECULAR:
        highlight *= _between(curves, ON_S + node_o + colour, t_o)
    return max(value - diffuse, 0.0), highlight


@njit(**_compile)
def _shares(
    q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    """Of each colour the part's share of the measurement, and the product of the part's factors; 1 if no file was
    read."""
    table, curves, part = int(q[TABLE]), int(q[CURVES]), int(q[PART])
    if table == 0:
        return (1.0, 1.0), (1.0, 1.0), (1.0, 1.0)
    at, next_phi, u, v, w, at_b, at_a = _place(ix, iy, iz, ox, oy, oz)
    if part > WHOLE:
        at_a, at_b = _curve_positions(part, at_a, q, ix, iy, iz, ox, oy, oz)
    (on_a, on_b), slant_i, slant_o = _curve_offsets(part), _slant(iz), _slant(oz)
    if q[ADAPTIVE] != 0.0:
        red, green, blue = adaptive_reflection(table, ix, iy, iz, ox, oy, oz)
    else:
        red = _sample(table, at, next_phi, u, v, w)
        green, blue = _sample(table, at + 1, next_phi, u, v, w), _sample(table, at + 2, next_phi, u, v, w)
    return (
        _part_of(red, curves, part, 0, slant_i, slant_o, on_a, on_b, at_a, at_b),
        _part_of(green, curves, part, 1, slant_i, slant_o, on_a, on_b, at_a, at_b),
        _part_of(blue, curves, part, 2, slant_i, slant_o, on_a, on_b, at_a, at_b),
    )


def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """rho_q cos_i of a measured layer, of the colour q[CHANNEL] or the MEAN of all; rho_q is 1 if no file was read.

    The mean is weighted by the reflection of each colour: the quotient of a colour that hardly reflects is meaningless.
    """
    channel = int(q[CHANNEL])
    shares = _shares(q, ix, iy, iz, ox, oy, oz)
    if channel != MEAN:
        share, product = shares[channel]
        return iz * share / product
    return iz * (shares[0][0] + shares[1][0] + shares[2][0]) / (shares[0][1] + shares[1][1] + shares[2][1])


def quotients(
    q: Float64Array,
    n: int,
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    ox: float,
    oy: float,
    oz: float,
    out: Float32Array,
) -> None:
    """rho_q cos_i of each colour for n directions to the light, one after the other in `out` (3 n,); 0 below the
    horizon. Of a grid, and parts whose curves are over theta_h and theta_d.

    Positions are computed first for all directions, then the look-ups: a look-up in such a large table takes as long as
    the angles do, and interleaved they would wait for each other.
    """
    table, curves, part = int(q[TABLE]), int(q[CURVES]), int(q[PART])
    ats, nexts, places = np.empty(n, np.int64), np.empty(n, np.int64), np.empty((6, n))
    slant_o = _slant(oz)
    for m in range(n):
        ix, iy, iz = float(x[m]), float(y[m]), max(float(z[m]), 0.0)
        at, next_phi, u, v, w, at_d, at_h = _place(ix, iy, iz, ox, oy, oz)
        ats[m], nexts[m], places[0, m], places[1, m], places[2, m] = at, next_phi, u, v, w
        places[3, m], places[4, m], places[5, m] = _slant(iz), at_h, at_d
    for m in range(n):
        iz = float(z[m]) if z[m] > GRAZING and oz > GRAZING else 0.0
        for colour in range(3):
            share, product = 1.0, 1.0
            if table != 0:
                value = _sample(table, ats[m] + colour, nexts[m], places[0, m], places[1, m], places[2, m])
                share, product = _part_of(
                    value, curves, part, colour, places[3, m], slant_o, ON_H, ON_D, places[4, m], places[5, m]
                )
            out[3 * m + colour] = iz * share / product


def any_quotients(
    q: Float64Array,
    n: int,
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    ox: float,
    oy: float,
    oz: float,
    out: Float32Array,
) -> None:
    """The same of any measurement and part, one direction after the other: a function of its own, since `quotients`
    takes a quarter longer with branches for these."""
    for m in range(n):
        if z[m] <= GRAZING or oz <= GRAZING:
            out[3 * m], out[3 * m + 1], out[3 * m + 2] = 0.0, 0.0, 0.0
            continue
        for colour, (share, product) in enumerate(_shares(q, float(x[m]), float(y[m]), float(z[m]), ox, oy, oz)):
            out[3 * m + colour] = z[m] * share / product
