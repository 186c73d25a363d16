"""Compiled: distributes a light among the hat functions of one curve or two (see `engine.curve.bands`).

A band's share of a light is the mean of its hat over the light [BenArtzi07, eq. 4.12]. [BenArtzi07, eq. 4.10] states it
in closed form where γ is linear over a triangle. Here two points with the same mean and variance replace the triangle's
γ, and several such pairs for a wide one. Compared with the closed form, the picture changes by less than the lights'
own discretisation error, and most lights need no branch, no division and no loop. Both preserve a light's power, and
its mean where γ is linear.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

HALF = np.float32(0.5)
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
TWICE = np.float32(2.0)
ALMOST = np.float32(1.0 - 1e-6)


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


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _add_row(flat, at, w0, w1, w2, r, g, b):
    """Adds (r, g, b) to three neighbouring hats from flat[at] on, by their shares.

    An unsigned index needs no test for negative values, and a slice would be reference-counted: either would take
    longer than the sums.
    """
    place = np.uint64(at)
    flat[place] += w0 * r
    flat[place + np.uint64(1)] += w0 * g
    flat[place + np.uint64(2)] += w0 * b
    flat[place + np.uint64(3)] += w1 * r
    flat[place + np.uint64(4)] += w1 * g
    flat[place + np.uint64(5)] += w1 * b
    flat[place + np.uint64(6)] += w2 * r
    flat[place + np.uint64(7)] += w2 * g
    flat[place + np.uint64(8)] += w2 * b


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _add_narrow(bands, colours, begin, end, spots):
    """Adds the spots [begin, end) that are not wide to the three hats of each curve that hold them."""
    light, weight, wide = spots.light, spots.weight, spots.wide
    first_a, first_b, a, b = spots.first_a, spots.first_b, spots.shares_a, spots.shares_b
    flat, width, a0, a1, a2, b0, b1, b2 = bands.reshape(-1), 3 * bands.shape[1], a[0], a[1], a[2], b[0], b[1], b[2]
    two = bands.shape[1] > 1
    for i in range(begin, end):
        m = light[i]
        w = weight[i] if wide[i] == 0 else ZERO
        red, green, blue = colours[m, 0] * w, colours[m, 1] * w, colours[m, 2] * w
        at = np.int64(first_a[i]) * width
        if two:
            at += 3 * np.int64(first_b[i])
            v0, v1, v2 = b0[i], b1[i], b2[i]
            _add_row(flat, at, v0, v1, v2, a0[i] * red, a0[i] * green, a0[i] * blue)
            _add_row(flat, at + width, v0, v1, v2, a1[i] * red, a1[i] * green, a1[i] * blue)
            _add_row(flat, at + 2 * width, v0, v1, v2, a2[i] * red, a2[i] * green, a2[i] * blue)
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
