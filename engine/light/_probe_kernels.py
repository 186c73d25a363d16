"""Compiled: resamples light probes and cube maps to lat-long maps. See `engine.light.probe_mappings`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Image = NDArray[np.float32]
Int32Array = NDArray[np.int32]


@njit(cache=True, nogil=True, error_model="numpy")
def resample_probe(
    probe: Image, is_ball: bool, cells: Int32Array, turns_back: bool, n_sub: int, start: int, stop: int, latlong: Image
) -> None:
    """Fills rows [start, stop) of latlong (H, W, 3): sin(theta)-weighted means of n_sub x n_sub texels of the probe.

    cells (6, 2): row and column of the faces +X, -X, +Y, -Y, +Z, -Z of a cube, in faces; empty for a map on a disc.
    turns_back: the face +Z stands on its head; is_ball: the disc is a mirroring ball.
    """
    height, width = latlong.shape[0], latlong.shape[1]
    for row in range(start, stop):
        for column in range(width):
            red = green = blue = total = 0.0
            for j in range(n_sub):
                # Direction of the sample in the lat-long map.
                theta = math.pi * (row + (j + 0.5) / n_sub) / height
                sin_theta, y = math.sin(theta), math.cos(theta)
                for i in range(n_sub):
                    phi = 2.0 * math.pi * ((column + (i + 0.5) / n_sub) / width - 0.5)
                    x, z = sin_theta * math.sin(phi), -sin_theta * math.cos(phi)
                    if len(cells) > 0:
                        u, v = cube_texel(x, y, z, cells, turns_back, probe.shape[0] // (cells[:, 0].max() + 1))
                    else:
                        u, v = disc_texel(x, y, z, is_ball, probe.shape[0])
                    red += sin_theta * float(probe[v, u, 0])
                    green += sin_theta * float(probe[v, u, 1])
                    blue += sin_theta * float(probe[v, u, 2])
                    total += sin_theta
            latlong[row, column, 0] = red / total
            latlong[row, column, 1] = green / total
            latlong[row, column, 2] = blue / total


@njit(cache=True, nogil=True, error_model="numpy")
def disc_texel(x: float, y: float, z: float, is_ball: bool, size: int) -> tuple[int, int]:
    """Column and row of a unit direction in a map on a disc, moved towards its centre until the texel's centre lies in
    it.

    The radius is the angle from -Z over pi; on a ball the sine of half the angle from +Z, because the normal there
    halves the angle between the direction and the camera.
    """
    across = math.sqrt(x * x + y * y)
    radius = math.sin(0.5 * math.atan2(across, z)) if is_ball else math.atan2(across, -z) / math.pi
    cosine = x / across if across > 0.0 else 1.0
    sine = y / across if across > 0.0 else 0.0
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
def cube_texel(x: float, y: float, z: float, cells: Int32Array, turns_back: bool, size: int) -> tuple[int, int]:
    """Column and row of a direction in the unfolded faces of a cube, each `size` texels wide. Seen from inside, each
    side face is upright; above and below, the side towards -Z adjoins the face of -Z."""
    ax, ay, az = abs(x), abs(y), abs(z)
    # s to the right and t upwards on the face, from -1 to 1.
    if az >= ax and az >= ay:
        face = 4 if z > 0.0 else 5
        s, t = (-x / az, y / az) if z > 0.0 else (x / az, y / az)
        if z > 0.0 and turns_back:
            s, t = -s, -t
    elif ax >= ay:
        face = 0 if x > 0.0 else 1
        s, t = (z / ax, y / ax) if x > 0.0 else (-z / ax, y / ax)
    else:
        face = 2 if y > 0.0 else 3
        s, t = (x / ay, z / ay) if y > 0.0 else (x / ay, -z / ay)
    u = size * int(cells[face, 1]) + min(int(0.5 * (1.0 + s) * size), size - 1)
    v = size * int(cells[face, 0]) + min(int(0.5 * (1.0 - t) * size), size - 1)
    return u, v
