"""Sharing a light out among the hats of one curve or two (see `engine.curve.bands`).

A band's share of a light is the mean of its hat over the light. [BenArtzi07, eq. 4.10] has that in closed form where γ
is linear over a triangle; here the triangle's γ is two points with its mean and its variance, and a wide one several
such pairs. Against the closed form the picture changes by less than the lights' own discretisation does, and there is
no branch, no division and no loop for most lights. Both keep a light's power, and its mean where γ is linear.
"""

import numba as nb
import numpy as np

HALF = np.float32(0.5)
ZERO = np.float32(0.0)
ONE = np.float32(1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def mean_and_spread(a, b, c):
    """Mean and standard deviation of a linear function over a triangle, from its values at the corners."""
    ab, bc, ca = a - b, b - c, c - a
    return (a + b + c) * np.float32(1 / 3), np.sqrt((ab * ab + bc * bc + ca * ca) * np.float32(1 / 36))


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def three_shares(mean, spread, last):
    """First of three neighbouring hats and the share of each of the points mean ± spread, 0 ≤ spread ≤ 1/2.

    mean in units of bands (hat j has its top at j + 1/2), last: the number of the last hat.
    """
    low = min(max(mean - HALF - spread, ZERO), last)
    high = min(max(mean - HALF + spread, ZERO), last)
    first, other = int(low), int(high)
    t, u = HALF * (low - np.float32(first)), HALF * (high - np.float32(other))
    if first == other:
        return first, ONE - t - u, t + u, ZERO
    return first, HALF - t, t + HALF - u, u


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _add(bands, j, k, w, r, g, b):
    bands[j, k, 0] += w * r
    bands[j, k, 1] += w * g
    bands[j, k, 2] += w * b


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _add_one(bands, r, g, b, mean, spread, last):
    first, w0, w1, w2 = three_shares(mean, spread, last)
    _add(bands, first, 0, w0, r, g, b)
    _add(bands, first + 1, 0, w1, r, g, b)
    _add(bands, first + 2, 0, w2, r, g, b)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _add_row(bands, j, k, w, w0, w1, w2, r, g, b):
    r, g, b = w * r, w * g, w * b
    _add(bands, j, k, w0, r, g, b)
    _add(bands, j, k + 1, w1, r, g, b)
    if w2 > ZERO:
        _add(bands, j, k + 2, w2, r, g, b)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _add_two(bands, r, g, b, mean_a, spread_a, last_a, mean_b, spread_b, last_b):
    j, w0, w1, w2 = three_shares(mean_a, spread_a, last_a)
    k, v0, v1, v2 = three_shares(mean_b, spread_b, last_b)
    _add_row(bands, j, k, w0, v0, v1, v2, r, g, b)
    _add_row(bands, j + 1, k, w1, v0, v1, v2, r, g, b)
    if w2 > ZERO:
        _add_row(bands, j + 2, k, w2, v0, v1, v2, r, g, b)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _deposit_wide(bands, r, g, b, mean_a, spread_a, last_a, mean_b, spread_b, last_b, two):
    """As `deposit` for a light of more than half a band's spread: in even pieces."""
    n_a = max(int(np.ceil(np.float32(2.0) * spread_a)), 1)
    n_b = max(int(np.ceil(np.float32(2.0) * spread_b)), 1)
    share = ONE / np.float32(n_a * n_b)
    r, g, b = r * share, g * share, b * share
    part_a, part_b = spread_a / np.float32(n_a), spread_b / np.float32(n_b)
    for i in range(n_a):
        at_a = mean_a + part_a * np.float32(2 * i + 1 - n_a)
        if not two:
            _add_one(bands, r, g, b, at_a, part_a, last_a)
            continue
        for k in range(n_b):
            at_b = mean_b + part_b * np.float32(2 * k + 1 - n_b)
            _add_two(bands, r, g, b, at_a, part_a, last_a, at_b, part_b, last_b)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def deposit(bands, r, g, b, mean_a, spread_a, last_a, mean_b, spread_b, last_b, two):
    """bands[j, k] += (r, g, b) · Δ_j · Δ_k [BenArtzi07, eq. 4.15]; without `two`, bands[j, 0] += (r, g, b) · Δ_j.

    bands has two rows and, with `two`, two columns more than there are hats; they stay 0. Means and spreads are in
    units of bands, last_a and last_b the numbers of the last hats.
    """
    if spread_a > HALF or spread_b > HALF:
        _deposit_wide(bands, r, g, b, mean_a, spread_a, last_a, mean_b, spread_b, last_b, two)
    elif two:
        _add_two(bands, r, g, b, mean_a, spread_a, last_a, mean_b, spread_b, last_b)
    else:
        _add_one(bands, r, g, b, mean_a, spread_a, last_a)
