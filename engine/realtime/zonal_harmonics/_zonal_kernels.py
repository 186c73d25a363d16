"""Compiled fit of zonal lobes to vectors of spherical harmonics: point by point, and the error of lobes that are
bilinear between the nodes of a map.

For given axes, the best coefficients of each band solve a small linear system whose matrix is a Legendre polynomial of
the axes' cosines. So only the axes are searched (variable projection), where [Sloan05, 4.1] searches axes and
coefficients at once. A ridge term keeps the coefficients bounded where two axes coincide. Kernels never validate:
`engine.realtime.zonal_harmonics.zonal` and `engine.realtime.zonal_harmonics.wrinkle` do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.sphere._kernels import basis_at

Float64Array = NDArray[np.float64]

RIDGE = 1e-6  # relative to a lobe's own diagonal entry
_STEPS = 100
_LEAST_GAIN = 1e-7  # share of the error: the search ends when a step gains less
_FIRST_TURN, _LARGEST_TURN = 0.1, 0.5  # radians
_ARMIJO = 1e-4  # share of the gain that the slope predicts
_INVERSE_4PI = 0.25 / math.pi

FIRST = 2  # lower bands are stored exactly


@njit(cache=True, nogil=True, error_model="numpy")
def fit_range(
    targets: Float64Array, first: int, n_restarts: int, enough: float, scan: Float64Array, scanned: Float64Array,
    start: int, stop: int, axes: Float64Array, coefficients: Float64Array, errors: Float64Array,
) -> None:  # fmt: skip
    """Fit the bands from `first` on of targets[start:stop] (P, n^2).

    n_restarts: number of restarts from random axes while the error exceeds `enough` of the vector's length. scan (D,
    3), scanned (D, n^2): candidates for a lobe's first direction, and the harmonics there. Fills axes (P, N, 3),
    coefficients (P, N, n), errors (P,).
    """
    n_lobes, n = axes.shape[1], coefficients.shape[2]
    work, single = _make_work(n_lobes, n), _make_work(1, n)
    trial = np.empty((n_lobes, 3))
    for point in range(start, stop):
        target = targets[point]
        length = _length(target, 0)
        if not _length(target, first) > 0.0:  # nothing to fit: no lobe, any axis
            axes[point], coefficients[point], errors[point] = 0.0, 0.0, 0.0
            axes[point, :, 2] = 1.0
            continue
        # One lobe after the other on the residual, then all axes together [Sloan05, 4.1].
        _add_greedily(target, first, scan, scanned, axes[point], single)
        errors[point] = _search(target, first, axes[point], work)
        _copy_rows(work.coefficients, coefficients[point])
        # Restart from random axes while the error is high [Sloan05, 4.1].
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
    """Working memory for a fit of N lobes of order n."""

    legendre: Float64Array  # (n, n + 1)
    basis: Float64Array  # (N, n^2) at the lobes' axes
    slopes: Float64Array  # (N, n^2, 3), gradients of the basis
    system: Float64Array  # (N, N), of one band
    coefficients: Float64Array  # (N, n): g*, 0 in the bands below the first
    rest: Float64Array  # (n^2,): the residual, 0 in the bands below the first
    gradient: Float64Array  # (N, 3): of the squared error with respect to the axes
    before: Float64Array  # (N, 3): the gradient at the start of a step
    end: Float64Array  # (N, 3): the axes at its end
    step: Float64Array  # (N, 3)
    product: Float64Array  # (N, 3)
    inverse: Float64Array  # (3N, 3N): BFGS's approximation of the inverse Hessian


@njit(cache=True, nogil=True)
def _make_work(n_lobes: int, n: int) -> _Work:
    """Allocate the working memory."""
    return _Work(
        np.zeros((n, n + 1)), np.empty((n_lobes, n * n)), np.empty((n_lobes, n * n, 3)), np.empty((n_lobes, n_lobes)),
        np.zeros((n_lobes, n)), np.zeros(n * n), np.empty((n_lobes, 3)), np.empty((n_lobes, 3)), np.empty((n_lobes, 3)),
        np.empty((n_lobes, 3)), np.empty((n_lobes, 3)), np.empty((3 * n_lobes, 3 * n_lobes)),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _copy_rows(rows: Float64Array, out: Float64Array) -> None:
    """Copy element by element: for whole arrays the compiler generates error messages, which takes longer than a
    fit."""
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            out[i, k] = rows[i, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_greedily(
    target: Float64Array, first: int, scan: Float64Array, scanned: Float64Array, axes: Float64Array, work: _Work
) -> None:
    """Add axes one by one, each the best for the residual of those before."""
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
    """Find the direction along which a single lobe leaves the smallest residual [Sloan05, eq. 18]."""
    best, most, n = 0, -1.0, int(math.sqrt(float(target.shape[0])))
    for d in range(scanned.shape[0]):
        gain = 0.0
        for l in range(first, n):  # noqa: E741
            along = 0.0
            for k in range(l * l, (l + 1) * (l + 1)):
                # The gain of the best coefficient: (Σ_m y_lm t_lm)^2 / Σ_m y_lm^2, whose denominator is (2l + 1) / (4
                # pi).
                along += scanned[d, k] * target[k]
            gain += along * along / (2 * l + 1)
        if gain > most:
            best, most = d, gain
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def _scatter(seed: np.uint64, axes: Float64Array) -> np.uint64:
    """Random axes, not normalized; returns the next seed [Knuth97, 3.3.4]."""
    for i in range(axes.shape[0]):
        for c in range(3):
            seed = seed * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
            axes[i, c] = (seed >> np.uint64(11)) * 2.0**-52 - 1.0
    return seed


@njit(cache=True, nogil=True, error_model="numpy")
def _length(values: Float64Array, first: int) -> float:
    """Length of a vector's bands from `first` on."""
    total = 0.0
    for k in range(first * first, values.shape[0]):
        total += values[k] * values[k]
    return math.sqrt(total)


