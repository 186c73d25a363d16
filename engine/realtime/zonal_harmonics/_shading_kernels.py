"""Compiled shading of points: zonal lobes under light that is tabulated over directions, gloss, the shadows of
clusters, and look-ups in textures of lobes.

Kernels never validate: `engine.realtime.zonal_harmonics.shading` and `engine.realtime.zonal_harmonics.patches` do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core import lanes
from engine.core._angle_kernels import arc_tangent
from engine.core._frame_kernels import to_world
from engine.core.fast_math import FAST

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

# Share of uniform light that is subtracted from what each cluster blocks, so that clusters below it have no effect.
LEAST_BLOCKED = 2e-3

_POINTS = 32  # whose lobes are looked up together
_ONE = np.float32(1.0)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shade_range(
    start: int, stop: int, which: NDArray[np.int64], low: Float32Array, axes: Float32Array, coefficients: Float32Array,
    frames: Float32Array, n_each: int, light: Float32Array, table: Float32Array, radiance: Float32Array,
) -> None:  # fmt: skip
    """Fill rows which[start:stop] of radiance (P, 3) [Sloan05, eq. 25].

    low (P, 4), axes (P, N, 3), coefficients (P, N, n): lobes in the points' own axes, the rows of frames (P / n_each,
    3, 3), which n_each of them in turn share. light (n^2, 3); table (rows, columns, n, 3): the light of each
    band along each direction [Sloan05, eq. 24], with one number behind it, see `engine.core.lanes`.
    """
    n_lobes, n, size = axes.shape[1], coefficients.shape[2], 3 * coefficients.shape[2]
    n_rows, n_columns = table.shape[0], table.shape[1]
    axis = np.empty((3, _POINTS * n_lobes), np.float32)
    row, column = np.empty((2, _POINTS * n_lobes))
    colour = np.empty(4, np.float32)
    for first in range(start, stop, _POINTS):
        some = which[first : min(first + _POINTS, stop)]
        # Rotate the lobes' axes [Sloan05, eq. 10].
        for j in range(len(some)):
            p, frame = some[j], frames[some[j] // n_each]
            for i in range(n_lobes):
                at = j * n_lobes + i
                axis[0, at], axis[1, at], axis[2, at] = to_world(frame, axes[p, i, 0], axes[p, i, 1], axes[p, i, 2])
        # Their places in the table: this loop vectorizes.
        for at in range(len(some) * n_lobes):
            row[at], column[at] = _place(n_rows, n_columns, axis[0, at], axis[1, at], axis[2, at])
        for j in range(len(some)):
            p = some[j]
            # The constant band, and the linear band, which rotates like the vector (-low_3, -low_1, low_2).
            x, y, z = to_world(frames[p // n_each], -low[p, 3], -low[p, 1], low[p, 2])
            total = _times(low[p, 0], lanes.of(light[0, 0], light[0, 1], light[0, 2]))
            if n > 1:
                total = lanes.plus_product(total, lanes.even(-y), lanes.of(light[1, 0], light[1, 1], light[1, 2]))
                total = lanes.plus_product(total, lanes.even(z), lanes.of(light[2, 0], light[2, 1], light[2, 2]))
                total = lanes.plus_product(total, lanes.even(-x), lanes.of(light[3, 0], light[3, 1], light[3, 2]))
            for i in range(n_lobes):
                # Interpolate the light along the lobe between four entries, and take the dot product with the lobe's
                # coefficients [Sloan05, eq. 25].
                four = _entries(row[j * n_lobes + i], column[j * n_lobes + i], n_rows, n_columns)
                a, b, c, d = size * four.first, size * four.beside, size * four.below, size * four.last
                right, down = four.right, four.down
                share_a, share_b = lanes.even((_ONE - down) * (_ONE - right)), lanes.even((_ONE - down) * right)
                share_c, share_d = lanes.even(down * (_ONE - right)), lanes.even(down * right)
                for l in range(n):  # noqa: E741
                    band = lanes.plus_product(lanes.zeros(), share_a, lanes.floats(table, a + 3 * l))
                    band = lanes.plus_product(band, share_b, lanes.floats(table, b + 3 * l))
                    band = lanes.plus_product(band, share_c, lanes.floats(table, c + 3 * l))
                    band = lanes.plus_product(band, share_d, lanes.floats(table, d + 3 * l))
                    total = lanes.plus_product(total, lanes.even(coefficients[p, i, l]), band)
            lanes.store(colour, 0, total)
            for k in range(3):
                radiance[p, k] = colour[k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _times(factor: float, vector):  # type: ignore[no-untyped-def]
    return lanes.plus_product(lanes.zeros(), lanes.even(factor), vector)


class _Entries(NamedTuple):
    """Indices of the four entries around a direction in a table, row by row, and the position between them, 0 to 1."""

    first: int
    beside: int
    below: int
    last: int
    down: np.float32
    right: np.float32


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _place(n_rows: int, n_columns: int, x: float, y: float, z: float) -> tuple[float, float]:
    """Row and column of a unit direction in a table, by latitude from +z and longitude from -x."""
    height = float(z)
    row = arc_tangent(math.sqrt(max(1.0 - height * height, 0.0)), height) * (n_rows / math.pi) - 0.5
    return row, (arc_tangent(y, x) + math.pi) * (n_columns / (2.0 * math.pi)) - 0.5


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _entries(row: float, column: float, n_rows: int, n_columns: int) -> _Entries:
    """The entries around a place; rows beyond a pole continue on the opposite side."""
    top, left = math.floor(row), math.floor(column)
    down, right = np.float32(row - top), np.float32(column - left)
    upper, lower = int(top), int(top) + 1
    first = int(left) if left >= 0 else n_columns - 1
    beside = first + 1 if first + 1 < n_columns else 0
    opposite = n_columns // 2
    across = beside + opposite if beside < opposite else beside - opposite
    over = first + opposite if first < opposite else first - opposite
    if upper < 0:
        return _Entries(over, across, first, beside, down, right)
    a, b = upper * n_columns + first, upper * n_columns + beside
    if lower == n_rows:
        return _Entries(a, b, upper * n_columns + over, upper * n_columns + across, down, right)
    return _Entries(a, b, a + n_columns, b + n_columns, down, right)


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(table: Float32Array, x: float, y: float, z: float, bands: Float32Array) -> None:
    """Interpolate the light of each band (n, 3) along a direction between four entries."""
    n_rows, n_columns = table.shape[0], table.shape[1]
    row, column = _place(n_rows, n_columns, x, y, z)
    four = _entries(row, column, n_rows, n_columns)
    right, down = four.right, four.down
    rows = table.reshape((n_rows * n_columns, bands.shape[0], 3))
    for l in range(bands.shape[0]):  # noqa: E741
        for k in range(3):
            upper = rows[four.first, l, k] + right * (rows[four.beside, l, k] - rows[four.first, l, k])
            lower = rows[four.below, l, k] + right * (rows[four.last, l, k] - rows[four.below, l, k])
            bands[l, k] = upper + down * (lower - upper)


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
