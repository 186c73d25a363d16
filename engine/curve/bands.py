"""A curve over [0, domain] as the mean of its values in each of J equal bands [BenArtzi07, eq. 4.17].

Integrated, not point-sampled, so that nothing pops while a curve is dragged; and adaptively, because a highlight of
roughness 1e-4 is a hundred times narrower than a band. Gauss-Kronrod (3, 7) over all intervals at once; intervals
whose two answers disagree are halved and done again. The first partition is graded towards 0, where generated curves
have their spikes, and split at the `features` a curve may carry (engine.curve.operators.EditedCurve), where edited
ones jump. scipy.integrate.quad was rejected: one Python call a point, and scipy is slow to import.

Over an angle from a pole (the half vector and the normal, say) the mean is taken by solid angle, with weight sin γ. In
the first band the plain mean counts the pole too much: a GGX lobe of roughness 0.01 over 128 bands would reflect 1.28
times its energy, one of 0.001 9.6 times; by solid angle both reflect what they should.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from engine.curve.wavelet import check_band_count

Array = NDArray[np.float64]

HALF_PI = math.pi / 2
# Grading stops where a spike of the least roughness, 1e-4, is resolved.
FINEST_GRADE = 2e-5
MOST_ROUNDS = 17
# By which two rules may disagree; the better one is then far closer than that.
RELATIVE_TOLERANCE = 1e-5
# Share of the largest value below which a band need not be right to its own size.
ABSOLUTE_TOLERANCE = 1e-10

# Kronrod's extension of the three-point Gauss rule: nodes in [-1, 1] (the Gauss ones are 1, 3, 5).
_NODES = np.array([-0.9604912687080203, -0.7745966692414834, -0.4342437493468026, 0.0,
                   0.4342437493468026, 0.7745966692414834, 0.9604912687080203])  # fmt: skip
_KRONROD = 0.5 * np.array([0.1046562260264673, 0.2684880898683334, 0.4013974147759622, 0.4509165386584741,
                           0.4013974147759622, 0.2684880898683334, 0.1046562260264673])  # fmt: skip
_GAUSS = 0.5 * np.array([0.0, 5.0 / 9.0, 0.0, 8.0 / 9.0, 0.0, 5.0 / 9.0, 0.0])
_RULES = np.stack([_KRONROD, _GAUSS])


def band_means(
    curve: Callable[[Array], Array], n_bands: int, domain: float = HALF_PI, by_solid_angle: bool = False
) -> Array:
    """Mean of the curve over each of `n_bands` equal bands of [0, domain], plain or with weight sin γ: (J, 3).

    curve: angles (N,) in radians to values (N, 3); an attribute `features`, if there is one, names angles where it
    may jump. Relative error below 1e-6 in bands above 1e-4 of the largest; at a jump nobody announced, about
    2**-16 of the jump. Raises BandCountError unless J is a power of two.
    """
    n_bands = check_band_count(n_bands)
    edges = _partition(n_bands, domain, getattr(curve, "features", ()))
    left, width = edges[:-1], np.diff(edges)
    band = np.minimum((left + 0.5 * width) * (n_bands / domain), n_bands - 1).astype(np.intp)
    density = _densities(n_bands, domain, by_solid_angle)
    weighted = (lambda g: curve(g) * np.sin(g)[:, None]) if by_solid_angle else curve
    means = np.zeros((n_bands, 3))
    near = means
    for _ in range(MOST_ROUNDS):
        share, error = _integrate(weighted, left, width, density[band])
        near = means.copy()
        _accumulate(near, band, share)
        tolerated = RELATIVE_TOLERANCE * np.abs(near) + ABSOLUTE_TOLERANCE * np.abs(near).max()
        wrong = (error > tolerated[band]).any(axis=1)
        if not wrong.any():
            break
        _accumulate(means, band[~wrong], share[~wrong])
        half = 0.5 * width[wrong]
        left = np.concatenate([left[wrong], left[wrong] + half])
        width, band = np.tile(half, 2), np.tile(band[wrong], 2)
    return near


def _partition(n_bands: int, domain: float, features: tuple[float, ...]) -> Array:
    """Band edges, the grades towards 0, and the features: increasing angles from 0 to the domain's end."""
    edges = np.arange(n_bands + 1) * (domain / n_bands)
    n_grades = max(0, math.ceil(math.log2(edges[1] / FINEST_GRADE)))
    inner = np.array([f for f in features if 0.0 < f < domain], dtype=float)
    points = np.concatenate([edges, edges[1] * 0.5 ** np.arange(1, n_grades + 1), inner])
    return np.unique(points)


def _densities(n_bands: int, domain: float, by_solid_angle: bool) -> Array:
    """One over the integral of the weight over each band, (J,)."""
    if not by_solid_angle:
        return np.full(n_bands, n_bands / domain)
    edges = np.arange(n_bands + 1) * (domain / n_bands)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * domain / n_bands
    return 1.0 / (2.0 * np.sin(middle) * math.sin(half))


def _integrate(curve: Callable[[Array], Array], left: Array, width: Array, density: Array) -> tuple[Array, Array]:
    """Each interval's share of its band's mean (I, 3), and how far the Gauss rule is from it."""
    nodes = left[:, None] + width[:, None] * (0.5 + 0.5 * _NODES)
    values = curve(nodes.ravel()).reshape(left.size, _NODES.size, 3)
    kronrod, gauss = np.einsum("rn,inc->ric", _RULES, values) * (width * density)[:, None]
    return kronrod, np.abs(kronrod - gauss)


def _accumulate(means: Array, band: NDArray[np.intp], share: Array) -> None:
    for channel in range(3):
        means[:, channel] += np.bincount(band, share[:, channel], minlength=means.shape[0])
