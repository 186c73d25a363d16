"""A measurement as part of a layer: the file, a number that identifies its table, and the factors fitted to it; and the
grid of its table.

Measurements are small, frozen and hashable, so that layers stay values; the table itself stays in the process that
computes (`engine.measured.tables`). Until a file has been read it has only its name, and the layer is diffuse.

The grid is that of MERL files, over half and difference angles [Rusinkiewicz98; Matusik03]. Sample (i, j, k) of (90,
90, 180) is at theta_h = 90 (i / 90)^2, theta_d = j and phi_d = k degrees: dense near the centre of the highlight. phi_d
has a period of 180 degrees, which is reciprocity. Curves of a measurement have 91 nodes, over theta_h spaced like the
grid, over all other angles one degree apart.

Look-ups on arrays are the reference for kernels in tests and brute force.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

SHAPE = (90, 90, 180)
N_NODES = 91
HALF_PI = np.pi / 2


def node_position(gamma: Float64Array, is_half: bool) -> Float64Array:
    """Positions of angles among the nodes of a curve, in [0, 90]; is_half: over theta_h."""
    share = np.clip(gamma / HALF_PI, 0.0, 1.0)
    return np.asarray((np.sqrt(share) if is_half else share) * (N_NODES - 1))


def node_angles(is_half: bool) -> Float64Array:
    """The nodes' angles (91,)."""
    share = np.arange(N_NODES) / (N_NODES - 1)
    return np.asarray(HALF_PI * (share * share if is_half else share))


def directions_at(
    theta_h: Float64Array, theta_d: Float64Array, phi_d: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """wi, wo (..., 3) for half and difference angles, which broadcast; the half vector is in the xz plane."""
    theta_h, theta_d, phi_d = np.broadcast_arrays(theta_h, theta_d, phi_d)
    x, y, z = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)
    cosine, sine = np.cos(theta_h), np.sin(theta_h)
    wi = np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=-1)
    wo = np.stack([-cosine * x + sine * z, -y, cosine * z + sine * x], axis=-1)
    return wi, wo


