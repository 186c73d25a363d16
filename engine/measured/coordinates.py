"""The grid of MERL files: half and difference angles [Rusinkiewicz98; Matusik03], and directions at its points.

Sample (i, j, k) of (90, 90, 180) is at theta_h = 90 (i / 90)^2, theta_d = j and phi_d = k degrees: dense near the
centre of the highlight. phi_d has a period of 180 degrees, which is reciprocity. Curves of a measurement have 91 nodes,
over theta_h spaced like the grid, over all other angles one degree apart.
"""

from __future__ import annotations

from functools import lru_cache

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
    turned = flat > 1e-9
    cosine = np.where(turned, half[:, 0] / np.where(turned, flat, 1.0), 1.0)
    sine = np.where(turned, half[:, 1] / np.where(turned, flat, 1.0), 0.0)
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
