"""Compiled: the light that comes in at a shading point, triangle by triangle of its own hemisphere."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.sphere._kernels import locate_one

Floats = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def powers_at(
    frame: Floats,
    bits: NDArray[np.uint8],
    upper: NDArray[np.int32],
    places: NDArray[np.int32],
    directions: Floats,
    solid_angles: Floats,
    sky: Floats,
    sun_direction: Floats,
    sun_power: Floats,
    roots: NDArray[np.float64],
    planes: NDArray[np.float64],
    level: int,
    powers: Floats,
) -> None:
    """Fill powers (5120, 3): radiance × solid angle of each triangle that a point sees; 0 what it does not.

    frame (3, 3) and bits (1280,) of the point; directions, solid_angles: of the upper triangles; places (5120,): of a
    triangle among these, or −1; level: of the triangles; roots, planes: what `locate_one` takes
    one level finer.
    """
    side = sky.shape[0]
    half = np.float32(0.5 * side)
    powers[:] = 0.0
    for k in range(len(upper)):
        seen = bits[k >> 1] >> (4 * (k & 1)) & 15
        if seen:
            a, b, c = directions[k, 0], directions[k, 1], directions[k, 2]
            x = a * frame[0, 0] + b * frame[1, 0] + c * frame[2, 0]
            y = a * frame[0, 1] + b * frame[1, 1] + c * frame[2, 1]
            z = a * frame[0, 2] + b * frame[1, 2] + c * frame[2, 2]
            scale = half / (abs(x) + abs(y) + abs(z))
            fold = max(-y, np.float32(0.0)) * scale
            u, v = x * scale, z * scale
            u = u - fold if u < 0.0 else u + fold
            v = v - fold if v < 0.0 else v + fold
            column = min(max(int(u + half), 0), side - 1)
            row = min(max(int(v + half), 0), side - 1)
            m = upper[k]
            share = solid_angles[k] * np.float32(0.25 * ((seen & 1) + (seen >> 1 & 1) + (seen >> 2 & 1) + (seen >> 3)))
            for i in range(3):
                powers[m, i] = sky[row, column, i] * share
    for s in range(len(sun_power)):
        m = triangle_seen(frame, bits, places, sun_direction[s], roots, planes, level)
        if m >= 0:
            for i in range(3):
                powers[m, i] += sun_power[s, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def triangle_seen(
    frame: Floats,
    bits: NDArray[np.uint8],
    places: NDArray[np.int32],
    direction: Floats,
    roots: NDArray[np.float64],
    planes: NDArray[np.float64],
    level: int,
) -> int:
    """The triangle of a point's sphere that holds a direction (3,) of the world if the point sees it there; else −1."""
    x = y = z = 0.0
    for i in range(3):
        x += frame[0, i] * direction[i]
        y += frame[1, i] * direction[i]
        z += frame[2, i] * direction[i]
    if y <= 0.0:
        return -1
    child = locate_one(x, y, z, level + 1, roots, planes)
    k = places[child >> 2]
    return child >> 2 if k >= 0 and bits[k >> 1] >> (4 * (k & 1) + (child & 3)) & 1 else -1


@njit(cache=True, nogil=True, error_model="numpy")
def suns_seen(
    points: NDArray[np.int64],
    frames: Floats,
    bits: NDArray[np.uint8],
    places: NDArray[np.int32],
    sun_direction: Floats,
    roots: NDArray[np.float64],
    planes: NDArray[np.float64],
    level: int,
    seen: NDArray[np.bool_],
) -> None:
    """Fill seen (N, M): whether points (N,) see each of M suns."""
    for j in range(len(points)):
        p = points[j]
        for s in range(len(sun_direction)):
            seen[j, s] = triangle_seen(frames[p], bits[p], places, sun_direction[s], roots, planes, level) >= 0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def add_patches(
    position: Floats,
    frame: Floats,
    bits: NDArray[np.uint8],
    centre: Floats,
    normal: Floats,
    flux: Floats,
    roots: NDArray[np.float64],
    planes: NDArray[np.float64],
    level: int,
    powers: Floats,
) -> None:
    """Add what a point sees of patches, each put whole into the triangle (5120,) that holds its centre's direction.

    centre, normal (M, 3); flux (M, 3): radiance × area; bits (⌈M / 8⌉,) of those that are free.
    """
    for k in range(len(centre)):
        if bits[k >> 3] >> (k & 7) & 1:
            a, b = centre[k, 0] - position[0], centre[k, 1] - position[1]
            c = centre[k, 2] - position[2]
            facing = -(a * normal[k, 0] + b * normal[k, 1] + c * normal[k, 2])
            y = frame[1, 0] * a + frame[1, 1] * b + frame[1, 2] * c
            if facing > 0.0 and y > 0.0:
                squared = a * a + b * b + c * c
                x = frame[0, 0] * a + frame[0, 1] * b + frame[0, 2] * c
                z = frame[2, 0] * a + frame[2, 1] * b + frame[2, 2] * c
                m = locate_one(x, y, z, level, roots, planes)
                solid = facing / (squared * math.sqrt(squared))
                for i in range(3):
                    powers[m, i] += flux[k, i] * solid


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def irradiance_of(powers: Floats, cosine: Floats, irradiance: Floats) -> None:
    """Σ power × cosine (5120,), into irradiance (3,)."""
    red = green = blue = np.float32(0.0)
    for m in range(len(cosine)):
        red += powers[m, 0] * cosine[m]
        green += powers[m, 1] * cosine[m]
        blue += powers[m, 2] * cosine[m]
    irradiance[0], irradiance[1], irradiance[2] = red, green, blue


