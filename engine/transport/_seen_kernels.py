"""Which lights a point sees, and where they stand in its own frame.

Directions are stored axis by axis, (3, N), so that loops over them are vector loops.
"""

import math

import numba as nb
import numpy as np

from engine.transport._angle_kernels import TINY


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def count_bits(word):
    """Number of set bits of a uint64."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _share(words, first, n):
    if n == 1:
        return np.float32((words[first >> 6] >> np.uint64(first & 63)) & np.uint64(1))
    if n < 64:
        part = (words[first >> 6] >> np.uint64(first & 63)) & ((np.uint64(1) << np.uint64(n)) - np.uint64(1))
        return np.float32(count_bits(part)) / np.float32(n)
    total = 0
    for w in range(first >> 6, (first + n) >> 6):
        total += count_bits(words[w])
    return np.float32(total) / np.float32(n)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def list_visible(words, fine_words, first, n_bits, fine, lights, weights):
    """List the lights a point sees and the share of each; returns their number.

    Light m sees the share of set bits in [first, first + n_bits), a range of 1, 4, 16 or whole words; or, where
    fine[m] ≥ 0, that bit of fine_words.
    """
    n = 0
    for m in range(fine.shape[0]):
        f = fine[m]
        if f >= 0:
            share = np.float32((fine_words[f >> 6] >> np.uint64(f & 63)) & np.uint64(1))
        else:
            share = _share(words, first[m], n_bits[m])
        lights[n] = m
        weights[n] = share
        n += share > np.float32(0.0)
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def to_local(vectors, frame, x, y, z):
    """Rotate (3, N) world vectors into the frame whose rows are tangent, bitangent, normal."""
    for v in range(vectors.shape[1]):
        x[v] = frame[0, 0] * vectors[0, v] + frame[0, 1] * vectors[1, v] + frame[0, 2] * vectors[2, v]
        y[v] = frame[1, 0] * vectors[0, v] + frame[1, 1] * vectors[1, v] + frame[1, 2] * vectors[2, v]
        z[v] = frame[2, 0] * vectors[0, v] + frame[2, 1] * vectors[1, v] + frame[2, 2] * vectors[2, v]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def gather_local(vectors, listed, n, frame, x, y, z):
    """As `to_local` for the first n listed columns alone."""
    for i in range(n):
        u, v, w = vectors[0, listed[i]], vectors[1, listed[i]], vectors[2, listed[i]]
        x[i] = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
        y[i] = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
        z[i] = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w


@nb.njit(cache=True, nogil=True, error_model="numpy")
def towards(points, place, out):
    """Unit vectors (3, N) from a place (3,) to points (3, N)."""
    for v in range(points.shape[1]):
        dx, dy, dz = points[0, v] - place[0], points[1, v] - place[1], points[2, v] - place[2]
        inverse = np.float32(1.0) / np.sqrt(max(dx * dx + dy * dy + dz * dz, TINY))
        out[0, v], out[1, v], out[2, v] = dx * inverse, dy * inverse, dz * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def patch_colours(directions, corners, radiance, colours, sizes):
    """Radiance times solid angle [VanOosterom83] and angular size of patches with unit corner directions (3, N)."""
    for m in range(corners.shape[0]):
        i, j, k = corners[m, 0], corners[m, 1], corners[m, 2]
        ax, ay, az = directions[0, i], directions[1, i], directions[2, i]
        bx, by, bz = directions[0, j], directions[1, j], directions[2, j]
        cx, cy, cz = directions[0, k], directions[1, k], directions[2, k]
        # The triple product through edge vectors: corners seen from afar are nearly parallel and would cancel.
        ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        triple = ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx)
        cosines = (ax * bx + ay * by + az * bz) + (bx * cx + by * cy + bz * cz) + (cx * ax + cy * ay + cz * az)
        solid_angle = np.float32(2.0) * math.atan2(abs(triple), np.float32(1.0) + cosines)
        for channel in range(3):
            colours[m, channel] = radiance[m, channel] * solid_angle
        wx, wy, wz = cx - bx, cy - by, cz - bz
        longest2 = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
        sizes[m] = np.sqrt(longest2)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def set_frame(tangent, normal, frame):
    for axis in range(3):
        frame[0, axis] = tangent[axis]
        frame[2, axis] = normal[axis]
    frame[1, 0] = normal[1] * tangent[2] - normal[2] * tangent[1]
    frame[1, 1] = normal[2] * tangent[0] - normal[0] * tangent[2]
    frame[1, 2] = normal[0] * tangent[1] - normal[1] * tangent[0]
