"""Fits a curve over [0, domain] by the nearest piecewise linear one through J nodes, the centres of J equal bands.

[BenArtzi07, eq. 4.17] takes a curve as constant over each band, with its mean. Here band j is a *hat function*: 1 at
the centre of its interval, falling to 0 at its neighbours' centres (constant beyond the first and the last), and the
values are the least-squares fit of those hats to the curve. Nothing else changes: light is projected onto the same J
numbers. On the tea tray this is 3 to 20 times more accurate with equally many bands (64 by 8: 1.9 % relRMSE with boxes,
0.6 % with hats; 64 by 16: 0.6 % and 0.1 %), for 5 to 10 % more time and storage.

Bands are integrated instead of point-sampled, so that nothing pops while the user drags a curve. The integration is
adaptive, because a highlight of roughness 1e-4 is a hundred times narrower than a band: Gauss-Kronrod (3, 7) over all
intervals at once, bisecting intervals whose two results disagree. The first partition is graded towards 0, where model
curves have their peaks, and divided at the `features` of a curve (engine.curve.operators.EditedCurve), where edited
curves jump. scipy.integrate.quad was rejected: it makes one Python call per point, and scipy is slow to import.

Over an angle from an axis (for example between the half vector and the normal) the fit is weighted by solid angle, with
sin γ: otherwise the first band gives the axis too much weight. Under either weight the fit preserves the curve's
integral, so that a lobe narrower than a band still reflects the right amount of light. Beside a step the least-squares
fit overshoots by a fifth, which draws a dark ring around a raised highlight. Each value is therefore clamped to the
range of the curve under its hat, and the excess goes to its neighbours, as far as their ranges permit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.curve.operators import unique_sorted
from engine.curve.wavelet import check_band_count

Float64Array = NDArray[np.float64]

HALF_PI = math.pi / 2
# Grading stops where a peak of the least roughness, 1e-4, is resolved.
FINEST_GRADE = 2e-5
MOST_ROUNDS = 17
# Permitted relative difference between the two rules; the better one is then far more accurate than that.
RELATIVE_TOLERANCE = 1e-5
# Relative to the largest mean over a cell: a cell's own value need not be more accurate than this.
ABSOLUTE_TOLERANCE = 1e-10
# After so many rounds of redistribution hardly any excess is left.
MAX_SHARING_ROUNDS = 8
# Less room than this fraction of the excess counts as none: the quotient of both may overflow.
LEAST_ROOM = 1e-12

# Kronrod's extension of the three-point Gauss rule: nodes in [-1, 1] (the Gauss ones are 1, 3, 5).
_NODES = np.array([-0.9604912687080203, -0.7745966692414834, -0.4342437493468026, 0.0,
                   0.4342437493468026, 0.7745966692414834, 0.9604912687080203])  # fmt: skip
_KRONROD = 0.5 * np.array([0.1046562260264673, 0.2684880898683334, 0.4013974147759622, 0.4509165386584741,
                           0.4013974147759622, 0.2684880898683334, 0.1046562260264673])  # fmt: skip
_GAUSS = 0.5 * np.array([0.0, 5.0 / 9.0, 0.0, 8.0 / 9.0, 0.0, 5.0 / 9.0, 0.0])

# Gauss' rule of eight points, from numpy.polynomial.legendre.leggauss(8); importing that would delay the window.
_EIGHT_NODES = np.array([-0.9602898564975362, -0.7966664774136267, -0.525532409916329, -0.18343464249564978,
                         0.18343464249564978, 0.525532409916329, 0.7966664774136267, 0.9602898564975362])  # fmt: skip
_EIGHT_WEIGHTS = 0.5 * np.array([0.10122853629037706, 0.22238103445337443, 0.3137066458778869, 0.36268378337836166] * 2)
_EIGHT_WEIGHTS[4:] = _EIGHT_WEIGHTS[3::-1]

# Sample positions for the range of an interval: just inside the ends, since a curve may jump there.
_RANGE_SAMPLES = np.array([1e-9, 0.25, 0.5, 0.75, 1.0 - 1e-9])


def band_nodes(n_bands: int, domain: float = HALF_PI) -> Float64Array:
    """The angles (J,) of the band values; a curve is linear in between, constant beyond the ends."""
    return np.asarray((np.arange(n_bands) + 0.5) * (domain / n_bands), np.float64)


@lru_cache(maxsize=64)
def band_weights(n_bands: int, domain: float = HALF_PI, by_solid_angle: bool = False) -> Float64Array:
    """The integral of each hat, plain or with weight sin γ, (J,): values times these sum to the curve's integral."""
    return _mass_matrix(n_bands, domain, by_solid_angle).sum(axis=0)


