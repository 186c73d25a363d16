"""Compiled loops that paint shapes onto a lat-long map, and that resample a map which is tilted.

A texel has the mean over its solid angle: of 2 x 2 samples where the share that is covered hardly varies in it, of
8 x 8 at rims. Kernels never validate; `engine.light.painting` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

CARD, DISC, GRADIENT, PANORAMA = 0, 1, 2, 3
FEW, MANY = 2, 8
EVEN = 0.02

Image = NDArray[np.float32]
Float64Array = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def fade(t: float, softness: float) -> float:
    """1 within a shape, 0 beyond its rim at t = 1, and a smooth step over the outermost share `softness`."""
    if t >= 1.0:
        return 0.0
    if t <= 1.0 - softness:
        return 1.0
    q = (1.0 - t) / softness
    return q * q * (3.0 - 2.0 * q)


@njit(cache=True, nogil=True, error_model="numpy")
def look_up(picture: Image, column: float, row: float, wraps: bool, found: Float64Array) -> None:
    """Writes the bilinear value (4,) of a picture (H, W, 4) at a place in units of its pixels, 0.5 at the first's
    centre."""
    height, width = picture.shape[0], picture.shape[1]
    x, y = column - 0.5, min(max(row - 0.5, 0.0), height - 1.0)
    left, top = int(math.floor(x)), int(math.floor(y))
    right_share, low_share = x - left, y - top
    low = min(top + 1, height - 1)
    if wraps:
        first, second = left % width, (left + 1) % width
    else:
        first, second = min(max(left, 0), width - 1), min(max(left + 1, 0), width - 1)
    for c in range(4):
        upper = float(picture[top, first, c]) * (1.0 - right_share) + float(picture[top, second, c]) * right_share
        lower = float(picture[low, first, c]) * (1.0 - right_share) + float(picture[low, second, c]) * right_share
        found[c] = upper * (1.0 - low_share) + lower * low_share


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate_shape(
    kind: int, x: float, y: float, z: float, size: Float64Array, softness: float, picture: Image, found: Float64Array
) -> None:
    """Writes colour and share covered (4,) of a shape in a direction: along its right, its top and towards it. size:
    the tangents of half a card's angles, or the angle of a disc's radius or of a gradient, radians."""
    height, width = picture.shape[0], picture.shape[1]
    if kind == PANORAMA:
        theta, phi = math.atan2(math.hypot(x, z), y), math.atan2(x, z)
        look_up(picture, (phi / (2.0 * math.pi) + 0.5) * width, theta / math.pi * height, True, found)
        return
    if kind == CARD:
        if z <= 1e-9:
            found[3] = 0.0
            return
        u, v = x / (z * size[0]), y / (z * size[1])
        share = fade(abs(u), softness) * fade(abs(v), softness)
        if share == 0.0:
            found[3] = 0.0
            return
        look_up(picture, 0.5 * (1.0 + u) * width, 0.5 * (1.0 - v) * height, False, found)
        found[3] *= share
        return
    t = math.atan2(math.hypot(x, y), z) / size[0]
    if kind == DISC:
        for c in range(3):
            found[c] = float(picture[0, 0, c])
        found[3] = float(picture[0, 0, 3]) * fade(t, softness)
        return
    # A gradient from the picture's first colour to its second; softness bends the ramp into a smooth step.
    t = min(t, 1.0)
    t += softness * (t * t * (3.0 - 2.0 * t) - t)
    for c in range(4):
        found[c] = float(picture[0, 0, c]) * (1.0 - t) + float(picture[0, 1, c]) * t


@njit(cache=True, nogil=True, error_model="numpy")
def sum_samples(
    n: int, kind: int, row: int, column: int, image: Image, frame: Float64Array, size: Float64Array, softness: float,
    picture: Image, found: Float64Array, total: Float64Array,
) -> bool:  # fmt: skip
    """Writes the mean over n x n samples of a texel of share times colour, and of share (4,); returns whether the share
    is nearly the same in all of them. Samples weigh as much as their solid angle."""
    height, width = image.shape[0], image.shape[1]
    total[:] = 0.0
    weights, least, most = 0.0, 2.0, -1.0
    for i in range(n):
        for k in range(n):
            # Staggered, so that no two have the same row or column: rims that run along either are met evenly.
            theta = math.pi * (row + (i + (k + 0.5) / n) / n) / height
            phi = 2.0 * math.pi * ((column + (k + (i + 0.5) / n) / n) / width - 0.5)
            sine, cosine = math.sin(theta), math.cos(theta)
            dx, dy, dz = sine * math.sin(phi), cosine, -sine * math.cos(phi)
            x = frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz
            y = frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz
            z = frame[2, 0] * dx + frame[2, 1] * dy + frame[2, 2] * dz
            evaluate_shape(kind, x, y, z, size, softness, picture, found)
            share = found[3]
            least, most = min(least, share), max(most, share)
            weights += sine
            if share > 0.0:
                for c in range(3):
                    total[c] += sine * share * found[c]
                total[3] += sine * share
    for c in range(4):
        total[c] /= weights
    return most - least < EVEN


@njit(cache=True, nogil=True, error_model="numpy")
def paint_rows(
    start: int, stop: int, image: Image, kind: int, frame: Float64Array, size: Float64Array, reach: float,
    softness: float, picture: Image, colour: Float64Array, opacity: float, covers: bool,
) -> None:  # fmt: skip
    """Paints a shape onto rows of an image (H, W, 3), in place. frame (3, 3): its right, its top and the direction
    towards it, in the image's frame; reach: the angle from there beyond which it is nowhere, radians."""
    height, width = image.shape[0], image.shape[1]
    found, total = np.zeros(4), np.zeros(4)
    texel = math.hypot(math.pi / height, 2.0 * math.pi / width)
    nearest = math.cos(min(reach + texel, math.pi))
    for row in range(start, stop):
        theta = math.pi * (row + 0.5) / height
        sine, cosine = math.sin(theta), math.cos(theta)
        # The row as a whole is too far away where even its nearest point, at the shape's azimuth, is.
        flat = math.hypot(frame[2, 0], frame[2, 2])
        if sine * flat + cosine * frame[2, 1] < nearest:
            continue
        for column in range(width):
            phi = 2.0 * math.pi * ((column + 0.5) / width - 0.5)
            ahead = sine * (math.sin(phi) * frame[2, 0] - math.cos(phi) * frame[2, 2]) + cosine * frame[2, 1]
            if ahead < nearest:
                continue
            is_even = sum_samples(FEW, kind, row, column, image, frame, size, softness, picture, found, total)
            if not is_even:
                sum_samples(MANY, kind, row, column, image, frame, size, softness, picture, found, total)
            if total[3] <= 0.0:
                continue
            below = 1.0 - opacity * total[3] if covers else 1.0
            for c in range(3):
                painted = below * float(image[row, column, c]) + opacity * colour[c] * total[c]
                image[row, column, c] = np.float32(painted)


