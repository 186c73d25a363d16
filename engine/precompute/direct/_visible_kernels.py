"""Compiled: lists the lights that a point sees, and transforms directions to its local frame.

Directions are stored axis by axis, (3, N), so that the compiler vectorises the loops over them.
"""

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def count_bits(word):
    """Number of set bits of a uint64."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _share(words, first, n):
    """The share of set bits in [first, first + n)."""
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
    """Lists the lights that a point sees, with the visible share of each; returns their number.

    The visible share of light m is that of set bits in [first, first + n_bits), a range of 1, 4, 16 or whole words; or,
    where fine[m] ≥ 0, that bit of fine_words.
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
    """Rotates (3, N) world vectors into the frame whose rows are tangent, bitangent, normal."""
    for v in range(vectors.shape[1]):
        x[v] = frame[0, 0] * vectors[0, v] + frame[0, 1] * vectors[1, v] + frame[0, 2] * vectors[2, v]
        y[v] = frame[1, 0] * vectors[0, v] + frame[1, 1] * vectors[1, v] + frame[1, 2] * vectors[2, v]
        z[v] = frame[2, 0] * vectors[0, v] + frame[2, 1] * vectors[1, v] + frame[2, 2] * vectors[2, v]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def gather_local(vectors, listed, n, frame, x, y, z):
    """As `to_local`, for the first n listed columns only."""
    for i in range(n):
        u, v, w = vectors[0, listed[i]], vectors[1, listed[i]], vectors[2, listed[i]]
        x[i] = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
        y[i] = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
        z[i] = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def set_frame(tangent, normal, frame):
    """Writes tangent, bitangent and normal as rows of the frame (3, 3)."""
    for axis in range(3):
        frame[0, axis] = tangent[axis]
        frame[2, axis] = normal[axis]
    frame[1, 0] = normal[1] * tangent[2] - normal[2] * tangent[1]
    frame[1, 1] = normal[2] * tangent[0] - normal[0] * tangent[2]
    frame[1, 2] = normal[0] * tangent[1] - normal[1] * tangent[0]
