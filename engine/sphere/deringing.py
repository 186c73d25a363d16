"""Removes ringing from the bands of a zonal lobe.

A lobe truncated after n bands becomes negative and rises again on its far side, so that a small bright light draws
black and white rings. A fixed window (Hann, Lanczos) leaves 3 to 5 % of the peak below zero, and blurs broad lobes that
need no window. The bands are therefore moved to the nearest ones, by the square integral over the sphere, whose lobe
decreases from its axis to its far side and is at least zero there; the mean is preserved. Under any light, the response
of such a lobe lies between the light's least and greatest value, times the lobe's mean.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

Float64Array = NDArray[np.float64]

_N_ANGLES = 65  # angles at which the lobe must decrease


def without_rings(bands: ArrayLike) -> Float64Array:
    """The nearest bands (n,) to those of a lobe, its integrals with the Legendre polynomials, whose lobe sum_l
    (2l+1)/(4 pi) bands_l P_l(cos theta) decreases from its axis on; the first band is unchanged.

    Solves for the least v with G v >= d [Lawson74, ch. 23], where v is the change in an orthonormal basis, and d the
    amount by which the lobe violates the conditions at some angles, and non-negativity at its far side.
    """
    given = np.asarray(bands, np.float64)
    root = np.sqrt(2.0 * np.arange(len(given)) + 1.0)
    falls = _falls(len(given))
    lacks = -(falls @ (root * given))
    change = falls[:, 1:]  # the first band is unchanged
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
    """Rows: the slope of each normalised band by the cosine, at angles between axis and far side; last, its value at
    the far side."""
    cosine, every = np.cos(np.linspace(0.0, np.pi, _N_ANGLES)), np.eye(n)
    slopes = [legendre.legval(cosine, legendre.legder(row)) for row in every]
    ends = [legendre.legval(-1.0, row) for row in every]
    return np.sqrt(2.0 * np.arange(n) + 1.0) * np.vstack([np.array(slopes).T, ends])