def band_values(
    curve: Callable[[Float64Array], Float64Array], n_bands: int, domain: float = HALF_PI, by_solid_angle: bool = False
) -> Float64Array:
    """Values at J nodes of the piecewise linear curve nearest to the given one, plain or by solid angle: (J, 3).

    curve: angles (N,) in radians to values (N, 3); an optional attribute `features` lists angles where it may jump.
    Preserves the curve's range and, to a relative 1e-5, its integral. Raises BandCountError unless J is a power of two.
    """
    n_bands = check_band_count(n_bands)
    edges = _partition(n_bands, domain, getattr(curve, "features", ()))
    weighted = (lambda g: curve(g) * np.sin(g)[:, None]) if by_solid_angle else curve
    values = _inverse_mass(n_bands, domain, by_solid_angle) @ _moments(weighted, edges, n_bands, domain)
    low, high = _range_under_hats(curve, edges, n_bands, domain)
    return _clamp_with_neighbours(values, low, high, band_weights(n_bands, domain, by_solid_angle)[:, None])


def _moments(
    curve: Callable[[Float64Array], Float64Array], edges: Float64Array, n_bands: int, domain: float
) -> Float64Array:
    """The integral of the curve times each hat, (J, 3)."""
    left, width = edges[:-1], np.diff(edges)
    cell, _ = _locate(left + 0.5 * width, n_bands, domain)
    cell_width = np.bincount(cell, width, minlength=n_bands)[:, None]
    done, near = np.zeros((2, n_bands, 3)), np.zeros((2, n_bands, 3))
    for _ in range(MOST_ROUNDS):
        shares, error = _integrate(curve, left, width, n_bands, domain)
        near = done + _by_cell(shares, cell, n_bands)
        means = np.abs(near[0]) / np.maximum(cell_width, FINEST_GRADE)
        tolerated = RELATIVE_TOLERANCE * np.abs(near[0]) + ABSOLUTE_TOLERANCE * means.max() * cell_width
        wrong = (error > tolerated[cell]).any(axis=1)
        if not wrong.any():
            break
        done += _by_cell(shares[:, ~wrong], cell[~wrong], n_bands)
        half = 0.5 * width[wrong]
        left = np.concatenate([left[wrong], left[wrong] + half])
        width, cell = np.tile(half, 2), np.tile(cell[wrong], 2)
    moments = near[0] - near[1]
    moments[1:] += near[1][:-1]
    return moments


def _locate(gamma: Float64Array, n_bands: int, domain: float) -> tuple[NDArray[np.intp], Float64Array]:
    """The node below each angle (at most J - 2, at least 0), and the fraction of the way to the next, 0 to 1."""
    position = np.clip(gamma * (n_bands / domain) - 0.5, 0.0, n_bands - 1.0)
    cell = np.clip(position.astype(np.intp), 0, max(n_bands - 2, 0))
    return cell, position - cell


def _partition(n_bands: int, domain: float, features: tuple[float, ...]) -> Float64Array:
    """Nodes, ends, grading towards 0, and features: increasing angles from 0 to the end of the domain."""
    nodes = band_nodes(n_bands, domain)
    n_grades = max(0, math.ceil(math.log2(nodes[0] / FINEST_GRADE)))
    inner = np.array([f for f in features if 0.0 < f < domain], dtype=float)
    grades = nodes[0] * 0.5 ** np.arange(1, n_grades + 1)
    return unique_sorted(np.concatenate([np.array([0.0, domain]), nodes, grades, inner]))


def _integrate(
    curve: Callable[[Float64Array], Float64Array], left: Float64Array, width: Float64Array, n_bands: int, domain: float
) -> tuple[Float64Array, Float64Array]:
    """Each interval's integrals of f and of f times the hat of the node above, (2, I, 3), and an error bound (I, 3)."""
    nodes = left[:, None] + width[:, None] * (0.5 + 0.5 * _NODES)
    values = curve(nodes.ravel()).reshape(left.size, _NODES.size, 3)
    rising = _locate(nodes, n_bands, domain)[1]
    kronrod = np.einsum("n,inc->ic", _KRONROD, values) * width[:, None]
    gauss = np.einsum("n,inc->ic", _GAUSS, values) * width[:, None]
    first = np.einsum("in,inc->ic", _KRONROD * rising, values) * width[:, None]
    return np.stack([kronrod, first]), np.abs(kronrod - gauss)


