"""Ashikhmin's anisotropic highlights: Ashikhmin and Shirley's with one exponent along the tangent and one across
[BenArtzi07, 3.2]; with their ratio, or its width, as its one curve [BenArtzi07, 3.3.2]; and one that the user draws
over the half vector's angle and azimuth, as on satin or velvet [Ashikhmin00].
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from engine.material import kinds
from engine.material.microfacet import SMALLEST_ALPHA, Directions, cosine_power, directions, ggx, schlick_fresnel
from engine.material.model import (
    GAMMA_ALPHA,
    GAMMA_BETA,
    GAMMA_RATIO,
    GAMMA_WIDTH,
    PHI_H,
    THETA_H,
    Float64Array,
    Model,
    Parameters,
    channels,
    grey,
    number,
)
from engine.material.parameters import FACING, TINT, Parameter


class AshikhminShirley(Model):
    """rho = scale N cos(theta_h)^(n_u cos^2 phi_h + n_v sin^2 phi_h) F / (8 pi (h.k) max(cos_i, cos_o)).

    [BenArtzi07, eq. 3.3-3.8]: f_A = cos(gamma_alpha)^n_u, f_B = cos(gamma_beta)^n_v, f_q = scale N with N = sqrt((n_u +
    1)(n_v + 1)), and the rest is the quotient. Eq. 3.3 prints theta_d for h.k; we use h.k = cos(theta_d), as Ashikhmin
    and Shirley do.

    Fresnel is Schlick's with one grey facing reflectance, inside the quotient; colour is in `scale`. The two-term split
    of eq. 3.12, by which a coloured Fresnel factor is edited in real time, is available for layers of any model: see
    `Layer`. The model's diffuse part is a `lambert` layer.
    """

    name = "ashikhmin_shirley"
    label = "Ashikhmin-Shirley"
    tooltip = "Brushed metal: a highlight with its own sharpness along and across the brushing."
    kind = kinds.ASHIKHMIN_SHIRLEY
    factors = (GAMMA_ALPHA, GAMMA_BETA)
    quotient_names = ("reflectance",)
    parameters = (
        Parameter(
            "n_u",
            "scalar",
            20.0,
            "Exponent along nᵤ",
            "Sharpness of the highlight along the brushing.",
            ("A", "scale"),
            maximum=1e6,
            logarithmic=True,
            power=-0.5,
        ),
        Parameter(
            "n_v",
            "scalar",
            200.0,
            "Exponent across nᵥ",
            "Sharpness of the highlight across the brushing; unlike the other it makes the highlight a streak.",
            ("B", "scale"),
            maximum=1e6,
            logarithmic=True,
            power=-0.5,
        ),
        FACING,
        TINT,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        exponent = number(params, "n_u" if self.factor(factor_name) is GAMMA_ALPHA else "n_v")
        return grey(cosine_power(np.cos(gamma), np.sin(gamma) ** 2, exponent))

    def scale(self, params: Parameters) -> Float64Array:
        strength = math.sqrt((number(params, "n_u") + 1.0) * (number(params, "n_v") + 1.0))
        return channels(params, "scale") * strength

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        lobe = anisotropic_lobe(d, number(params, "n_u"), number(params, "n_v"), number(params, "reflectance"))
        return channels(params, "scale") * lobe[:, None]


def anisotropic_lobe(d: Directions, n_u: float, n_v: float, reflectance: float) -> Float64Array:
    """The specular term of Ashikhmin and Shirley, (N,), 1/sr; 0 below the horizon."""
    power = cosine_power(d.cos_h, d.sin2_h, n_u * d.cos2_phi_h + n_v * (1.0 - d.cos2_phi_h))
    steeper = np.where(d.above, np.maximum(d.cos_i, d.cos_o), 1.0)
    strength = math.sqrt((n_u + 1.0) * (n_v + 1.0)) / (8.0 * math.pi)
    lobe = strength * power * schlick_fresnel(d.cos_d, reflectance) / (d.cos_d * steeper)
    return np.asarray(np.where(d.above, lobe, 0.0))


def exponents_of(wide: float, ratio: float) -> tuple[float, float]:
    """(n_u, n_v) of a highlight with the exponent `wide` on its wide side and max(r, 1/r) times that on the other: the
    streak is along the tangent for a ratio r > 1, and turns across it for r < 1, as the vase of [BenArtzi07, 6.2.1]."""
    return (wide, wide * ratio) if ratio >= 1.0 else (wide / ratio, wide)


def signed(number: float, ratio: float) -> float:
    """The number with the sign that tells kernels whether a highlight of this ratio is turned (`kinds`)."""
    return number if ratio >= 1.0 else -number


WIDE = Parameter(
    "n_u",
    "scalar",
    20.0,
    "Exponent n",
    "Sharpness of the highlight on its wide side.",
    ("scale", "quotient"),
    minimum=1.0,
    maximum=1e3,
    logarithmic=True,
    power=-0.5,
)
RATIO = Parameter(
    "ratio",
    "scalar",
    10.0,
    "Anisotropy ratio r",
    "How many times sharper the highlight is across the brushing than along it: 1 is round, 100 a streak along it, "
    "0.01 one across. Where it turns, at 1, the picture follows when idle.",
    ("A", "scale"),
    minimum=1e-3,
    maximum=1e3,
    logarithmic=True,
    power=-0.5,
)


class AshikhminShirleyRatio(Model):
    """`ashikhmin_shirley` with one exponent n and a ratio r: the width on the wide side is fixed, its ratio to the
    width on the other side is edited.

    [BenArtzi07, eq. 3.13-3.15], which omit the squares of cos(phi_h) and sin(phi_h) that eq. 3.5 and 3.6 have, and take
    the base of the power itself for gamma_r; we use squares, and an angle as in eq. 3.7. For r >= 1:

        gamma_r = arccos(cos(theta_h)^(n sin^2 phi_h)),  f_A = cos(gamma_r)^r,
        rho_q = cos(theta_h)^(n cos^2 phi_h) F / (8 pi (h.k) max(cos_i, cos_o)),  f_q = scale sqrt((n + 1)(r n + 1)).

    For r < 1 sine and cosine of phi_h change places, and 1/r is in the place of r: the streak turns across the tangent
    [BenArtzi07, 6.2.1]. Eq. 3.14 itself with r < 1 was rejected: it has the highlight's tail compressed into the last
    band, where cos(gamma_r)^r falls from almost 1 to 0 within less than any band.
    """

    name = "ashikhmin_shirley_ratio"
    label = "Ashikhmin-Shirley, one ratio"
    tooltip = (
        "Brushed metal: Ashikhmin and Shirley's anisotropic highlight, a streak, with one curve. Its width on the wide "
        "side is fixed; the curve says how much narrower it is on the other, the anisotropy ratio."
    )
    kind = kinds.ASHIKHMIN_SHIRLEY_RATIO
    highlight_in_quotient = True
    factors = (GAMMA_RATIO,)
    parameters = (WIDE, RATIO, FACING, TINT)

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        ratio = number(params, "ratio")
        return grey(cosine_power(np.cos(gamma), np.sin(gamma) ** 2, max(ratio, 1.0 / ratio)))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") * strength_of(params)

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = super().quotient_parameters(params)
        q[:2] = number(params, "reflectance"), signed(number(params, "n_u"), number(params, "ratio"))
        return q

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        return streak(params, wi, wo)


class AshikhminShirleyWidth(Model):
    """`ashikhmin_shirley` with amount and direction of the anisotropy known: the width of the streak is edited.

    The single-factor form that [BenArtzi07, 3.3.2] mentions: with r fixed,

        gamma_w = arccos(cos(theta_h)^(cos^2 phi_h + r sin^2 phi_h)),  f_A = cos(gamma_w)^n,
        rho_q = F / (8 pi (h.k) max(cos_i, cos_o)),  f_q = scale sqrt((n + 1)(r n + 1)),

    for r >= 1; below, sine and cosine of phi_h change places and 1/r is in the place of r, as in
    `ashikhmin_shirley_ratio`.
    """

    name = "ashikhmin_shirley_width"
    label = "Ashikhmin-Shirley, one width"
    tooltip = (
        "Brushed metal: Ashikhmin and Shirley's anisotropic highlight, a streak, with one curve. How much longer than "
        "wide it is, and which way it lies, are fixed; the curve is its profile."
    )
    kind = kinds.ASHIKHMIN_SHIRLEY
    factors = (GAMMA_WIDTH,)
    parameters = (
        dataclasses.replace(WIDE, maximum=1e6, drives=("A", "scale")),
        dataclasses.replace(
            RATIO,
            drives=("scale", "quotient"),
            tooltip="How many times sharper the highlight is across the brushing than along it: 1 is round, 100 a "
            "streak along it, 0.01 one across. The picture follows when idle.",
        ),
        FACING,
        TINT,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        self.factor(factor_name)
        return grey(cosine_power(np.cos(gamma), np.sin(gamma) ** 2, number(params, "n_u")))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") * strength_of(params)

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q, ratio = super().quotient_parameters(params), number(params, "ratio")
        q[:2] = number(params, "reflectance"), signed(max(ratio, 1.0 / ratio), ratio)
        return q

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        return streak(params, wi, wo)


def strength_of(params: Parameters) -> float:
    """N of a highlight given by n and ratio."""
    n_u, n_v = exponents_of(number(params, "n_u"), number(params, "ratio"))
    return math.sqrt((n_u + 1.0) * (n_v + 1.0))


def streak(params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
    """The highlight given by n and ratio, (N, 3), 1/sr."""
    n_u, n_v = exponents_of(number(params, "n_u"), number(params, "ratio"))
    return (
        channels(params, "scale")
        * anisotropic_lobe(directions(wi, wo), n_u, n_v, number(params, "reflectance"))[:, None]
    )


class AshikhminHybrid(Model):
    """rho = scale p(h) F / (4 cos theta_d max(cos_i, cos_o)),  p(h) = f_A(theta_h) f_B(phi_h).

    The hybrid of [BenArtzi07, 3.4]: a formula for everything except the half vector, whose table is the two curves.
    Parameters give initial curves: f_A = D cos theta_h with D of GGX, so that p integrates to 1, and f_B = 1 + b cos 2
    phi_h. [Ashikhmin00] divides by a shadowing term that is an integral over p; we use the denominator of Ashikhmin and
    Shirley, with which the albedo is at most the integral of p for any curves: d omega_i = 4 cos theta_d d omega_h, and
    cos_i / max(cos_i, cos_o) is at most 1.

    f_q = 2 pi scale, because the quotient is that of `ashikhmin_shirley`, F / (8 pi cos theta_d max(cos_i, cos_o)).
    """

    name = "ashikhmin_hybrid"
    label = "Satin (drawn highlight)"
    tooltip = "A highlight with one curve from its middle outwards and one around: satin, velvet, woven cloth."
    kind = kinds.ASHIKHMIN_SHIRLEY
    factors = (THETA_H, PHI_H)
    quotient_names = ("reflectance",)
    parameters = (
        Parameter(
            "alpha",
            "scalar",
            0.3,
            "Roughness α",
            "Width of the highlight that the curve starts from.",
            ("A",),
            minimum=SMALLEST_ALPHA,
            maximum=1.0,
            logarithmic=True,
        ),
        Parameter(
            "bias",
            "scalar",
            0.5,
            "Bias b",
            "Where around its middle the highlight is bright: 1 along the threads, -1 across, 0 all around.",
            ("B",),
            minimum=-1.0,
        ),
        FACING,
        TINT,
    )

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is PHI_H:
            return grey(1.0 + number(params, "bias") * np.cos(2.0 * gamma))
        return grey(ggx(np.cos(gamma), np.sin(gamma) ** 2, number(params, "alpha")) * np.maximum(np.cos(gamma), 0.0))

    def scale(self, params: Parameters) -> Float64Array:
        return channels(params, "scale") * (2.0 * math.pi)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d = directions(wi, wo)
        around = 1.0 + number(params, "bias") * (2.0 * d.cos2_phi_h - 1.0)
        facets = ggx(d.cos_h, d.sin2_h, number(params, "alpha")) * d.cos_h * around
        fixed = schlick_fresnel(d.cos_d, number(params, "reflectance")) / (4.0 * d.cos_d)
        lobe = facets * fixed / np.where(d.above, np.maximum(d.cos_i, d.cos_o), 1.0)
        return channels(params, "scale") * np.where(d.above, lobe, 0.0)[:, None]


MODELS = (AshikhminShirley(), AshikhminShirleyRatio(), AshikhminShirleyWidth(), AshikhminHybrid())
