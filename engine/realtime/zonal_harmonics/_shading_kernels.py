"""Compiled shading of points: zonal lobes under light that is tabulated over directions, gloss, the shadows of
clusters, and look-ups in textures of lobes.

Kernels never validate: `engine.realtime.zonal_harmonics.shading` and `engine.realtime.zonal_harmonics.patches` do.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_world
from engine.core.fast_math import FAST

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

# Share of uniform light that is subtracted from what each cluster blocks, so that clusters below it have no effect.
LEAST_BLOCKED = 2e-3


@njit(cache=True, nogil=True, error_model="numpy")
def shade_range(
    low: Float32Array, axes: Float32Array, coefficients: Float32Array, frames: Float32Array, light: Float32Array,
    table: Float32Array,
    start: int, stop: int, radiance: Float32Array,
) -> None:  # fmt: skip
    """Fill radiance[start:stop] (P, 3) [Sloan05, eq. 25].

    low (P, 4), axes (P, N, 3), coefficients (P, N, n): lobes in the points' own axes, the rows of frames (P, 3, 3).
    light (n^2, 3); table (rows, columns, n, 3): the light of each band along each direction [Sloan05, eq. 24].
    """
    n = coefficients.shape[2]
    bands = np.empty((n, 3), np.float32)
    for p in range(start, stop):
        frame = frames[p]
        # The constant band, and the linear band, which rotates like the vector (-low_3, -low_1, low_2).
        x, y, z = to_world(frame, -low[p, 3], -low[p, 1], low[p, 2])
        for c in range(3):
            radiance[p, c] = low[p, 0] * light[0, c]
            if n > 1:
                radiance[p, c] += -y * light[1, c] + z * light[2, c] - x * light[3, c]
        for i in range(axes.shape[1]):
            # Rotate the lobe's axis [Sloan05, eq. 10], look up the light along it, and take the dot product with the
            # lobe's coefficients [Sloan05, eq. 25].
            x, y, z = to_world(frame, axes[p, i, 0], axes[p, i, 1], axes[p, i, 2])
            _look_up(table, x, y, z, bands)
            for l in range(n):  # noqa: E741
                for c in range(3):
                    radiance[p, c] += coefficients[p, i, l] * bands[l, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(table: Float32Array, x: float, y: float, z: float, bands: Float32Array) -> None:
    """Interpolate the light of each band (n, 3) along a direction between four entries; rows beyond a pole continue on
    the opposite side."""
    n_rows, n_columns = table.shape[0], table.shape[1]
    # Latitude and longitude in units of table entries.
    row = math.acos(min(max(z, -1.0), 1.0)) * (n_rows / math.pi) - 0.5
    column = (math.atan2(y, x) + math.pi) * (n_columns / (2.0 * math.pi)) - 0.5
    top, left = math.floor(row), math.floor(column)
    below, beside = np.float32(row - top), np.float32(column - left)
    bands[:] = 0.0
    for down in range(2):
        for right in range(2):
            r, c = int(top) + down, int(left) + right
            if r < 0 or r >= n_rows:
                r, c = min(max(r, 0), n_rows - 1), c + n_columns // 2
            c %= n_columns
            share = (below if down else np.float32(1.0) - below) * (beside if right else np.float32(1.0) - beside)
            for l in range(bands.shape[0]):  # noqa: E741
                for k in range(3):
                    bands[l, k] += share * table[r, c, l, k]


@njit(cache=True, nogil=True, error_model="numpy")
def gloss_range(
    which: NDArray[np.int64], places: Float32Array, normals: Float32Array, camera_position: Float64Array,
    table: Float32Array, bands: Float32Array,
    lean: Float32Array, steepest: float, cosine: Float32Array, even: float, white: Float32Array, sent: Float32Array,
) -> None:  # fmt: skip
    """Add the radiance that points send to the camera to sent (S, 3); bands (A, n, 3) and lean (A,) of the reflection
    at polar angles 0 to steepest of wo; cosine (n,): the bands of a white Lambertian surface; even: the radiance that
    such a surface reflects of the mean light, summed over the channels, times
    `engine.realtime.zonal_harmonics.shading.EVEN`."""
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


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shadow_range(
    start: int, stop: int, rows: Float32Array, casts: NDArray[np.bool_], owners: NDArray[np.int32],
    places: Float32Array,
    normals: Float32Array, table: Float32Array, window: Float32Array, white: Float32Array,
) -> None:  # fmt: skip
    """Darken white[start:stop] (S, 3); rows (K, 14) of clusters: see `engine.realtime.zonal_harmonics.shading`."""
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
            if most < LEAST_BLOCKED:
                continue
            distance, widest = math.sqrt(square), math.sqrt(most)
            up = (normals[p, 0] * x + normals[p, 1] * y + normals[p, 2] * z) / distance
            if up < -widest or most * (max(up, 0.0) + 0.25 * widest) < LEAST_BLOCKED:
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
            weight = sine2 * up - LEAST_BLOCKED
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


@njit(cache=True, nogil=True, error_model="numpy")
def look_up_range(
    low: Float32Array, axes: Float32Array, coefficients: Float32Array, uvs: NDArray[np.float64],
    start: int, stop: int, found_low: Float32Array, found_axes: Float32Array, found_coefficients: Float32Array,
) -> None:  # fmt: skip
    """Fill found_... [start:stop] (P, ...) at texture coordinates (P, 2), v upwards, from maps (H, W, ...)."""
    n_rows, n_columns = low.shape[0], low.shape[1]
    for p in range(start, stop):
        column = (uvs[p, 0] - math.floor(uvs[p, 0])) * n_columns - 0.5
        row = (1.0 - (uvs[p, 1] - math.floor(uvs[p, 1]))) * n_rows - 0.5
        left, top = math.floor(column), math.floor(row)
        beside, below = np.float32(column - left), np.float32(row - top)
        # Bilinear interpolation of the low bands.
        found_low[p] = 0.0
        for down in range(2):
            for right in range(2):
                share = (below if down else np.float32(1.0) - below) * (beside if right else np.float32(1.0) - beside)
                texel = low[(int(top) + down) % n_rows, (int(left) + right) % n_columns]
                for k in range(4):
                    found_low[p, k] += share * texel[k]
        # Nearest texel for the lobes: those of neighbours do not correspond.
        nearest_row = (int(top) + (1 if below >= 0.5 else 0)) % n_rows
        nearest_column = (int(left) + (1 if beside >= 0.5 else 0)) % n_columns
        for i in range(axes.shape[2]):  # by element: for whole rows the compiler generates error messages
            for k in range(axes.shape[3]):
                found_axes[p, i, k] = axes[nearest_row, nearest_column, i, k]
            for k in range(coefficients.shape[3]):
                found_coefficients[p, i, k] = coefficients[nearest_row, nearest_column, i, k]