def _by_cell(shares: Float64Array, cell: NDArray[np.intp], n_bands: int) -> Float64Array:
    """Sums (2, J, 3) of the intervals' integrals (2, I, 3) over the cells they lie in."""
    sums = np.zeros((2, n_bands, 3))
    for moment in range(2):
        for channel in range(3):
            sums[moment, :, channel] = np.bincount(cell, shares[moment, :, channel], minlength=n_bands)
    return sums


def _mass_matrix(n_bands: int, domain: float, by_solid_angle: bool) -> Float64Array:
    """The integrals of the products of every two hats, (J, J), by Gauss' rule over each cell."""
    edges = np.concatenate([[0.0], band_nodes(n_bands, domain), [domain]])
    gamma = (edges[:-1, None] + np.diff(edges)[:, None] * (0.5 + 0.5 * _EIGHT_NODES)).ravel()
    weight = (np.diff(edges)[:, None] * _EIGHT_WEIGHTS).ravel() * (np.sin(gamma) if by_solid_angle else 1.0)
    cell, rising = _locate(gamma, n_bands, domain)
    above = np.minimum(cell + 1, n_bands - 1)
    mass = np.zeros((n_bands, n_bands))
    for i, u in ((cell, 1.0 - rising), (above, rising)):
        for k, v in ((cell, 1.0 - rising), (above, rising)):
            np.add.at(mass, (i, k), weight * u * v)
    return mass


@lru_cache(maxsize=64)
def _inverse_mass(n_bands: int, domain: float, by_solid_angle: bool) -> Float64Array:
    """The inverse mass matrix. It is tridiagonal: row-by-row elimination takes 2 ms for 128 bands, whereas LAPACK's
    threads take 25 ms for a general matrix."""
    mass = _mass_matrix(n_bands, domain, by_solid_angle)
    diagonal, beside, inverse = mass.diagonal().copy(), mass.diagonal(1), np.eye(n_bands)
    for i in range(1, n_bands):
        share = beside[i - 1] / diagonal[i - 1]
        diagonal[i] -= share * beside[i - 1]
        inverse[i] -= share * inverse[i - 1]
    inverse[-1] /= diagonal[-1]
    for i in reversed(range(n_bands - 1)):
        inverse[i] = (inverse[i] - beside[i] * inverse[i + 1]) / diagonal[i]
    return inverse


def _range_under_hats(
    curve: Callable[[Float64Array], Float64Array], edges: Float64Array, n_bands: int, domain: float
) -> tuple[Float64Array, Float64Array]:
    """Least and largest value (J, 3) of the curve where each hat is positive, from samples in every interval."""
    gamma = (edges[:-1, None] + np.diff(edges)[:, None] * _RANGE_SAMPLES).ravel()
    cell, values = _locate(gamma, n_bands, domain)[0], curve(gamma)
    starts = np.flatnonzero(np.diff(cell, prepend=-1))
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    first, last = np.r_[0, np.arange(len(low))], np.r_[np.arange(len(low)), len(low) - 1]
    if n_bands == 1:
        return low, high
    return np.minimum(low[first], low[last]), np.maximum(high[first], high[last])


def _clamp_with_neighbours(
    values: Float64Array, low: Float64Array, high: Float64Array, weights: Float64Array
) -> Float64Array:
    """Clamps values (J, 3) to their bounds: an excess goes to the neighbours, the remainder to all values with room."""
    total = (values * weights).sum(axis=0)
    for _ in range(MAX_SHARING_ROUNDS):
        bounded = np.clip(values, low, high)
        excess = (values - bounded) * weights
        values = bounded
        if not excess.any():
            break
        values = values + _share_excess(np.maximum(excess, 0.0), (high - values) * weights) / weights
        values = values - _share_excess(np.maximum(-excess, 0.0), (values - low) * weights) / weights
    values = np.clip(values, low, high)
    left = total - (values * weights).sum(axis=0)
    room = np.where(left > 0.0, high - values, values - low)
    room_in_all = (room * weights).sum(axis=0)
    share = np.divide(left, room_in_all, out=np.zeros_like(left), where=room_in_all > LEAST_ROOM * np.abs(left))
    return np.clip(values + room * share, low, high)


def _share_excess(excess: Float64Array, room: Float64Array) -> Float64Array:
    """The amount (J, 3) that each value receives when every excess is divided between its two neighbours in proportion
    to their room."""
    around = np.zeros_like(room)
    around[1:] += room[:-1]
    around[:-1] += room[1:]
    share = np.divide(excess, around, out=np.zeros_like(room), where=around > LEAST_ROOM * excess)
    received = np.zeros_like(room)
    received[1:] += share[:-1]
    received[:-1] += share[1:]
    return received * room
