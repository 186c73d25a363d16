"""Finds the change of a curve that brings pixels to given radiances: non-negative least squares.

The radiance of a pixel is linear in the band values of one curve [BenArtzi07, eq. 4.16]. With rows A (n, J) of the
pixels, the change d (J,) of the band values c, the missing radiance r (n,) and weights w (n,), for each channel

    minimize  sum_p w_p (A_p d - r_p)^2  +  h n/n_h sum_q w_q (A_q d)^2  +  s t (l^4 |D x|^2 + |x|^2),   d >= -c.

The second sum holds n_h other pixels q of the object as they are, with the weight h. x = d / rho is the change relative
to the curve's own size rho (J,), because the values of a highlight span decades; D takes second differences by the
angle, l is the angle over which a change that no pixel asks for fades away, and t, the mean diagonal of the matrix of
both sums in terms of x, makes the smoothness s a number without unit.

All of this depends on pixels through J x J matrices alone, so that many
pixels cost little more than few. The bound is solved as a problem with x >= 0 by scipy [Lawson74].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.curve.tables import HALF_PI

Float64Array = NDArray[np.float64]

# In place of a curve's name: a layer's scale, which is solved for like a curve of one band whose value is 1.
SCALE = "scale"
SMOOTHNESS = 1e-6
HOLDING = 0.1
# l, radians.
FADING = 0.1
# The least size of a curve, relative to its largest value, that a relative change is measured against.
LEAST_SIZE = 1e-3
# The error of a radiance that is not otherwise known, relative to it and to the mean of all.
RELATIVE_ERROR, MEAN_ERROR = 0.01, 0.01
# Multiplications in one product of matrices that a BLAS leaves to one thread. On a machine that does much else, its
# threads wait for each other: 8,192 pixels of 32 bands took 1 s at once, and take 0.02 s in parts.
_UNTHREADED = 2**18
# Keeps the factorization of singular equations going, relative to their diagonal.
_JITTER = 1e-12


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """What pixels say of a curve's change: gram (3, J, J) = AᵀWA, moments (3, J) = AᵀWr."""

    gram: Float64Array
    moments: Float64Array
    n_pixels: int

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(self.gram + other.gram, self.moments + other.moments, self.n_pixels + other.n_pixels)

    def times(self, weight: float) -> NormalEquations:
        """The same with all weights multiplied."""
        return NormalEquations(weight * self.gram, weight * self.moments, self.n_pixels)


@dataclass(frozen=True, eq=False)
class CurveFit:
    """change (J, 3) of the band values, and deviation (J, 3): its standard deviation where weights are 1 / variance,
    at most the size of the curve, where pixels say nothing."""

    change: Float64Array
    deviation: Float64Array


