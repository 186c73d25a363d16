"""Distributions of microfacets, their masking, and the reflectance of smooth surfaces (Fresnel), as functions of
angles.

Distributions take both cosine and squared sine, so that neither is computed from the other with cancellation: at
roughness 1e-4 the textbook (cos^2 (alpha^2 - 1) + 1) of GGX is infinite in single precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.material.kinds import GRAZING
from engine.material.parameters import Parameter

Array = NDArray[Any]

# Least roughness that differs from a mirror.
SMALLEST_ALPHA = 1e-4
ROUGHNESS = Parameter(
    "alpha",
    "scalar",
    0.2,
    "Roughness α",
    "Width of the highlight: small is close to a mirror, large is dull.",
    ("A", "quotient"),
    minimum=SMALLEST_ALPHA,
    maximum=1.0,
    logarithmic=True,
)


def ggx(cosine: Array, sin2: Array, alpha: float) -> Array:
    """D(theta_h) of GGX, per steradian: alpha^2 / (pi (alpha^2 cos^2 + sin^2)^2) [Walter07, eq. 33].

    `alpha` below 1e-4 counts as 1e-4. The integral of D cos over the hemisphere is 1. Zero below the horizon.
    """
    a2 = max(alpha, SMALLEST_ALPHA) ** 2
    return np.where(cosine > 0.0, a2 / (math.pi * (a2 * cosine * cosine + sin2) ** 2), 0.0)


def beckmann(cosine: Array, sin2: Array, alpha: float) -> Array:
    """D(theta_h) of Beckmann, per steradian: exp(-tan^2/alpha^2) / (pi alpha^2 cos^4) [Walter07, eq. 25]."""
    a2 = max(alpha, SMALLEST_ALPHA) ** 2
    cos2 = np.maximum(cosine * cosine, 1e-30)
    exponent = np.minimum(sin2 / (cos2 * a2), 700.0)
    return np.where((cosine > 0.0) & (exponent < 700.0), np.exp(-exponent) / (math.pi * a2 * cos2 * cos2), 0.0)


def smith_ggx(cosine: Array, sin2: Array, alpha: float) -> Array:
    """Smith's G1 of GGX, the visible share: 2 / (1 + sqrt(1 + alpha^2 tan^2)) [Walter07, eq. 34]."""
    return 2.0 * cosine / (cosine + np.sqrt(cosine * cosine + alpha * alpha * sin2))


def smith_beckmann(cosine: Array, sin2: Array, alpha: float) -> Array:
    """Smith's G1 of Beckmann in the rational approximation of [Walter07, eq. 27], a = cos / (alpha sin)."""
    a = cosine / np.maximum(alpha * np.sqrt(sin2), 1e-300)
    a = np.minimum(a, 1.6)
    return np.where(a < 1.6, (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a), 1.0)


def cosine_power(cosine: Array, sin2: Array, exponent: Array | float) -> Array:
    """max(cosine, 0) ** exponent with 0 ** 0 = 1, exact for exponents of a million: exp(n log1p(-sin^2) / 2)."""
    near = sin2 < 0.5
    flat = 0.5 * np.log1p(-np.where(near, sin2, 0.0))
    log = np.where(near, flat, np.log(np.maximum(np.where(near, 1.0, cosine), 1e-300)))
    return np.where(cosine < -1e-12, 0.0, np.exp(np.maximum(exponent * log, -700.0)))


def v_groove(cosine_h: Array, cosine_i: Array, cosine_o: Array, cosine_d: Array) -> Array:
    """Geometric attenuation of Torrance and Sparrow's V-grooves: min(1, 2 (n.h)(n.o)/(o.h), 2 (n.h)(n.i)/(o.h))."""
    return np.minimum(1.0, 2.0 * cosine_h * np.minimum(cosine_i, cosine_o) / cosine_d)


@dataclass(frozen=True, eq=False)
class Directions:
    """Unit directions (N, 3) in the local frame (z = normal) and the angles (N,) of reflection models; half: the half
    vector, the normal if wi = -wo; length2: squared length of their sum. Rarely used values are computed on request."""

    wi: Array
    wo: Array
    half: Array
    length2: Array

    @property
    def cos_i(self) -> Array:
        return self.wi[:, 2]

    @property
    def cos_o(self) -> Array:
        return self.wo[:, 2]

    @property
    def sin2_i(self) -> Array:
        return _sin2(self.wi)

    @property
    def sin2_o(self) -> Array:
        return _sin2(self.wo)

    @property
    def cos_h(self) -> Array:
        return self.half[:, 2]

    @property
    def sin2_h(self) -> Array:
        return _sin2(self.half)

    @property
    def cos_d(self) -> Array:
        return np.clip(0.5 * np.sqrt(self.length2), 1e-12, 1.0)

    @property
    def cos_r(self) -> Array:
        """Cosine between the mirror direction of wi and wo."""
        return np.clip(np.einsum("ij,ij->i", self._mirrored, self.wo), -1.0, 1.0)

    @property
    def sin2_r(self) -> Array:
        crossed = np.cross(self._mirrored, self.wo)
        return np.clip(np.einsum("ij,ij->i", crossed, crossed), 0.0, 1.0)

    @property
    def cos2_phi_h(self) -> Array:
        """Squared cosine of the half vector's azimuth; 0.5 if undefined."""
        sin2_h = self.sin2_h
        return np.where(sin2_h > 0.0, self.half[:, 0] ** 2 / np.where(sin2_h > 0.0, sin2_h, 1.0), 0.5)

    @property
    def above(self) -> NDArray[np.bool_]:
        """Pairs that reflect: both cosines over 1e-12."""
        return (self.cos_i > GRAZING) & (self.cos_o > GRAZING)

    @property
    def _mirrored(self) -> Array:
        return self.wi * np.array([-1.0, -1.0, 1.0])


def directions(wi: Array, wo: Array) -> Directions:
    """Make it of unit directions wi, wo (N, 3)."""
    total = wi + wo
    length2 = np.einsum("ij,ij->i", total, total)
    opposite = length2 < 1e-24
    half = total / np.sqrt(np.where(opposite, 1.0, length2))[:, None]
    if opposite.any():
        half[opposite] = 0.0, 0.0, 1.0
    return Directions(wi, wo, half, length2)


def _sin2(direction: Array) -> Array:
    """Squared sine to the normal (N,)."""
    return np.asarray(direction[:, 0] ** 2 + direction[:, 1] ** 2)


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
