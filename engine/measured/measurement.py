"""A measurement as part of a layer: the file, a number that identifies its table, and the factors fitted to it.

Small, frozen and hashable, so that layers stay values; the table itself stays in the process that computes
(`engine.measured.tables`). Until a file has been read it has only its name, and the layer is diffuse.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.measured.coordinates import N_NODES, node_position

Float64Array = NDArray[np.float64]
Part = Literal["diffuse", "specular", "whole"]
RGB = tuple[float, float, float]

# The factors of both parts: of wi and wo, then of difference and half angle; and of the whole, P and Q.
CURVES = ("theta_i", "theta_o", "theta_d", "theta_h", "p", "q")
HALF_ANGLE_CURVES = ("theta_h", "q")
# Readable files: MERL's grids and Cornell's scattered samples.
ENDINGS = (".binary", ".brdf")
# Standard width, in nodes to either side, for a smoothing of 1.
_WIDEST = 8.0
UNIT_RGB: RGB = (1.0 / np.pi, 1.0 / np.pi, 1.0 / np.pi)


@dataclass(frozen=True)
class FitReport:
    """Report on a file: number of filled samples above the horizon and below it; error of the factors alone, natural
    logarithm, RMS over all samples and colours, for both parts and for the whole; and how they were found."""

    n_missing: int
    n_below: int
    error: float
    error_whole: float
    method: str


@dataclass(frozen=True)
class Measurement:
    """file: its name; number: identifies the table, 0 if nothing was read; strengths (1/sr per channel) and curves of
    the factors [BenArtzi07, 3.5]: rho_d = diffuse G(theta_i) H(theta_o), rho_s = specular G(theta_d) H(theta_h), or of
    everything whole P(theta_i) Q(theta_h) P(theta_o). Each curve is float32 (91, 3) as bytes, in the order of `CURVES`,
    positive, with a maximum of 1."""

    file: str
    number: int = 0
    diffuse: RGB = UNIT_RGB
    specular: RGB = UNIT_RGB
    whole: RGB = UNIT_RGB
    curves: tuple[bytes, ...] = ()
    report: FitReport | None = None

    @property
    def is_read(self) -> bool:
        return self.number != 0

    def nodes(self, name: str, smoothing: float = 0.0) -> Float64Array:
        """A factor at its nodes (91, 3), smoothed if smoothing is above 0; at most 1."""
        if not self.curves:
            return np.ones((N_NODES, 3))
        return smooth_curve(self.curves[CURVES.index(name)], smoothing)

    def curve(self, name: str, gamma: Float64Array, smoothing: float = 0.0) -> Float64Array:
        """A factor at angles (N,): (N, 3)."""
        values = self.nodes(name, smoothing)
        position = node_position(np.asarray(gamma, float), name in HALF_ANGLE_CURVES)
        nodes = np.arange(N_NODES)
        return np.stack([np.interp(position, nodes, values[:, c]) for c in range(3)], axis=1)


NO_MEASUREMENT = Measurement("")


@lru_cache(maxsize=64)
def smooth_curve(curve: bytes, smoothing: float) -> Float64Array:
    """Geometric mean of a curve's nodes (91, 3) under a bell, for smoothing > 0: noise acts on ratios."""
    values = np.frombuffer(curve, np.float32).reshape(N_NODES, 3).astype(float)
    if smoothing > 0.0:
        apart = np.subtract.outer(np.arange(N_NODES), np.arange(N_NODES)) / (_WIDEST * smoothing)
        bell = np.exp(-0.5 * apart * apart)
        values = np.exp(bell @ np.log(values) / bell.sum(axis=1, keepdims=True))
    values.setflags(write=False)
    return values
