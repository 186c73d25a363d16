"""Whether directions were drawn with a density, by counting them in the triangles of a geodesic sphere."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from engine.sphere.geodesic import geodesic, locate

_BINS, _FINE = 2, 7
_FEWEST = 8.0


def p_of_directions(drawn: NDArray, pdf: Callable[[NDArray], NDArray]) -> float:
    """The chance of counts as far from the density's as those of directions (N, 3); pdf (n, 3) -> (n,) per steradian.

    The density is integrated over 320 triangles, by 1,024 places in each; where it does not come to 1, the rest is for
    directions in which it is 0, one bin more. Bins in which few are expected are counted together.
    """
    sphere, n_bins = geodesic(_FINE), geodesic(_BINS).n_triangles
    density = pdf(sphere.centres)
    mass = (density * sphere.solid_angles).reshape(n_bins, -1).sum(axis=1)
    inside = pdf(drawn) > 0.0
    counts = np.append(np.bincount(locate(drawn[inside], _BINS), minlength=n_bins), (~inside).sum())
    expected = len(drawn) * np.append(mass, max(1.0 - mass.sum(), 0.0))
    few = expected < _FEWEST
    counts = np.append(counts[~few], counts[few].sum())
    expected = np.append(expected[~few], expected[few].sum())
    counts, expected = (each[expected > _FEWEST] for each in (counts, expected))
    return float(chdtrc(len(counts) - 1, ((counts - expected) ** 2 / expected).sum()))
