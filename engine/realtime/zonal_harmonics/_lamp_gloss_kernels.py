"""Compiled part of `lamp_gloss`. It does not validate."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics._lamp_kernels import towards_part

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def sum_parts(
    start: int, stop: int, which: NDArray[np.int64], places: Float32Array, normals: Float32Array, parts: Float64Array,
    mean: Float64Array, power: Float64Array, unblocked: Float64Array,
) -> None:  # fmt: skip
    """Sum the parts (N, 14) of a lamp of emission 1, see `scene_lamps.Lamp.rows`, as seen from the
    points which[start:stop].

    mean (P, 3): mean direction, whose length tells how narrow the lamp is; power (P, 3): sum of Ω L; unblocked (P, 3):
    radiance of white Lambertian points without any shadow.
    """
    for at in range(start, stop):
        p = which[at]
        mean[at], power[at], unblocked[at] = 0.0, 0.0, 0.0
        angles = 0.0
        for s in range(len(parts)):
            part = parts[s]
            x, y, z, angle = towards_part(part, places[p, 0], places[p, 1], places[p, 2])
            if angle <= 0.0:
                continue
            cosine = max(x * normals[p, 0] + y * normals[p, 1] + z * normals[p, 2], 0.0) / math.pi
            angles += angle
            mean[at, 0] += angle * x
            mean[at, 1] += angle * y
            mean[at, 2] += angle * z
            for c in range(3):
                power[at, c] += angle * part[11 + c]
                unblocked[at, c] += angle * cosine * part[11 + c]
        for c in range(3):
            mean[at, c] /= max(angles, 1e-30)
