"""Microfacets described by their reflectance, the diffuse base beneath them, and a coat over both: the reflection of
glTF [glTF20, B] and of its coat [glTF20, KHR_materials_clearcoat], in the editable factors of [BenArtzi07, eq. 3.1].

    gloss   D(theta_h) F(theta_d) G / (4 cos_i cos_o)          F = F0 + (F90 - F0)(1 - cos theta_d)^5
    base    (1 - max F(theta_d)) albedo / pi                   the maximum is over the channels
    coat    s E(theta_o) D(theta_h) G / (4 cos_i cos_o)        E = R + (1 - R)(1 - cos theta_o)^5,  R of an index

Gloss and base share F0 and F90 if the base `follows` the gloss. What lies under a coat is dimmed by 1 - s E(theta_o)
(`Layer.under`). G is Smith's for GGX, separable, as the specification prints it, and not the height-correlated form of
many viewers, which reflects up to a quarter more from rough surfaces at grazing angles.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from engine.material import kinds
from engine.material.diffuse import ALBEDO
from engine.material.microfacet import (
    ROUGHNESS,
    SMALLEST_ALPHA,
    Directions,
    directions,
    ggx,
    schlick_fresnel,
    smith_ggx,
)
from engine.material.model import (
    THETA_D,
    THETA_H,
    THETA_O,
    Factor,
    Float64Array,
    Model,
    Parameters,
    channels,
    grey,
    number,
)
from engine.material.parameters import TINT, Parameter, reflectance_of_index

F0 = Parameter(
    "f0",
    "rgb",
    (0.04, 0.04, 0.04),
    "Facing F₀",
    "Share of each colour that the gloss reflects head-on: 0.04 is plastic or varnish, the metal's colour for metal.",
    ("B",),
)
F90 = Parameter(
    "f90",
    "scalar",
    1.0,
    "Grazing F₉₀",
    "Share of light that the gloss reflects at grazing angles: 1 for smooth surfaces, less where gloss is weak.",
    ("B",),
)
BENEATH = Factor("beneath", kinds.THETA_D, "beneath θ_d", "What the gloss above lets through, from head-on to grazing.")
WHITE_TINT = dataclasses.replace(TINT, default=(1.0, 1.0, 1.0))
STRENGTH = Parameter(
    "scale", "scalar", 1.0, "Strength", "How much of the coat there is: 0 is none, 1 covers everything.", ("scale",)
)
COAT_INDEX = Parameter(
    "ior",
    "scalar",
    1.5,
    "Index n",
    "Index of refraction of the coat: 1.5 is varnish, which reflects 4 % head-on; more reflects more.",
    ("o",),
    minimum=1.0,
    maximum=3.0,
)


class Gloss(Model):
    """rho = scale D(theta_h) F(theta_d) G1(wi) G1(wo) / (4 cos_i cos_o), of some Fresnel curve F; GGX's D and G1.

    f_A = D, f_B = F, f_q = scale. The quotient is that of `rough_conductor`.
    """

    kind = kinds.ROUGH_CONDUCTOR
    factors = (THETA_H, THETA_D)

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        """F (N, 3) at cosines of theta_d (N,)."""
        raise NotImplementedError

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is THETA_H:
            return grey(ggx(np.cos(gamma), np.sin(gamma) ** 2, number(params, "alpha")))
        return self.fresnel(params, np.cos(gamma))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        return _smith_parameters(super().quotient_parameters(params), params)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        return channels(params, "scale") * self.fresnel(params, d.cos_d) * _facets(d, params)[:, None]


class Microfacet(Gloss):
    """A rough surface with F = F0 + (F90 - F0)(1 - cos theta_d)^5: specular_brdf of [glTF20, B.2] times its Fresnel."""

    name = "microfacet"
    label = "Rough surface"
    tooltip = "Plastic, varnish or metal by what it reflects head-on and at grazing angles, as glTF files describe it."
    parameters = (ROUGHNESS, F0, F90, WHITE_TINT)

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return schlick_curve(channels(params, "f0"), number(params, "f90"), cosine)


class DiffuseBase(Model):
    """rho = albedo f_A(theta_d) / pi,  f_A = 1 - max over channels of F0 + (F90 - F0)(1 - cos theta_d)^5.

    The base of fresnel_mix [glTF20, B.2.2], beneath a gloss with these F0 and F90, which it takes from the layer that
    it follows.
    """

    name = "diffuse_base"
    label = "Diffuse under gloss"
    tooltip = "The coloured base of plastic or paint: even light, less what the gloss above it reflects."
    kind = kinds.LAMBERT
    is_diffuse = True
    factors = (BENEATH,)
    parameters = (ALBEDO, *(dataclasses.replace(each, drives=("A",)) for each in (F0, F90)))

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        """F of the gloss (N, 3) at cosines of theta_d (N,)."""
        return schlick_curve(channels(params, "f0"), number(params, "f90"), cosine)

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return grey(self._let_through(params, np.cos(gamma)))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "albedo")

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        let_through = np.where(d.above, self._let_through(params, d.cos_d), 0.0)
        return channels(params, "albedo") / math.pi * let_through[:, None]

    def _let_through(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        """1 - max F, (N,)."""
        return np.clip(1.0 - self.fresnel(params, cosine).max(axis=1), 0.0, 1.0)


class Clearcoat(Model):
    """rho = s E(theta_o) D(theta_h) G1(wi) G1(wo) / (4 cos_i cos_o),  E = R + (1 - R)(1 - cos theta_o)^5.

    The layer of fresnel_coat [glTF20, KHR_materials_clearcoat]: E is taken at the view's angle to the surface, so that
    it is also what the layers beneath lose, and light and view cannot be exchanged. f_A = D, f_o = E, f_q = s.
    """

    name = "clearcoat"
    label = "Clear coat"
    tooltip = "A clear varnish on the other layers: it adds a gloss of its own and dims what lies under it."
    kind = kinds.ROUGH_CONDUCTOR
    is_cover = True
    is_reciprocal = False
    factors = (THETA_H,)
    view_factor = THETA_O
    parameters = (dataclasses.replace(ROUGHNESS, default=0.01), COAT_INDEX, STRENGTH)

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is THETA_O:
            return grey(_coat_fresnel(params, np.cos(gamma)))
        return grey(ggx(np.cos(gamma), np.sin(gamma) ** 2, number(params, "alpha")))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        return _smith_parameters(super().quotient_parameters(params), params)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        return channels(params, "scale") * (_coat_fresnel(params, d.cos_o) * _facets(d, params))[:, None]

    def coverage(
        self, params: Parameters, curve: Callable[[str], Callable[[Float64Array], Float64Array]], theta_o: Float64Array
    ) -> Float64Array:
        return number(params, "scale") * curve(THETA_O.name)(theta_o).max(axis=1)


def schlick_curve(f0: Float64Array, f90: float, cosine: Float64Array) -> Float64Array:
    """F0 + (F90 - F0)(1 - cosine)^5, (N, 3), for F0 (3,) and cosines (N,)."""
    rise = np.clip(1.0 - cosine, 0.0, 1.0)[:, None] ** 5
    return np.asarray(f0 + (f90 - f0) * rise)


def _coat_fresnel(params: Parameters, cosine: Float64Array) -> Float64Array:
    facing = reflectance_of_index(number(params, "ior"))
    return schlick_fresnel(cosine, float(facing))  # type: ignore[arg-type]


def _facets(d: Directions, params: Parameters) -> Float64Array:
    """D G1(wi) G1(wo) / (4 cos_i cos_o), (N,), 0 below the horizon."""
    alpha = number(params, "alpha")
    cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
    visible = smith_ggx(cos_i, d.sin2_i, alpha) * smith_ggx(cos_o, d.sin2_o, alpha)
    return np.where(d.above, ggx(d.cos_h, d.sin2_h, alpha) * visible / (4.0 * cos_i * cos_o), 0.0)


def _smith_parameters(q: Float64Array, params: Parameters) -> Float64Array:
    q[kinds.ROUGH_DISTRIBUTION] = kinds.GGX
    q[kinds.ROUGH_ALPHA] = max(number(params, "alpha"), SMALLEST_ALPHA)
    return q


MODELS = (Microfacet(), DiffuseBase(), Clearcoat())
