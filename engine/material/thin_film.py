"""Iridescence: a gloss under a thin film, whose interference colours its Fresnel curve [BelcourBarla17; glTF20,
KHR_materials_iridescence], and the diffuse base beneath it.

With R12 of air and film, R23 of film and base, T = 1 - R12, the optical path D = 2 n d cos theta_2 and the phase phi of
the reflections, the light that leaves after m more passes is a cosine over the wavelength, whose integral under the
colour matching functions is known for Gaussians:

    F = R12 + Rs + sum over m = 1, 2 of (Rs - T) sqrt(R12 R23)^m  2 S(m D, m phi),   Rs = T^2 R23 / (1 - R12 R23).

It is glTF's approximation: two terms, Schlick's curve for each interface, one polarization, a base without absorption.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from engine.material.dielectric import F0, F90, WHITE_TINT, DiffuseBase, Gloss, schlick_curve
from engine.material.diffuse import ALBEDO
from engine.material.microfacet import ROUGHNESS
from engine.material.model import Float64Array, Parameters, channels, number
from engine.material.parameters import Parameter

FILM = (
    Parameter(
        "film", "scalar", 0.8, "Film", "How much of the gloss has the film's colours: 0 is none, 1 all of it.", ("B",)
    ),
    Parameter(
        "film_ior",
        "scalar",
        1.3,
        "Film index",
        "Index of refraction of the film: the more it differs from the surface's, the stronger the colours.",
        ("B",),
        minimum=1.0,
        maximum=5.0,
    ),
    Parameter(
        "thickness",
        "scalar",
        400.0,
        "Film thickness",
        "Thickness of the film: around half a wavelength its colours are clear, thicker films are paler.",
        ("B",),
        maximum=5000.0,
        soft=(0.0, 1200.0),
        unit="nm",
    ),
)
_XYZ_TO_RGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.969266, 1.8760108, 0.041556], [0.0556434, -0.2040259, 1.0572252]]
)
# Gaussians over 1/wavelength, 1/m, that add up to the colour matching functions: X twice, Y, Z.
_HEIGHTS = np.array([5.4856e-13, 9.7470e-14, 4.4201e-13, 5.2481e-13])
_MIDDLES = np.array([1.6810e6, 2.2399e6, 1.7953e6, 2.2084e6])
_VARIANCES = np.array([4.3278e9, 4.5282e9, 9.3046e9, 6.6121e9])
_NORM = 1.0685e-7


class ThinFilm(Gloss):
    """rho = scale D F G / (4 cos_i cos_o) with F a mixture, by `film`, of Schlick's curve and the film's."""

    name = "thin_film"
    label = "Rough surface, iridescent"
    tooltip = "Gloss under a thin film, as of oil, soap or a beetle's wing: its colour changes with the angle."
    parameters = (ROUGHNESS, F0, F90, *FILM, WHITE_TINT)

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return _mixed_curve(params, cosine)


class ThinFilmBase(DiffuseBase):
    """rho = albedo (1 - max F(theta_d)) / pi, beneath an iridescent gloss that it follows."""

    name = "thin_film_base"
    label = "Diffuse under iridescence"
    tooltip = "The coloured base of a glossy surface with a thin film: even light, less what the gloss reflects."
    parameters = (ALBEDO, *(dataclasses.replace(each, drives=("A",)) for each in (F0, F90, *FILM)))

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return _mixed_curve(params, cosine)


def _mixed_curve(params: Parameters, cosine: Float64Array) -> Float64Array:
    """F (N, 3) at cosines (N,)."""
    f0, film = channels(params, "f0"), number(params, "film")
    plain = schlick_curve(f0, number(params, "f90"), cosine)
    return (1.0 - film) * plain + film * film_curve(f0, number(params, "film_ior"), number(params, "thickness"), cosine)


def film_curve(f0: Float64Array, film_ior: float, thickness: float, cosine: Float64Array) -> Float64Array:
    """F (N, 3) of a film in air, thickness in nm, on a base that without it reflects f0 (3,) head-on."""
    inside = np.sqrt(np.maximum(1.0 - (1.0 - cosine**2) / film_ior**2, 0.0))
    root = np.sqrt(np.minimum(f0 + 1e-4, 0.9999))
    base_ior = (1.0 + root) / (1.0 - root)
    r12 = schlick_curve(np.full(3, ((film_ior - 1.0) / (film_ior + 1.0)) ** 2), 1.0, cosine)
    r23 = schlick_curve(((base_ior - film_ior) / (base_ior + film_ior)) ** 2, 1.0, inside)
    # The reflection inside the film from air shifts the phase by pi, and that from the base if this is the thinner one.
    shift = math.pi + np.where(base_ior < film_ior, math.pi, 0.0)
    path = 2e-9 * film_ior * thickness * inside
    both = np.clip(r12 * r23, 1e-5, 0.9999)
    passed = (1.0 - r12) ** 2 * r23 / (1.0 - both)
    total, strength = r12 + passed, passed - (1.0 - r12)
    for m in (1, 2):
        strength = strength * np.sqrt(both)
        total = total + 2.0 * strength * _sensitivity(m * path, m * shift)
    return np.clip(total, 0.0, 1.0)


def _sensitivity(path: Float64Array, shift: Float64Array) -> Float64Array:
    """S (N, 3), linear Rec. 709, of optical paths (N,) in metres and phases (3,)."""
    phase = 2.0 * math.pi * path[:, None]
    fading = _HEIGHTS * np.sqrt(2.0 * math.pi * _VARIANCES) * np.exp(-_VARIANCES * phase**2)
    x, more, y, z = (
        fading[:, k] * np.cos(_MIDDLES[k] * phase[:, 0] + shift[channel]) for k, channel in enumerate((0, 0, 1, 2))
    )
    return np.stack([x + more, y, z], axis=1) / _NORM @ _XYZ_TO_RGB.T


MODELS = (ThinFilm(), ThinFilmBase())
