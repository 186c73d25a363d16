"""The gloss, the coat and the metal of [OpenPBR]; the first two are those of [StandardSurface] as well.

`Varnish` is a rough dielectric on other layers, which it dims by its directional albedo:

    rho = scale D(theta_h) F(theta_d) G1(wi) G1(wo) / (4 cos_i cos_o),

with GGX's D and Smith's G1, and the exact Fresnel term F of its index. What lies under it is dimmed by

    1 - max(scale) E(theta_o),      E = ∫ D F G1 G1 / (4 cos_i cos_o) cos_i d omega_i,

the albedo scaling of both models; E is that of the edited curves. Clear coats of glTF have another form (`Clearcoat` in
`engine.material.dielectric`): their E is the Fresnel term at theta_o.

`TintedMicrofacet` has Schlick's term S with a tint at 82°, where cos = 1/7 [Kutz21]:

    F = S(cos) - (1 - tint) S(1/7) kappa(cos) / kappa(1/7),      kappa = cos (1 - cos)^6.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from engine.material.dielectric import COAT_INDEX, F0, F90, WHITE_TINT, Gloss, schlick_curve
from engine.material.microfacet import ROUGHNESS, SMALLEST_ALPHA, conductor_fresnel, ggx, smith_ggx
from engine.material.model import THETA_D, THETA_H, Float64Array, Parameters, channels, grey, number
from engine.material.parameters import Parameter
from engine.material.sheen import view_angles

# Nodes of the quadrature of the directional albedo: half vectors by GGX's density, azimuths in half a turn.
_N_FACETS, _N_PHI = 96, 24
_N_FRESNEL = 181
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


class Varnish(Gloss):
    """See the module. f_A = D, f_B = F, f_q = scale; the quotient is that of `rough_conductor`."""

    name = "varnish"
    label = "Varnish"
    tooltip = "A clear gloss or coat on the other layers, which takes from them what it reflects, angle by angle."
    is_cover = True
    parameters = (ROUGHNESS, INDEX, dataclasses.replace(WHITE_TINT, maximum=1.0))

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        return grey(conductor_fresnel(cosine, np.array(number(params, "ior")), np.zeros(())))

    def coverage(
        self, params: Parameters, curve: Callable[[str], Callable[[Float64Array], Float64Array]], theta_o: Float64Array
    ) -> Float64Array:
        alpha = max(number(params, "alpha"), SMALLEST_ALPHA)
        theta_h = facet_angles(alpha)
        generated = ggx(np.cos(theta_h), np.sin(theta_h) ** 2, alpha)
        profile = curve(THETA_H.name)(theta_h).max(axis=1) / generated
        fresnel = curve(THETA_D.name)(_difference_angles()).max(axis=1)
        albedo = _directional_albedo(alpha, profile.tobytes(), np.ascontiguousarray(fresnel).tobytes())
        share = float(channels(params, "scale").max())
        return np.asarray(share * np.interp(theta_o, view_angles(), albedo), np.float64)


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

    With d omega_i = 4 cos_d d omega_h, the integral is the mean of F G1 G1 cos_d / (cos_o cos_h) over half vectors by
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
        masking = smith_ggx(cos_i, 1.0 - np.minimum(cos_i, 1.0) ** 2, alpha) * smith_ggx(
            np.array([cos_o]), np.array([sine**2]), alpha
        )
        reflected = np.interp(np.arccos(cos_d), _difference_angles(), curve)
        weight = ratio * reflected * masking * cos_d / (cos_o * np.cos(theta))
        found[k] = np.mean(np.where(is_seen, weight, 0.0))
    found.flags.writeable = False
    return found


class TintedMicrofacet(Gloss):
    """See the module. f_A = D, f_B = F, f_q = scale; the quotient is that of `rough_conductor`."""

    name = "tinted_microfacet"
    label = "Rough metal, edge tint"
    tooltip = "Metal by its colour head-on and what tints it near the edge of a ball, as OpenPBR describes it."
    parameters = (ROUGHNESS, F0, F90, EDGE_TINT, WHITE_TINT)

    def fresnel(self, params: Parameters, cosine: Float64Array) -> Float64Array:
        f0, f90 = channels(params, "f0"), number(params, "f90")
        schlick, at_edge = (schlick_curve(f0, f90, each) for each in (cosine, np.array([_EDGE])))
        dip = cosine * np.clip(1.0 - cosine, 0.0, 1.0) ** 6 / (_EDGE * (1.0 - _EDGE) ** 6)
        return np.asarray(np.maximum(schlick - (1.0 - channels(params, "f82")) * at_edge * dip[:, None], 0.0))


MODELS = (Varnish(), TintedMicrofacet())