@njit(cache=True, nogil=True, error_model="numpy")
def compress(powers: Floats, n: int, wavelets: Floats, sizes: Floats, number: NDArray[np.int16], value: Floats) -> None:
    """Wavelets of powers (5120, 3), at most the n largest by size, 20 means among them: number ascending, value (n, 3).

    What is left of both is 0. powers, wavelets (5120, 3) and sizes (5120,) are written over.
    """
    _transform(powers, wavelets, sizes)
    least = _least_size(sizes, n)
    found = 0
    for k in range(len(sizes)):
        if sizes[k] >= least:
            number[found] = k
            for i in range(3):
                value[found, i] = wavelets[k, i]
            found += 1
    for k in range(found, n):
        number[k] = 0
        for i in range(3):
            value[k, i] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _transform(means: Floats, wavelets: Floats, sizes: Floats) -> None:
    """`engine.sphere.haar.forward`, and each coefficient's size by the measure of its triangle.

    In place: parent t of a level reads its four children and leaves their mean in row t.
    """
    parents, measure = len(means) // 4, np.float32(1.0)
    coarse = parents
    while coarse > 20:
        coarse //= 4
        measure *= np.float32(0.25)
    while parents >= 20:
        for t in range(parents):
            at = parents + 3 * t
            sizes[at] = sizes[at + 1] = sizes[at + 2] = 0.0
            for i in range(3):
                a, b = np.float32(0.25) * means[4 * t, i], np.float32(0.25) * means[4 * t + 1, i]
                c, d = np.float32(0.25) * means[4 * t + 2, i], np.float32(0.25) * means[4 * t + 3, i]
                means[t, i] = a + b + c + d
                for w, difference in enumerate((a - b - c + d, b - a - c + d, c - a - b + d)):
                    wavelets[at + w, i] = difference
                    sizes[at + w] = max(sizes[at + w], measure * abs(difference))
        parents //= 4
        measure *= np.float32(4.0)
    for t in range(20):
        sizes[t] = np.inf
        for i in range(3):
            wavelets[t, i] = means[t, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _least_size(sizes: Floats, n: int) -> np.float32:
    """A size that at most n have or exceed, and few less: by counting, in bins an eighth of an octave wide."""
    bits = sizes.view(np.int32)
    counts = np.zeros(1 << 11, np.int32)
    for k in range(len(bits)):
        counts[bits[k] >> 20] += 1
    total, bin_ = 0, len(counts) - 1
    while bin_ > 0 and total + counts[bin_] <= n:
        total += counts[bin_]
        bin_ -= 1
    edge = np.empty(1, np.int32)
    edge[0] = (bin_ + 1) << 20
    return edge.view(np.float32)[0]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def light_range(
    start: int, stop: int, n: int, frames: Floats, bits: NDArray[np.uint8], upper: NDArray[np.int32],
    places: NDArray[np.int32], directions: Floats, solid_angles: Floats, sky: Floats, sun_direction: Floats,
    sun_power: Floats, roots: NDArray[np.float64], planes: NDArray[np.float64], level: int,
    positions: Floats, patch_bits: NDArray[np.uint8], centre: Floats, normal: Floats, flux: Floats, cosine: Floats,
    number: NDArray[np.int16], value: Floats, irradiance: Floats,
) -> None:  # fmt: skip
    """`powers_at`, `add_patches`, `irradiance_of` and `compress` for points start to stop.

    number, value and irradiance are of all points.
    """
    powers, wavelets = np.empty((len(cosine), 3), np.float32), np.empty((len(cosine), 3), np.float32)
    sizes = np.empty(len(cosine), np.float32)
    for p in range(start, stop):
        powers_at(frames[p], bits[p], upper, places, directions, solid_angles, sky, sun_direction, sun_power, roots,
                  planes, level, powers)  # fmt: skip
        add_patches(positions[p], frames[p], patch_bits[p], centre, normal, flux, roots, planes, level, powers)
        irradiance_of(powers, cosine, irradiance[p])
        compress(powers, n, wavelets, sizes, number[p], value[p])
