"""A highlight that the user draws over the half vector's angle and azimuth, as on satin or velvet [Ashikhmin00]."""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.fresnel import schlick_fresnel
from engine.material.microfacet import SMALLEST_ALPHA, directions, ggx
from engine.material.model import PHI_H, THETA_H, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import FACING, TINT, Parameter


class AshikhminHybrid(Model):
    """rho = scale p(h) F / (4 cos theta_d max(cos_i, cos_o)),  p(h) = f_A(theta_h) f_B(phi_h).

    The hybrid of [BenArtzi07, 3.4]: a formula for everything except the half vector, whose table is the two curves.
    Parameters give initial curves: f_A = D cos theta_h with D of GGX, so that p integrates to 1, and f_B = 1 + b cos 2
    phi_h. [Ashikhmin00] divides by a shadowing term that is an integral over p; we use the denominator of Ashikhmin and
    Shirley, with which the albedo is at most the integral of p for any curves: d omega_i = 4 cos theta_d d omega_h, and
    cos_i / max(cos_i, cos_o) is at most 1.

    f_q = 2 pi scale, because the quotient is that of `ashikhmin_shirley`, F / (8 pi cos theta_d max(cos_i, cos_o)).
    """

    name = "ashikhmin_hybrid"
    label = "Satin (drawn highlight)"
    tooltip = "A highlight with one curve from its middle outwards and one around: satin, velvet, woven cloth."
    kind = kinds.ASHIKHMIN_SHIRLEY
    factors = (THETA_H, PHI_H)
    parameters = (
        Parameter(
            "alpha",
            "scalar",
            0.3,
            "Roughness α",
            "Width of the highlight that the curve starts from.",
            ("A",),
            minimum=SMALLEST_ALPHA,
            maximum=1.0,
            logarithmic=True,
        ),
        Parameter(
            "bias",
            "scalar",
            0.5,
            "Bias b",
            "Where around its middle the highlight is bright: 1 along the threads, -1 across, 0 all around.",
            ("B",),
            minimum=-1.0,
        ),
        FACING,
        TINT,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is PHI_H:
            return grey(1.0 + number(params, "bias") * np.cos(2.0 * gamma))
        return grey(ggx(np.cos(gamma), np.sin(gamma) ** 2, number(params, "alpha")) * np.maximum(np.cos(gamma), 0.0))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") * (2.0 * math.pi)

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[kinds.FACING_REFLECTANCE] = number(params, "reflectance")
        return q

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        around = 1.0 + number(params, "bias") * (2.0 * d.cos2_phi_h - 1.0)
        facets = ggx(d.cos_h, d.sin2_h, number(params, "alpha")) * d.cos_h * around
        fixed = schlick_fresnel(d.cos_d, number(params, "reflectance")) / (4.0 * d.cos_d)
        lobe = facets * fixed / np.where(d.above, np.maximum(d.cos_i, d.cos_o), 1.0)
        return channels(params, "scale") * np.where(d.above, lobe, 0.0)[:, None]


MODEL = AshikhminHybrid()
