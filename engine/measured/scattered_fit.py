"""Fits factors to scattered samples, some thousand where a grid has a million; and a table to those of isotropic
surfaces.

The same model as in `fit`, with piecewise linear curves over few nodes, fitted by damped least squares of logarithms.
Curves are exponentials, so none is negative, and their curvature is penalized, so that nodes without samples follow
their neighbours; the alternating steps of `fit` were tried first and give such nodes no values. The table is the
product of the factors times the mean ratio of nearby samples to it; far from all samples, the product alone.

Of isotropic samples a third is left out to judge whether S(theta_i) S(theta_o) makes the highlight better; errors of
anisotropic ones decide whether it is edited over theta_h and theta_d, theta_h and phi_h, or its two slopes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.measured.factors import (
    LEAST_STRENGTH,
    OF_HALF_ANGLE,
    ChannelFit,
    Factors,
    curve_angles,
    factors_of,
    highlight_strengths,
    normalize_curve,
)
from engine.measured.fit import DARK, WORTHWHILE
from engine.measured.measurement import (
    HALF_ANGLE_CURVES,
    HALF_PI,
    N_NODES,
    SHAPE,
    Part,
    grid_directions,
    half_and_difference,
    node_position,
)
from engine.measured.sample_files import FilledTable, ScatteredSamples

Float64Array = NDArray[np.float64]

METHOD = "damped least squares of logarithms on scattered samples, smooth positive curves of 46 and 10 nodes"
_STEPS = 30
# Weights of curvature and of a step, in samples.
_SMOOTH, _SMOOTH_FINE, _DAMPING, _LEAST_DAMPING = 3.0, 1.0, 0.1, 1e-3
# At the centre of a highlight, where there are no samples, the curve is as high as around it: its first nodes are held
# level.
_LEVEL, _N_LEVEL = 3.0, 4
# S is nearly level where there are no samples: its scale is not otherwise known apart from the other curves'.
_CALM = 0.3
# Steep slopes of the half vector go with large theta_d: left free, curves over both would grow against each other.
_FLAT, _N_FLAT = 10.0, 14
_QUANTILE = 0.2
_EVERY = 6  # degrees of phi_d between the places where nearby samples are averaged
_N_FINE, _N_COARSE = 46, 10
_NEIGHBOURS = 6
_REACH = 0.06  # distance, in shares of the angles, over which a sample counts
_AWAY = np.radians(25.0)
# Factors of the highlight: the one over the half vector first.
PLAIN = ("theta_h", "theta_d")
SLANTED = (*PLAIN, "s")
AROUND = ("theta_h", "phi_h", "theta_d", "phi_d", "s")
BRUSHED = ("theta_u", "theta_v", "theta_d", "s")


def fit_scattered(samples: ScatteredSamples) -> Iterator[float | tuple[FilledTable, Factors]]:
    """Fit a table and its factors; yields the share done, then both."""
    judged = np.arange(len(samples.values)) % 3 == 0
    errors = []
    for k, curves in enumerate((PLAIN, SLANTED)):
        fits = [ProductFit(samples, channel, curves, ~judged) for channel in range(3)]
        errors.append(_rms([fit.error(judged) for fit in fits]))
        yield (k + 1) / 6
    curves = SLANTED if errors[1] < errors[0] else PLAIN
    factors = factors_of([ProductFit(samples, channel, curves).channel(OF_HALF_ANGLE) for channel in range(3)])
    note = f"left-out samples {errors[1]:.3f} with theta_i and theta_o in the highlight, {errors[0]:.3f} without"
    yield 0.7
    yield _table(samples, factors), replace(factors, note=note)


def fit_anisotropic(samples: ScatteredSamples) -> Iterator[float | Factors]:
    """Fit factors to samples of an anisotropic surface; yields the share done, then the factors.

    The highlight is edited over theta_h and theta_d, unless it is better by theta_h and phi_h, or by its slopes.
    """
    found = []
    products: tuple[tuple[tuple[str, ...], tuple[Part, ...]], ...] = (
        (SLANTED, OF_HALF_ANGLE), (AROUND, OF_HALF_ANGLE), (BRUSHED, ("brushed",)),
    )  # fmt: skip
    for curves, parts in products:
        for channel in range(3):
            found.append(ProductFit(samples, channel, curves).channel(parts))
            yield len(found) / 10
    slanted, around, brushed = (factors_of(found[k : k + 3]) for k in (0, 3, 6))
    errors: dict[Part, float] = {
        "specular": WORTHWHILE * slanted.error, "around": around.error, "brushed": brushed.error
    }  # fmt: skip
    highlight = min(errors, key=lambda part: errors[part])
    best = brushed if highlight == "brushed" else around
    slopes = {name: brushed.curves[name] for name in ("theta_u", "theta_v")}
    slants = {name: best.curves[name] for name in ("theta_i", "theta_o")}
    note = (
        f"highlight {slanted.error:.3f} log RMS by theta_h and theta_d, {around.error:.3f} by theta_h and phi_h, "
        f"{brushed.error:.3f} by its slopes"
    )
    yield replace(
        best,
        strengths={**around.strengths, "brushed": brushed.strengths["brushed"], "diffuse": best.strengths["diffuse"]},
        curves={**around.curves, **slopes, **slants},
        highlight=highlight,
        note=note,
    )


def _rms(errors: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


class ProductFit:
    """One colour of samples, those of a mask: logarithms of g's nodes, and of those of each curve of the highlight."""

    def __init__(
        self, samples: ScatteredSamples, channel: int, curves: tuple[str, ...], used: NDArray[np.bool_] | None = None
    ) -> None:
        self.values, self.names = samples.values[:, channel], ("g", *curves)
        self._angles = curve_angles(samples.wi, samples.wo)
        hats = [self._hats(name) for name in self.names]
        self._ends = np.cumsum([each.shape[1] for each in hats])
        self._rows = np.concatenate(hats, axis=1)
        self._solve(np.ones(len(self.values), bool) if used is None else used)

    def error(self, mask: NDArray[np.bool_]) -> float:
        """Log RMS over the samples of a mask."""
        diffuse_part, highlight = self._parts(self._rows[mask])
        return _log_rms(self.values[mask], diffuse_part + highlight)

    def channel(self, parts: Sequence[Part]) -> ChannelFit:
        """Strengths and curves at the nodes of a measurement; those of the highlight's `parts`."""
        curves = {name: _nodes(logs) for name, logs in zip(self.names, self._split(self._logs), strict=True)}
        slant = curves.pop("g")
        peaks = [curve.max() ** (2 if name == "s" else 1) for name, curve in curves.items()]
        relative = {name: normalize_curve(curve) for name, curve in curves.items()}
        factors = {name: self._at(name, relative[name]) for name in relative if name != "s"}
        if "s" in relative:
            factors["s_i"], factors["s_o"] = (self._at(name, relative["s"]) for name in ("theta_i", "theta_o"))
        diffuse_part, highlight = self._parts(self._rows)
        weights = highlight / (diffuse_part + highlight + DARK)
        product = max(float(np.prod(peaks)), LEAST_STRENGTH)
        whole, p, q = _fit_cloth(self.values, self._hats("s"), self._hats("theta_h"))
        cloth = whole * self._at("theta_i", p) * self._at("theta_o", p) * self._at("q", q)
        return ChannelFit(
            {
                "diffuse": max(float(slant.max() ** 2), LEAST_STRENGTH),
                "whole": whole,
                **highlight_strengths(product, factors, weights, parts),
            },
            {"theta_i": normalize_curve(slant), "theta_o": normalize_curve(slant), "p": p, "q": q, **relative},
            product,
            self.error(np.ones(len(self.values), bool)),
            _log_rms(self.values, cloth),
        )

    def _hats(self, name: str) -> Float64Array:
        """Weights (N, n) of the nodes of a curve: of both angles where it is one curve for wi and wo."""
        if name in ("g", "s"):
            return self._hats("theta_i") + self._hats("theta_o")
        n, is_half = (_N_FINE, True) if name in HALF_ANGLE_CURVES else (_N_COARSE, False)
        position = node_position(self._angles[name], is_half) * ((n - 1) / (N_NODES - 1))
        return np.maximum(1.0 - np.abs(position[:, None] - np.arange(n)), 0.0)

    def _at(self, name: str, curve: Float64Array) -> Float64Array:
        """A curve (91,) at the samples' angles."""
        position = node_position(self._angles["theta_h" if name == "q" else name], name in HALF_ANGLE_CURVES)
        return np.asarray(np.interp(position, np.arange(N_NODES), curve))

    def _split(self, array: Float64Array) -> list[Float64Array]:
        """The parts of each curve, along the last axis."""
        return np.split(array, self._ends[:-1], axis=-1)

    def _parts(self, rows: Float64Array) -> tuple[Float64Array, Float64Array]:
        """The diffuse part and the highlight of samples."""
        first = self._ends[0]
        return np.exp(rows[:, :first] @ self._logs[:first]), np.exp(rows[:, first:] @ self._logs[first:])

    def _solve(self, used: NDArray[np.bool_]) -> None:
        """Find the logarithms, from an initial guess, by steps of Levenberg and Marquardt."""
        from scipy.sparse import csr_array, hstack

        values, rows, first = self.values[used], self._rows[used], self._ends[0]
        smooth = self._smoothness()
        self._logs = self._first_guess(values, rows, self._angles["theta_h"][used])
        target = np.log(values + DARK)
        hats = csr_array(rows[:, :first]), csr_array(rows[:, first:])
        best, least, damping = self._logs, np.inf, _DAMPING
        for _ in range(_STEPS):
            parts = self._parts(rows)
            fit = parts[0] + parts[1] + DARK
            left, bent = target - np.log(fit), smooth @ self._logs
            # A step that makes it worse is taken back, and a shorter one tried.
            error = float(left @ left + bent @ bent)
            if error < least:
                best, least, damping = self._logs, error, max(0.3 * damping, _LEAST_DAMPING)
                slope = hstack([
                    each.multiply((part / fit)[:, None]) for each, part in zip(hats, parts, strict=True)
                ]).tocsr()  # fmt: skip
                # Sparse, two nodes a curve: dense products start threads, which take ten times as long on busy
                # processors.
                square = (slope.T @ slope).toarray() + smooth.T @ smooth
                right = slope.T @ left - smooth.T @ bent
            else:
                damping *= 10.0
            step = np.linalg.solve(square + damping * np.eye(len(best)), right)
            self._logs = best + np.clip(step, -1.0, 1.0)
        self._logs = best

    def _smoothness(self) -> Float64Array:
        """A matrix that measures how all curves bend."""
        blocks = []
        for name, start, end in zip(self.names, (0, *self._ends), self._ends, strict=False):
            steps, bending = np.diff(np.eye(end - start), axis=0), _bending(end - start)
            if name in ("s", "theta_i", "theta_o"):
                bending = np.concatenate([bending, _CALM * steps])
            elif name in ("theta_u", "theta_v"):
                bending = np.concatenate([bending, _FLAT * steps[-_N_FLAT:]])
            block = np.zeros((len(bending), self._ends[-1]))
            block[:, start:end] = bending
            blocks.append(block)
        return np.concatenate(blocks)

    def _first_guess(self, values: Float64Array, rows: Float64Array, theta_h: Float64Array) -> Float64Array:
        """A constant diffuse part, and above it the mean logarithm at each node of the highlight's first curve."""
        away = values[theta_h > _AWAY]
        diffuse_part = max(float(np.quantile(away, _QUANTILE)) if len(away) else 0.0, LEAST_STRENGTH)
        above = np.log(np.maximum(values - diffuse_part, 0.03 * values) + 0.01 * DARK)
        parts = self._split(np.zeros(self._ends[-1]))
        parts[0] += 0.5 * np.log(diffuse_part)
        hats = self._split(rows)[1]
        total, at = hats.sum(axis=0), np.arange(hats.shape[1])
        known = total > 1e-3
        parts[1] += np.interp(at, at[known], (hats.T @ above)[known] / total[known])
        return np.concatenate(parts)


