"""Parts of a measured surface as models [BenArtzi07, 3.5]: its highlight, with curves over half and difference angle,
or over other angles of the half vector and of wi about it; its diffuse part, with curves over the angles of wi and wo;
and all of it as cloth, P(theta_i) Q(theta_h) P(theta_o) times the quotient [McCool01].

The fit finds more factors of a highlight than a layer has curves, and each of its models edits some of them: the others
stay in the quotient [BenArtzi07, 3.5].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from engine.material import kinds
from engine.material.homomorphic import P, Q
from engine.material.model import (
    PHI_D,
    PHI_H,
    SLOPE_U,
    SLOPE_V,
    THETA_D,
    THETA_H,
    THETA_I,
    THETA_O,
    Float64Array,
    Model,
    Parameters,
    channels,
    number,
)
from engine.material.parameters import Parameter
from engine.measured.measurement import HALF_ANGLE_CURVES, NO_MEASUREMENT, Measurement, Part, node_angles

PARTS: dict[Part, int] = {
    "diffuse": kinds.DIFFUSE,
    "specular": kinds.SPECULAR,
    "whole": kinds.WHOLE,
    "around": kinds.AROUND,
    "twist": kinds.TWIST,
    "brushed": kinds.BRUSHED,
}


class MeasuredModel(Model):
    """One part of a measurement; see `engine.measured`. Without a file it is diffuse, rho = scale / pi.

    Shaders treat it as Phong, whose quotient is 1, and multiply by the measured quotient once its table is on the GPU
    (shaders/brdf/measured.glsl); until then lobes and material previews show the product of the factors.
    """

    kind = kinds.PHONG
    is_coloured = True
    needs_file = True
    part: ClassVar[Part]
    # The measurement's curve by a factor's name, if they differ.
    curve_of: ClassVar[Mapping[str, str]] = {}

    @property
    def number(self) -> int:
        from engine.material._kernels import quotient_number
        from engine.material._measured_kernels import quotient

        return quotient_number(quotient)

    def colours_number(self, q: Float64Array) -> int:
        from engine.material._kernels import colours_number
        from engine.material._measured_kernels import any_quotients, quotients

        is_usual = q[kinds.ADAPTIVE] == 0.0 and q[kinds.PART] <= kinds.WHOLE
        return colours_number(quotients if is_usual else any_quotients)

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        name = self.factor(factor_name).name
        return measurement_of(params).curve(self.curve_of.get(name, name), gamma, number(params, "smoothing"))

    def samples(self, factor_name: str, params: Parameters) -> tuple[Float64Array, Float64Array] | None:
        measurement = measurement_of(params)
        if not measurement.is_read or number(params, "smoothing") == 0.0:
            return None
        name = self.curve_of.get(factor_name, factor_name)
        return node_angles(name in HALF_ANGLE_CURVES), measurement.nodes(name)

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") * measurement_of(params).strength(self.part)

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[kinds.TABLE], q[kinds.SMOOTHING] = measurement_of(params).number, number(params, "smoothing")
        q[kinds.CHANNEL], q[kinds.PART] = kinds.MEAN, PARTS[self.part]
        q[kinds.ADAPTIVE] = measurement_of(params).is_anisotropic
        return q

    def bind_parameters(self, q: Float64Array) -> Float64Array:
        bound = np.array(q, float)
        if q[kinds.TABLE]:
            from engine.measured.tables import table_of

            table = table_of(int(q[kinds.TABLE]))
            bound[kinds.TABLE] = table.samples.ctypes.data
            bound[kinds.SMOOTHING] = table.curves(float(q[kinds.SMOOTHING])).ctypes.data
        return bound

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        measurement = measurement_of(params)
        if not measurement.is_read:
            above = (wi[:, 2] > kinds.GRAZING) & (wo[:, 2] > kinds.GRAZING)
            return channels(params, "scale") * np.where(above, 1.0 / np.pi, 0.0)[:, None]
        from engine.measured.measurement import evaluate_part
        from engine.measured.tables import table_of

        smoothing, whole = number(params, "smoothing"), np.zeros((len(wi), 3))
        above = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
        whole[above] = table_of(measurement.number).evaluate(wi[above], wo[above])
        return channels(params, "scale") * evaluate_part(whole, measurement, self.part, smoothing, wi, wo)


def measurement_of(params: Parameters) -> Measurement:
    """The measurement of a layer's parameters."""
    value = params["file"]
    assert isinstance(value, Measurement)
    return value


def parameters(*curves: str) -> tuple[Parameter, ...]:
    """The parameter table of a measured model with these curves: "A", "B", "o"."""
    return (
        Parameter(
            "file",
            "file",
            NO_MEASUREMENT,
            "Measured",
            "The file of the measurement. Curves are factors fitted to it; the residual is kept as measured.",
            (*curves, "scale", "quotient"),  # type: ignore[arg-type]
        ),
        Parameter(
            "smoothing",
            "scalar",
            0.0,
            "Smoothing",
            "Takes noise out of the curves, dots being what was found; unedited the picture stays as measured.",
            (*curves, "quotient"),  # type: ignore[arg-type]
        ),
        Parameter(
            "scale",
            "rgb",
            (1.0, 1.0, 1.0),
            "Scale",
            "Strength and colour: 1 is as measured.",
            ("scale",),
            maximum=4.0,
        ),
    )


class Measured(MeasuredModel):
    """rho_s = s q_s G(theta_d) H(theta_h) S(theta_o): the part of the measurement above its diffuse part. S is constant
    where it does not make the fit better."""

    name = "measured"
    label = "Measured, highlight"
    tooltip = "The highlight of a measured surface, as it was measured and as you bend it."
    part = "specular"
    factors = (THETA_H, THETA_D)
    view_factor = THETA_O
    curve_of = {"theta_o": "s"}
    parameters = parameters("A", "B", "o")


class MeasuredAround(MeasuredModel):
    """rho_s = s q_s H(theta_h) P(phi_h): the same part, with a curve over the azimuth of the half vector."""

    name = "measured_around"
    label = "Measured, highlight around"
    tooltip = "The highlight of a measured surface, by its profile and by where around its middle it is bright."
    part = "around"
    factors = (THETA_H, PHI_H)
    parameters = parameters("A", "B")


class MeasuredTwist(MeasuredModel):
    """rho_s = s q_s H(theta_h) Q(phi_d): the same part, with a curve over the azimuth of wi about the half vector."""

    name = "measured_twist"
    label = "Measured, highlight by twist"
    tooltip = "The highlight of a measured surface, by its profile and by how light and view turn about its middle."
    part = "twist"
    factors = (THETA_H, PHI_D)
    parameters = parameters("A", "B")


class MeasuredBrushed(MeasuredModel):
    """rho_s = s q_s U(theta_u) V(theta_v): the same part of a brushed surface, by the slopes of the half vector along
    and across, as `ward_anisotropic` has them."""

    name = "measured_brushed"
    label = "Measured, brushed highlight"
    tooltip = "The highlight of a measured brushed surface, by its profiles along and across the brushing."
    part = "brushed"
    factors = (SLOPE_U, SLOPE_V)
    parameters = parameters("A", "B")


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


HIGHLIGHT_MODELS: dict[Part, Model] = {
    model.part: model for model in (Measured(), MeasuredAround(), MeasuredTwist(), MeasuredBrushed())
}
MODELS = (*HIGHLIGHT_MODELS.values(), MeasuredDiffuse(), MeasuredCloth())
