"""Highlights by a cosine power: Phong's about the mirror direction, normalized so that it never reflects more than it
receives, and Blinn's microfacets over the half angle with V-groove masking, as in PBRT.
"""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.microfacet import cosine_power, directions, schlick_fresnel, v_groove
from engine.material.model import THETA_H, THETA_R, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import FACING, TINT, Parameter

EXPONENT = Parameter(
    "exponent",
    "scalar",
    50.0,
    "Exponent",
    "Sharpness of the highlight: 1 is dull, 10,000 is close to a mirror.",
    ("A", "scale"),
    maximum=1e6,
    logarithmic=True,
    power=-0.5,
)


class _CosinePower(Model):
    """f_A = cos^n, f_q = scale (n + 2) / (2 pi)."""

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return grey(cosine_power(np.cos(gamma), np.sin(gamma) ** 2, number(params, "exponent")))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") * ((number(params, "exponent") + 2.0) / (2.0 * math.pi))


class Phong(_CosinePower):
    """rho = scale (n + 2) / (2 pi) cos(theta_r)^n; f_A = cos^n, the quotient is 1.

    [BenArtzi07, ch. 3] has sqrt(n) for f_q, which looks right but reflects up to twice the light received; we use (n +
    2) / (2 pi), with which the albedo at normal incidence is `scale` for every n. n = 0: the curve is constant 1.
    """

    name = "phong"
    label = "Phong"
    tooltip = "A round highlight around the mirrored direction."
    kind = kinds.PHONG
    factors = (THETA_R,)
    parameters = (EXPONENT, TINT)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        lobe = np.where(d.above, cosine_power(d.cos_r, d.sin2_r, number(params, "exponent")), 0.0)
        return self.scale(params) * lobe[:, None]


class BlinnPhong(_CosinePower):
    """rho = scale (n + 2) / (2 pi) cos(theta_h)^n G F / (4 cos_i cos_o).

    f_A = cos^n, f_q = scale (n + 2) / (2 pi), so that f_q f_A is a distribution of microfacets; the quotient contains
    the V-groove G and a fixed Fresnel term in Schlick's approximation, which is 1 for reflectance 1.
    """

    name = "blinn_phong"
    label = "Blinn-Phong"
    tooltip = "A highlight that stretches at grazing angles, as on plastic or lacquer."
    kind = kinds.BLINN_PHONG
    factors = (THETA_H,)
    quotient_names = ("reflectance",)
    parameters = (EXPONENT, FACING, TINT)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
        lobe = cosine_power(d.cos_h, d.sin2_h, number(params, "exponent"))
        fixed = v_groove(d.cos_h, cos_i, cos_o, d.cos_d) * schlick_fresnel(d.cos_d, number(params, "reflectance"))
        return self.scale(params) * np.where(d.above, lobe * fixed / (4.0 * cos_i * cos_o), 0.0)[:, None]


MODELS = (Phong(), BlinnPhong())
