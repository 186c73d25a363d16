"""Diffuse models with curves over the angles of wi and wo: Lambert's, "LV" in [BenArtzi07], and Oren and Nayar's for
rough surfaces, such as plaster or clay, which stay bright towards the light [OrenNayar94], also as OpenPBR has it
[Portsmouth25].
"""

from __future__ import annotations

import math

import numpy as np

from engine.material import kinds
from engine.material.microfacet import directions
from engine.material.model import THETA_I, THETA_O, Float64Array, Model, Parameters, channels, number, ones
from engine.material.parameters import Parameter

ALBEDO = Parameter(
    "albedo",
    "rgb",
    (0.5, 0.5, 0.5),
    "Albedo",
    "Colour and brightness: the share of the light that is scattered back.",
    ("scale",),
)


class _Diffuse(Model):
    """What the diffuse models share: f_A(theta_i) f_o(theta_o), both 1 until the user edits them, and f_q = albedo."""

    is_diffuse = True
    factors = (THETA_I,)
    view_factor = THETA_O

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return ones(gamma)

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "albedo")


class Lambert(_Diffuse):
    """rho = albedo / pi, times f_A(theta_i) f_o(theta_o), both 1 until the user edits them."""

    name = "lambert"
    label = "Diffuse"
    tooltip = "Light scattered evenly, as by paper or chalk."
    kind = kinds.LAMBERT
    parameters = (ALBEDO,)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        above = directions(wi, wo).above
        return np.where(above[:, None], channels(params, "albedo") / math.pi, 0.0)


