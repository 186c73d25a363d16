"""The gloss, the coat and the metals of [OpenPBR] and [StandardSurface]: GGX with Smith's masking by height,

    rho = scale D(theta_h) F(theta_d) G2(wi, wo) / (4 cos_i cos_o).

`Varnish` is a rough dielectric on other layers, with the exact Fresnel term F of its index; `SchlickVarnish` has
Schlick's term. What lies under them is dimmed by

    1 - max(scale) E(theta_o),      E = ∫ D F G2 / (4 cos_i cos_o) cos_i d omega_i,

the albedo scaling of both models; E is that of the edited curves. Clear coats of glTF have another form (`Clearcoat` in
`engine.material.dielectric`): their E is the Fresnel term at theta_o.

Metals have light that facets reflect several times [Turquin19] in their curve over the view,

    f_o = 1 + s (1 - E1) / E1,      E1: the E of F = 1;      s: what a facet reflects.

`TintedMicrofacet` has Schlick's term S with a tint at 82°, where cos = 1/7 [Kutz21]:

    F = S(cos) - (1 - tint) S(1/7) kappa(cos) / kappa(1/7),      kappa = cos (1 - cos)^6,

and `Metal` the exact one of a complex index.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar

import numpy as np

from engine.material import kinds
from engine.material.dielectric import COAT_INDEX, F0, F90, WHITE_TINT, Gloss, schlick_curve
from engine.material.microfacet import ROUGHNESS, SMALLEST_ALPHA, conductor_fresnel, directions, ggx
from engine.material.model import THETA_D, THETA_H, THETA_O, Float64Array, Parameters, channels, grey, number
from engine.material.parameters import ETA, EXTINCTION, Parameter
from engine.material.sheen import view_angles

# Nodes of the quadrature of the directional albedo: half vectors by GGX's density, azimuths in half a turn.
_N_FACETS, _N_PHI, _N_SEEN = 96, 24, 192
_N_FRESNEL = 181
_N_COSINES = 64  # parts of cos(theta_d) in means over it
INDEX: Parameter = dataclasses.replace(
    COAT_INDEX, tooltip="Index of refraction: 1.5 is varnish, which reflects 4 % head-on; more reflects more.",
    drives=("B",), minimum=1.01, maximum=5.0, soft=(1.0, 3.0),
)  # fmt: skip


EDGE_TINT = Parameter(
    "f82",
    "rgb",
    (1.0, 1.0, 1.0),
    "Edge tint F₈₂",
    "Multiplies what the metal reflects at 82°, near the edge of a ball: 1 is Schlick's curve.",
    ("B",),
)
_EDGE = 1.0 / 7.0  # the cosine of 82°


SEVERAL = Parameter(
    "several",
    "rgb",
    (0.5, 0.5, 0.5),
    "Scattered again",
    "What a facet reflects of light that others sent to it: 0 leaves rough metals dark, their colour leaves none.",
    ("o",),
)


_ROUGHNESS = dataclasses.replace(ROUGHNESS, drives=("A", "o", "quotient"))  # of metals


class FacetsByHeight(Gloss):
    """f_A = D, f_B = F, f_q = scale; the quotient is G2 / (4 cos_i cos_o), correlated by height [Heitz14, eq. 99]."""

    kind = kinds.OWN

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        q = np.zeros(kinds.N_QUOTIENT_PARAMETERS)
        q[0] = max(number(params, "alpha"), SMALLEST_ALPHA)
        return q

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: alpha."""
        a2 = q[0] * q[0]
        length_i = math.sqrt(iz * iz + a2 * (ix * ix + iy * iy))
        length_o = math.sqrt(oz * oz + a2 * (ox * ox + oy * oy))
        return 0.5 * iz / (length_i * oz + length_o * iz)

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        d, alpha = directions(wi, wo), max(number(params, "alpha"), SMALLEST_ALPHA)
        cos_i, cos_o = np.where(d.above, d.cos_i, 1.0), np.where(d.above, d.cos_o, 1.0)
        visible = masking_by_height(cos_i, cos_o, alpha) / (4.0 * cos_i * cos_o)
        lobe = np.where(d.above, ggx(d.cos_h, d.sin2_h, alpha) * visible, 0.0)
        return channels(params, "scale") * self.fresnel(params, d.cos_d) * lobe[:, None]


def masking_by_height(cos_i: Float64Array, cos_o: Float64Array, alpha: float) -> Float64Array:
    """Smith's G2 of GGX: 1 / (1 + Lambda_i + Lambda_o) [Heitz14, eq. 99]."""
    lambdas = [0.5 * np.sqrt(1.0 + alpha**2 * (1.0 - c * c) / (c * c)) - 0.5 for c in (cos_i, cos_o)]
    return np.asarray(1.0 / (1.0 + lambdas[0] + lambdas[1]))


