"""Metal with a rough surface: GGX or Beckmann microfacets, Smith's masking, exact Fresnel [Walter07]."""

from __future__ import annotations

import numpy as np

from engine.material import kinds
from engine.material.fresnel import conductor_fresnel
from engine.material.microfacet import SMALLEST_ALPHA, beckmann, directions, ggx, smith_beckmann, smith_ggx
from engine.material.model import THETA_D, THETA_H, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import ETA, EXTINCTION, SCALE, Parameter


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
        Parameter(
            "alpha",
            "scalar",
            0.2,
            "Roughness α",
            "Width of the highlight: small is close to a mirror, large is dull.",
            ("A", "quotient"),
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
            distribution = beckmann if params["distribution"] == "beckmann" else ggx
            return grey(distribution(np.cos(gamma), np.sin(gamma) ** 2, number(params, "alpha")))
        return conductor_fresnel(np.cos(gamma)[:, None], channels(params, "eta"), channels(params, "k"))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale")

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


MODEL = RoughConductor()