def half_and_difference(wi: Float64Array, wo: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """theta_h, theta_d, phi_d in [0, pi) of unit directions (N, 3): (N,) each. The half vector of opposite directions
    is the normal."""
    total, apart = wi + wo, 0.5 * (wi - wo)
    length = np.linalg.norm(total, axis=1)
    safe = np.where(length > 1e-12, length, 1.0)[:, None]
    half = np.where(length[:, None] > 1e-12, total / safe, [0.0, 0.0, 1.0])
    flat = np.hypot(half[:, 0], half[:, 1])
    theta_h = np.arctan2(flat, half[:, 2])
    theta_d = np.arctan2(np.linalg.norm(apart, axis=1), 0.5 * length)
    has_azimuth = flat > 1e-9
    cosine = np.where(has_azimuth, half[:, 0] / np.where(has_azimuth, flat, 1.0), 1.0)
    sine = np.where(has_azimuth, half[:, 1] / np.where(has_azimuth, flat, 1.0), 0.0)
    x = half[:, 2] * (cosine * apart[:, 0] + sine * apart[:, 1]) - flat * apart[:, 2]
    y = cosine * apart[:, 1] - sine * apart[:, 0]
    return theta_h, theta_d, np.arctan2(y, x) % np.pi


@lru_cache(maxsize=4)
def grid_directions(every: int = 1) -> tuple[Float64Array, Float64Array]:
    """wi, wo (90, 90, 180 / every, 3) at the grid's points, for every n-th phi_d."""
    theta_h = node_angles(is_half=True)[:-1]
    theta_d, phi_d = np.radians(np.arange(SHAPE[1])), np.radians(np.arange(0, SHAPE[2], every))
    wi, wo = directions_at(theta_h[:, None, None], theta_d[:, None], phi_d)
    for array in (wi, wo):
        array.setflags(write=False)
    return wi, wo


def above_horizon() -> NDArray[np.bool_]:
    """Which of the grid's points (90, 90, 180) have wi and wo above the surface."""
    wi, wo = grid_directions()
    return np.asarray((wi[..., 2] > 0.0) & (wo[..., 2] > 0.0))


Part = Literal["diffuse", "specular", "whole", "around", "twist", "brushed"]
RGB = tuple[float, float, float]

# The factors of all parts: of wi and wo in the diffuse part; of difference and half angle, of wi or wo, and of the
# half vector's and the difference's azimuth in the highlight; of the half vector's two slopes in one that is brushed;
# and of the whole, P and Q. S, P: one curve for wi and wo.
CURVES = ("theta_i", "theta_o", "theta_d", "theta_h", "s", "phi_h", "phi_d", "theta_u", "theta_v", "p", "q")
# Those whose nodes are dense about 0.
HALF_ANGLE_CURVES = ("theta_h", "theta_u", "theta_v", "q")
PARTS: tuple[Part, ...] = ("diffuse", "specular", "whole", "around", "twist", "brushed")
# The factors of the highlight by the layer that it is edited in; all that are not there remain in its quotient.
HIGHLIGHTS: dict[Part, tuple[str, ...]] = {
    "specular": ("theta_h", "theta_d", "s_o"),
    "around": ("theta_h", "phi_h"),
    "twist": ("theta_h", "phi_d"),
    "brushed": ("theta_u", "theta_v"),
}
# Readable files: MERL's grids, Cornell's scattered samples and RGL's tensors.
ENDINGS = (".binary", ".brdf", ".bsdf")
# Standard width, in nodes to either side, for a smoothing of 1.
_WIDEST = 8.0


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
    """file: its name; number: identifies the table, 0 if nothing was read; strengths (1/sr per channel), in the order
    of `PARTS`, and curves of the factors [BenArtzi07, 3.5]: rho_d = d G(theta_i) H(theta_o), rho_s = s G(theta_d)
    H(theta_h) S(theta_o) or another product of `HIGHLIGHTS`, or of everything w P(theta_i) Q(theta_h) P(theta_o). Each
    curve is float32 (91, 3) as bytes, in the order of `CURVES`, positive, with a maximum of 1.

    is_anisotropic: the table is no grid (`engine.measured.adaptive`). highlight: the part whose factors fit best.
    is_import: an unread file whose layers take that part, whichever it is.
    """

    file: str
    number: int = 0
    strengths: tuple[RGB, ...] = ((1.0 / np.pi,) * 3,) * len(PARTS)
    curves: tuple[bytes, ...] = ()
    report: FitReport | None = None
    is_anisotropic: bool = False
    highlight: Part = "specular"
    is_import: bool = False

    @property
    def is_read(self) -> bool:
        return self.number != 0

    def strength(self, part: Part) -> Float64Array:
        """The strength of a part (3,)."""
        return np.array(self.strengths[PARTS.index(part)])

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


def evaluate_table(table: NDArray[np.float32], wi: Float64Array, wo: Float64Array) -> Float64Array:
    """Reflection (N, 3), 1/sr, of a table (90, 90, 180, 3), interpolated, for unit directions (N, 3).

    Linear in the square root of theta_h, as the grid is spaced, in theta_d and in phi_d, which wraps around.
    """
    theta_h, theta_d, phi_d = half_and_difference(wi, wo)
    a = np.minimum(node_position(theta_h, True), SHAPE[0] - 1.0)
    b = np.minimum(node_position(theta_d, False), SHAPE[1] - 1.0)
    c = phi_d * (SHAPE[2] / np.pi)
    i, j, k = (np.floor(x).astype(int) for x in (a, b, c))
    found = np.zeros((len(wi), 3))
    for di, u in ((0, 1.0 - (a - i)), (1, a - i)):
        for dj, v in ((0, 1.0 - (b - j)), (1, b - j)):
            for dk, w in ((0, 1.0 - (c - k)), (1, c - k)):
                at = np.minimum(i + di, SHAPE[0] - 1), np.minimum(j + dj, SHAPE[1] - 1), (k + dk) % SHAPE[2]
                found += (u * v * w)[:, None] * table[at]
    return found


def evaluate_part(
    whole: Float64Array, measurement: Measurement, part: Part, smoothing: float, wi: Float64Array, wo: Float64Array
) -> Float64Array:
    """Of reflection `whole` (N, 3) the diffuse part or that of the highlight, whose sum is exactly the measurement; or
    the whole. 0 below the horizon."""
    above = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
    theta_i, theta_o = (np.arccos(np.clip(v[:, 2], 0.0, 1.0)) for v in (wi, wo))
    factors = (measurement.curve(name, at, smoothing) for name, at in (("theta_i", theta_i), ("theta_o", theta_o)))
    diffuse_part = measurement.strength("diffuse")
    for factor in factors:
        diffuse_part = diffuse_part * factor
    if part == "diffuse":
        value = np.minimum(whole, diffuse_part)
    else:
        value = whole if part == "whole" else np.maximum(whole - diffuse_part, 0.0)
    return np.where(above[:, None], value, 0.0)
