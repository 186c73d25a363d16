"""Reflectance of a smooth surface over the angle to its normal."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def conductor_fresnel(cosine: Array, eta: Array, k: Array) -> Array:
    """Exact unpolarized reflectance of an interface with complex index eta + i k, in [0, 1].

    cosine, eta and k broadcast; cosine in [0, 1] is of the angle between light and the (micro)facet. k = 0 is a
    dielectric: eta < 1 reflects totally beyond the critical angle, eta = 1 reflects nothing. At cosine = 0 the value is
    1, except 0 for eta = 1, k = 0, the limit from smaller angles. [Walter07, eq. 22] for dielectrics; the general form
    as in any optics text, with

        2 a^2 = sqrt(t^2 + 4 eta^2 k^2) + t,  2 b^2 = sqrt(t^2 + 4 eta^2 k^2) - t,  t = eta^2 - k^2 - sin^2,
        R_s = ((a - cos)^2 + b^2) / ((a + cos)^2 + b^2),
        R_p = R_s ((a cos - sin^2)^2 + b^2 cos^2) / ((a cos + sin^2)^2 + b^2 cos^2),   F = (R_s + R_p) / 2.
    """
    cos2 = cosine * cosine
    sin2 = 1.0 - cos2
    t = (eta - 1.0) * (eta + 1.0) - k * k + cos2  # eta^2 - k^2 - sin^2 without its cancellation at eta = 1
    root = np.sqrt(t * t + 4.0 * (eta * k) ** 2)
    a = np.sqrt(np.maximum(0.5 * (root + t), 0.0))
    b2 = np.maximum(0.5 * (root - t), 0.0)
    r_s = _ratio((a - cosine) ** 2 + b2, (a + cosine) ** 2 + b2)
    r_p = r_s * _ratio((a * cosine - sin2) ** 2 + b2 * cos2, (a * cosine + sin2) ** 2 + b2 * cos2)
    return np.asarray(0.5 * (r_s + r_p))


def schlick_fresnel(cosine: Array, facing: Array | float) -> Array:
    """facing + (1 - facing)(1 - cosine)^5, [Schlick94; BenArtzi07, eq. 3.10]; `facing` = 1 reflects all."""
    return np.asarray(facing + (1.0 - facing) * np.clip(1.0 - cosine, 0.0, 1.0) ** 5)


def rise(wi: Array, wo: Array) -> Array:
    """(1 - cos theta_d)^5 (N,) of unit directions (N, 3): what Schlick's factor adds towards grazing angles."""
    cos_d = 0.5 * np.linalg.norm(wi + wo, axis=1)
    return np.asarray(np.clip(1.0 - cos_d, 0.0, 1.0) ** 5)


def _ratio(numerator: Array, denominator: Array) -> Array:
    """0 where the denominator is 0, which is rare: a test at each number takes twice as long."""
    is_there = denominator > 0.0
    if is_there.all():
        return np.asarray(numerator / denominator)
    return np.divide(numerator, denominator, out=np.zeros_like(denominator), where=is_there)
