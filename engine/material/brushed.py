"""Brushed surfaces: the anisotropic microfacets of glTF [glTF20, KHR_materials_anisotropy] with one curve.

    rho = scale D F / (2 (cos_i L(wo) + cos_o L(wi))),    L(w) = |(a_t w_x, a_b w_y, w_z)|,
    D = 1 / (pi a_t a_b (h_x^2 / a_t^2 + h_y^2 / a_b^2 + h_z^2)^2),    a_b = alpha, a_t = alpha + (1 - alpha) s^2

with the tangent as x, along which the highlight is a streak. D is not the product of a curve along and one across, as
Ward's is. But it is constant on ellipses: over the angle gamma with

    tan(gamma)^2 = ((a_b / a_t)^2 h_x^2 + h_y^2) / h_z^2

its profile is that of the round GGX of width a_b, so that

    f_A = D_GGX(gamma; a_b),  f_B = F(theta_d),  f_q = scale,
    rho_q = a_b / a_t / ((a_b / a_t)^2 h_x^2 + h_y^2 + h_z^2)^2 / (2 (cos_i L(wo) + cos_o L(wi))).

The curve is the streak's profile, and its length stays in proportion. The masking is correlated by height, as the
extension prints it; that of round gloss is separable, as the core specification prints it.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from engine.material import kinds
from engine.material.dielectric import F0, F90, WHITE_TINT, Gloss, schlick_curve
from engine.material.microfacet import ROUGHNESS, SMALLEST_ALPHA, directions, ggx
from engine.material.model import STREAK, THETA_D, Float64Array, Parameters, channels, grey, number
from engine.material.parameters import Parameter

ANISOTROPY = Parameter(
    "anisotropy",
    "scalar",
    0.5,
    "Anisotropy",
    "How much longer than wide the highlight is: 0 is round, 1 a streak along the brushing. The picture follows when "
    "idle.",
    ("quotient",),
)


class Brushed(Gloss):
    """See the module. F = F0 + (F90 - F0)(1 - cos theta_d)^5."""

    name = "brushed"
    label = "Brushed surface"
    tooltip = "Brushed metal or hair: a highlight that is a streak along the brushing, as glTF files describe it."
    kind = kinds.OWN
    factors = (STREAK, THETA_D)
    highlight_in_quotient = True
    parameters = (
        dataclasses.replace(ROUGHNESS, tooltip="Width of the streak, across the brushing."), ANISOTROPY, F0, F90,
        WHITE_TINT,
    )  # fmt: skip

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return schlick_curve(channels(params, "f0"), number(params, "f90"), cosine)

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is STREAK:
            return grey(ggx(np.cos(gamma), np.sin(gamma) ** 2, number(params, "alpha")))
        return self.fresnel(params, np.cos(gamma))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = np.zeros(kinds.N_QUOTIENT_PARAMETERS)
        q[kinds.ALPHA_ALONG], q[kinds.ALPHA_ACROSS] = _widths(params)
        return q

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: widths along and across. With s = i + o: h = s / |s|."""
        ratio = q[1] / q[0]
        sx, sy, sz = ix + ox, iy + oy, iz + oz
        length2 = sx * sx + sy * sy + sz * sz
        flat = sx * ratio
        share = length2 / (flat * flat + sy * sy + sz * sz)
        ax, ay, bx, by = q[0] * ix, q[1] * iy, q[0] * ox, q[1] * oy
        masked = iz * math.sqrt(bx * bx + by * by + oz * oz) + oz * math.sqrt(ax * ax + ay * ay + iz * iz)
        return 0.5 * ratio * share * share * iz / masked

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d, (along, across) = directions(wi, wo), _widths(params)
        slopes = (d.half[:, 0] / along) ** 2 + (d.half[:, 1] / across) ** 2 + d.cos_h**2
        lengths = [np.linalg.norm(w * np.array([along, across, 1.0]), axis=1) for w in (wi, wo)]
        masked = np.where(d.above, d.cos_i * lengths[1] + d.cos_o * lengths[0], 1.0)
        lobe = np.where(d.above, 0.5 / (math.pi * along * across * slopes**2 * masked), 0.0)
        return channels(params, "scale") * self.fresnel(params, d.cos_d) * lobe[:, None]


def _widths(params: Parameters) -> tuple[float, float]:
    """a_t and a_b."""
    across = max(number(params, "alpha"), SMALLEST_ALPHA)
    return across + (1.0 - across) * number(params, "anisotropy") ** 2, across


MODELS = (Brushed(),)