def _bending(n: int) -> Float64Array:
    """A matrix that measures the curvature of a curve of n nodes and, of one over theta_h, the slope at its centre."""
    if n == _N_COARSE:
        return np.asarray(_SMOOTH * np.diff(np.eye(n), n=2, axis=0))
    level = _LEVEL * np.diff(np.eye(n), axis=0)[:_N_LEVEL]
    return np.concatenate([_SMOOTH_FINE * np.diff(np.eye(n), n=2, axis=0), level])


def _fit_cloth(
    values: Float64Array, slants: Float64Array, half: Float64Array
) -> tuple[float, Float64Array, Float64Array]:
    """w, P, Q (91,) of w P(theta_i) Q(theta_h) P(theta_o): least squares of logarithms; slants, half: weights (N, n) of
    the nodes of P and Q."""
    rows = np.concatenate([slants, half], axis=1)
    square = rows.T @ rows + 1e-3 * np.eye(rows.shape[1])
    for part, n in ((slice(0, _N_COARSE), _N_COARSE), (slice(_N_COARSE, None), _N_FINE)):
        square[part, part] += _bending(n).T @ _bending(n)
    found = np.linalg.solve(square, rows.T @ np.log(values + DARK))
    p, q = (_nodes(part) for part in np.split(found, [_N_COARSE]))
    return float(p.max() ** 2 * q.max()), normalize_curve(p), normalize_curve(q)


