"""Schlick's rational model, from diffuse to mirror, isotropic or brushed, with cheap terms [Schlick94]."""

from __future__ import annotations

import math

import numpy as np

from engine.material.fresnel import schlick_fresnel
from engine.material.microfacet import directions, ggx
from engine.material.model import THETA_D, THETA_H, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import SCALE, Parameter

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

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale")

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


MODEL = Schlick()
