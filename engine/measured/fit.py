"""Fits factors to a measurement: diffuse and specular separately, each a product of two curves per colour [BenArtzi07,
3.5].

    rho ~ d G_d(theta_i) H_d(theta_o)  +  s G_s(theta_d) H_s(theta_h),     everything at least 0

in the spirit of SACLS [Lawrence06]: constrained alternating least squares. In each step all curves except one are
fixed, and the best value of each node of that one follows in closed form and is clamped to be non-negative.

Diffuse: the part that does not depend on azimuth. For each (theta_i, theta_o), a low quantile of all samples away from
the highlight is taken; a product g(theta_i) g(theta_o) is fitted to these, with one curve for both because of
reciprocity. Specular: alternating sums over the remainder.

Errors are relative to the fit of the previous step (iteratively reweighted): reflection spans five decades, ratios are
what the user sees, and the remaining quotient is then a number near 1. Plain least squares, as printed, fits the peak
alone. Logarithms would work as well, except for the many zeros of a remainder.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.measured.measurement import HALF_PI, N_NODES, grid_directions

Float64Array = NDArray[np.float64]

METHOD = "alternating constrained least squares of relative errors, diffuse from the low quantile away from highlights"
# Every fourth sample in phi_d takes part.
EVERY = 4
# 1/sr below which differences do not count: dark samples are mostly noise.
DARK = 1e-3
# Least value of a curve relative to its maximum, so that a quotient is finite.
LEAST = 1e-5
LEAST_STRENGTH = 1e-6
_SLANTS = 30  # rings of theta_i and theta_o
_QUANTILE = 0.1
_AWAY = np.radians(25.0)  # theta_h beyond which no highlight is expected
_STEPS = 20
_GRAZING = np.cos(np.radians(85.0))
N_NODES_LESS = N_NODES - 1


@dataclass(frozen=True, eq=False)
class Factors:
    """diffuse, specular and whole (3,): strengths in 1/sr; the others are curves (91, 3) with a maximum of 1, positive,
    at the nodes of `measurement.node_angles`.

    error: log RMS of the diffuse and specular factors together; error_whole: of those of the whole, w P(theta_i)
    Q(theta_h) P(theta_o) [McCool01].
    """

    diffuse: Float64Array
    slant: Float64Array
    specular: Float64Array
    theta_d: Float64Array
    theta_h: Float64Array
    whole: Float64Array
    slant_p: Float64Array
    half_q: Float64Array
    error: float
    error_whole: float


def fit_factors(table: NDArray[np.float32], measured: NDArray[np.bool_]) -> Iterator[float | Factors]:
    """Fit to a filled table (90, 90, 180, 3), using the samples that were `measured`; yields the share done, then the
    factors."""
    wi, wo = grid_directions(EVERY)
    cosines = wi[..., 2], wo[..., 2]
    weights = np.where(measured[:, :, ::EVERY], np.minimum(*cosines).clip(0.0, 1.0), 0.0)
    weights[np.minimum(*cosines) < _GRAZING] = 0.0
    if not weights.any():
        weights = measured[:, :, ::EVERY].astype(float)
    slants = [np.arccos(np.clip(c, 0.0, 1.0)) for c in cosines]
    found = []
    for channel in range(3):
        samples = table[:, :, ::EVERY, channel].astype(float)
        found.append(_fit_channel(samples, weights, slants))
        yield (channel + 1) / 4
    factors = factors_of(found)
    errors = _log_errors(table, measured, factors, slants)
    yield replace(factors, error=errors[0], error_whole=errors[1])


def factors_of(channels: Sequence[tuple[Float64Array | float, ...]]) -> Factors:
    """Combine the factors of three colours, d, g, s, G, H and w, P, Q each; their errors are unknown."""
    diffuse, slant, specular, over_d, over_h, whole, p, q = (
        np.stack(parts, axis=-1) for parts in zip(*channels, strict=True)
    )
    return Factors(diffuse, slant, specular, over_d, over_h, whole, p, q, 0.0, 0.0)


def _fit_channel(
    samples: Float64Array, weights: Float64Array, slants: list[Float64Array]
) -> tuple[Float64Array | float, ...]:
    """d, g (91,), s, G (91,), H (91,), and w, P (91,), Q (91,) of one colour."""
    strength, slant = _diffuse(samples, weights, slants)
    diffuse_part = strength * _at_slants(slant, slants[0]) * _at_slants(slant, slants[1])
    over_h, over_d = _specular(np.maximum(samples - diffuse_part, 0.0), diffuse_part, weights)
    over_h, over_d = (np.append(curve, curve[-1]) for curve in (over_h, over_d))
    specular = max(over_h.max() * over_d.max(), LEAST_STRENGTH)
    cloth = _fit_cloth(samples, weights, slants)
    return max(strength, LEAST_STRENGTH), slant, specular, _normalize_curve(over_d), _normalize_curve(over_h), *cloth


def _fit_cloth(
    samples: Float64Array, weights: Float64Array, slants: list[Float64Array]
) -> tuple[float, Float64Array, Float64Array]:
    """w, P and Q of the product w P(theta_i) Q(theta_h) P(theta_o): alternating means of logarithms, which is their
    least squares solution, because every sample is at one node of each curve."""
    log = np.log(samples + DARK)
    nodes = [np.minimum((slant * (_SLANTS / HALF_PI)).astype(int), _SLANTS - 1) for slant in slants]
    p, q = np.zeros(_SLANTS), np.zeros(samples.shape[0])
    flat = np.concatenate([node.ravel() for node in nodes])
    counted = _sums(flat, weights)
    rows = weights.sum(axis=(1, 2))
    for _ in range(_STEPS):
        q = _solve_nodes(((log - p[nodes[0]] - p[nodes[1]]) * weights).sum(axis=(1, 2)), rows)
        left = (log - p[nodes[0]] - p[nodes[1]] - q[:, None, None]) * weights
        p = p + 0.5 * _solve_nodes(_sums(flat, left), counted)
    middles = (np.arange(_SLANTS) + 0.5) * (N_NODES_LESS / _SLANTS)
    slant, half = np.exp(np.interp(np.arange(N_NODES), middles, p)), np.exp(np.append(q, q[-1]))
    return float(slant.max() ** 2 * half.max()), _normalize_curve(slant), _normalize_curve(half)


def _sums(rings: NDArray[np.integer], values: Float64Array) -> Float64Array:
    """Sums over the rings of wi and of wo."""
    return np.bincount(rings, np.tile(values.ravel(), 2), _SLANTS).astype(float)


def _normalize_curve(curve: Float64Array) -> Float64Array:
    """Scale to a maximum of 1, and raise to a positive minimum."""
    peak = curve.max()
    return np.maximum(curve / peak, LEAST) if peak > 0.0 else np.ones_like(curve)


def _diffuse(samples: Float64Array, weights: Float64Array, slants: list[Float64Array]) -> tuple[float, Float64Array]:
    """d and g (91,) with maximum 1 of the product d g(theta_i) g(theta_o) below the samples."""
    theta_h = HALF_PI * (np.arange(samples.shape[0]) / N_NODES_LESS) ** 2
    there = (weights > 0.0) & (theta_h >= _AWAY)[:, None, None]
    if not there.any():
        return 0.0, np.ones(N_NODES)
    rings = [np.minimum((s[there] / HALF_PI * _SLANTS).astype(int), _SLANTS - 1) for s in slants]
    envelope = _quantiles(samples[there], rings[0] * _SLANTS + rings[1]).reshape(_SLANTS, _SLANTS)
    envelope = np.fmin(envelope, envelope.T)
    known = np.isfinite(envelope)
    log = np.log(np.maximum(np.where(known, envelope, 1.0), 1e-9))
    curve = np.zeros(_SLANTS)
    seen = known.any(axis=1)
    for _ in range(100):  # log e_ij = u_i + u_j, damped because u is on both sides
        curve[seen] += 0.5 * ((log - curve[:, None] - curve) * known).sum(axis=1)[seen] / known.sum(axis=1)[seen]
    if not seen.any():
        return 0.0, np.ones(N_NODES)
    middles = (np.arange(_SLANTS) + 0.5) * (N_NODES_LESS / _SLANTS)
    nodes = np.exp(np.interp(np.arange(N_NODES), middles[seen], curve[seen]))
    peak = float(nodes.max())
    return peak * peak, np.maximum(nodes / peak, LEAST)


def _specular(
    above: Float64Array, diffuse_part: Float64Array, weights: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """H (90,) over theta_h and G (90,) over theta_d of the product on top of the diffuse part."""
    over_d = np.ones(above.shape[1])
    total = weights.sum(axis=(1, 2))
    over_h = np.divide((above * weights).sum(axis=(1, 2)), total, out=np.zeros_like(total), where=total > 0.0)
    for _ in range(_STEPS):
        fit = over_h[:, None, None] * over_d[:, None]
        relative = weights / (diffuse_part + fit + DARK) ** 2
        over_h = _solve_nodes(
            np.einsum("hdp,hdp,d->h", relative, above, over_d), np.einsum("hdp,d->h", relative, over_d**2)
        )
        over_d = _solve_nodes(
            np.einsum("hdp,hdp,h->d", relative, above, over_h), np.einsum("hdp,h->d", relative, over_h**2)
        )
    return over_h, over_d


def _solve_nodes(products: Float64Array, squares: Float64Array) -> Float64Array:
    """The least squares value of each node; nodes without samples take that of the nearest one."""
    known = squares > 1e-12 * squares.max(initial=0.0)
    if not known.any():
        return np.zeros_like(products)
    at = np.arange(len(products))
    return np.asarray(np.interp(at, at[known], products[known] / squares[known]))


def _quantiles(values: Float64Array, group: NDArray[np.integer]) -> Float64Array:
    """The low quantile of each group (n^2,), NaN for empty ones."""
    order = np.lexsort((values, group))
    counts = np.bincount(group, minlength=_SLANTS * _SLANTS)
    first = np.cumsum(counts) - counts
    at = first + (_QUANTILE * np.maximum(counts - 1, 0)).astype(int)
    found = values[order][np.minimum(at, len(values) - 1)]
    return np.where(counts > 0, found, np.nan)


def _at_slants(curve: Float64Array, theta: Float64Array) -> Float64Array:
    return np.asarray(np.interp(theta * (N_NODES_LESS / HALF_PI), np.arange(N_NODES), curve))


def _log_errors(
    table: NDArray[np.float32], measured: NDArray[np.bool_], factors: Factors, slants: list[Float64Array]
) -> tuple[float, float]:
    """RMS of ln((rho + DARK) / (fit + DARK)) over the samples that were measured: of both parts, and of the whole."""
    there = measured[:, :, ::EVERY]
    squares = np.zeros(2)
    for c in range(3):
        slanted, cloth = (
            _at_slants(curve[:, c], slants[0]) * _at_slants(curve[:, c], slants[1])
            for curve in (factors.slant, factors.slant_p)
        )
        specular_part = factors.specular[c] * factors.theta_h[:-1, None, None, c] * factors.theta_d[:-1, None, c]
        fits = (
            factors.diffuse[c] * slanted + specular_part,
            factors.whole[c] * cloth * factors.half_q[:-1, None, None, c],
        )
        for i, fit in enumerate(fits):
            apart = np.log((table[:, :, ::EVERY, c] + DARK) / (fit + DARK))[there]
            squares[i] += float((apart * apart).mean()) / 3.0
    return float(squares[0] ** 0.5), float(squares[1] ** 0.5)
