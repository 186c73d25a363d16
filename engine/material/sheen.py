"""Sheen of cloth: light that the ends of fibres scatter at grazing angles [EstevezKulla17; glTF20,
KHR_materials_sheen]."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar

import numpy as np

from engine.material.microfacet import cosine_power, directions
from engine.material.model import THETA_H, Float64Array, Model, Parameters, channels, grey, number
from engine.material.parameters import TINT, Parameter

# Nodes of the quadrature of the directional albedo: views, half vectors' angles, and azimuths in half a turn.
_N_VIEWS, _N_THETA, _N_PHI = 33, 96, 24
_STEEPEST = math.radians(89.5)


class Sheen(Model):
    """rho = scale D(theta_h) / ((1 + L(cos_i) + L(cos_o)) 4 cos_i cos_o),

    D = (2 + 1/alpha) sin(theta_h)^(1/alpha) / (2 pi): Charlie's distribution; L is the fit of its shadowing by
    [EstevezKulla17], without its softer terminator, which glTF does not have. f_A = D, f_q = scale; the rest is the
    quotient. glTF's roughness r is alpha = r^2. The sheen takes its directional albedo from what lies beneath, by the
    view alone: of glTF's two forms the one that factors.
    """

    name = "sheen"
    label = "Sheen"
    tooltip = (
        "A fuzz of fibres on the other layers, bright at grazing angles, as on velvet: it dims what lies under it."
    )
    is_cover = True
    is_masked: ClassVar[bool] = True
    factors = (THETA_H,)
    parameters = (
        Parameter(
            "alpha",
            "scalar",
            0.25,
            "Spread α",
            "How far the fibres stray from upright: small is a thin rim at grazing angles, 1 is a soft bloom.",
            ("A", "quotient"),
            minimum=0.01,
            maximum=1.0,
            logarithmic=True,
        ),
        dataclasses.replace(TINT, maximum=1.0),
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return grey(_charlie(np.cos(gamma) ** 2, number(params, "alpha")))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[:6] = _fit(number(params, "alpha"))
        return q

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: a, b, c, d, e of the fit l(x) = a / (1 + b x^c) + d x + e, and l(0.5)."""
        x = iz if iz < 0.5 else max(1.0 - iz, 0.0)
        y = oz if oz < 0.5 else max(1.0 - oz, 0.0)
        l_i = q[0] / (1.0 + q[1] * math.pow(x, q[2])) + q[3] * x + q[4]
        l_o = q[0] / (1.0 + q[1] * math.pow(y, q[2])) + q[3] * y + q[4]
        shadow_i = math.exp(l_i if iz < 0.5 else 2.0 * q[5] - l_i)
        shadow_o = math.exp(l_o if oz < 0.5 else 2.0 * q[5] - l_o)
        return 0.25 / ((1.0 + shadow_i + shadow_o) * oz)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d, alpha = directions(wi, wo), number(params, "alpha")
        cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
        visible = 0.25 / ((1.0 + _shadow(cos_i, alpha) + _shadow(cos_o, alpha)) * cos_i * cos_o)
        lobe = np.where(d.above, _charlie(d.cos_h**2, alpha) * visible, 0.0)
        return channels(params, "scale") * lobe[:, None]

    def coverage(
        self, params: Parameters, curve: Callable[[str], Callable[[Float64Array], Float64Array]], theta_o: Float64Array
    ) -> Float64Array:
        profile = np.ascontiguousarray((channels(params, "scale") * curve(THETA_H.name)(_half_angles())).max(axis=1))
        albedo = _directional_albedo(number(params, "alpha"), profile.tobytes(), self.is_masked)
        return np.asarray(np.interp(theta_o, view_angles(), albedo), np.float64)


