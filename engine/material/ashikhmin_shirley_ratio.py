"""Ashikhmin and Shirley's model with one editable curve: the ratio of its two exponents [BenArtzi07, 3.3.2]."""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.ashikhmin_shirley import anisotropic_lobe
from engine.material.microfacet import cosine_power, directions
from engine.material.model import GAMMA_RATIO, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import FACING, TINT, Parameter


class AshikhminShirleyRatio(Model):
    """`ashikhmin_shirley` with n_v = r n_u: the width along the tangent is fixed, its ratio to the width across is
    edited.

    [BenArtzi07, eq. 3.13-3.15], which omit the squares of cos(phi_h) and sin(phi_h) that eq. 3.5 and 3.6 have, and take
    the base of the power itself for gamma_r; we use squares, and an angle as in eq. 3.7:

        gamma_r = arccos(cos(theta_h)^(n_u sin^2 phi_h)),  f_A = cos(gamma_r)^r,
        rho_q = cos(theta_h)^(n_u cos^2 phi_h) F / (8 pi (h.k) max(cos_i, cos_o)),  f_q = scale sqrt((n_u+1)(r n_u+1)).

    r is at least 1: below, the highlight's tail would be compressed into the last band, where cos(gamma_r)^r falls from
    almost 1 to 0 within less than any band. The wider side is along the tangent.
    """

    name = "ashikhmin_shirley_ratio"
    label = "Ashikhmin-Shirley, one ratio"
    tooltip = (
        "Brushed metal: Ashikhmin and Shirley's anisotropic highlight, a streak, with one curve. Its width along the "
        "brushing is fixed; the curve says how much narrower than that it is across, the anisotropy ratio."
    )
    kind = kinds.ASHIKHMIN_SHIRLEY_RATIO
    highlight_in_quotient = True
    factors = (GAMMA_RATIO,)
    parameters = (
        Parameter(
            "n_u",
            "scalar",
            20.0,
            "Exponent nᵤ",
            "Sharpness of the highlight along the brushing.",
            ("scale", "quotient"),
            minimum=1.0,
            maximum=1e3,
            logarithmic=True,
            power=-0.5,
        ),
        Parameter(
            "ratio",
            "scalar",
            10.0,
            "Anisotropy ratio r",
            "How many times sharper the highlight is across the brushing than along it: 1 is round, 100 is a streak.",
            ("A", "scale"),
            minimum=1.0,
            maximum=1e3,
            logarithmic=True,
            power=-0.5,
        ),
        FACING,
        TINT,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return grey(cosine_power(np.cos(gamma), np.sin(gamma) ** 2, number(params, "ratio")))

    def scale(self, params: Parameters) -> Float64Array:
        n_u, ratio = number(params, "n_u"), number(params, "ratio")
        return channels(params, "scale") * math.sqrt((n_u + 1.0) * (ratio * n_u + 1.0))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[kinds.FACING_REFLECTANCE] = number(params, "reflectance")
        q[kinds.RATIO_EXPONENT] = number(params, "n_u")
        return q

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        n_u = number(params, "n_u")
        lobe = anisotropic_lobe(directions(wi, wo), n_u, n_u * number(params, "ratio"), number(params, "reflectance"))
        return channels(params, "scale") * lobe[:, None]


MODEL = AshikhminShirleyRatio()
