"""Fits factors to a measurement: diffuse and specular separately, products of curves per colour [BenArtzi07, 3.5].

    rho ~ d G_d(theta_i) G_d(theta_o)  +  s G_s(theta_d) H_s(theta_h) Q_s(phi_d) S(theta_i) S(theta_o),  all at least 0

in the spirit of SACLS [Lawrence06]: constrained alternating least squares. In each step all curves except one are
fixed, and the best value of each node of that one follows in closed form and is clamped to be non-negative.

Diffuse: the part that does not depend on azimuth. For each (theta_i, theta_o), a low quantile of all samples away from
the highlight is taken; a product g(theta_i) g(theta_o) is fitted to these. Specular: alternating sums over the
remainder. One curve serves wi and wo in both, because a table is the same where they change places: of a product of two
different curves the best one has equal ones. S is used where the error falls by it; [BenArtzi07, eq. 3.17] has none.

Errors are relative to the fit of the previous step (iteratively reweighted): reflection spans five decades, ratios are
what the user sees, and the remaining quotient is then a number near 1. Plain least squares, as printed, fits the peak
alone. Logarithms would work as well, except for the many zeros of a remainder.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.measured.factors import (
    LEAST,
    LEAST_STRENGTH,
    OF_HALF_ANGLE,
    ChannelFit,
    Factors,
    factors_of,
    highlight_strengths,
    normalize_curve,
)
from engine.measured.measurement import HALF_PI, N_NODES, SHAPE, Part, grid_directions

Float64Array = NDArray[np.float64]

METHOD = "alternating constrained least squares of relative errors, diffuse from the low quantile away from highlights"
# Every fourth sample in phi_d takes part.
EVERY = 4
# 1/sr below which differences do not count: dark samples are mostly noise.
DARK = 1e-3
# S is used where the error falls to this share.
WORTHWHILE = 0.97
_SLANTS = 30  # rings of theta_i and theta_o
_QUANTILE = 0.1
_AWAY = np.radians(25.0)  # theta_h beyond which no highlight is expected
_STEPS = 20
_GRAZING = np.cos(np.radians(85.0))
N_NODES_LESS = N_NODES - 1


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
    found: list[tuple[ChannelFit, ChannelFit]] = []
    for channel in range(3):
        samples = table[:, :, ::EVERY, channel].astype(float)
        found.append(_fit_channel(samples, measured[:, :, ::EVERY], weights, slants))
        yield (channel + 1) / 4
    plain, slanted = (factors_of(fits) for fits in zip(*found, strict=True))
    note = f"{slanted.error:.3f} log RMS with theta_i and theta_o in the highlight, {plain.error:.3f} without"
    yield replace(slanted if slanted.error < WORTHWHILE * plain.error else plain, note=note)


def _fit_channel(
    samples: Float64Array, measured: NDArray[np.bool_], weights: Float64Array, slants: list[Float64Array]
) -> tuple[ChannelFit, ChannelFit]:
    """The factors of one colour, without and with S."""

    def of_slants(curve: Float64Array) -> Float64Array:
        return _at_slants(curve, slants[0]) * _at_slants(curve, slants[1])

    def log_rms(fit: Float64Array) -> float:
        apart = np.log((samples + DARK) / (fit + DARK))[measured]
        return float(np.sqrt((apart * apart).mean()))

    diffuse, slant = _diffuse(samples, weights, slants)
    diffuse_part = diffuse * of_slants(slant)
    whole, p, q = _fit_cloth(samples, weights, slants)
    error_whole = log_rms(whole * of_slants(p) * q[:-1, None, None])
    turns = np.arange(0, SHAPE[2], EVERY)
    fits = []
    for highlight in _specular(np.maximum(samples - diffuse_part, 0.0), diffuse_part, weights, slants):
        curves = highlight.curves
        azimuth = curves["phi_d"][np.minimum(turns, SHAPE[2] - turns)]
        shape = curves["theta_h"][:-1, None, None] * curves["theta_d"][:-1, None] * azimuth * of_slants(curves["s"])
        fits.append(ChannelFit(
            {"diffuse": max(diffuse, LEAST_STRENGTH), "whole": whole, **highlight.strengths},
            {"theta_i": slant, "theta_o": slant, "p": p, "q": q, **curves},
            highlight.product, log_rms(diffuse_part + highlight.product * shape), error_whole,
        ))  # fmt: skip
    return fits[0], fits[1]


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
    return float(slant.max() ** 2 * half.max()), normalize_curve(slant), normalize_curve(half)


def _sums(rings: NDArray[np.integer], values: Float64Array) -> Float64Array:
    """Sums over the rings of wi and of wo."""
    return np.bincount(rings, np.tile(values.ravel(), 2), _SLANTS).astype(float)


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
    above: Float64Array, diffuse_part: Float64Array, weights: Float64Array, slants: list[Float64Array]
) -> list[_Highlight]:
    """The highlights on top of the diffuse part: G(theta_d) H(theta_h) Q(phi_d), and that times S(theta_i)
    S(theta_o)."""
    n_h, n_d, n_phi = above.shape
    over_d, over_phi, over_slant = np.ones(n_d), np.ones(n_phi), np.ones(_SLANTS)
    total = weights.sum(axis=(1, 2))
    over_h = np.divide((above * weights).sum(axis=(1, 2)), total, out=np.zeros_like(total), where=total > 0.0)
    rings = [np.minimum((slant * (_SLANTS / HALF_PI)).astype(int), _SLANTS - 1) for slant in slants]
    slanted, found = np.ones_like(above), []
    for step in range(2 * _STEPS):
        fit = over_h[:, None, None] * over_d[:, None] * over_phi * slanted
        relative = weights / (diffuse_part + fit + DARK) ** 2
        wanted = relative * above * slanted
        squares = relative * slanted * slanted
        # One curve after the other; einsum sums over all else.
        over_h = _solve_nodes(
            np.einsum("hdp,d,p->h", wanted, over_d, over_phi), np.einsum("hdp,d,p->h", squares, over_d**2, over_phi**2)
        )
        over_d = _solve_nodes(
            np.einsum("hdp,h,p->d", wanted, over_h, over_phi), np.einsum("hdp,h,p->d", squares, over_h**2, over_phi**2)
        )
        over_phi = _solve_nodes(
            np.einsum("hdp,h,d->p", wanted, over_h, over_d), np.einsum("hdp,h,d->p", squares, over_h**2, over_d**2)
        )
        over_phi = 0.5 * (over_phi + np.roll(over_phi[::-1], 1))  # the same at phi_d and -phi_d
        if step >= _STEPS:
            # S is on both sides: each with the other fixed, and half a step.
            rest = over_h[:, None, None] * over_d[:, None] * over_phi
            products, norms = np.zeros(_SLANTS), np.zeros(_SLANTS)
            for ring, other in (rings, rings[::-1]):
                term = rest * over_slant[other]
                products += np.bincount(ring.ravel(), (relative * above * term).ravel(), _SLANTS)
                norms += np.bincount(ring.ravel(), (relative * term * term).ravel(), _SLANTS)
            over_slant = np.sqrt(over_slant * np.maximum(_solve_nodes(products, norms), LEAST))
            slanted = over_slant[rings[0]] * over_slant[rings[1]]
        if step in (_STEPS - 1, 2 * _STEPS - 1):
            found.append(_highlight(over_h, over_d, over_phi, over_slant, rings, weights))
    return found


@dataclass(frozen=True)
class _Highlight:
    """product: the strength of all curves together; strengths of those that are edited together."""

    product: float
    strengths: Mapping[Part, float]
    curves: Mapping[str, Float64Array]


def _highlight(
    over_h: Float64Array, over_d: Float64Array, over_phi: Float64Array, over_slant: Float64Array,
    rings: list[NDArray[np.integer]], weights: Float64Array,
) -> _Highlight:  # fmt: skip
    """Curves at the nodes of a measurement, with a maximum of 1, and strengths."""
    middles = (np.arange(_SLANTS) + 0.5) * (N_NODES_LESS / _SLANTS)
    turned = np.append(over_phi, over_phi[0])[: len(over_phi) // 2 + 1]  # from 0 to 90 degrees
    curves = {
        "theta_h": np.append(over_h, over_h[-1]),
        "theta_d": np.append(over_d, over_d[-1]),
        "phi_d": np.interp(np.arange(N_NODES), np.arange(len(turned)) * EVERY, turned),
        "s": np.interp(np.arange(N_NODES), middles, over_slant),
    }
    peaks = [over_h.max(), over_d.max(), over_phi.max(), over_slant.max() ** 2]
    strength = max(float(np.prod(peaks)), LEAST_STRENGTH)
    relative = [np.maximum(curve / max(curve.max(), 1e-300), LEAST) for curve in (over_h, over_d, over_phi, over_slant)]
    factors: Mapping[str, Float64Array] = {
        "theta_h": relative[0][:, None, None],
        "theta_d": relative[1][:, None],
        "phi_d": relative[2],
        "s_i": relative[3][rings[0]],
        "s_o": relative[3][rings[1]],
    }
    strengths = highlight_strengths(strength, factors, weights * factors["theta_h"], OF_HALF_ANGLE)
    return _Highlight(strength, strengths, {name: normalize_curve(curve) for name, curve in curves.items()})


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
