"""Metals: microfacets with one curve over the half angle and a Fresnel curve over the difference angle.

Cook and Torrance's model with Beckmann's distribution and an exact Fresnel term [BenArtzi07, 3.1]; GGX or Beckmann with
Smith's masking and an exact Fresnel term [Walter07]; and Schlick's rational model, from diffuse to mirror, isotropic or
brushed, with cheap terms [Schlick94].
"""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.microfacet import (
    ROUGHNESS,
    SMALLEST_ALPHA,
    beckmann,
    conductor_fresnel,
    directions,
    ggx,
    schlick_fresnel,
    smith_beckmann,
    smith_ggx,
    v_groove,
)
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


class RoughConductor(Model):
    """rho = scale D(theta_h) F(theta_d) G1(wi) G1(wo) / (4 cos_i cos_o).

    f_A = D, f_B = F, f_q = scale; the quotient is Smith's G at the layer's alpha over 4 cos_i cos_o. The same as
    Mitsuba 3's `roughconductor` with isotropic `alpha`.
    """

    name = "rough_conductor"
    label = "Rough metal"
    tooltip = "Metal from polished to brushed, tinted by its index of refraction."
    kind = kinds.ROUGH_CONDUCTOR
    factors = (THETA_H, THETA_D)
    parameters = (
        Parameter(
            "distribution",
            "choice",
            "ggx",
            "Distribution",
            "Shape of the highlight: GGX has a small core and a wide glow, Beckmann ends sooner.",
            ("A", "quotient"),
            choices=("ggx", "beckmann"),
        ),
        ROUGHNESS,
        ETA,
        EXTINCTION,
        SCALE,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is THETA_H:
            distribution = beckmann if params["distribution"] == "beckmann" else ggx
            return grey(distribution(np.cos(gamma), np.sin(gamma) ** 2, number(params, "alpha")))
        return conductor_fresnel(np.cos(gamma)[:, None], channels(params, "eta"), channels(params, "k"))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[kinds.ROUGH_DISTRIBUTION] = kinds.BECKMANN if params["distribution"] == "beckmann" else kinds.GGX
        q[kinds.ROUGH_ALPHA] = max(number(params, "alpha"), SMALLEST_ALPHA)
        return q

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d, alpha = directions(wi, wo), number(params, "alpha")
        is_beckmann = params["distribution"] == "beckmann"
        density, masking = (beckmann, smith_beckmann) if is_beckmann else (ggx, smith_ggx)
        cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
        visible = masking(cos_i, d.sin2_i, alpha) * masking(cos_o, d.sin2_o, alpha)
        grey_part = density(d.cos_h, d.sin2_h, alpha) * visible / (4.0 * cos_i * cos_o)
        eta, k = channels(params, "eta"), channels(params, "k")
        if np.ptp(eta) == np.ptp(k) == 0.0:  # equal for all three channels
            eta, k = eta[:1], k[:1]
        # Channel by channel: NumPy takes twice as long for rows of three.
        fresnel = conductor_fresnel(d.cos_d, eta[:, None], k[:, None])
        value = channels(params, "scale")[:, None] * fresnel * np.where(d.above, grey_part, 0.0)
        return np.ascontiguousarray(value.T)


COLOUR = Parameter(
    "reflectance",
    "rgb",
    (0.9, 0.6, 0.3),
    "Facing reflectance",
    "Share of each colour reflected head-on; it pales towards white at grazing angles.",
    ("B",),
)


class Schlick(Model):
    """rho = scale S(theta_d) Z(theta_h) A(phi_h) G(cos_i) G(cos_o) / (4 pi cos_i cos_o)  [Schlick94].

    S = R + (1 - R)(1 - cos theta_d)^5, Z = r / (1 + (r - 1) cos^2 theta_h)^2, G(v) = v / (k + (1 - k) v) and, with w
    the cosine between tangent and projected half vector, A = sqrt(p / (p^2 + (1 - p^2) w^2)). f_A = Z / pi, which is
    the distribution of GGX with alpha^2 = r, f_B = S [BenArtzi07, 3.4], f_q = scale; the rest is the quotient.

    Schlick takes k = r, with which the model reflects 2.5 times the light at grazing angles for r = 0.01; we use his
    own k = sqrt(2 r / pi) of the approximation of Smith's G, with r the squared slope, and the albedo is at most 1. Of
    his two terms this is the first; light that is reflected several times is a `lambert` layer.
    """

    name = "schlick"
    label = "Schlick"
    tooltip = "Metal, plastic or brushed metal by rational formulas, with a wide glow about the highlight."
    factors = (THETA_H, THETA_D)
    highlight_in_quotient = True
    parameters = (
        Parameter(
            "roughness",
            "scalar",
            0.04,
            "Roughness r",
            "Width of the highlight: 0.0001 is close to a mirror, 1 is dull.",
            ("A", "quotient"),
            minimum=1e-8,
            maximum=1.0,
            logarithmic=True,
            power=0.5,
        ),
        Parameter(
            "isotropy",
            "scalar",
            1.0,
            "Isotropy p",
            "1 is a round highlight; small values stretch it across the brushing, as on brushed metal.",
            ("quotient",),
            minimum=0.01,
            maximum=1.0,
            logarithmic=True,
        ),
        COLOUR,
        SCALE,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is THETA_H:
            return grey(ggx(np.cos(gamma), np.sin(gamma) ** 2, math.sqrt(number(params, "roughness"))))
        return schlick_fresnel(np.cos(gamma)[:, None], channels(params, "reflectance"))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[0], q[1] = _masking(number(params, "roughness")), number(params, "isotropy")
        return q

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: k and p. G(cos) / cos is one expression."""
        k, p2 = q[0], q[1] * q[1]
        sx, sy = ix + ox, iy + oy
        flat2 = sx * sx + sy * sy
        w2 = sx * sx / flat2 if flat2 > 1e-300 else 0.5
        stretch = math.sqrt(q[1] / (p2 + (1.0 - p2) * w2))
        return 0.25 * stretch * iz / ((k + (1.0 - k) * iz) * (k + (1.0 - k) * oz))

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d, r, p = directions(wi, wo), number(params, "roughness"), number(params, "isotropy")
        k = _masking(r)
        cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
        seen = cos_i / (k + (1.0 - k) * cos_i) * cos_o / (k + (1.0 - k) * cos_o)
        azimuth = np.sqrt(p / (p * p - p * p * d.cos2_phi_h + d.cos2_phi_h))
        zenith = r / (r * d.cos_h**2 + d.sin2_h) ** 2
        facets = zenith * azimuth * seen / (4.0 * math.pi * cos_i * cos_o)
        fresnel = schlick_fresnel(d.cos_d[:, None], channels(params, "reflectance"))
        return channels(params, "scale") * fresnel * np.where(d.above, facets, 0.0)[:, None]


def _masking(r: float) -> float:
    return math.sqrt(2.0 * r / math.pi)


MODELS = (CookTorrance(), RoughConductor(), Schlick())
