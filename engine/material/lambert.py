"""Diffuse reflection with curves over the angles of wi and wo, "LV" in [BenArtzi07]."""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.microfacet import directions
from engine.material.model import THETA_I, THETA_O, Float64Array, Model, Parameters, channels, ones
from engine.material.parameters import Parameter


class Lambert(Model):
    """rho = albedo / pi, times f_A(theta_i) f_o(theta_o), both 1 until the user edits them."""

    name = "lambert"
    label = "Diffuse"
    tooltip = "Light scattered evenly, as by paper or chalk."
    kind = kinds.LAMBERT
    is_diffuse = True
    factors = (THETA_I,)
    view_factor = THETA_O
    parameters = (
        Parameter(
            "albedo",
            "rgb",
            (0.5, 0.5, 0.5),
            "Albedo",
            "Colour and brightness: the share of the light that is scattered back.",
            ("scale",),
        ),
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return ones(gamma)

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "albedo")

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        above = directions(wi, wo).above
        return np.where(above[:, None], channels(params, "albedo") / math.pi, 0.0)


MODEL = Lambert()
