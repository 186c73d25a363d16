"""The specular part of a measured surface, with curves over half and difference angle [BenArtzi07, 3.5]."""

from __future__ import annotations

from engine.material.measured_model import MeasuredModel, parameters
from engine.material.model import THETA_D, THETA_H


class Measured(MeasuredModel):
    """rho_s = s q_s G(theta_d) H(theta_h): the part of the measurement above its diffuse part."""

    name = "measured"
    label = "Measured, highlight"
    tooltip = "The highlight of a measured surface, as it was measured and as you bend it."
    part = "specular"
    factors = (THETA_H, THETA_D)
    parameters = parameters("A", "B")


MODEL = Measured()
