"""Thin membranes that transmit light: transfer in closed form, a single lobe about the normal [Sloan05, 4.2]."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.sphere.harmonics import basis, clamped_cosine


def membrane(translucency: ArrayLike, n: int) -> Zonal:
    """Lobes of order n for points of translucency alpha (P,) in [0, 1], in their own axes [Sloan05, eqs. 22 and 23].

    Light from above counts by its cosine, light from below by alpha times its cosine.
    """
    alpha = np.asarray(translucency, np.float64).reshape(-1, 1)
    if not ((alpha >= 0.0) & (alpha <= 1.0)).all():
        raise ValueError("translucency, expected 0 to 1")
    of_above = clamped_cosine(n) / np.pi  # irradiance to the radiance of a white Lambertian surface
    of_below = of_above * (-1.0) ** np.arange(n)
    coefficients = of_above + alpha * of_below
    low = np.zeros((len(alpha), 4))
    low[:, 0] = coefficients[:, 0] * basis([0.0, 0.0, 1.0], 1)[0]
    coefficients[:, 0] = 0.0
    axes = np.tile([0.0, 0.0, 1.0], (len(alpha), 1, 1))
    return Zonal(low, axes, coefficients[:, None], np.zeros(len(alpha)))