class SoftSheen(Sheen):
    """rho = scale D(theta_h) / (4 (cos_i + cos_o - cos_i cos_o)): the sheen of [StandardSurface], without shadowing, as
    MaterialX has it; D is Charlie's, with alpha for its roughness."""

    name = "soft_sheen"
    label = "Sheen, soft"
    tooltip = "A fuzz of fibres on the other layers that do not shadow each other, as Standard Surface describes it."
    is_masked = False
    parameters = (dataclasses.replace(Sheen.parameters[0], drives=("A",)), *Sheen.parameters[1:])

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        return Model.quotient_parameters(self, params)

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: nothing."""
        return 0.25 * iz / (iz + oz - iz * oz)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        visible = 0.25 / np.where(d.above, d.cos_i + d.cos_o - d.cos_i * d.cos_o, 1.0)
        lobe = np.where(d.above, _charlie(d.cos_h**2, number(params, "alpha")) * visible, 0.0)
        return channels(params, "scale") * lobe[:, None]


def _charlie(cos2: Float64Array, alpha: float) -> Float64Array:
    """D (N,) of squared cosines (N,) of theta_h."""
    sine2 = np.clip(1.0 - cos2, 0.0, 1.0)
    return (2.0 + 1.0 / alpha) / (2.0 * math.pi) * cosine_power(np.sqrt(sine2), 1.0 - sine2, 1.0 / alpha)


def _fit(alpha: float) -> Float64Array:
    """a, b, c, d, e and l(0.5) of an alpha [EstevezKulla17]."""
    sharp = (1.0 - alpha) ** 2
    soft_fit = np.array([21.5473, 3.82987, 0.19823, -1.97760, -4.32054])
    sharp_fit = np.array([25.3245, 3.32435, 0.16801, -1.27393, -4.85967])
    a, b, c, d, e = (1.0 - sharp) * soft_fit + sharp * sharp_fit
    return np.array([a, b, c, d, e, a / (1.0 + b * 0.5**c) + d * 0.5 + e])


def _shadow(cosine: Float64Array, alpha: float) -> Float64Array:
    """L (N,): exp(l(x)) below a cosine of 0.5, exp(2 l(0.5) - l(1 - x)) above."""
    a, b, c, d, e, middle = _fit(alpha)
    x = np.where(cosine < 0.5, cosine, np.clip(1.0 - cosine, 0.0, 1.0))
    fit = a / (1.0 + b * x**c) + d * x + e
    return np.asarray(np.exp(np.where(cosine < 0.5, fit, 2.0 * middle - fit)))


def view_angles() -> Float64Array:
    """Angles of the view from 0 to `_STEEPEST`, dense towards it, where the albedo changes fast."""
    return np.asarray(_STEEPEST * (1.0 - np.linspace(1.0, 0.0, _N_VIEWS) ** 2))


def _half_angles() -> Float64Array:
    """Middles of even parts of [0, pi/2]."""
    return np.asarray((np.arange(_N_THETA) + 0.5) * (0.5 * math.pi / _N_THETA))


@lru_cache(maxsize=16)
def _directional_albedo(alpha: float, profile: bytes, is_masked: bool = True) -> Float64Array:
    """Directional albedo at `view_angles`, for the values of D at `_half_angles`: the integral of D V cos_i over wi,
    with d omega_i = 4 cos(theta_d) d omega_h; V with shadowing or without."""
    theta = _half_angles()[:, None]
    phi = (np.arange(_N_PHI) + 0.5) * (math.pi / _N_PHI)
    weight = np.frombuffer(profile)[:, None] * np.sin(theta) * (0.5 * math.pi / _N_THETA) * (2.0 * math.pi / _N_PHI)
    found = np.empty(_N_VIEWS)
    for k, angle in enumerate(view_angles()):
        sine, cos_o = math.sin(angle), math.cos(angle)
        cos_d = np.sin(theta) * np.cos(phi) * sine + np.cos(theta) * cos_o
        cos_i = 2.0 * cos_d * np.cos(theta) - cos_o
        is_seen = (cos_d > 0.0) & (cos_i > 0.0)
        cos_i = np.where(is_seen, cos_i, 1.0)
        if is_masked:
            visible = 1.0 / ((1.0 + _shadow(cos_i, alpha) + _shadow(np.array([cos_o]), alpha)) * cos_o)
        else:
            visible = cos_i / (cos_i + cos_o - cos_i * cos_o)
        found[k] = np.sum(np.where(is_seen, weight * cos_d * visible, 0.0))
    found.flags.writeable = False
    return found


MODELS = (Sheen(), SoftSheen())
