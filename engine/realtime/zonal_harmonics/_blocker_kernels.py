"""Compiled: the light that clusters of triangles block at points.

Kernels never validate: `engine.realtime.zonal_harmonics.blockers` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST
from engine.realtime.zonal_harmonics._shading_kernels import _look_up

Float32Array = NDArray[np.float32]

# Share of uniform light that is subtracted from what each cluster blocks, so that clusters below it have no effect.
LEAST = 2e-3


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shadow_range(
    start: int, stop: int, rows: Float32Array, casts: NDArray[np.bool_], owners: NDArray[np.int32],
    places: Float32Array,
    normals: Float32Array, table: Float32Array, window: Float32Array, white: Float32Array,
) -> None:  # fmt: skip
    """Darken white[start:stop] (S, 3); rows (K, 14) of clusters: see `engine.realtime.zonal_harmonics.blockers`."""
    n = table.shape[2]
    light = np.empty((n, 3), np.float32)
    blocked, mean = np.empty(3), np.empty(3)
    for p in range(start, stop):
        blocked[:] = 0.0
        for k in range(len(rows)):
            row = rows[k]
            if not casts[owners[p], int(row[13])]:
                continue
            # Direction and squared distance to the cluster's centre.
            x, y, z = row[0] - places[p, 0], row[1] - places[p, 1], row[2] - places[p, 2]
            square = max(x * x + y * y + z * z, 1e-20)
            most = row[3] / (row[3] + math.pi * square)  # upper bound: the cluster faces the point with all of its area
            if most < LEAST:
                continue
            distance, widest = math.sqrt(square), math.sqrt(most)
            up = (normals[p, 0] * x + normals[p, 1] * y + normals[p, 2] * z) / distance
            if up < -widest or most * (max(up, 0.0) + 0.25 * widest) < LEAST:
                continue
            x, y, z = x / distance, y / distance, z / distance
            # Projected area of an ellipsoid with spread Q along d: pi sqrt(d^T adj(Q) d).
            outline = row[4] * x * x + row[5] * y * y + row[6] * z * z
            outline += 2.0 * (row[7] * x * y + row[8] * x * z + row[9] * y * z)
            outline = min(math.pi * math.sqrt(max(outline, 0.0)), row[3])
            away = row[10] * x + row[11] * y + row[12] * z  # positive if it faces away
            outline *= min(max(1.0 - 2.0 * away, 0.0), 1.0)
            # Replace the outline by a cone: sin^2 of its half-angle, A / (A + pi r^2).
            sine2 = outline / (outline + math.pi * square)
            sine = math.sqrt(sine2)
            if up < sine:  # the cone extends below the horizon
                up = (up + sine) ** 2 / max(4.0 * sine, 1e-20) if up > -sine else 0.0
            weight = sine2 * up - LEAST
            if weight <= 0.0:
                continue
            _look_up(table, x, y, z, light)
            # Mean of each band's light over the cone: (P_(l-1) - P_(l+1)) / ((2l+1)(1-c)) at its rim, where c is the
            # cosine.
            c = math.sqrt(1.0 - sine2)
            before, here = 1.0, c
            for i in range(3):  # by channel: for whole rows the compiler generates error messages
                mean[i] = window[0] * light[0, i]
            for l in range(1, n):  # noqa: E741
                # Recurrence of the Legendre polynomials: (l + 1) P_(l+1) = (2l + 1) c P_l - l P_(l-1).
                after = ((2 * l + 1) * c * here - l * before) / (l + 1)
                share = window[l] * (before - after) / ((2 * l + 1) * (1.0 - c))
                for i in range(3):
                    mean[i] += share * light[l, i]
                before, here = here, after
            for i in range(3):
                blocked[i] += weight * max(mean[i], 0.0)
        for i in range(3):
            if blocked[i] > 0.0 and white[p, i] > 0.0:
                left = max(1.0 - 0.5 * blocked[i] / white[p, i], 0.0)  # clusters also occlude one another
                white[p, i] *= left * left
