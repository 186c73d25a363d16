"""Compiled loops of the lights: binning texels into geodesic triangles, reading RGBE scanlines, resampling angular maps.

Kernels never validate; the public functions beside them do.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.sphere._kernels import locate_one, solid_angle_from


@njit(cache=True, nogil=True, error_model="numpy")
def place_samples(rows, width, n_theta, n_phi, row_start, d_theta, turn, level, roots, planes, triangle, weight, sums):
    """Lay the sub-texel samples of texel rows [rows[0], rows[1]): triangle and solid angle of each; sums += weights.

    n_phi (H, n_theta) samples across one texel; row_start (H + 1,) first sample of a row; a texel's samples are
    consecutive. Sample directions are in the world: azimuth `turn` radians less than in the map.
    """
    texel_width = 2.0 * math.pi / width
    for row in range(rows[0], rows[1]):
        k = row_start[row]
        for column in range(width):
            for j in range(n_theta):
                top = (row + j / n_theta) * d_theta
                bottom = (row + (j + 1) / n_theta) * d_theta
                share = 2.0 * math.sin(0.5 * (top + bottom)) * math.sin(0.5 * (bottom - top)) * texel_width
                sin_theta, cos_theta = math.sin(0.5 * (top + bottom)), math.cos(0.5 * (top + bottom))
                n = n_phi[row, j]
                for i in range(n):
                    phi = (column + (i + 0.5) / n) * texel_width - math.pi - turn
                    t = locate_one(sin_theta * math.sin(phi), cos_theta, -sin_theta * math.cos(phi),
                                   level, roots, planes)  # fmt: skip
                    triangle[k] = t
                    weight[k] = share / n
                    sums[t] += share / n
                    k += 1


@njit(cache=True, nogil=True, error_model="numpy")
def balance_weights(rows, width, row_start, texel_solid_angle, factor, triangle, weight, sums):
    """Multiply each weight by its triangle's factor, restore every texel's solid angle, and add up the triangles."""
    for row in range(rows[0], rows[1]):
        n = (row_start[row + 1] - row_start[row]) // width
        for column in range(width):
            start = row_start[row] + column * n
            total = 0.0
            for k in range(start, start + n):
                weight[k] *= factor[triangle[k]]
                total += weight[k]
            restore = texel_solid_angle[row] / total
            for k in range(start, start + n):
                weight[k] *= restore
                sums[triangle[k]] += weight[k]


@njit(cache=True, nogil=True, error_model="numpy")
def gather_radiance(rows, radiance, row_start, triangle, weight, integrals):
    """integrals (T, 3) += radiance of the texel times the weight, over the samples of the rows."""
    width = radiance.shape[1]
    for row in range(rows[0], rows[1]):
        n = (row_start[row + 1] - row_start[row]) // width
        for column in range(width):
            start = row_start[row] + column * n
            red, green, blue = radiance[row, column, 0], radiance[row, column, 1], radiance[row, column, 2]
            for k in range(start, start + n):
                integrals[triangle[k], 0] += weight[k] * red
                integrals[triangle[k], 1] += weight[k] * green
                integrals[triangle[k], 2] += weight[k] * blue


@njit(cache=True, nogil=True, error_model="numpy")
def decode_rgbe(data, position, pixels):
    """Decode Radiance scanlines from data[position:] into pixels (H, W, 4) uint8 [Ward91].

    New run-length scanlines start with 2, 2 and the width; all others are flat quadruples, where 1, 1, 1, n repeats the
    pixel before. Returns (status, row, byte): 0 read all; 1 the data end early; 2 a run leaves its scanline; 3 a
    scanline states another width; 4 a repeat with nothing before it.
    """
    height, width = pixels.shape[0], pixels.shape[1]
    end = len(data)
    for row in range(height):
        if position + 4 > end:
            return 1, row, position
        packed = data[position] == 2 and data[position + 1] == 2 and data[position + 2] < 128 and 8 <= width <= 32767
        if packed:
            if 256 * data[position + 2] + data[position + 3] != width:
                return 3, row, position
            position += 4
            for channel in range(4):
                column = 0
                while column < width:
                    if position + 2 > end:
                        return 1, row, position
                    count = int(data[position])
                    if count > 128:
                        count -= 128
                        if column + count > width:
                            return 2, row, position
                        pixels[row, column : column + count, channel] = data[position + 1]
                        position += 2
                    else:
                        if count == 0 or column + count > width:
                            return 2, row, position
                        if position + 1 + count > end:
                            return 1, row, position
                        pixels[row, column : column + count, channel] = data[position + 1 : position + 1 + count]
                        position += 1 + count
                    column += count
            continue
        column = 0
        shift = 0
        while column < width:
            if position + 4 > end:
                return 1, row, position
            quad = data[position : position + 4]
            if quad[0] == 1 and quad[1] == 1 and quad[2] == 1:
                count = int(quad[3]) << shift
                if column == 0 and row == 0:
                    return 4, row, position
                if column + count > width or shift > 24:
                    return 2, row, position
                before = pixels[row, column - 1] if column > 0 else pixels[row - 1, width - 1]
                for i in range(count):
                    pixels[row, column + i] = before
                column += count
                shift += 8
            else:
                pixels[row, column] = quad
                column += 1
                shift = 0
            position += 4
    return 0, height, position


@njit(cache=True, nogil=True, error_model="numpy")
def resample_angular(angular, n_sub, latlong):
    """Fill latlong (H, 2H, 3) with the mean of n_sub x n_sub angular-map texels per texel, weighted by sin(theta).

    Only texels whose centre lies inside the disc are read: on the rim the sample is pulled inwards.
    """
    size = angular.shape[0]
    height, width = latlong.shape[0], latlong.shape[1]
    for row in range(height):
        for column in range(width):
            red = green = blue = total = 0.0
            for j in range(n_sub):
                theta = math.pi * (row + (j + 0.5) / n_sub) / height
                sin_theta, y = math.sin(theta), math.cos(theta)
                for i in range(n_sub):
                    phi = 2.0 * math.pi * ((column + (i + 0.5) / n_sub) / width - 0.5)
                    x, z = sin_theta * math.sin(phi), -sin_theta * math.cos(phi)
                    across = math.sqrt(x * x + y * y)
                    radius = math.atan2(across, -z) / math.pi
                    cosine = x / across if across > 0.0 else 1.0
                    sine = y / across if across > 0.0 else 0.0
                    u, v = angular_texel(cosine, sine, radius, size)
                    red += sin_theta * angular[v, u, 0]
                    green += sin_theta * angular[v, u, 1]
                    blue += sin_theta * angular[v, u, 2]
                    total += sin_theta
            latlong[row, column, 0] = red / total
            latlong[row, column, 1] = green / total
            latlong[row, column, 2] = blue / total


@njit(cache=True, nogil=True, error_model="numpy")
def angular_texel(cosine, sine, radius, size):
    """Column and row of the texel at polar place (radius, angle), drawn towards the middle until it is in the disc."""
    u = v = size // 2
    for _ in range(4):
        u = min(int(0.5 * (1.0 + radius * cosine) * size), size - 1)
        v = min(int(0.5 * (1.0 - radius * sine) * size), size - 1)
        du = (2.0 * u + 1.0) / size - 1.0
        dv = (2.0 * v + 1.0) / size - 1.0
        if du * du + dv * dv <= 1.0:
            return u, v
        radius -= 1.0 / size
    return u, v


@njit(cache=True, nogil=True, error_model="numpy")
def solid_angles_range(points, corners, start, stop, result):
    """result[p, m] for points [start, stop): signed solid angle of patch m."""
    for p in range(start, stop):
        x, y, z = np.float64(points[p, 0]), np.float64(points[p, 1]), np.float64(points[p, 2])
        for m in range(len(corners)):
            result[p, m] = solid_angle_from(x, y, z, corners[m])
