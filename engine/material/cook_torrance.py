"""The model of Cook and Torrance with Beckmann's distribution and an exact Fresnel term [BenArtzi07, 3.1]."""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.fresnel import conductor_fresnel
from engine.material.microfacet import SMALLEST_ALPHA, beckmann, directions, v_groove
from engine.material.model import THETA_D, THETA_H, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import ETA, EXTINCTION, SCALE, Parameter


class CookTorrance(Model):
    """rho = s F(theta_d) G D(theta_h) / (pi cos_i cos_o)  [BenArtzi07, eq. 3.2].

    f_A = D, f_B = F, f_q = s / pi, and the quotient is the V-groove G over cos_i cos_o. With pi in the denominator D
    has no 1/pi of its own. Cook and Torrance's D = exp(-tan^2/sigma^2) / (sigma^2 cos^4) then reflects four times the
    incident light; we use D / 4, so that s = 1 is the microfacet model D F G / (4 cos_i cos_o) of [Walter07].
    """

    name = "cook_torrance"
    label = "Cook-Torrance"
    tooltip = "Rough metal or plastic by the classic formula; its highlight ends sooner than GGX."
    kind = kinds.COOK_TORRANCE
    factors = (THETA_H, THETA_D)
    parameters = (
        Parameter(
            "sigma",
            "scalar",
            0.2,
            "Slope σ",
            "Mean slope of the microfacets: small is a narrow highlight, large is dull.",
            ("A",),
            minimum=SMALLEST_ALPHA,
            maximum=1.0,
            logarithmic=True,
        ),
        ETA,
        EXTINCTION,
        SCALE,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is THETA_H:
            return grey(0.25 * math.pi * beckmann(np.cos(gamma), np.sin(gamma) ** 2, number(params, "sigma")))
        return conductor_fresnel(np.cos(gamma)[:, None], channels(params, "eta"), channels(params, "k"))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") / math.pi

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
        density = beckmann(d.cos_h, d.sin2_h, number(params, "sigma"))
        facets = density * v_groove(d.cos_h, cos_i, cos_o, d.cos_d) / (4.0 * cos_i * cos_o)
        fresnel = conductor_fresnel(d.cos_d[:, None], channels(params, "eta"), channels(params, "k"))
        return channels(params, "scale") * fresnel * np.where(d.above, facets, 0.0)[:, None]


MODEL = CookTorrance()
