"""Compiled look-up of a measurement's quotients: once for each pixel and light, like all of `engine.material._kernels`.

The functions are called by address. The quotient parameters give the addresses of the table and the factors' curves
(`engine.measured.tables`).
"""

from __future__ import annotations

import ctypes
import math

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from engine.material import kinds
from engine.material._kernels import _angle, _compile, _is_interpreted, theta_d, theta_h
from engine.measured.measurement import N_NODES, SHAPE

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

TABLE, CURVES, CHANNEL, PART = kinds.TABLE, kinds.SMOOTHING, kinds.CHANNEL, kinds.PART
MEAN, GRAZING = kinds.MEAN, kinds.GRAZING
DIFFUSE, WHOLE = kinds.DIFFUSE, kinds.WHOLE
N_H, N_D, N_PHI = SHAPE
LAST = N_NODES - 1
PER_RADIAN = LAST / (math.pi / 2)
# Offsets of each factor in their array, and the length of one.
ROW = 3 * N_NODES
THETA_I, THETA_O, THETA_D, THETA_H, P, Q = 9, 9 + ROW, 9 + 2 * ROW, 9 + 3 * ROW, 9 + 4 * ROW, 9 + 5 * ROW


@intrinsic
def _float_compiled(typingctx, address, index):  # type: ignore[no-untyped-def]
    """The index-th float32 from an address on."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = builder.inttoptr(arguments[0], ir.FloatType().as_pointer())
        return builder.load(builder.gep(pointer, [arguments[1]]))

    return types.float32(types.int64, types.int64), generate


def _float_plain(address: int, index: int) -> float:
    """For interpreted kernels."""
    return float(ctypes.c_float.from_address(address + 4 * index).value)


_float = _float_plain if _is_interpreted else _float_compiled


@njit(inline="always", **_compile)
def _node(position: float) -> tuple[int, float]:
    """The node below a position on a curve, as an offset in the array of the factors, and the distance from it, 0 to
    1."""
    node = min(int(position), LAST - 1)
    return 3 * node, position - node


@njit(inline="always", **_compile)
def _between(address: int, at: int, t: float) -> float:
    """A curve of one colour, interpolated at t between two nodes."""
    return (1.0 - t) * _float(address, at) + t * _float(address, at + 3)  # type: ignore[call-arg,no-any-return]


@njit(inline="always", **_compile)
def _strength(address: int, part: int, colour: int) -> float:
    """Strength of a part, by its row in the array of the factors."""
    return _float(address, 3 * part + colour)  # type: ignore[call-arg,no-any-return]


@njit(inline="always", **_compile)
def _slant(cosine: float) -> float:
    """An angle to the normal in units of nodes."""
    return _angle(cosine, max(1.0 - cosine * cosine, 0.0)) * PER_RADIAN


@njit(inline="always", **_compile)
def _phi_d(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """Azimuth of wi about the half vector, from the plane through half vector and normal, in [0, pi]; its period is pi.
    By an arc cosine, which takes a quarter of the time of an arc tangent."""
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    dx, dy, dz = ix - ox, iy - oy, iz - oz
    flat = math.sqrt(sx * sx + sy * sy)
    length = math.sqrt(flat * flat + sz * sz)
    # Rotate the difference i - o into the frame of the half vector; x is in the plane of half vector and normal.
    x, y = dx, dy
    if flat > 1e-9 * length and length > 1e-12:
        cosine, sine = sx / flat, sy / flat
        x = (sz * (cosine * dx + sine * dy) - flat * dz) / length
        y = cosine * dy - sine * dx
    square = x * x + y * y
    if square <= 0.0:
        return 0.0
    angle = _angle(x / math.sqrt(square), y * y / square)
    return math.pi - angle if y < 0.0 else angle


@njit(inline="always", **_compile)
def _cell(address: int, at: int, next_d: int, next_phi: int, v: float, w: float) -> float:
    """Interpolate between four samples of one theta_h."""
    near = (1.0 - w) * _float(address, at) + w * _float(address, at + next_phi)  # type: ignore[call-arg]
    at += next_d
    far = (1.0 - w) * _float(address, at) + w * _float(address, at + next_phi)  # type: ignore[call-arg]
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
    a, b, c = min(at_h, N_H - 1.0), min(at_d, N_D - 1.0), _phi_d(ix, iy, iz, ox, oy, oz) * (N_PHI / math.pi)
    i, j, k = min(int(a), N_H - 2), min(int(b), N_D - 2), int(c)
    # phi_d wraps around.
    w = c - k
    k %= N_PHI
    next_phi = 3 if k < N_PHI - 1 else 3 - 3 * N_PHI
    return 3 * ((i * N_D + j) * N_PHI + k), next_phi, a - i, b - j, w, at_d, at_h


@njit(inline="always", **_compile)
def _part_of(
    table: int, curves: int, part: int, colour: int, at: int, next_phi: int, u: float, v: float, w: float,
    slant_i: float, slant_o: float, at_d: float, at_h: float,
) -> tuple[float, float]:  # fmt: skip
    """The part's share of the interpolated sample, and the product of the part's factors; one colour."""
    next_h, next_d = 3 * N_D * N_PHI, 3 * N_PHI
    (node_i, t_i), (node_o, t_o) = _node(slant_i), _node(slant_o)
    (node_d, t_d), (node_h, t_h) = _node(at_d), _node(at_h)
    # Trilinear interpolation of the measurement.
    value = _cell(table, at + colour, next_d, next_phi, v, w)
    value += u * (_cell(table, at + colour + next_h, next_d, next_phi, v, w) - value)
    # Factors over the angles of both directions: P, or G and H of the diffuse part.
    on_i, on_o = (P + node_i, P + node_o) if part == WHOLE else (THETA_I + node_i, THETA_O + node_o)
    slant = _between(curves, on_i + colour, t_i) * _between(curves, on_o + colour, t_o)
    if part == WHOLE:
        return value, _strength(curves, 2, colour) * _between(curves, Q + node_h + colour, t_h) * slant
    # The diffuse part is the measurement, but at most the product D of its factors.
    diffuse = _strength(curves, 0, colour) * slant
    if part == DIFFUSE:
        return min(value, diffuse), diffuse
    # The specular part is the remainder; its factors are over theta_d and theta_h.
    highlight = _strength(curves, 1, colour) * _between(curves, THETA_H + node_h + colour, t_h)
    return max(value - diffuse, 0.0), highlight * _between(curves, THETA_D + node_d + colour, t_d)


def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """rho_q cos_i of a measured layer, of the colour q[CHANNEL] or the MEAN of all; rho_q is 1 if no file was read.

    The mean is weighted by the reflection of each colour: the quotient of a colour that hardly reflects is meaningless.
    """
    table, curves, part, channel = int(q[TABLE]), int(q[CURVES]), int(q[PART]), int(q[CHANNEL])
    if table == 0:
        return iz
    at, next_phi, u, v, w, at_d, at_h = _place(ix, iy, iz, ox, oy, oz)
    slant_i, slant_o = _slant(iz), _slant(oz)
    first, end = (0, 3) if channel == MEAN else (channel, channel + 1)
    parts, products = 0.0, 0.0
    for colour in range(first, end):
        value, product = _part_of(table, curves, part, colour, at, next_phi, u, v, w, slant_i, slant_o, at_d, at_h)
        parts += value
        products += product
    return iz * parts / products


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
    horizon.

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
        places[3, m], places[4, m], places[5, m] = _slant(iz), at_d, at_h
    for m in range(n):
        iz = float(z[m]) if z[m] > GRAZING and oz > GRAZING else 0.0
        for colour in range(3):
            value, product = 1.0, 1.0
            if table != 0:
                value, product = _part_of(
                    table, curves, part, colour, ats[m], nexts[m], places[0, m], places[1, m], places[2, m],
                    places[3, m], slant_o, places[4, m], places[5, m],
                )  # fmt: skip
            out[3 * m + colour] = iz * value / product
