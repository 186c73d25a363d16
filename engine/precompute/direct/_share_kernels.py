"""Compiled: distributes a light among the hat functions of one curve or two (see `engine.curve.bands`).

A band's share of a light is the mean of its hat over the light [BenArtzi07, eq. 4.12]. [BenArtzi07, eq. 4.10] states it
in closed form where γ is linear over a triangle. Here two points with the same mean and variance replace the triangle's
γ, and several such pairs for a wide one. Compared with the closed form, the picture changes by less than the lights'
own discretisation error, and most lights need no branch, no division and no loop. Both preserve a light's power, and
its mean where γ is linear.

Near the axis of a curve's angle γ is the distance from a point, and not linear. For a spot at distance r from the axis,
of extent s, the mean of γ² is r² + s²/12 (an equilateral triangle in the plane). Spread 0.204 s and mean sqrt(r² +
s²/24) have the same mean square, so that small lights need no splitting even at the axis. A light larger than a band is
split in four until it is far from the axis or small, and its parts take the sky's brightness at their positions: a
narrow lobe is resolved as finely as its bands, wherever it points, while the cut remains that of the whole scene. With
4,000 lights, the error of measured nickel, whose lobe is 1.1° wide at half its height, is 0.8 % against direct
evaluation of the data; with uniform parts it was 2.4 %, and 0.7 % required 10,000 lights.
"""

from typing import NamedTuple

import numba as nb
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from engine.material.kinds import THETA_D, THETA_I
from engine.precompute.direct._angle_kernels import slope

HALF = np.float32(0.5)
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
TWICE = np.float32(2.0)
ALMOST = np.float32(1.0 - 1e-6)
MAX_DEPTH = 3
LEAVES = 4**MAX_DEPTH
# A light that contains the axis: the deviation of γ from a line, relative to the light's extent.
AT_THE_AXIS = np.float32(0.35)
SPREAD = np.float32(0.204)
_CHILDREN = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def mean_and_spread(a, b, c):
    """Mean and standard deviation of a linear function over a triangle, from its values at the corners."""
    ab, bc, ca = a - b, b - c, c - a
    return (a + b + c) * np.float32(1 / 3), np.sqrt((ab * ab + bc * bc + ca * ca) * np.float32(1 / 36))


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def three_shares(mean, spread, last):
    """The first of three neighbouring hats, and their shares of the points mean ± spread, 0 ≤ spread ≤ 1/2.

    mean in units of bands (hat j has its peak at j + 1/2); last: the number of the last hat.
    """
    low = min(max(mean - HALF - spread, ZERO), last)
    high = min(max(mean - HALF + spread, ZERO), last)
    first = np.int32(low)
    x, y = low - np.float32(first), high - np.float32(first)
    w0, w2 = HALF * (ONE - x + max(ONE - y, ZERO)), HALF * max(y - ONE, ZERO)
    return first, w0, ONE - w0 - w2, w2


