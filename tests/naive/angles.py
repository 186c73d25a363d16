"""Slow, obvious twin of the compiled angles: textbook formulas with arccos, in extended precision."""

import numpy as np

from engine.material import kinds


def angle(kind, exponent, wi, wo):
    """The angle of `kind` between unit directions (N, 3) in the local frame; `exponent` is n of the ratio, r of the
    width, below 0 where the highlight is turned."""
    wi, wo = wi.astype(np.longdouble), wo.astype(np.longdouble)
    half = wi + wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    cos2_phi = half[:, 0] ** 2 / (half[:, 0] ** 2 + half[:, 1] ** 2)
    # wi about the half vector, from the plane of half vector and normal: the sign does not matter.
    across = np.cross(np.array([0, 0, 1]), half)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along, beside = (wi * np.cross(across, half)).sum(axis=1), (wi * across).sum(axis=1)
    mirrored = wi * np.array([-1, -1, 1])
    cosine = {
        kinds.THETA_I: wi[:, 2],
        kinds.THETA_O: wo[:, 2],
        kinds.THETA_R: (mirrored * wo).sum(axis=1),
        kinds.THETA_H: half[:, 2],
        kinds.THETA_D: (wi * half).sum(axis=1),
        kinds.GAMMA_ALPHA: half[:, 2] ** cos2_phi,
        kinds.GAMMA_BETA: half[:, 2] ** (1 - cos2_phi),
        kinds.GAMMA_RATIO: half[:, 2] ** (abs(exponent) * (cos2_phi if exponent < 0 else 1 - cos2_phi)),
        kinds.GAMMA_WIDTH: half[:, 2]
        ** (
            (1 - cos2_phi if exponent < 0 else cos2_phi) + abs(exponent) * (cos2_phi if exponent < 0 else 1 - cos2_phi)
        ),
        kinds.SLOPE_U: half[:, 2] / np.hypot(half[:, 0], half[:, 2]),
        kinds.SLOPE_V: half[:, 2] / np.hypot(half[:, 1], half[:, 2]),
        kinds.PHI_D: np.abs(along) / np.hypot(along, beside),
        kinds.PHI_H: np.abs(half[:, 0]) / np.hypot(half[:, 0], half[:, 1]),
    }[kind]
    return np.arccos(np.clip(cosine, -1, 1)).astype(float)