@njit(cache=True, nogil=True, error_model="numpy")
def _search(target: Float64Array, first: int, axes: Float64Array, work: _Work) -> float:
    """Minimize the error over the axes by BFGS; `work` then holds the coefficients. Returns the length of the
    residual."""
    error = _evaluate(target, first, axes, work)
    largest = _largest(work.gradient)
    # The first inverse Hessian: such that the first step turns the axes by _FIRST_TURN.
    _diagonal(work.inverse, _FIRST_TURN / max(largest, 1e-300))
    for step in range(_STEPS if largest > 0.0 else 0):
        slope = _point_downhill(work)
        if not slope < 0.0:
            break
        # Backtracking line search with Armijo's condition.
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
        # Accept the step; stop when it gains too little.
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
    """Normalize the axes, and compute the squared error of the best coefficients about them, ridge included, and its
    gradient.

    The coefficients are optimal, so the gradient has only the axes' part [Sloan05, eqs. 20 and 21].
    """
    n_lobes, n = work.coefficients.shape
    # Normalize the axes, and evaluate harmonics and their gradients there.
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
    # Keep the tangential part of the gradient: the axes stay on the sphere [Sloan05, eq. 21].
    for i in range(n_lobes):
        outward = 0.0
        for c in range(3):
            outward += work.gradient[i, c] * axes[i, c]
        for c in range(3):
            work.gradient[i, c] -= outward * axes[i, c]
    return error


@njit(cache=True, nogil=True, error_model="numpy")
def _evaluate_band(target: Float64Array, l: int, work: _Work) -> float:  # noqa: E741
    """Compute one band's coefficients by the normal equations, its part of the error, and add its part of the
    gradient."""
    n_lobes = work.coefficients.shape[0]
    low, high = l * l, (l + 1) * (l + 1)
    ridge = RIDGE * (2 * l + 1) * _INVERSE_4PI
    # Normal equations: A_ij = Σ_m y_lm(s_i) y_lm(s_j), b_i = Σ_m y_lm(s_i) t_lm.
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
    # Residual t - t~ [Sloan05, eq. 11] and squared error [Sloan05, eq. 17].
    for k in range(low, high):
        rest = target[k]
        for i in range(n_lobes):
            rest -= work.basis[i, k] * work.coefficients[i, l]
        error += rest * rest
        work.rest[k] = rest
        # Gradient by the axes [Sloan05, eq. 20].
        for i in range(n_lobes):
            for c in range(3):
                work.gradient[i, c] -= 2.0 * rest * work.coefficients[i, l] * work.slopes[i, k, c]
    return error


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(system: Float64Array, values: Float64Array, l: int) -> None:  # noqa: E741
    """Solve a positive definite system, given by its lower half, for values[:, l], by Cholesky factorization in
    place."""
    size = system.shape[0]
    # Factorize A = L L^T.
    for i in range(size):
        for j in range(i + 1):
            total = system[i, j]
            for k in range(j):
                total -= system[i, k] * system[j, k]
            system[i, j] = math.sqrt(max(total, 1e-300)) if i == j else total / system[j, j]
    # Solve L z = b, then L^T x = z.
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
    """Compute the quasi-Newton step, no axis by more than the largest turn; return the error's slope along it."""
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
    """Update the inverse Hessian by the gradient's change over the last step [Nocedal06, eq. 6.17, 6.20]."""
    step, change, product = work.step.reshape(-1), work.before.reshape(-1), work.product.reshape(-1)
    gradient, inverse = work.gradient.reshape(-1), work.inverse
    size = step.shape[0]
    # y: the gradient's change; curve = s·y.
    curve, size2 = 0.0, 0.0
    for a in range(size):
        change[a] = gradient[a] - change[a]
        curve += step[a] * change[a]
        size2 += change[a] * change[a]
    if not curve > 1e-14 * math.sqrt(size2):
        return  # negative curvature would make the matrix indefinite
    # Scale the first inverse Hessian by s·y / y·y [Nocedal06, eq. 6.20].
    if is_first:
        _diagonal(inverse, curve / size2)
    # product = H y, bend = y·H y.
    bend = 0.0
    for a in range(size):
        total = 0.0
        for b in range(size):
            total += inverse[a, b] * change[b]
        product[a] = total
        bend += total * change[a]
    # H += ((1 + y·H y / s·y) s s^T - s (H y)^T - (H y) s^T) / s·y [Nocedal06, eq. 6.17].
    for a in range(size):
        for b in range(size):
            inverse[a, b] += (
                (1.0 + bend / curve) * step[a] * step[b] - step[a] * product[b] - product[a] * step[b]
            ) / curve


