"""The fuzz of [OpenPBR]: light that a layer of fibres scatters, many times over [Zeltner22].

The light that leaves towards a view has the distribution of a cosine lobe that a matrix has transformed. With
a(cos_o, r) and b(cos_o, r) of the inverse matrix, of roughness r, and wi in the frame whose x axis lies beneath wo,

    rho = scale E(theta_o) (a / l²)² / pi,      l² = (a x + b z)² + (a y)² + z².

The lobe keeps its power on the hemisphere, so that E is the directional albedo, at every roughness. Charlie's sheen
(`engine.material.sheen`), whose light is scattered once, cannot have it: its albedo head-on ends at 0.16 where that of
this is 0.35, at r = 1. E, a and b are MaterialX's fits to the tables of the paper.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from engine.material.microfacet import directions
from engine.material.model import THETA_I, THETA_O, Float64Array, Model, Parameters, channels, grey, number, ones
from engine.material.parameters import TINT, Parameter
from engine.material.sheen import view_angles

_N_RINGS, _N_PHI = 24, 24  # of the quadrature of an edited curve over the lobe, in half a turn


class Fuzz(Model):
    """See the module. f_A(theta_i) = 1 until the user edits it, f_o = E, f_q = scale; the lobe is the quotient. Light
    and view cannot be exchanged."""

    name = "fuzz"
    label = "Fuzz"
    tooltip = "Fibres on the other layers, from a thin rim of dust to a thick felt, as OpenPBR describes them."
    is_cover = True
    is_reciprocal = False
    factors = (THETA_I,)
    view_factor = THETA_O
    parameters = (
        Parameter(
            "roughness",
            "scalar",
            0.5,
            "Roughness",
            "How far the fibres stray from upright: small is a thin rim at grazing angles, 1 is felt.",
            ("o", "quotient"),
            minimum=0.01,
        ),
        dataclasses.replace(TINT, maximum=1.0),
    )
    quotient_names = ("roughness",)

    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        if self.factor(factor_name) is THETA_I:
            return ones(gamma)
        return grey(_albedo(np.cos(gamma), number(params, "roughness")))

    @staticmethod
    def quotient(q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
        """q: the roughness."""
        y = q[0]
        a = (2.58126 * oz + 0.813703 * y) * y / (1.0 + 0.310327 * oz * oz + 2.60994 * oz * y)
        b = math.sqrt(max(1.0 - oz, 0.0)) * (y - 1.0) * y * y * y
        b /= 0.0000254053 + 1.71228 * oz - 1.71506 * oz * y + 1.34174 * y * y
        # wi in the frame of wo: x along, and what is left of its length across. Seen head-on, b is 0.
        sine = math.sqrt(ox * ox + oy * oy)
        along = 0.0
        if sine > 1e-6:
            along = (ix * ox + iy * oy) / sine
        across2 = max(ix * ix + iy * iy - along * along, 0.0)
        slope = a * along + b * iz
        lobe = a / (slope * slope + a * a * across2 + iz * iz)
        return iz * lobe * lobe / math.pi

    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        r, cos_o = number(params, "roughness"), np.clip(wo[:, 2], 1e-9, 1.0)
        x = wo * np.array([1.0, 1.0, 0.0])
        length = np.linalg.norm(x, axis=1, keepdims=True)
        x = np.where(length > 1e-6, x / np.maximum(length, 1e-6), np.array([1.0, 0.0, 0.0]))
        y = np.cross(np.array([0.0, 0.0, 1.0]), x)
        a, b = _inverse_matrix(cos_o, r)
        turned = np.stack([(wi * x).sum(axis=1), (wi * y).sum(axis=1), wi[:, 2]], axis=1)
        untransformed = np.stack([a * turned[:, 0] + b * turned[:, 2], a * turned[:, 1], turned[:, 2]], axis=1)
        lobe = _albedo(cos_o, r) / math.pi * (a / (untransformed**2).sum(axis=1)) ** 2
        return channels(params, "scale") * np.where(directions(wi, wo).above, lobe, 0.0)[:, None]

    def coverage(
        self, params: Parameters, curve: Callable[[str], Callable[[Float64Array], Float64Array]], theta_o: Float64Array
    ) -> Float64Array:
        share = float(channels(params, "scale").max())
        seen = curve(THETA_O.name)(theta_o).max(axis=1)
        lit = curve(THETA_I.name)(_lobe_angles(number(params, "roughness")).ravel()).max(axis=1)
        mean = lit.reshape(len(view_angles()), -1).mean(axis=1)
        return np.asarray(share * seen * np.interp(theta_o, view_angles(), mean), np.float64)


def _albedo(cos_o: Float64Array, r: float) -> Float64Array:
    """E (N,): a Gaussian over the cosine and an offset."""
    width = r * (0.0206607 + 1.58491 * r) / (0.0379424 + r * (1.32227 + r))
    middle = r * (-0.193854 + r * (-1.14885 + r * (1.7932 - 0.95943 * r * r))) / (0.046391 + r)
    offset = r * (0.000654023 + (-0.0207818 + 0.119681 * r) * r) / (1.26264 + r * (-1.92021 + r))
    gaussian = np.exp(-0.5 * ((cos_o - middle) / width) ** 2) / (width * math.sqrt(2.0 * math.pi))
    return np.asarray(np.maximum(gaussian + offset, 0.0))  # the fit of the offset is below 0 for the smoothest


def _inverse_matrix(cos_o: Float64Array, r: float) -> tuple[Float64Array, Float64Array]:
    """a and b (N,)."""
    a = (2.58126 * cos_o + 0.813703 * r) * r / (1.0 + 0.310327 * cos_o**2 + 2.60994 * cos_o * r)
    b = np.sqrt(np.clip(1.0 - cos_o, 0.0, 1.0)) * (r - 1.0) * r**3
    return a, b / (0.0000254053 + 1.71228 * cos_o - 1.71506 * cos_o * r + 1.34174 * r * r)


@lru_cache(maxsize=16)
def _lobe_angles(r: float) -> Float64Array:
    """Angles theta_i (V, N) of directions that have the lobe's distribution, for views at `view_angles`."""
    cosine2 = (np.arange(_N_RINGS)[:, None] + 0.5) / _N_RINGS
    phi = (np.arange(_N_PHI) + 0.5) * (math.pi / _N_PHI)
    x, z = np.sqrt(1.0 - cosine2) * np.cos(phi), np.sqrt(cosine2)
    y = np.sqrt(1.0 - cosine2) * np.sin(phi)
    a, b = (each[:, None, None] for each in _inverse_matrix(np.cos(view_angles()), r))
    found = np.arctan2(np.hypot((x - b * z) / a, y / a), np.broadcast_to(z, (len(a), *x.shape)))
    found = found.reshape(len(a), -1)
    found.flags.writeable = False
    return found


MODELS = (Fuzz(),)