class Spots(NamedTuple):
    """Lights, or parts of them, as they project onto the curves.

    light (N,): index of the colour; weight (N,); mean_a, spread_a (N,) of γ in radians; outputs: first_a (N,), shares_a
    (3, N), wide (N,), 1 where three hats do not hold the spot. The same for curve b.
    """

    light: np.ndarray
    weight: np.ndarray
    mean_a: np.ndarray
    mean_b: np.ndarray
    spread_a: np.ndarray
    spread_b: np.ndarray
    first_a: np.ndarray
    first_b: np.ndarray
    shares_a: np.ndarray
    shares_b: np.ndarray
    wide: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def make_spots(n):
    """Working memory for n spots."""
    return Spots(
        np.empty(n, np.int64), np.empty(n, np.float32),
        np.empty(n, np.float32), np.empty(n, np.float32), np.empty(n, np.float32), np.empty(n, np.float32),
        np.empty(n, np.int32), np.empty(n, np.int32), np.empty((3, n), np.float32), np.empty((3, n), np.float32),
        np.empty(n, np.int32),
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _fill_shares(mean, spread, scale, last, first, w0, w1, w2, wide):
    """`three_shares` of many spots, with means and spreads times `scale`; marks spots too wide for three hats in
    `wide`."""
    for i in range(mean.shape[0]):
        extent = spread[i] * scale
        wide[i] |= np.int32(extent > HALF)
        first[i], w0[i], w1[i], w2[i] = three_shares(mean[i] * scale, min(extent, HALF), last)


@intrinsic
def _add_row(typing_context, flat, at, w0, w1, w2, r, g, b):
    """Adds (r, g, b) to three neighbouring hats from flat[at] on, by their shares: flat[at + 3 i + c] += w_i colour_c.

    A point spends most of its time on these nine sums. Numba compiles them to nine times three instructions; here eight
    of them are one, which takes two thirds of the time of a spot (15 to 10 ns) and has the same result.
    """
    signature = types.void(flat, types.uint64, *[types.float32] * 6)

    def generate(context, builder, signature, arguments):
        flat, at, *values = arguments
        data = context.make_array(signature.args[0])(context, builder, flat).data
        number, index = ir.FloatType(), ir.IntType(32)

        def arranged(three, order):
            """A vector of eight of three numbers."""
            four = ir.Constant(ir.VectorType(number, 4), ir.Undefined)
            for i, value in enumerate(three):
                four = builder.insert_element(four, value, index(i))
            return builder.shuffle_vector(four, four, ir.VectorType(index, 8)([index(i) for i in order]))

        def add_product(place, a, b):
            pointer = builder.bitcast(builder.gep(data, [place]), a.type.as_pointer())
            product = builder.fmul(a, b, flags=("contract",))
            builder.store(builder.fadd(builder.load(pointer, align=4), product, flags=("contract",)), pointer, align=4)

        shares, colours = values[:3], values[3:]
        add_product(at, arranged(shares, (0, 0, 0, 1, 1, 1, 2, 2)), arranged(colours, (0, 1, 2, 0, 1, 2, 0, 1)))
        add_product(builder.add(at, at.type(8)), shares[2], colours[2])
        return context.get_dummy_value()

    return signature, generate


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _add_narrow(bands, colours, begin, end, spots):
    """Adds the spots [begin, end) that are not wide to the three hats of each curve that hold them."""
    light, weight, wide = spots.light, spots.weight, spots.wide
    first_a, first_b, a, b = spots.first_a, spots.first_b, spots.shares_a, spots.shares_b
    flat, width = bands.reshape(-1), np.uint64(3 * bands.shape[1])
    a0, a1, a2, b0, b1, b2 = a[0], a[1], a[2], b[0], b[1], b[2]
    two = bands.shape[1] > 1
    for i in range(begin, end):
        m = light[i]
        w = weight[i] if wide[i] == 0 else ZERO
        red, green, blue = colours[m, 0] * w, colours[m, 1] * w, colours[m, 2] * w
        # An unsigned index needs no test for negative values.
        at = np.uint64(first_a[i]) * width
        if two:
            at += np.uint64(3) * np.uint64(first_b[i])
            v0, v1, v2 = b0[i], b1[i], b2[i]
            _add_row(flat, at, v0, v1, v2, a0[i] * red, a0[i] * green, a0[i] * blue)
            _add_row(flat, at + width, v0, v1, v2, a1[i] * red, a1[i] * green, a1[i] * blue)
            _add_row(flat, at + np.uint64(2) * width, v0, v1, v2, a2[i] * red, a2[i] * green, a2[i] * blue)
        else:
            _add_row(flat, at, a0[i], a1[i], a2[i], red, green, blue)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _share_and_add(bands, colours, begin, end, spots, scale_a, scale_b):
    """Computes the shares of the spots [begin, end) on both curves, and adds those that are not wide to the bands."""
    a, b, wide, two = spots.shares_a, spots.shares_b, spots.wide[begin:end], bands.shape[1] > 1
    last_a, last_b = np.float32(bands.shape[0] - 3), np.float32(bands.shape[1] - 3)
    wide[:] = np.int32(0)
    _fill_shares(
        spots.mean_a[begin:end], spots.spread_a[begin:end], scale_a, last_a, spots.first_a[begin:end],
        a[0, begin:end], a[1, begin:end], a[2, begin:end], wide,
    )  # fmt: skip
    if two:
        _fill_shares(
            spots.mean_b[begin:end], spots.spread_b[begin:end], scale_b, last_b, spots.first_b[begin:end],
            b[0, begin:end], b[1, begin:end], b[2, begin:end], wide,
        )  # fmt: skip
    _add_narrow(bands, colours, begin, end, spots)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def share_out(bands, colours, n, spots, scale_a, scale_b):
    """bands[j, k] += weight · colour · Δ_j · Δ_k of the first n spots [BenArtzi07, eq. 4.15]; one curve: bands[j, 0].

    bands (J + 2, K + 2, 3), or (J + 2, 1, 3) for one curve: two more than there are hats, which stay 0. Scales: bands
    per radian. Wide spots are divided into equal pieces with a spread of at most half a band. The pieces are buffered
    behind the n-th spot, where there must be room, and distributed whenever the buffer is full.
    """
    # A literal 0 would have its own type, and everything would be compiled twice.
    _share_and_add(bands, colours, np.int64(0), n, spots, scale_a, scale_b)
    light, weight, wide, two = spots.light, spots.weight, spots.wide, bands.shape[1] > 1
    mean_a, mean_b, spread_a, spread_b = spots.mean_a, spots.mean_b, spots.spread_a, spots.spread_b
    at = n
    for i in range(n):
        if wide[i] == 0 or not weight[i] > ZERO:
            continue
        # Number and spread of the pieces along each curve.
        n_a = max(int(np.ceil(TWICE * spread_a[i] * scale_a)), 1)
        n_b = max(int(np.ceil(TWICE * spread_b[i] * scale_b)), 1) if two else 1
        part_a = spread_a[i] / np.float32(n_a)
        part_b = spread_b[i] / np.float32(n_b) if two else ZERO
        share = weight[i] / np.float32(n_a * n_b)
        for u in range(n_a):
            for v in range(n_b):
                if at == light.shape[0]:
                    _share_and_add(bands, colours, n, at, spots, scale_a, scale_b)
                    at = n
                light[at], weight[at] = light[i], share
                # Slightly less than its share: rounding must not make a piece wide again.
                mean_a[at], spread_a[at] = mean_a[i] + part_a * np.float32(2 * u + 1 - n_a), part_a * ALMOST
                if two:
                    mean_b[at], spread_b[at] = mean_b[i] + part_b * np.float32(2 * v + 1 - n_b), part_b * ALMOST
                at += 1
    _share_and_add(bands, colours, n, at, spots, scale_a, scale_b)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def is_curved(size, middle, scale, tolerance):
    """Whether γ, a cone, deviates from linear over a triangle by more than `tolerance` bands, and by as much of its
    size.

    Over a triangle of extent s at distance r from the axis, γ deviates from its chord by s²/8r. A triangle far larger
    than a band need not follow the band: the bound is then 0.3 · tolerance of the triangle. middle: γ at its centre.
    """
    nearest, bound = middle - HALF * size, tolerance * max(np.float32(1.0) / scale, np.float32(0.3) * size)
    return size * size * np.float32(0.125) > nearest * bound and AT_THE_AXIS * size > bound


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def distance_from_axis(kind, x, y, z, ox, oy, oz):
    """The distance (chord) of a direction of any length from the axis; γ near the axis is about `slope` times that."""
    inverse = np.float32(1.0) / np.sqrt(x * x + y * y + z * z)
    px, py, pz = np.float32(0.0), np.float32(0.0), np.float32(1.0)
    if kind == THETA_D:
        px, py, pz = ox, oy, oz
    elif kind != THETA_I:
        px, py, pz = -ox, -oy, oz
    dx, dy, dz = x * inverse - px, y * inverse - py, z * inverse - pz
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def split(stack, depths, rows, row, size, scale_a, scale_b, optics, n_rows, ox, oy, oz, leaves, begin):
    """Splits the triangle stack[0] (corners by axes) where γ is curved; writes the leaves from `begin` on.

    row: the triangle's row in a tree of n_rows, in which the children of row r are 4 r + 20 to 4 r + 23. leaves:
    centres x, y, z, relative sizes, the row of each one's colour, and its size relative to that row's triangle. There
    must be room for LEAVES; returns the end of the list.
    """
    x, y, z, shrink, row_of, above = leaves
    six = np.empty((6, 3), np.float32)
    slope_a, slope_b = slope(optics.kind_a), slope(optics.kind_b)
    two, top, end = optics.n_b > 1, 0, begin
    depths[0], rows[0, 0], rows[0, 1] = 0, row, 0
    while top >= 0:
        part = HALF ** depths[top]
        cx = stack[top, 0, 0] + stack[top, 1, 0] + stack[top, 2, 0]
        cy = stack[top, 0, 1] + stack[top, 1, 1] + stack[top, 2, 1]
        cz = stack[top, 0, 2] + stack[top, 1, 2] + stack[top, 2, 2]
        curved = False
        # Test curvature of both angles at the triangle's centre.
        if depths[top] < MAX_DEPTH:
            middle = slope_a * distance_from_axis(optics.kind_a, cx, cy, cz, ox, oy, oz)
            curved = is_curved(size * part * slope_a, middle, scale_a, optics.tolerance)
            if two and not curved:
                middle = slope_b * distance_from_axis(optics.kind_b, cx, cy, cz, ox, oy, oz)
                curved = is_curved(size * part * slope_b, middle, scale_b, optics.tolerance)
        if curved:
            _push_children(stack, depths, rows, n_rows, top, six)
            top += 3
            continue
        # A leaf: its centre, size and tree row.
        inverse = np.float32(1.0) / np.sqrt(cx * cx + cy * cy + cz * cz)
        x[end], y[end], z[end], shrink[end] = cx * inverse, cy * inverse, cz * inverse, part
        row_of[end], above[end] = rows[top, 0], HALF ** rows[top, 1]
        end += 1
        top -= 1
    return end


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _push_children(stack, depths, rows, n_rows, top, six):
    """Replaces the triangle stack[top] by its four quarters."""
    for i in range(3):
        j = (i + 1) % 3
        for axis in range(3):
            six[i, axis] = stack[top, i, axis]
        x, y, z = six[i, 0] + stack[top, j, 0], six[i, 1] + stack[top, j, 1], six[i, 2] + stack[top, j, 2]
        inverse = np.float32(1.0) / np.sqrt(x * x + y * y + z * z)
        six[3 + i, 0], six[3 + i, 1], six[3 + i, 2] = x * inverse, y * inverse, z * inverse
    depth, row, below = depths[top] + 1, rows[top, 0], rows[top, 1]
    first = 4 * row + 20
    for child in range(4):
        for corner in range(3):
            for axis in range(3):
                stack[top + child, corner, axis] = six[_CHILDREN[child, corner], axis]
        depths[top + child] = depth
        rows[top + child, 0] = first + child if first < n_rows else row
        rows[top + child, 1] = below if first < n_rows else below + 1
