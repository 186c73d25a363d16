"""Compiled fit of zonal lobes to vectors of spherical harmonics, point by point.

For given axes the best coefficients of each band are those of a small linear system, whose matrix is a Legendre
polynomial of the axes' cosines; so only the axes are searched for (variable projection), where [Sloan05, 4.1] searches
for axes and coefficients at once. A ridge on the coefficients keeps them bounded where two axes meet.
Kernels never validate: `engine.realtime.zonal_harmonics.zonal` does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.sphere._harmonic_kernels import basis_at

Float64Array = NDArray[np.float64]

RIDGE = 1e-6  # of a lobe's own weight in the system
_STEPS = 100
_LEAST_GAIN = 1e-7  # of the error: a step that gains less is the last
_FIRST_TURN, _LARGEST_TURN = 0.1, 0.5  # radians
_ARMIJO = 1e-4  # of the gain that the slope promises
_INVERSE_4PI = 0.25 / math.pi


@njit(cache=True, nogil=True, error_model="numpy")
def fit_range(
    targets: Float64Array, first: int, n_restarts: int, enough: float, scan: Float64Array, scanned: Float64Array,
    start: int, stop: int, axes: Float64Array, coefficients: Float64Array, errors: Float64Array,
) -> None:  # fmt: skip
    """Fit the bands from `first` on of targets[start:stop] (P, n^2).

    n_restarts: how often random axes are tried where the error is above `enough` of the vector's length.
    scan (D, 3), scanned (D, n^2): directions that a lobe may begin with, and the harmonics there.
    axes (P, N, 3), coefficients (P, N, n), errors (P,): filled.
    """
    n_lobes, n = axes.shape[1], coefficients.shape[2]
    work, single = _make_work(n_lobes, n), _make_work(1, n)
    trial = np.empty((n_lobes, 3))
    for point in range(start, stop):
        target = targets[point]
        length = _length(target, 0)
        if not _length(target, first) > 0.0:  # nothing to fit: no lobe, about any axis
            axes[point], coefficients[point], errors[point] = 0.0, 0.0, 0.0
            axes[point, :, 2] = 1.0
            continue
        _add_greedily(target, first, scan, scanned, axes[point], single)
        errors[point] = _search(target, first, axes[point], work)
        _copy_rows(work.coefficients, coefficients[point])
        seed = np.uint64(point)
        for _ in range(n_restarts if n_lobes > 1 else 0):
            if errors[point] <= enough * length:
                break
            seed = _scatter(seed, trial)
            error = _search(target, first, trial, work)
            if error < errors[point]:
                _copy_rows(trial, axes[point])
                _copy_rows(work.coefficients, coefficients[point])
                errors[point] = error


class _Work(NamedTuple):
    """What a fit of N lobes of order n works in."""

    legendre: Float64Array  # (n, n + 1)
    basis: Float64Array  # (N, n^2) of the lobes' axes
    slopes: Float64Array  # (N, n^2, 3)
    system: Float64Array  # (N, N), of a band
    coefficients: Float64Array  # (N, n): g*, 0 in the bands below the first
    rest: Float64Array  # (n^2,): what they leave of the target, 0 in the bands below the first
    gradient: Float64Array  # (N, 3): of the squared error, as the axes turn
    before: Float64Array  # (N, 3): the gradient where a step began
    end: Float64Array  # (N, 3): the axes where it ends
    step: Float64Array  # (N, 3)
    product: Float64Array  # (N, 3)
    inverse: Float64Array  # (3N, 3N): of the Hessian, as BFGS knows it


@njit(cache=True, nogil=True)
def _make_work(n_lobes: int, n: int) -> _Work:
    return _Work(
        np.zeros((n, n + 1)), np.empty((n_lobes, n * n)), np.empty((n_lobes, n * n, 3)), np.empty((n_lobes, n_lobes)),
        np.zeros((n_lobes, n)), np.zeros(n * n), np.empty((n_lobes, 3)), np.empty((n_lobes, 3)), np.empty((n_lobes, 3)),
        np.empty((n_lobes, 3)), np.empty((n_lobes, 3)), np.empty((3 * n_lobes, 3 * n_lobes)),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _copy_rows(rows: Float64Array, out: Float64Array) -> None:
    """Number by number: for whole arrays the compiler makes the words of an error, which takes longer than a fit."""
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            out[i, k] = rows[i, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_greedily(
    target: Float64Array, first: int, scan: Float64Array, scanned: Float64Array, axes: Float64Array, work: _Work
) -> None:
    """Axes one by one, each the best for what those before it leave."""
    rest = target.copy()
    for i in range(axes.shape[0]):
        best = _best_of(rest, first, scanned)
        for c in range(3):
            axes[i, c] = scan[best, c]
        _search(rest, first, axes[i : i + 1], work)
        for k in range(rest.shape[0]):
            rest[k] = work.rest[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _best_of(target: Float64Array, first: int, scanned: Float64Array) -> int:
    """The direction along which a single lobe leaves least of the target (eq. 18)."""
    best, most, n = 0, -1.0, int(math.sqrt(float(target.shape[0])))
    for d in range(scanned.shape[0]):
        gain = 0.0
        for l in range(first, n):  # noqa: E741
            along = 0.0
            for k in range(l * l, (l + 1) * (l + 1)):
                along += scanned[d, k] * target[k]
            gain += along * along / (2 * l + 1)
        if gain > most:
            best, most = d, gain
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def _scatter(seed: np.uint64, axes: Float64Array) -> np.uint64:
    """Random axes, not yet of length 1; the next seed [Knuth97, 3.3.4]."""
    for i in range(axes.shape[0]):
        for c in range(3):
            seed = seed * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
            axes[i, c] = (seed >> np.uint64(11)) * 2.0**-52 - 1.0
    return seed


@njit(cache=True, nogil=True, error_model="numpy")
def _length(values: Float64Array, first: int) -> float:
    """Of a vector from the band `first` on."""
    total = 0.0
    for k in range(first * first, values.shape[0]):
        total += values[k] * values[k]
    return math.sqrt(total)


@njit(cache=True, nogil=True, error_model="numpy")
def _search(target: Float64Array, first: int, axes: Float64Array, work: _Work) -> float:
    """Turn the axes to where the error is least around, by BFGS; `work` has their coefficients. The error's length."""
    error = _evaluate(target, first, axes, work)
    largest = _largest(work.gradient)
    _diagonal(work.inverse, _FIRST_TURN / max(largest, 1e-300))
    for step in range(_STEPS if largest > 0.0 else 0):
        slope = _point_downhill(work)
        if not slope < 0.0:
            break
        _copy_rows(work.gradient, work.before)
        share, next_error = 1.0, math.inf
        while share > 1e-6:
            for i in range(axes.shape[0]):
                for c in range(3):
                    work.end[i, c] = axes[i, c] + share * work.step[i, c]
            next_error = _evaluate(target, first, work.end, work)
            if next_error <= error + _ARMIJO * share * slope:
                break
            share *= 0.5
        if not next_error < error:
            break
        _copy_rows(work.end, axes)
        work.step[:] *= share
        gain, error = error - next_error, next_error
        if gain < _LEAST_GAIN * error:
            break
        _learn(work, step == 0)
    _evaluate(target, first, axes, work)
    return _length(work.rest, first)


