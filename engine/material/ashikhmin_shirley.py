"""The anisotropic Phong model of Ashikhmin and Shirley with one exponent along the tangent and one across [BenArtzi07,
3.2]."""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.fresnel import schlick_fresnel
from engine.material.microfacet import Directions, cosine_power, directions
from engine.material.model import GAMMA_ALPHA, GAMMA_BETA, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import FACING, TINT, Parameter


class AshikhminShirley(Model):
    """rho = scale N cos(theta_h)^(n_u cos^2 phi_h + n_v sin^2 phi_h) F / (8 pi (h.k) max(cos_i, cos_o)).

    [BenArtzi07, eq. 3.3-3.8]: f_A = cos(gamma_alpha)^n_u, f_B = cos(gamma_beta)^n_v, f_q = scale N with N = sqrt((n_u +
    1)(n_v + 1)), and the rest is the quotient. Eq. 3.3 prints theta_d for h.k; we use h.k = cos(theta_d), as Ashikhmin
    and Shirley do.

    Fresnel is Schlick's with one grey facing reflectance, inside the quotient; colour is in `scale`. The two-term split
    of eq. 3.12, by which a coloured Fresnel factor is edited in real time, is available for layers of any model: see
    `Layer`. The model's diffuse part is a `lambert` layer.
    """

    name = "ashikhmin_shirley"
    label = "Ashikhmin-Shirley"
    tooltip = "Brushed metal: a highlight with its own sharpness along and across the brushing."
    kind = kinds.ASHIKHMIN_SHIRLEY
    factors = (GAMMA_ALPHA, GAMMA_BETA)
    parameters = (
        Parameter(
            "n_u",
            "scalar",
            20.0,
            "Exponent along nᵤ",
            "Sharpness of the highlight along the brushing.",
            ("A", "scale"),
            maximum=1e6,
            logarithmic=True,
            power=-0.5,
        ),
        Parameter(
            "n_v",
            "scalar",
            200.0,
            "Exponent across nᵥ",
            "Sharpness of the highlight across the brushing; unlike the other it makes the highlight a streak.",
            ("B", "scale"),
            maximum=1e6,
            logarithmic=True,
            power=-0.5,
        ),
        FACING,
        TINT,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        exponent = number(params, "n_u" if self.factor(factor_name) is GAMMA_ALPHA else "n_v")
        return grey(cosine_power(np.cos(gamma), np.sin(gamma) ** 2, exponent))

    def scale(self, params: Parameters) -> Float64Array:
        strength = math.sqrt((number(params, "n_u") + 1.0) * (number(params, "n_v") + 1.0))
        return channels(params, "scale") * strength

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[kinds.FACING_REFLECTANCE] = number(params, "reflectance")
        return q

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        lobe = anisotropic_lobe(d, number(params, "n_u"), number(params, "n_v"), number(params, "reflectance"))
        return channels(params, "scale") * lobe[:, None]


def anisotropic_lobe(d: Directions, n_u: float, n_v: float, reflectance: float) -> Float64Array:
    """The specular term of Ashikhmin and Shirley, (N,), 1/sr; 0 below the horizon."""
    power = cosine_power(d.cos_h, d.sin2_h, n_u * d.cos2_phi_h + n_v * (1.0 - d.cos2_phi_h))
    steeper = np.where(d.above, np.maximum(d.cos_i, d.cos_o), 1.0)
    strength = math.sqrt((n_u + 1.0) * (n_v + 1.0)) / (8.0 * math.pi)
    lobe = strength * power * schlick_fresnel(d.cos_d, reflectance) / (d.cos_d * steeper)
    return np.asarray(np.where(d.above, lobe, 0.0))


MODEL = AshikhminShirley()
