"""Distributions of microfacets and their masking, as functions of plain angles.

All are written with both cosine and squared sine, so that neither is obtained from the other where that cancels: at
roughness 1e-4 the textbook (cos^2 (alpha^2 - 1) + 1) of GGX is infinite in single precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.material.kinds import GRAZING

Array = NDArray[Any]

# Least roughness that is told apart from a mirror.
SMALLEST_ALPHA = 1e-4


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
    """Smith's G1 of Beckmann by the rational approximation of [Walter07, eq. 27], a = cos / (alpha sin)."""
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
    """Geometric attenuation of Torrance and Sparrow's grooves: min(1, 2 (n.h)(n.o)/(o.h), 2 (n.h)(n.i)/(o.h))."""
    return np.minimum(1.0, 2.0 * cosine_h * np.minimum(cosine_i, cosine_o) / cosine_d)


@dataclass(frozen=True)
class Directions:
    """Cosines (N,) that reflection models are written in, of directions in the local frame (z = normal)."""

    cos_i: Array
    cos_o: Array
    sin2_i: Array
    sin2_o: Array
    cos_h: Array
    sin2_h: Array
    cos_d: Array
    cos_r: Array
    sin2_r: Array
    cos2_phi_h: Array
    above: NDArray[np.bool_]


def directions(wi: Array, wo: Array) -> Directions:
    """From unit directions wi, wo (N, 3). Where wi = -wo the half vector is the normal; no phi_h: 45 degrees.

    `above` marks pairs that reflect: both cosines over 1e-12.
    """
    total = wi + wo
    length2 = np.einsum("ij,ij->i", total, total)
    opposite = length2 < 1e-24
    length = np.sqrt(np.where(opposite, 1.0, length2))
    half = np.where(opposite[:, None], np.array([0.0, 0.0, 1.0]), total / length[:, None])
    sin2_h = half[:, 0] ** 2 + half[:, 1] ** 2
    mirrored = wi * np.array([-1.0, -1.0, 1.0])
    crossed = np.cross(mirrored, wo)
    return Directions(
        cos_i=wi[:, 2],
        cos_o=wo[:, 2],
        sin2_i=wi[:, 0] ** 2 + wi[:, 1] ** 2,
        sin2_o=wo[:, 0] ** 2 + wo[:, 1] ** 2,
        cos_h=half[:, 2],
        sin2_h=sin2_h,
        cos_d=np.clip(0.5 * np.sqrt(length2), 1e-12, 1.0),
        cos_r=np.clip(np.einsum("ij,ij->i", mirrored, wo), -1.0, 1.0),
        sin2_r=np.clip(np.einsum("ij,ij->i", crossed, crossed), 0.0, 1.0),
        cos2_phi_h=np.where(sin2_h > 0.0, half[:, 0] ** 2 / np.where(sin2_h > 0.0, sin2_h, 1.0), 0.5),
        above=(wi[:, 2] > GRAZING) & (wo[:, 2] > GRAZING),
    )