@njit(cache=True, nogil=True, error_model="numpy")
def _evaluate(target: Float64Array, first: int, axes: Float64Array, work: _Work) -> float:
    """The squared error, ridge and all, of the best coefficients about these axes, which become of length 1, and its
    gradient.

    The coefficients being the best, only the axes' own part is left of the gradient (eq. 20, 21).
    """
    n_lobes, n = work.coefficients.shape
    for i in range(n_lobes):
        length = math.sqrt(axes[i, 0] ** 2 + axes[i, 1] ** 2 + axes[i, 2] ** 2)
        if not length > 1e-30:
            axes[i, 0], axes[i, 1], axes[i, 2], length = 0.0, 0.0, 1.0, 1.0
        axes[i] /= length
        basis_at(axes[i, 0], axes[i, 1], axes[i, 2], work.legendre, work.basis[i], work.slopes[i])
    error = 0.0
    work.gradient[:] = 0.0
    for l in range(first, n):  # noqa: E741
        error += _evaluate_band(target, l, work)
    for i in range(n_lobes):
        outward = 0.0
        for c in range(3):
            outward += work.gradient[i, c] * axes[i, c]
        for c in range(3):
            work.gradient[i, c] -= outward * axes[i, c]
    return error


@njit(cache=True, nogil=True, error_model="numpy")
def _evaluate_band(target: Float64Array, l: int, work: _Work) -> float:  # noqa: E741
    """Its coefficients by the normal equations, its part of the error and of the gradient."""
    n_lobes = work.coefficients.shape[0]
    low, high = l * l, (l + 1) * (l + 1)
    ridge = RIDGE * (2 * l + 1) * _INVERSE_4PI
    for i in range(n_lobes):
        for j in range(i + 1):
            total = 0.0
            for k in range(low, high):
                total += work.basis[i, k] * work.basis[j, k]
            work.system[i, j] = total
        work.system[i, i] += ridge
        along = 0.0
        for k in range(low, high):
            along += work.basis[i, k] * target[k]
        work.coefficients[i, l] = along
    _solve(work.system, work.coefficients, l)
    error = 0.0
    for i in range(n_lobes):
        error += ridge * work.coefficients[i, l] ** 2
    for k in range(low, high):
        rest = target[k]
        for i in range(n_lobes):
            rest -= work.basis[i, k] * work.coefficients[i, l]
        error += rest * rest
        work.rest[k] = rest
        for i in range(n_lobes):
            for c in range(3):
                work.gradient[i, c] -= 2.0 * rest * work.coefficients[i, l] * work.slopes[i, k, c]
    return error


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(system: Float64Array, values: Float64Array, l: int) -> None:  # noqa: E741
    """values[:, l] by a positive definite system, of which the lower half is given; by Cholesky, in place."""
    size = system.shape[0]
    for i in range(size):
        for j in range(i + 1):
            total = system[i, j]
            for k in range(j):
                total -= system[i, k] * system[j, k]
            system[i, j] = math.sqrt(max(total, 1e-300)) if i == j else total / system[j, j]
    for i in range(size):
        for k in range(i):
            values[i, l] -= system[i, k] * values[k, l]
        values[i, l] /= system[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            values[i, l] -= system[k, i] * values[k, l]
        values[i, l] /= system[i, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _point_downhill(work: _Work) -> float:
    """The next step, no axis by more than the largest turn; how the error slopes along it."""
    step, gradient = work.step.reshape(-1), work.gradient.reshape(-1)
    for a in range(step.shape[0]):
        total = 0.0
        for b in range(step.shape[0]):
            total -= work.inverse[a, b] * gradient[b]
        step[a] = total
    largest = _largest(work.step)
    if largest > _LARGEST_TURN:
        step *= _LARGEST_TURN / largest
    slope = 0.0
    for a in range(step.shape[0]):
        slope += step[a] * gradient[a]
    return slope


@njit(cache=True, nogil=True, error_model="numpy")
def _learn(work: _Work, is_first: bool) -> None:
    """What the gradient's change over the last step says of the inverse Hessian [Nocedal06, eq. 6.17, 6.20]."""
    step, change, product = work.step.reshape(-1), work.before.reshape(-1), work.product.reshape(-1)
    gradient, inverse = work.gradient.reshape(-1), work.inverse
    size = step.shape[0]
    curve, size2 = 0.0, 0.0
    for a in range(size):
        change[a] = gradient[a] - change[a]
        curve += step[a] * change[a]
        size2 += change[a] * change[a]
    if not curve > 1e-14 * math.sqrt(size2):
        return  # it bends the other way, and would make the matrix indefinite
    if is_first:
        _diagonal(inverse, curve / size2)
    bend = 0.0
    for a in range(size):
        total = 0.0
        for b in range(size):
            total += inverse[a, b] * change[b]
        product[a] = total
        bend += total * change[a]
    for a in range(size):
        for b in range(size):
            inverse[a, b] += (
                (1.0 + bend / curve) * step[a] * step[b] - step[a] * product[b] - product[a] * step[b]
            ) / curve


@njit(cache=True, nogil=True, error_model="numpy")
def _diagonal(matrix: Float64Array, value: float) -> None:
    matrix[:] = 0.0
    for a in range(matrix.shape[0]):
        matrix[a, a] = value


@njit(cache=True, nogil=True, error_model="numpy")
def _largest(vectors: Float64Array) -> float:
    largest = 0.0
    for i in range(vectors.shape[0]):
        largest = max(largest, vectors[i, 0] ** 2 + vectors[i, 1] ** 2 + vectors[i, 2] ** 2)
    return math.sqrt(largest)
