"""Compiled: glossy reflection of points, by the light of each band along a lobe's axis.

Kernels never validate: `engine.realtime.zonal_harmonics.gloss` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics._shading_kernels import _look_up

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def gloss_range(
    which: NDArray[np.int64], places: Float32Array, normals: Float32Array, camera_position: Float64Array,
    table: Float32Array, bands: Float32Array,
    lean: Float32Array, steepest: float, cosine: Float32Array, even: float, white: Float32Array, sent: Float32Array,
) -> None:  # fmt: skip
    """Add the radiance that points send to the camera to sent (S, 3); bands (A, n, 3) and lean (A,) of the reflection
    at polar angles 0 to steepest of wo; cosine (n,): the bands of a white Lambertian surface; even: the radiance that
    such a surface reflects of the mean light, summed over the channels, times
    `engine.realtime.zonal_harmonics.gloss.EVEN`."""
    n = table.shape[2]
    light = np.empty((n, 3), np.float32)
    for at in range(len(which)):
        p = which[at]
        x, y, z = (
            camera_position[0] - places[p, 0],
            camera_position[1] - places[p, 1],
            camera_position[2] - places[p, 2],
        )
        length = math.sqrt(x * x + y * y + z * z)
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        if not length > 1e-15:  # the camera is at the point: take its normal
            x, y, z, length = nx, ny, nz, 1.0
        up = (x * nx + y * ny + z * nz) / length
        up = max(up, 0.01)  # with normals that diverge, a triangle may still face the camera
        ax, ay, az = x / length - up * nx, y / length - up * ny, z / length - up * nz  # along the surface
        across = max(math.sqrt(ax * ax + ay * ay + az * az), 1e-12)
        # Interpolate between the tabulated angles of wo.
        place = min(math.acos(min(up, 1.0)) / steepest, 1.0) * (len(lean) - 1)
        low = min(int(place), len(lean) - 2)
        share = np.float32(place - low)
        turn = lean[low] + share * (lean[low + 1] - lean[low])
        # The lobe's axis: the normal, rotated by lean away from wo, towards its mirror direction.
        c, s = math.cos(turn), -math.sin(turn) / across
        _look_up(table, c * nx + s * ax, c * ny + s * ay, c * nz + s * az, light)
        values = np.zeros(3, np.float32)
        # Radiance: Σ_l bands_l × light_l along the axis.
        for l in range(n):  # noqa: E741
            for i in range(3):
                values[i] += (bands[low, l, i] + share * (bands[low + 1, l, i] - bands[low, l, i])) * light[l, i]
        # Visibility: the ratio of the Lambertian radiance with and without shadows.
        _look_up(table, nx, ny, nz, light)
        unblocked = np.float32(0.0)
        for l in range(n):  # noqa: E741
            unblocked += cosine[l] * (light[l, 0] + light[l, 1] + light[l, 2])
        # Where hardly any light arrives, both values are errors of the bands; the added constant then makes the ratio
        # 1.
        reached = white[p, 0] + white[p, 1] + white[p, 2] + np.float32(even)
        open_ = reached / max(unblocked + np.float32(even), np.float32(1e-20))
        open_ = min(max(open_, np.float32(0.0)), np.float32(1.0))
        for i in range(3):
            sent[p, i] += max(open_ * values[i], np.float32(0.0))
