"""A whole measurement as cloth, P(theta_i) Q(theta_h) P(theta_o) times the quotient [McCool01; BenArtzi07, 3.5]."""

from __future__ import annotations

from engine.material.homomorphic import P, Q
from engine.material.measured_model import MeasuredModel, parameters
from engine.material.model import THETA_O


class MeasuredCloth(MeasuredModel):
    """rho = w q P(theta_i) Q(theta_h) P(theta_o): one layer of homomorphic factors that contains the whole measurement.

    P is one curve for wi and wo, as in `homomorphic`.
    """

    name = "measured_cloth"
    label = "Measured, cloth (P·Q·P)"
    tooltip = "A measured surface in one layer, bent by how light and view slant and by the highlight's profile."
    part = "whole"
    factors = (Q, P)
    view_factor = THETA_O
    shared = {"theta_o": "theta_i"}
    curve_of = {"theta_h": "q", "theta_i": "p", "theta_o": "p"}
    parameters = parameters("A", "B", "o")


MODEL = MeasuredCloth()