@njit(cache=True, nogil=True, error_model="numpy")
def tilt_rows(start: int, stop: int, radiance: Image, inverse: Float64Array, tilted: Image) -> None:
    """Writes rows of a map that is tilted: each texel has the mean of 2 x 2 interpolated values of `radiance`, where
    `inverse` (3, 3) turns the tilted map's directions to."""
    height, width = tilted.shape[0], tilted.shape[1]
    rows, columns = radiance.shape[0], radiance.shape[1]
    total = np.zeros(3)
    for row in range(start, stop):
        for column in range(width):
            total[:] = 0.0
            for i in range(2):
                theta = math.pi * (row + 0.25 + 0.5 * i) / height
                sine, cosine = math.sin(theta), math.cos(theta)
                for k in range(2):
                    phi = 2.0 * math.pi * ((column + 0.25 + 0.5 * k) / width - 0.5)
                    dx, dy, dz = sine * math.sin(phi), cosine, -sine * math.cos(phi)
                    x = inverse[0, 0] * dx + inverse[0, 1] * dy + inverse[0, 2] * dz
                    y = inverse[1, 0] * dx + inverse[1, 1] * dy + inverse[1, 2] * dz
                    z = inverse[2, 0] * dx + inverse[2, 1] * dy + inverse[2, 2] * dz
                    at_row = min(max(math.atan2(math.hypot(x, z), y) / math.pi * rows - 0.5, 0.0), rows - 1.0)
                    at_column = (math.atan2(x, -z) / (2.0 * math.pi) + 0.5) * columns - 0.5
                    top, left = int(math.floor(at_row)), int(math.floor(at_column))
                    down, right = at_row - top, at_column - left
                    low, first, second = min(top + 1, rows - 1), left % columns, (left + 1) % columns
                    for c in range(3):
                        upper = float(radiance[top, first, c]) * (1.0 - right) + float(radiance[top, second, c]) * right
                        lower = float(radiance[low, first, c]) * (1.0 - right) + float(radiance[low, second, c]) * right
                        total[c] += upper * (1.0 - down) + lower * down
            for c in range(3):
                tilted[row, column, c] = np.float32(0.25 * total[c])
