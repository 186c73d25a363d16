"""Direct look-up of a measurement on arrays: the reference for kernels in tests and brute force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.measured.coordinates import SHAPE, half_and_difference, node_position
from engine.measured.measurement import Measurement, Part

Float64Array = NDArray[np.float64]


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
    table: NDArray[np.float32],
    measurement: Measurement,
    part: Part,
    smoothing: float,
    wi: Float64Array,
    wo: Float64Array,
) -> Float64Array:
    """The diffuse or the specular part of a measurement (N, 3), whose sum is exactly the measurement; or the whole. 0
    below the horizon."""
    above = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
    whole = evaluate_table(table, wi, wo)
    theta_i, theta_o = (np.arccos(np.clip(v[:, 2], 0.0, 1.0)) for v in (wi, wo))
    factors = (measurement.curve(name, at, smoothing) for name, at in (("theta_i", theta_i), ("theta_o", theta_o)))
    diffuse_part = np.asarray(measurement.diffuse)
    for factor in factors:
        diffuse_part = diffuse_part * factor
    parts = {
        "diffuse": np.minimum(whole, diffuse_part),
        "specular": np.maximum(whole - diffuse_part, 0.0),
        "whole": whole,
    }
    value = parts[part]
    return np.where(above[:, None], value, 0.0)