def normal_equations(
    rows: NDArray[np.floating], missing: NDArray[np.floating], weights: NDArray[np.floating]
) -> NormalEquations:
    """The equations of pixels: rows (J, n, 3) band by band, missing radiance (n, 3), weights (n,) or (n, 3).

    Rows and radiances may have any unit that all pixels share. Pixels that are not finite count for nothing.
    """
    n_bands, n, _ = rows.shape
    weights = np.broadcast_to(weights if weights.ndim == 2 else weights[:, None], (n, 3)).astype(np.float64)
    gram, moments = np.zeros((3, n_bands, n_bands)), np.zeros((3, n_bands))
    block = max(_UNTHREADED // n_bands**2, 8)
    for begin in range(0, n, block):
        some = slice(begin, begin + block)
        for channel in range(3):
            a = rows[:, some, channel].astype(np.float64)
            r, w = missing[some, channel].astype(np.float64), weights[some, channel]
            sound = np.isfinite(r) & np.isfinite(w) & np.isfinite(a).all(axis=0)
            if not sound.all():
                a, r, w = a[:, sound], r[sound], w[sound]
            weighted = a * w
            gram[channel] += weighted @ a.T
            moments[channel] += weighted @ r
    return NormalEquations(gram, moments, n)


def radiance_weights(radiance: NDArray[np.floating], relative: float = RELATIVE_ERROR) -> Float64Array:
    """Weights (n, 3) of radiances (n, 3): 1 / variance for an error of so much of each, and of the mean of all."""
    radiance = np.where(np.isfinite(radiance), np.abs(radiance), 0.0).astype(np.float64)
    error = relative * radiance + MEAN_ERROR * (radiance.mean() if radiance.size else 0.0)
    smallest = np.finfo(np.float64).tiny ** 0.25
    return 1.0 / np.maximum(error, smallest) ** 2


def fit_change(
    equations: NormalEquations, curve: Float64Array, held: NormalEquations | None = None,
    smoothness: float = SMOOTHNESS, holding: float = HOLDING, in_grey: bool = False, counts: Sequence[int] = (),
    prior: float | None = None, noise: float = 1.0,
) -> CurveFit:  # fmt: skip
    """The change of a curve (J, 3) that fits the equations best. held: those of pixels that are to stay as they are,
    with weight `holding` relative to all others together; smoothness: from 0, stiffer where it is larger; in_grey: the
    change relative to the curve's size is the same in all channels, so that the curve keeps its hues; counts: the
    numbers of bands of several curves that lie behind each other in J, none for one curve; prior: in place
    of s t, the weight of a penalty that 1 makes that of changes of the curve's own size, by standard deviation, beside
    weights of 1 / variance; noise: how much larger the errors of pixels are than these weights say."""
    counts = counts or (len(curve),)
    if held is not None and held.n_pixels:
        equations = equations + held.times(holding * max(equations.n_pixels, 1) / held.n_pixels)
    size = np.concatenate([curve_size(each) for each in np.split(curve, np.cumsum(counts)[:-1])])
    penalty = roughness_matrix(counts)
    if prior is None:
        penalty *= smoothness
    else:  # as it is, the penalty alone would leave each band this variance
        penalty *= prior * noise**2 * float(np.linalg.inv(penalty).diagonal().mean())
    # In terms of x, for each channel.
    matrices = equations.gram * size.T[:, :, None] * size.T[:, None, :]
    vectors, lowest = equations.moments * size.T, (-curve / size).T
    if in_grey:
        # A channel that has less than its size in a band ends at 0 there, and does not stop the others.
        x, variance = _fit_channel(
            matrices.sum(axis=0), vectors.sum(axis=0), lowest.min(axis=0), penalty, prior is None
        )
        deviation = np.minimum(noise * np.sqrt(variance), 1.0)
        return CurveFit(np.maximum(size * x[:, None], -curve), size * deviation[:, None])
    fits = [_fit_channel(*channel, penalty, prior is None) for channel in zip(matrices, vectors, lowest, strict=True)]
    x, variance = (np.stack(part, axis=1) for part in zip(*fits, strict=True))
    return CurveFit(size * x, size * np.minimum(noise * np.sqrt(variance), 1.0))


def curve_size(curve: Float64Array) -> Float64Array:
    """rho (J, 3): the values that a change of a curve (J, 3) is measured against, all above 0."""
    largest = curve.max()
    if not largest > 0.0:
        return np.ones_like(curve)
    return np.maximum(curve, LEAST_SIZE * np.maximum(curve.max(axis=0), LEAST_SIZE * largest))


def _fit_channel(
    matrix: Float64Array, vector: Float64Array, lowest: Float64Array, penalty: Float64Array, is_relative: bool
) -> tuple[Float64Array, Float64Array]:
    """x (J,) of one channel, at least `lowest`, and its variance, infinite without any light; penalty (J, J), relative
    to t or as it is."""
    mean = float(matrix.diagonal().mean())
    if not mean > 0.0:  # no light meets the curve
        return np.zeros_like(vector), np.full_like(vector, np.inf)
    matrix = matrix + penalty * (mean if is_relative else 1.0)
    matrix[np.diag_indices_from(matrix)] += _JITTER * mean
    x = _bounded_minimum(matrix / mean, vector / mean, lowest)
    variance = np.linalg.inv(matrix / mean).diagonal() / mean
    return x, np.maximum(variance, 0.0)


def roughness_matrix(counts: Sequence[int]) -> Float64Array:
    """l^4 DᵀD + 1, (J, J), of curves of so many bands that lie behind each other."""
    matrix = np.eye(sum(counts))
    for end, n_bands in zip(np.cumsum(counts), counts, strict=True):
        own = slice(end - n_bands, end)
        differences = np.diff(np.eye(n_bands), 2, axis=0)
        matrix[own, own] += (FADING * n_bands / HALF_PI) ** 4 * differences.T @ differences
    return matrix


def _bounded_minimum(matrix: Float64Array, vector: Float64Array, lowest: Float64Array) -> Float64Array:
    """argmin of ½ xᵀMx - vᵀx over x >= lowest, M (J, J) positive definite.

    With M = RᵀR and y = x - lowest it is |Ry - R⁻ᵀ(v - M lowest)| over y >= 0.
    """
    from scipy.linalg import cho_factor, cho_solve, solve_triangular  # late: the window's process never solves
    from scipy.optimize import nnls

    factor, is_lower = cho_factor(matrix)
    free = np.asarray(cho_solve((factor, is_lower), vector))
    if (free >= lowest).all():
        return free
    root = np.triu(factor)
    wanted = solve_triangular(root, vector - matrix @ lowest, trans="T")
    return np.asarray(nnls(root, wanted, maxiter=30 * len(vector))[0]) + lowest
