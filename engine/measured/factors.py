"""What a fit finds: strengths and curves of all parts of a measurement, with their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.measured.measurement import (
    CURVES,
    HALF_ANGLE_CURVES,
    HIGHLIGHTS,
    N_NODES,
    PARTS,
    Part,
    half_and_difference,
    node_position,
)

Float64Array = NDArray[np.float64]

# Least value of a curve relative to its maximum, so that a quotient is finite.
LEAST = 1e-5
LEAST_STRENGTH = 1e-6
# The highlights that have a curve over theta_h.
OF_HALF_ANGLE: tuple[Part, ...] = ("specular", "around", "twist")


@dataclass(frozen=True, eq=False)
class Factors:
    """strengths: (3,) by part, 1/sr; curves: (91, 3) by name, with a maximum of 1, positive, at the nodes of
    `measurement.node_angles`; product: the strength (3,) of all of the highlight's factors together.

    error: log RMS of the diffuse part and the best highlight together, all factors of which take part; error_whole: of
    the whole, w P(theta_i) Q(theta_h) P(theta_o) [McCool01]. highlight: the best one. note: how others compare.
    """

    strengths: Mapping[Part, Float64Array]
    curves: Mapping[str, Float64Array]
    product: Float64Array
    error: float
    error_whole: float
    highlight: Part = "specular"
    note: str = ""

    def at(self, name: str, angle: Float64Array) -> Float64Array:
        """A curve at angles (N,): (N, 3)."""
        position, nodes = node_position(angle, name in HALF_ANGLE_CURVES), np.arange(N_NODES)
        return np.stack([np.interp(position, nodes, self.curves[name][:, c]) for c in range(3)], axis=1)


def curve_angles(wi: Float64Array, wo: Float64Array) -> dict[str, Float64Array]:
    """The angles (N,) of unit directions (N, 3) that curves are over, by the curves' names; azimuths folded into [0,
    pi/2], as `engine.material.kinds` has them."""
    theta_h, theta_d, phi_d = half_and_difference(wi, wo)
    half = np.abs(wi + wo)
    return {
        "theta_i": np.arccos(np.clip(wi[:, 2], 0.0, 1.0)),
        "theta_o": np.arccos(np.clip(wo[:, 2], 0.0, 1.0)),
        "theta_h": theta_h,
        "theta_d": theta_d,
        "phi_d": np.minimum(phi_d, np.pi - phi_d),
        "phi_h": np.arctan2(half[:, 1], half[:, 0]),
        "theta_u": np.arctan2(half[:, 0], half[:, 2]),
        "theta_v": np.arctan2(half[:, 1], half[:, 2]),
    }


@dataclass(frozen=True, eq=False)
class ChannelFit:
    """The factors of one colour, as in `Factors`."""

    strengths: Mapping[Part, float]
    curves: Mapping[str, Float64Array]
    product: float
    error: float
    error_whole: float


def factors_of(channels: Sequence[ChannelFit]) -> Factors:
    """Combine the fits of three colours. A curve that was not fitted is 1; a highlight that was not has the strength of
    the product."""
    strengths = {part: np.array([fit.strengths.get(part, fit.product) for fit in channels]) for part in PARTS}
    flat = np.ones(N_NODES)
    curves = {name: np.stack([fit.curves.get(name, flat) for fit in channels], axis=1) for name in CURVES}
    squares = np.mean([(fit.error**2, fit.error_whole**2) for fit in channels], axis=0)
    product = np.array([fit.product for fit in channels])
    return Factors(strengths, curves, product, float(squares[0] ** 0.5), float(squares[1] ** 0.5))


def normalize_curve(curve: Float64Array) -> Float64Array:
    """Scale to a maximum of 1, and raise to a positive minimum."""
    peak = curve.max()
    return np.maximum(curve / peak, LEAST) if peak > 0.0 else np.ones_like(curve)


def highlight_strengths(
    strength: float, factors: Mapping[str, Float64Array], weights: Float64Array, parts: Sequence[Part]
) -> dict[Part, float]:
    """The strengths of highlights that have some of the factors as curves, of a product of strength and all factors
    (..., by name, "s_i" and "s_o" for S): that times the geometric mean of the others, so that their quotients are
    about 1."""
    found: dict[Part, float] = {}
    total = max(float(weights.sum()), 1e-300)
    for part in parts:
        logs = [np.log(factor) for name, factor in factors.items() if name not in HIGHLIGHTS[part]]
        mean = sum(float((weights * log).sum()) for log in logs) / total
        found[part] = max(strength * float(np.exp(mean)), LEAST_STRENGTH)
    return found