class OrenNayar(_Diffuse):
    """rho = albedo (A + B max(0, cos(phi_i - phi_o)) sin(alpha) tan(beta)) / (pi N),

    where alpha is the larger and beta the smaller of theta_i and theta_o, A = 1 - 0.5 s^2 / (s^2 + 0.33) and B = 0.45
    s^2 / (s^2 + 0.09) [OrenNayar94], and s the standard deviation of the facets' slopes. f_A(theta_i) and f_o(theta_o)
    are 1 until the user edits them, f_q = albedo; the static terms are the quotient [BenArtzi07, 3.4]. There are two
    terms, A and B cos sin tan, with the same curves; one quotient contains their sum, which s drives.

    As printed, a white surface reflects up to 1.4 % more than it receives, for small s at grazing angles, where the
    albedo is A + B / 2; we divide by N, which is that number if it is above 1.
    """

    name = "oren_nayar"
    label = "Rough diffuse"
    tooltip = "Light scattered by a rough surface, such as plaster, clay or the moon: flatter than diffuse."
    parameters = (
        ALBEDO,
        Parameter(
            "sigma",
            "scalar",
            0.4,
            "Roughness σ",
            "Spread of the facets' slopes: 0 is even diffuse light, more keeps the surface bright towards the light.",
            ("quotient",),
            unit="rad",
        ),
    )

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[:2] = oren_nayar_terms(number(params, "sigma"))
        return q

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: A / N and B / N. cos(phi_i - phi_o) sin(alpha) tan(beta) = (i_x o_x + i_y o_y) / max(cos_i, cos_o)."""
        return iz * (q[0] + q[1] * max(ix * ox + iy * oy, 0.0) / max(iz, oz)) / math.pi

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        constant, rough = oren_nayar_terms(number(params, "sigma"))
        theta_i, theta_o = (np.arctan2(np.hypot(v[:, 0], v[:, 1]), np.maximum(v[:, 2], 1e-12)) for v in (wi, wo))
        turn = np.arctan2(wi[:, 1], wi[:, 0]) - np.arctan2(wo[:, 1], wo[:, 0])
        lean = np.sin(np.maximum(theta_i, theta_o)) * np.tan(np.minimum(theta_i, theta_o))
        value = (constant + rough * np.maximum(np.cos(turn), 0.0) * lean) / math.pi
        return channels(params, "albedo") * np.where(d.above, value, 0.0)[:, None]


def oren_nayar_terms(sigma: float) -> tuple[float, float]:
    """A / N and B / N of `OrenNayar`."""
    s2 = sigma * sigma
    constant, rough = 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    most = max(constant + 0.5 * rough, 1.0)
    return constant / most, rough / most


class RoughDiffuse(_Diffuse):
    """rho = albedo (A (1 + r lean) + k (1 - E(theta_i)) (1 - E(theta_o)) / (1 - E_mean)) / pi  [Portsmouth25],

    lean = s / max(cos_i, cos_o) for s = cos phi_d sin_i sin_o > 0, else s;  A = 1 / (1 + (1/2 - 2 / (3 pi)) r), and E
    the directional albedo of the first term. The second one is light that facets of the albedo `several`, m, send to
    each other: k = m E_mean / (1 - m (1 - E_mean)). So a white surface reflects all light. The curves are as those of
    `OrenNayar`.
    """

    name = "rough_diffuse"
    label = "Rough diffuse, bright"
    tooltip = "Light scattered by a rough surface that loses none of it, as OpenPBR describes it."
    parameters = (
        ALBEDO,
        Parameter(
            "roughness",
            "scalar",
            0.5,
            "Roughness",
            "0 is even diffuse light, more keeps the surface bright towards the light.",
            ("quotient",),
        ),
        Parameter(
            "several",
            "scalar",
            0.5,
            "Scattered again",
            "The albedo of facets for light that others sent to them; the surface's own is right.",
            ("quotient",),
        ),
    )

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[:3] = rough_diffuse_terms(number(params, "roughness"), number(params, "several"))
        return q

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: A, A r and k / (1 - E_mean). 1 - E(theta) = 1 - A - A r G(theta) / pi."""
        lean = ix * ox + iy * oy
        if lean > 0.0:
            lean = lean / max(iz, oz)
        z_i, z_o = min(iz, 1.0), min(oz, 1.0)
        s_i, s_o = math.sqrt(1.0 - z_i * z_i), math.sqrt(1.0 - z_o * z_o)
        g_i = s_i * (math.acos(z_i) - s_i * z_i) + 2.0 / 3.0 * (s_i / iz * (1.0 - s_i * s_i * s_i) - s_i)
        g_o = s_o * (math.acos(z_o) - s_o * z_o) + 2.0 / 3.0 * (s_o / oz * (1.0 - s_o * s_o * s_o) - s_o)
        lost = max(1.0 - q[0] - q[1] * g_i / math.pi, 0.0) * max(1.0 - q[0] - q[1] * g_o / math.pi, 0.0)
        return iz / math.pi * (max(q[0] + q[1] * lean, 0.0) + q[2] * lost)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        r = number(params, "roughness")
        a, rough, k = rough_diffuse_terms(r, number(params, "several"))
        above = directions(wi, wo).above
        cos_i, cos_o = (np.where(above, v[:, 2], 1.0) for v in (wi, wo))
        s = (wi[:, :2] * wo[:, :2]).sum(axis=1)
        once = np.maximum(a * (1.0 + r * np.where(s > 0.0, s / np.maximum(cos_i, cos_o), s)), 0.0)
        lost = [np.maximum(1.0 - a - rough * _lean_integral(c) / math.pi, 0.0) for c in (cos_i, cos_o)]
        value = (once + k * lost[0] * lost[1]) / math.pi
        return channels(params, "albedo") * np.where(above, value, 0.0)[:, None]


def rough_diffuse_terms(roughness: float, several: float) -> tuple[float, float, float]:
    """A, A r and k / (1 - E_mean) of `RoughDiffuse`."""
    a = 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * math.pi)) * roughness)
    mean = rough_diffuse_mean(roughness)
    k = several * mean / (1.0 - several * (1.0 - mean))
    return a, a * roughness, k / max(1.0 - mean, 1e-6)


def rough_diffuse_mean(roughness: float) -> float:
    """E_mean of `RoughDiffuse`: what it reflects of light from all sides, at once."""
    rise, fall = 2.0 / 3.0 - 28.0 / (15.0 * math.pi), 0.5 - 2.0 / (3.0 * math.pi)
    return (1.0 + rise * roughness) / (1.0 + fall * roughness)


def _lean_integral(cosine: Float64Array) -> Float64Array:
    """G (N,): pi times the part of E for A r = 1."""
    sine, theta = np.sqrt(np.clip(1.0 - cosine**2, 0.0, 1.0)), np.arccos(np.minimum(cosine, 1.0))
    return np.asarray(sine * (theta - sine * cosine) + 2.0 / 3.0 * (sine / cosine * (1.0 - sine**3) - sine))


MODELS = (Lambert(), OrenNayar(), RoughDiffuse())
