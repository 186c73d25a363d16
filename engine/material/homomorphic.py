"""Cloth as P(theta_i) Q(theta_h) P(theta_o), McCool's homomorphic factors [McCool01; BenArtzi07, 3.5]."""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.microfacet import cosine_power, directions
from engine.material.model import (
    THETA_H,
    THETA_I,
    THETA_O,
    Factor,
    Float64Array,
    Model,
    Parameters,
    channels,
    grey,
    number,
)
from engine.material.parameters import TINT, Parameter

Q = Factor("theta_h", THETA_H.gamma, "Q, half θₕ", "The highlight's profile, from the mirror direction outwards.")
P = Factor("theta_i", THETA_I.gamma, "P, slant θᵢ", "Brightness by the slant of the light, and equally of the view.")


class Homomorphic(Model):
    """rho = scale P(theta_i) Q(theta_h) P(theta_o) / pi  [BenArtzi07, eq. 3.16].

    P for light and view is one curve: an edit applies to both, and reciprocity holds. P is f_B and f_o here, and Q is
    f_A; the quotient is 1 / pi. Parameters give initial curves like those of velvet, P = a + (1 - a)(1 - cos)^m and Q =
    b + (1 - b) cos^n: neither exceeds 1, so neither does the albedo.
    """

    name = "homomorphic"
    label = "Cloth (P·Q·P)"
    tooltip = "Cloth such as velvet, bright at grazing light and grazing view."
    kind = kinds.LAMBERT
    factors = (Q, P)
    view_factor = THETA_O
    shared = {"theta_o": "theta_i"}
    parameters = (
        Parameter(
            "facing",
            "scalar",
            0.45,
            "Head-on a",
            "Brightness head-on compared with that at grazing angles: small is velvet, 1 is even.",
            ("B", "o"),
        ),
        Parameter(
            "rise",
            "scalar",
            2.0,
            "Rise m",
            "How late towards grazing angles it brightens.",
            ("B", "o"),
            minimum=0.25,
            maximum=16.0,
            logarithmic=True,
        ),
        Parameter(
            "matt",
            "scalar",
            0.6,
            "Diffuse share b",
            "Brightness far from the mirror direction compared with that at it: 1 has no highlight.",
            ("A",),
        ),
        Parameter(
            "exponent",
            "scalar",
            8.0,
            "Exponent n",
            "Sharpness of the highlight: 1 is dull, 10,000 is close to a mirror.",
            ("A",),
            maximum=1e6,
            logarithmic=True,
            power=-0.5,
        ),
        TINT,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if factor_name == Q.name:
            return grey(_highlight(np.cos(gamma), np.sin(gamma) ** 2, params))
        self.factor(factor_name)
        return grey(_slant(np.cos(gamma), params))

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        product = _slant(d.cos_i, params) * _highlight(d.cos_h, d.sin2_h, params) * _slant(d.cos_o, params)
        return channels(params, "scale") * np.where(d.above, product / math.pi, 0.0)[:, None]


def _slant(cosine: Float64Array, params: Parameters) -> Float64Array:
    facing = number(params, "facing")
    return np.asarray(facing + (1.0 - facing) * np.clip(1.0 - cosine, 0.0, 1.0) ** number(params, "rise"))


def _highlight(cosine: Float64Array, sin2: Float64Array, params: Parameters) -> Float64Array:
    diffuse = number(params, "matt")
    return np.asarray(diffuse + (1.0 - diffuse) * cosine_power(cosine, sin2, number(params, "exponent")))


MODELS = (Homomorphic(),)
