"""The diffuse part of a measured surface, with curves over the angles of wi and wo [BenArtzi07, 3.5]."""

from __future__ import annotations

from engine.material.measured_model import MeasuredModel, parameters
from engine.material.model import THETA_I, THETA_O


class MeasuredDiffuse(MeasuredModel):
    """rho_d = d q_d G(theta_i) H(theta_o): the part of the measurement below the product of the factors d G H."""

    name = "measured_diffuse"
    label = "Measured, diffuse part"
    tooltip = "What a measured surface scatters evenly."
    is_diffuse = True
    part = "diffuse"
    factors = (THETA_I,)
    view_factor = THETA_O
    parameters = parameters("A", "o")


MODEL = MeasuredDiffuse()