def _nodes(logs: Float64Array) -> Float64Array:
    """A curve at the 91 nodes of a measurement, from its logarithms at fewer nodes of the same spacing."""
    return np.asarray(np.exp(np.interp(np.linspace(0.0, len(logs) - 1.0, N_NODES), np.arange(len(logs)), logs)))


def _log_rms(values: Float64Array, fit: Float64Array) -> float:
    apart = np.log((values + DARK) / (fit + DARK))
    return float(np.sqrt((apart * apart).mean()))


def _product(factors: Factors, angles: Mapping[str, Float64Array]) -> Float64Array:
    """The diffuse part and the highlight (N, 3), of an isotropic surface, at angles (N,) of each curve."""
    slants = [factors.at(name, angles[name]) for name in ("theta_i", "theta_o")]
    highlight = [factors.at(name, angles[name]) for name in ("theta_h", "theta_d")]
    shapes = [factors.at("s", angles[name]) for name in ("theta_i", "theta_o")]
    return np.asarray(
        factors.strengths["diffuse"] * slants[0] * slants[1]
        + factors.product * highlight[0] * highlight[1] * shapes[0] * shapes[1]
    )


def _table(samples: ScatteredSamples, factors: Factors) -> FilledTable:
    """The product of the factors on the grid, times the mean ratio of nearby samples to it."""
    from scipy.spatial import cKDTree

    angles = curve_angles(samples.wi, samples.wo)
    beyond = np.log((samples.values + DARK) / (_product(factors, angles) + DARK))
    places = _places(samples.wi, samples.wo)
    mirrored = _places(samples.wi, samples.wo, mirrored=True)
    tree = cKDTree(np.concatenate([places, mirrored]))
    beyond = np.concatenate([beyond, beyond])
    wi, wo = (v.reshape(-1, 3) for v in grid_directions(_EVERY))
    distance, nearest = tree.query(_places(wi, wo), k=_NEIGHBOURS)
    width = 0.5 * distance[:, 1:2] + 1e-3
    weight = np.exp(-0.5 * (distance / width) ** 2)
    mean = np.einsum("nk,nkc->nc", weight, beyond[nearest]) / weight.sum(axis=1, keepdims=True)
    confidence = np.exp(-0.5 * (distance[:, :1] / _REACH) ** 2)
    coarse = (SHAPE[0], SHAPE[1], SHAPE[2] // _EVERY)
    product = _product(factors, curve_angles(wi, wo))
    logs = (np.log(product + DARK) + confidence * mean).reshape(*coarse, 3)
    table = np.maximum(np.exp(_between(logs)) - DARK, 0.0).astype(np.float32)
    above = ((wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)).reshape(coarse)
    measured = np.repeat((confidence > 0.5).reshape(coarse) & above, _EVERY, axis=2)
    return FilledTable(table, measured, _EVERY * int(above.sum()) - int(measured.sum()), samples.n_below)


def _places(wi: Float64Array, wo: Float64Array, mirrored: bool = False) -> Float64Array:
    """Coordinates of pairs of directions in which distance means difference: phi_d has no effect at theta_h = 0 and
    theta_d = 0."""
    theta_h, theta_d, phi_d = half_and_difference(wi, wo)
    turn = 2.0 * (np.pi - phi_d if mirrored else phi_d)
    reach = 0.2 * np.sin(theta_d) * np.minimum(theta_h / np.radians(30.0), 1.0)
    return np.stack([np.sqrt(theta_h / HALF_PI), theta_d / HALF_PI, reach * np.cos(turn), reach * np.sin(turn)], axis=1)


def _between(coarse: Float64Array) -> Float64Array:
    """Interpolate all phi_d linearly from every sixth, with wrap-around."""
    following = np.roll(coarse, -1, axis=2)
    steps = [coarse + (k / _EVERY) * (following - coarse) for k in range(_EVERY)]
    return np.stack(steps, axis=3).reshape(*SHAPE, 3)
