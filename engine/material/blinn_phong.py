"""Blinn's microfacets: a cosine power of the half angle with V-groove masking, as in PBRT."""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.fresnel import schlick_fresnel
from engine.material.microfacet import cosine_power, directions, v_groove
from engine.material.model import THETA_H, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import FACING, TINT
from engine.material.phong import EXPONENT


class BlinnPhong(Model):
    """rho = scale (n + 2) / (2 pi) cos(theta_h)^n G F / (4 cos_i cos_o).

    f_A = cos^n, f_q = scale (n + 2) / (2 pi), so that f_q f_A is a distribution of microfacets; the quotient contains
    the V-groove G and a fixed Fresnel term in Schlick's approximation, which is 1 for reflectance 1.
    """

    name = "blinn_phong"
    label = "Blinn-Phong"
    tooltip = "A highlight that stretches at grazing angles, as on plastic or lacquer."
    kind = kinds.BLINN_PHONG
    factors = (THETA_H,)
    parameters = (EXPONENT, FACING, TINT)

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return grey(cosine_power(np.cos(gamma), np.sin(gamma) ** 2, number(params, "exponent")))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") * ((number(params, "exponent") + 2.0) / (2.0 * math.pi))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[kinds.FACING_REFLECTANCE] = number(params, "reflectance")
        return q

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
        lobe = cosine_power(d.cos_h, d.sin2_h, number(params, "exponent"))
        fixed = v_groove(d.cos_h, cos_i, cos_o, d.cos_d) * schlick_fresnel(d.cos_d, number(params, "reflectance"))
        return self.scale(params) * np.where(d.above, lobe * fixed / (4.0 * cos_i * cos_o), 0.0)[:, None]


MODEL = BlinnPhong()
