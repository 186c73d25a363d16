"""Bands of a lobe without rings.

A lobe that is cut off after n bands swings below zero and up again on its far side, so that a small bright light
draws black and white rings. A fixed window (Hann, Lanczos) leaves 3 to 5 % of the peak below zero, and blurs broad
lobes that need none. So the bands are moved to the nearest ones, by the square integral over the sphere, whose lobe
falls from its axis to its far side, and there is no less than zero; the mean stays. Under no light does such a lobe
give more than the light's most or less than its least, times its mean.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

Float64Array = NDArray[np.float64]

_N_ANGLES = 65  # at which the lobe must fall


def without_rings(bands: ArrayLike) -> Float64Array:
    """The nearest bands (n,) to those of a lobe, its integrals with the Legendre polynomials, whose lobe
    sum_l (2l+1)/(4 pi) bands_l P_l(cos theta) only falls from its axis on; the first one as it is.

    The least v with G v >= d [Lawson74, ch. 23], v the change in an orthonormal basis: d is what the lobe lacks of
    falling at some angles, and of zero at its far side.
    """
    given = np.asarray(bands, np.float64)
    root = np.sqrt(2.0 * np.arange(len(given)) + 1.0)
    falls = _falls(len(given))
    lacks = -(falls @ (root * given))
    change = falls[:, 1:]  # the first band stays
    if len(given) == 1 or (lacks <= 0.0).all():
        return given.copy()
    equations = np.vstack([change.T, lacks])
    target = np.zeros(len(equations))
    target[-1] = 1.0
    residual = equations @ nnls(equations, target)[0] - target
    result = given.copy()
    result[1:] -= residual[:-1] / residual[-1] / root[1:]
    return result


@cache
def _falls(n: int) -> Float64Array:
    """Rows: the slope of each normalized band by the cosine, at angles between axis and far side; last, its value
    there."""
    cosine, every = np.cos(np.linspace(0.0, np.pi, _N_ANGLES)), np.eye(n)
    slopes = [legendre.legval(cosine, legendre.legder(row)) for row in every]
    ends = [legendre.legval(-1.0, row) for row in every]
    return np.sqrt(2.0 * np.arange(n) + 1.0) * np.vstack([np.array(slopes).T, ends])