class Varnish(FacetsByHeight):
    """See the module."""

    name = "varnish"
    label = "Varnish"
    tooltip = "A clear gloss or coat on the other layers, which takes from them what it reflects, angle by angle."
    is_cover = True
    parameters: ClassVar[tuple[Parameter, ...]] = (ROUGHNESS, INDEX, dataclasses.replace(WHITE_TINT, maximum=1.0))

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return grey(conductor_fresnel(cosine, np.array(number(params, "ior")), np.zeros(())))

    def coverage(
        self, params: Parameters, curve: Callable[[str], Callable[[Float64Array], Float64Array]], theta_o: Float64Array
    ) -> Float64Array:
        alpha = max(number(params, "alpha"), SMALLEST_ALPHA)
        theta_h = facet_angles(alpha)
        generated = ggx(np.cos(theta_h), np.sin(theta_h) ** 2, alpha)
        profile = curve(THETA_H.name)(theta_h).max(axis=1) / generated
        fresnel = self.average(curve(THETA_D.name)(_difference_angles()))
        albedo = _directional_albedo(alpha, profile.tobytes(), np.ascontiguousarray(fresnel).tobytes())
        share = float(channels(params, "scale").max())
        return np.asarray(share * np.interp(theta_o, view_angles(), albedo), np.float64)

    def average(self, curve: Float64Array) -> Float64Array:
        """The one curve (N,) of three (N, 3) by which what lies beneath is dimmed."""
        return curve.max(axis=1)


class SchlickVarnish(Varnish):
    """See the module. What lies beneath loses the mean of the three channels, as UsdPreviewSurface has it."""

    name = "schlick_varnish"
    label = "Varnish, coloured"
    tooltip = "A gloss by its colours head-on and at grazing angles, which takes their mean from the other layers."
    parameters = (ROUGHNESS, F0, F90, dataclasses.replace(WHITE_TINT, maximum=1.0))

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return schlick_curve(channels(params, "f0"), number(params, "f90"), cosine)

    def average(self, curve: Float64Array) -> Float64Array:
        return np.asarray(curve.mean(axis=1))


def facet_angles(alpha: float) -> Float64Array:
    """Angles theta_h at the middles of parts that GGX's D cos_h weights alike: tan = alpha sqrt(x / (1 − x))
    [Walter07, eq. 35]."""
    x = (np.arange(_N_FACETS) + 0.5) / _N_FACETS
    return np.asarray(np.arctan(alpha * np.sqrt(x / (1.0 - x))))


def _difference_angles() -> Float64Array:
    return np.linspace(0.0, 0.5 * math.pi, _N_FRESNEL)


@lru_cache(maxsize=64)
def _directional_albedo(alpha: float, profile: bytes, fresnel: bytes) -> Float64Array:
    """Directional albedo at `view_angles`. profile: D over GGX's at `facet_angles`; fresnel: F at angles theta_d.

    With d omega_i = 4 cos_d d omega_h, the integral is the mean of F G2 cos_d / (cos_o cos_h) over half vectors by
    their density D cos_h.
    """
    theta = facet_angles(alpha)[:, None]
    phi = (np.arange(_N_PHI) + 0.5) * (math.pi / _N_PHI)
    ratio, curve = np.frombuffer(profile)[:, None], np.frombuffer(fresnel)
    found = np.empty(len(view_angles()))
    for k, angle in enumerate(view_angles()):
        sine, cos_o = math.sin(angle), math.cos(angle)
        cos_d = np.sin(theta) * np.cos(phi) * sine + np.cos(theta) * cos_o
        cos_i = 2.0 * cos_d * np.cos(theta) - cos_o
        is_seen = (cos_d > 0.0) & (cos_i > 0.0)
        cos_i, cos_d = np.where(is_seen, cos_i, 1.0), np.where(is_seen, np.minimum(cos_d, 1.0), 1.0)
        masking = masking_by_height(cos_i, np.array([cos_o]), alpha)
        reflected = np.interp(np.arccos(cos_d), _difference_angles(), curve)
        weight = ratio * reflected * masking * cos_d / (cos_o * np.cos(theta))
        found[k] = np.mean(np.where(is_seen, weight, 0.0))
    found.flags.writeable = False
    return found


class ScatteringAgain(FacetsByHeight):
    """Metals with f_o, see the module. Light and view cannot be exchanged."""

    is_reciprocal = False
    view_factor = THETA_O

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is not THETA_O:
            return super().generate(factor_name, params, gamma)
        return 1.0 + channels(params, "several") * lost_light(number(params, "alpha"), gamma)[:, None]

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        lost = lost_light(number(params, "alpha"), np.arccos(np.clip(wo[:, 2], 0.0, 1.0)))
        return super().brdf(params, wi, wo) * (1.0 + channels(params, "several") * lost[:, None])