@njit(cache=True, nogil=True, error_model="numpy")
def _diagonal(matrix: Float64Array, value: float) -> None:
    """Set a matrix to a multiple of the identity."""
    matrix[:] = 0.0
    for a in range(matrix.shape[0]):
        matrix[a, a] = value


@njit(cache=True, nogil=True, error_model="numpy")
def _largest(vectors: Float64Array) -> float:
    """Length of the longest of vectors (N, 3)."""
    largest = 0.0
    for i in range(vectors.shape[0]):
        largest = max(largest, vectors[i, 0] ** 2 + vectors[i, 1] ** 2 + vectors[i, 2] ** 2)
    return math.sqrt(largest)


@njit(cache=True, nogil=True, error_model="numpy")
def map_error(
    targets: Float64Array, places: Float64Array, axes: Float64Array, coefficients: Float64Array, start: int, stop: int,
    of_axes: Float64Array, of_coefficients: Float64Array,
) -> float:  # fmt: skip
    """Return the squared error of samples start to stop [Sloan05, eq. 17]; add its gradient with respect to the nodes
    [Sloan05, eqs. 19 to 21].

    targets (S, n^2) at places (S, 2) on the map, in nodes; axes (H, W, N, 3) of any length, coefficients (H, W, N, n).
    """
    n_rows, n_columns, n_lobes, n = coefficients.shape
    legendre, values, slopes = np.zeros((n, n + 1)), np.empty((n_lobes, n * n)), np.empty((n_lobes, n * n, 3))
    axis, size, share = np.empty((n_lobes, 3)), np.empty(n_lobes), np.empty((n_lobes, n))
    rest, turned, weight = np.empty(n * n), np.empty(3), np.empty(4)
    error = 0.0
    for s in range(start, stop):
        # The map's cell, and bilinear weights of its four nodes.
        row, column = min(int(places[s, 0]), n_rows - 2), min(int(places[s, 1]), n_columns - 2)
        down, right = places[s, 0] - row, places[s, 1] - column
        for r in range(2):
            for c in range(2):
                weight[2 * r + c] = (down if r else 1.0 - down) * (right if c else 1.0 - right)
        axis[:], share[:] = 0.0, 0.0
        # Interpolate axes and coefficients, normalize the axes, and evaluate the harmonics and their gradients there.
        for i in range(n_lobes):
            for corner in range(4):
                r, c = row + corner // 2, column + corner % 2
                for k in range(3):
                    axis[i, k] += weight[corner] * axes[r, c, i, k]
                for l in range(FIRST, n):  # noqa: E741
                    share[i, l] += weight[corner] * coefficients[r, c, i, l]
            size[i] = math.sqrt(max(axis[i, 0] ** 2 + axis[i, 1] ** 2 + axis[i, 2] ** 2, 1e-24))
            for k in range(3):
                axis[i, k] /= size[i]
            basis_at(axis[i, 0], axis[i, 1], axis[i, 2], legendre, values[i], slopes[i])
        # Residual t~ - t, with t~ by [Sloan05, eq. 11], and its squared length [Sloan05, eq. 17].
        for l in range(FIRST, n):  # noqa: E741
            for k in range(l * l, (l + 1) * (l + 1)):
                rest[k] = targets[s, k]
                for i in range(n_lobes):
                    rest[k] -= share[i, l] * values[i, k]
                error += rest[k] * rest[k]
        # Gradient by the coefficients [Sloan05, eq. 19] and by the axis [Sloan05, eq. 20].
        for i in range(n_lobes):
            turned[:] = 0.0
            for l in range(FIRST, n):  # noqa: E741
                along = 0.0
                for k in range(l * l, (l + 1) * (l + 1)):
                    along -= 2.0 * rest[k] * values[i, k]
                    for c in range(3):
                        turned[c] -= 2.0 * rest[k] * share[i, l] * slopes[i, k, c]
                for corner in range(4):
                    of_coefficients[row + corner // 2, column + corner % 2, i, l] += weight[corner] * along
            # The axis is normalized, so only the tangential part counts, divided by the length [Sloan05, eq. 21]; the
            # chain rule through the interpolation multiplies by the node's weight.
            outward = turned[0] * axis[i, 0] + turned[1] * axis[i, 1] + turned[2] * axis[i, 2]
            for corner in range(4):
                for c in range(3):
                    change = weight[corner] * (turned[c] - outward * axis[i, c]) / size[i]
                    of_axes[row + corner // 2, column + corner % 2, i, c] += change
    return error
