"""Fits factors and a table to scattered samples, some thousand where a grid has a million.

The same model as in `fit`, with piecewise linear curves over few nodes, fitted by damped least squares of logarithms.
Curves are exponentials, so none is negative, and their curvature is penalized, so that nodes without samples follow
their neighbours; the alternating steps of `fit` were tried first and give such nodes no values. The table is the
product of the factors times the mean ratio of nearby samples to it; far from all samples, the product alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.measured.fit import DARK, LEAST, LEAST_STRENGTH, Factors, factors_of
from engine.measured.measurement import (
    HALF_PI,
    N_NODES,
    SHAPE,
    grid_directions,
    half_and_difference,
    node_position,
)
from engine.measured.sample_files import FilledTable, ScatteredSamples

Float64Array = NDArray[np.float64]

METHOD = "damped least squares of logarithms on scattered samples, smooth positive curves of 46 and 10 nodes"
_STEPS = 20
_SMOOTH, _SMOOTH_FINE, _DAMPING = 3.0, 1.0, 0.1  # weights of curvature and of a step, in samples
# At the centre of a highlight, where there are no samples, the curve is as high as around it: its first nodes are held
# level.
_LEVEL, _N_LEVEL = 3.0, 4
_QUANTILE = 0.2
_EVERY = 6  # degrees of phi_d between the places where nearby samples are averaged
_N_FINE, _N_COARSE = 46, 10
_NEIGHBOURS = 6
_REACH = 0.06  # distance, in shares of the angles, over which a sample counts
_AWAY = np.radians(25.0)


def fit_scattered(samples: ScatteredSamples) -> Iterator[float | tuple[FilledTable, Factors]]:
    """Fit a table and its factors; yields the share done, then both."""
    angles = _Angles(samples.wi, samples.wo)
    found = []
    for channel in range(3):
        found.append(_fit_channel(samples.values[:, channel], angles))
        yield (channel + 1) / 5
    factors = factors_of(found)
    errors = [_log_rms(samples.values, fit) for fit in (_product(factors, angles), _cloth(factors, angles))]
    factors = replace(factors, error=errors[0], error_whole=errors[1])
    yield 0.7
    yield _table(samples, factors, angles), factors


class _Angles:
    """theta_i, theta_o, theta_d, theta_h and phi_d (N,) of pairs of directions."""

    def __init__(self, wi: Float64Array, wo: Float64Array) -> None:
        self.light, self.view = (np.arccos(np.clip(v[:, 2], 0.0, 1.0)) for v in (wi, wo))
        self.half, self.difference, self.azimuth = half_and_difference(wi, wo)

    def hats(self, which: str) -> Float64Array:
        """Weights (N, n) of the nodes of a curve over one of the angles."""
        values, is_half = getattr(self, which), which == "half"
        n = _N_FINE if is_half else _N_COARSE
        position = node_position(values, is_half) * ((n - 1) / (N_NODES - 1))
        return np.maximum(1.0 - np.abs(position[:, None] - np.arange(n)), 0.0)


def _fit_channel(values: Float64Array, angles: _Angles) -> tuple[Float64Array | float, ...]:
    """d, g, s, G, H and w, P, Q of one colour."""
    light, view, difference, half = (angles.hats(name) for name in ("light", "view", "difference", "half"))
    away = values[angles.half > _AWAY]
    diffuse_part = max(float(np.quantile(away, _QUANTILE)) if len(away) else 0.0, LEAST_STRENGTH)
    first = np.concatenate([
        np.full(_N_COARSE, 0.5 * np.log(diffuse_part)), np.zeros(_N_COARSE),
        _first_guess(half, np.maximum(values - diffuse_part, 0.03 * values) + 0.01 * DARK),
    ])  # fmt: skip
    logs = _solve(first, values, light + view, np.concatenate([difference, half], axis=1))
    slant, over_d, over_h = (_nodes(part) for part in np.split(logs, [_N_COARSE, 2 * _N_COARSE]))
    strengths = [max(float(a.max() * b.max()), LEAST_STRENGTH) for a, b in ((slant, slant), (over_d, over_h))]
    return (
        strengths[0],
        _normalize_curve(slant),
        strengths[1],
        _normalize_curve(over_d),
        _normalize_curve(over_h),
        *_fit_cloth(values, angles),
    )


def _solve(first: Float64Array, values: Float64Array, slants: Float64Array, highlight: Float64Array) -> Float64Array:
    """Logarithms of the nodes of g, G and H, from an initial guess by damped Gauss-Newton steps."""
    logs, n = first, len(first)
    coarse, fine = _bending(_N_COARSE), _bending(_N_FINE)
    smooth = np.zeros((2 * len(coarse) + len(fine), n))
    for k, part in enumerate((coarse, coarse, fine)):
        smooth[k * len(coarse) : k * len(coarse) + len(part), k * _N_COARSE : k * _N_COARSE + part.shape[1]] = part
    target = np.log(values + DARK)
    for _ in range(_STEPS):
        diffuse_part, specular_part = np.exp(slants @ logs[:_N_COARSE]), np.exp(highlight @ logs[_N_COARSE:])
        fit = diffuse_part + specular_part + DARK
        rows = np.concatenate(
            [slants * (diffuse_part / fit)[:, None], highlight * (specular_part / fit)[:, None]], axis=1
        )
        # Not by @: the threads of its library take ten times as long on busy processors.
        square = np.einsum("ni,nj->ij", rows, rows) + smooth.T @ smooth + _DAMPING * np.eye(n)
        step = np.linalg.solve(square, rows.T @ (target - np.log(fit)) - smooth.T @ (smooth @ logs))
        logs = logs + np.clip(step, -1.0, 1.0)
    return logs


def _bending(n: int) -> Float64Array:
    """A matrix that measures the curvature of a curve of n nodes and, of one over theta_h, the slope at its centre."""
    if n == _N_COARSE:
        return np.asarray(_SMOOTH * np.diff(np.eye(n), n=2, axis=0))
    level = _LEVEL * np.diff(np.eye(n), axis=0)[:_N_LEVEL]
    return np.concatenate([_SMOOTH_FINE * np.diff(np.eye(n), n=2, axis=0), level])


def _fit_cloth(values: Float64Array, angles: _Angles) -> tuple[float, Float64Array, Float64Array]:
    """w, P, Q (91,) of w P(theta_i) Q(theta_h) P(theta_o): least squares of logarithms."""
    both, half = angles.hats("light") + angles.hats("view"), angles.hats("half")
    rows = np.concatenate([both, half], axis=1)
    square = rows.T @ rows + 1e-3 * np.eye(rows.shape[1])
    for part, n in ((slice(0, _N_COARSE), _N_COARSE), (slice(_N_COARSE, None), _N_FINE)):
        square[part, part] += _bending(n).T @ _bending(n)
    found = np.linalg.solve(square, rows.T @ np.log(values + DARK))
    p, q = (_nodes(part) for part in np.split(found, [_N_COARSE]))
    return float(p.max() ** 2 * q.max()), _normalize_curve(p), _normalize_curve(q)


def _first_guess(hats: Float64Array, values: Float64Array) -> Float64Array:
    """The mean logarithm at each node; interpolated for nodes without samples."""
    total, at = hats.sum(axis=0), np.arange(hats.shape[1])
    known = total > 1e-3
    return np.asarray(np.interp(at, at[known], (hats.T @ np.log(values))[known] / total[known]))


def _nodes(logs: Float64Array) -> Float64Array:
    """A curve at the 91 nodes of a measurement, from its logarithms at fewer nodes of the same spacing."""
    return np.asarray(np.exp(np.interp(np.linspace(0.0, len(logs) - 1.0, N_NODES), np.arange(len(logs)), logs)))


def _normalize_curve(curve: Float64Array) -> Float64Array:
    return np.maximum(curve / curve.max(), LEAST)


def _at(curve: Float64Array, angle: Float64Array, is_half: bool = False) -> Float64Array:
    """A curve (91, 3) at angles (N,)."""
    position = node_position(angle, is_half)
    return np.stack([np.interp(position, np.arange(N_NODES), curve[:, c]) for c in range(3)], axis=1)


def _product(factors: Factors, angles: _Angles) -> Float64Array:
    diffuse_part = factors.diffuse * _at(factors.slant, angles.light) * _at(factors.slant, angles.view)
    specular_part = _at(factors.theta_d, angles.difference) * _at(factors.theta_h, angles.half, True)
    return np.asarray(diffuse_part + factors.specular * specular_part)


def _cloth(factors: Factors, angles: _Angles) -> Float64Array:
    slants = _at(factors.slant_p, angles.light) * _at(factors.slant_p, angles.view)
    return np.asarray(factors.whole * slants * _at(factors.half_q, angles.half, True))


def _log_rms(values: Float64Array, fit: Float64Array) -> float:
    apart = np.log((values + DARK) / (fit + DARK))
    return float(np.sqrt((apart * apart).mean()))


def _table(samples: ScatteredSamples, factors: Factors, angles: _Angles) -> FilledTable:
    """The product of the factors on the grid, times the mean ratio of nearby samples to it."""
    from scipy.spatial import cKDTree

    beyond = np.log((samples.values + DARK) / (_product(factors, angles) + DARK))
    places = _places(angles)
    mirrored = _places(angles, mirrored=True)
    tree = cKDTree(np.concatenate([places, mirrored]))
    beyond = np.concatenate([beyond, beyond])
    wi, wo = (v.reshape(-1, 3) for v in grid_directions(_EVERY))
    grid = _Angles(wi, wo)
    distance, nearest = tree.query(_places(grid), k=_NEIGHBOURS)
    width = 0.5 * distance[:, 1:2] + 1e-3
    weight = np.exp(-0.5 * (distance / width) ** 2)
    mean = np.einsum("nk,nkc->nc", weight, beyond[nearest]) / weight.sum(axis=1, keepdims=True)
    confidence = np.exp(-0.5 * (distance[:, :1] / _REACH) ** 2)
    coarse = (SHAPE[0], SHAPE[1], SHAPE[2] // _EVERY)
    logs = (np.log(_product(factors, grid) + DARK) + confidence * mean).reshape(*coarse, 3)
    table = np.maximum(np.exp(_between(logs)) - DARK, 0.0).astype(np.float32)
    above = ((wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)).reshape(coarse)
    measured = np.repeat((confidence > 0.5).reshape(coarse) & above, _EVERY, axis=2)
    return FilledTable(table, measured, _EVERY * int(above.sum()) - int(measured.sum()), samples.n_below)


def _places(angles: _Angles, mirrored: bool = False) -> Float64Array:
    """Coordinates of pairs of directions in which distance means difference: phi_d has no effect at theta_h = 0 and
    theta_d = 0."""
    turn = 2.0 * (np.pi - angles.azimuth if mirrored else angles.azimuth)
    reach = 0.2 * np.sin(angles.difference) * np.minimum(angles.half / np.radians(30.0), 1.0)
    half = np.sqrt(angles.half / HALF_PI)
    return np.stack([half, angles.difference / HALF_PI, reach * np.cos(turn), reach * np.sin(turn)], axis=1)


def _between(coarse: Float64Array) -> Float64Array:
    """Interpolate all phi_d linearly from every sixth, with wrap-around."""
    following = np.roll(coarse, -1, axis=2)
    steps = [coarse + (k / _EVERY) * (following - coarse) for k in range(_EVERY)]
    return np.stack(steps, axis=3).reshape(*SHAPE, 3)