def lost_light(alpha: float, theta_o: Float64Array) -> Float64Array:
    """(1 - E1) / E1 (N,) at angles of the view: what facets keep of light over what they reflect of it, if they are
    white. 0 at grazing angles, from which no facet hides another."""
    angles, lost = (
        np.append(view_angles(), 0.5 * math.pi),
        np.append(_scattered_again(max(alpha, SMALLEST_ALPHA))[0], 0.0),
    )
    return np.asarray(np.interp(theta_o, angles, lost))


def mean_seen_again(alpha: float, fresnel: Callable[[Float64Array], Float64Array]) -> Float64Array:
    """What facets reflect of light that others sent to them: the mean (C,) of a Fresnel term over pairs of directions,
    by what rough metals reflect of them times (1 - E1) / E1 of the view. fresnel: values (N, C) at cosines (N,) of
    theta_d.

    On rough surfaces facets are seen from their front, so that less counts of Schlick's rise than the 1/21 of a mean by
    the cosine: 0.006 at alpha = 0.64.
    """
    _, weights = _scattered_again(max(alpha, SMALLEST_ALPHA))
    return np.asarray(weights @ fresnel((np.arange(_N_COSINES) + 0.5) / _N_COSINES))


@lru_cache(maxsize=64)
def _scattered_again(alpha: float) -> tuple[Float64Array, Float64Array]:
    """(1 - E1) / E1 at `view_angles`, and the weights of parts of cos(theta_d) in `mean_seen_again`. E1 is the mean of
    G2 / G1 over half vectors as the view sees them: evenly spread ones on a cap of the sphere, stretched [Dupuy23]."""
    u = (np.arange(_N_SEEN)[:, None] + 0.5) / _N_SEEN
    phi = (np.arange(_N_PHI) + 0.5) * (math.pi / _N_PHI)
    views = view_angles()
    lost, weights = np.empty(len(views)), np.empty((len(views), _N_COSINES))
    for k, angle in enumerate(views):
        sine, cos_o = math.sin(angle), math.cos(angle)
        length = math.hypot(alpha * sine, cos_o)
        x, z = alpha * sine / length, cos_o / length
        up = (1.0 - u) * (1.0 + z) - z
        out = np.sqrt(np.clip(1.0 - up * up, 0.0, 1.0))
        half = [alpha * (out * np.cos(phi) + x), alpha * out * np.sin(phi), np.broadcast_to(up + z, (_N_SEEN, _N_PHI))]
        size = np.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)
        cos_d = (half[0] * sine + half[2] * cos_o) / size
        cos_i = 2.0 * cos_d * half[2] / size - cos_o
        seen = cos_i > 0.0
        both = masking_by_height(np.where(seen, cos_i, 1.0), np.array([cos_o]), alpha)
        one = 2.0 * cos_o / (cos_o + math.sqrt(cos_o * cos_o + alpha * alpha * sine * sine))
        reflected = np.where(seen, both / one, 0.0)
        lost[k] = max(1.0 / float(reflected.mean()) - 1.0, 0.0)
        part = np.clip(cos_d * _N_COSINES, 0, _N_COSINES - 1).astype(int)
        in_parts = np.bincount(part.ravel(), reflected.ravel(), _N_COSINES)
        weights[k] = lost[k] * math.sin(2.0 * angle) * in_parts  # by the solid angle of the view, and its cosine
    steps = np.gradient(views)
    total = steps @ weights
    total = total / total.sum() if total.sum() > 0.0 else np.full(_N_COSINES, 1.0 / _N_COSINES)
    for each in (lost, total):
        each.flags.writeable = False
    return lost, total


class TintedMicrofacet(ScatteringAgain):
    """See the module."""

    name = "tinted_microfacet"
    label = "Rough metal, edge tint"
    tooltip = "Metal by its colour head-on and what tints it near the edge of a ball, as OpenPBR describes it."
    parameters = (_ROUGHNESS, F0, F90, EDGE_TINT, SEVERAL, WHITE_TINT)

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        f0, f90 = channels(params, "f0"), number(params, "f90")
        schlick, at_edge = (schlick_curve(f0, f90, each) for each in (cosine, np.array([_EDGE])))
        dip = cosine * np.clip(1.0 - cosine, 0.0, 1.0) ** 6 / (_EDGE * (1.0 - _EDGE) ** 6)
        return np.asarray(np.maximum(schlick - (1.0 - channels(params, "f82")) * at_edge * dip[:, None], 0.0))


class Metal(ScatteringAgain):
    """See the module."""

    name = "metal"
    label = "Rough metal, bright"
    tooltip = "Metal by its index of refraction that stays bright where it is rough, as Standard Surface describes it."
    parameters = (_ROUGHNESS, ETA, EXTINCTION, SEVERAL, WHITE_TINT)

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return np.asarray(conductor_fresnel(cosine[:, None], channels(params, "eta"), channels(params, "k")))


MODELS = (Varnish(), SchlickVarnish(), TintedMicrofacet(), Metal())
