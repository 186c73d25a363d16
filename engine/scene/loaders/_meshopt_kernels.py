"""Compiled loops of `engine.scene.loaders.meshopt`: the streams of vertices, triangles and indices.

Each returns 0, or the number of what is wrong: `TRUNCATED`, `LEFT_OVER`, `BAD_CODE`. No read goes beyond `end`,
whatever the stream says.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
UInt32Array = NDArray[np.uint32]
Int64Array = NDArray[np.int64]

TRUNCATED, LEFT_OVER, BAD_CODE = 1, 2, 3
GROUP = 16
BLOCK_BYTES, BLOCK_ELEMENTS = 8192, 256
_MASK = 0xFFFFFFFF


@nb.njit(cache=True, nogil=True, error_model="numpy")
def decode_vertices(source: Bytes, count: int, stride: int, target: Bytes) -> int:
    """Decode `count` elements of `stride` bytes into target (count · stride,) [KHR_meshopt_compression, A, mode 0]."""
    version = nb.int64(source[0]) & 15
    n_tail = stride + stride // 4 if version else stride
    end = len(source) - max(n_tail, 24 if version else 32)
    tail = len(source) - n_tail
    if end < 1:
        return TRUNCATED
    previous = source[tail : tail + stride].copy()
    deltas = np.zeros((stride, BLOCK_ELEMENTS), np.uint8)
    most, at = min(BLOCK_BYTES // stride // GROUP * GROUP, BLOCK_ELEMENTS), 1
    for first in range(0, count, most):
        n = min(most, count - first)
        controls = at
        at += stride // 4 if version else 0
        if at > end:
            return TRUNCATED
        for k in range(stride):
            control = _two_bits(source, controls, k) if version else -1
            at = _unpack_bytes(source, at, end, control, n, deltas[k])
            if at < 0:
                return TRUNCATED
        for channel in range(stride // 4):
            mode = nb.int64(source[tail + stride + channel]) if version else 0
            if mode & 15 > 2:
                return BAD_CODE
            _add_deltas(
                deltas[4 * channel :], n, mode, previous[4 * channel :], target[first * stride + 4 * channel :], stride
            )
    return 0 if at == end else LEFT_OVER


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _two_bits(source: Bytes, first: int, k: int) -> int:
    """The number k of numbers of two bits, the first in the lowest bits of its byte."""
    return nb.int64(source[first + k // 4]) >> 2 * (k % 4) & 3


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _unpack_bytes(source: Bytes, at: int, end: int, control: int, n: int, deltas: Bytes) -> int:
    """Unpack the deltas of one byte of n elements. control: of version 1, −1 in version 0. Returns the position behind
    them, −1 at the stream's end."""
    if control == 2:  # all are 0
        deltas[:n] = 0
        return at
    if control == 3:  # as they are
        if at + n > end:
            return -1
        deltas[:n] = source[at : at + n]
        return at + n
    n_groups = (n + GROUP - 1) // GROUP
    header = at
    at += (n_groups + 3) // 4
    if at > end:
        return -1
    for group in range(n_groups):
        width = _two_bits(source, header, group)
        if control < 0:
            bits = (0, 2, 4, 8)[width]
        else:
            bits = (0, 1, 2, 4, 8)[width + control]
        at = _unpack_group(source, at, end, bits, deltas[GROUP * group : GROUP * (group + 1)])
        if at < 0:
            return -1
    return at


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _unpack_group(source: Bytes, at: int, end: int, bits: int, deltas: Bytes) -> int:
    """Unpack 16 deltas of so many bits; one with all bits set stands for a byte that follows them."""
    if bits == 0:
        deltas[:] = 0
        return at
    behind = at + 2 * bits
    if behind > end:
        return -1
    if bits == 8:
        deltas[:] = source[at:behind]
        return behind
    sentinel, n_in_byte = (1 << bits) - 1, 8 // bits
    for i in range(GROUP):
        place = i % n_in_byte
        shift = place if bits == 1 else 8 - bits * (place + 1)
        delta = nb.int64(source[at + i // n_in_byte]) >> shift & sentinel
        if delta == sentinel:
            if behind >= end:
                return -1
            delta = nb.int64(source[behind])
            behind += 1
        deltas[i] = delta
    return behind


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _add_deltas(deltas: Bytes, n: int, mode: int, previous: Bytes, target: Bytes, stride: int) -> None:
    """Add up the deltas of a channel, four bytes of n elements: as bytes, as two pairs, or as one number by exclusive
    or, rotated right by the mode's upper half."""
    kind, turn = mode & 15, mode >> 4
    for i in range(n):
        if kind == 0:
            for k in range(4):
                previous[k] = nb.int64(previous[k]) + _unzig(nb.int64(deltas[k, i])) & 255
        elif kind == 1:
            for k in range(0, 4, 2):
                delta = nb.int64(deltas[k, i]) | nb.int64(deltas[k + 1, i]) << 8
                value = (nb.int64(previous[k]) | nb.int64(previous[k + 1]) << 8) + _unzig(delta) & 0xFFFF
                previous[k], previous[k + 1] = value & 255, value >> 8
        else:
            delta = nb.int64(0)
            for k in range(4):
                delta |= nb.int64(deltas[k, i]) << 8 * k
            delta = (delta >> turn | delta << 32 - turn) & _MASK
            for k in range(4):
                previous[k] = nb.int64(previous[k]) ^ delta >> 8 * k & 255
        for k in range(4):
            target[i * stride + k] = previous[k]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _unzig(value: int) -> int:
    """The signed number of a zigzag code: 0, −1, 1, −2, …"""
    return value >> 1 ^ -(value & 1)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def decode_triangles(source: Bytes, target: UInt32Array) -> int:
    """Decode the indices of triangles into target (3 T,) [KHR_meshopt_compression, A, mode 1]."""
    n = len(target) // 3
    end = len(source) - 16
    if 1 + n > end:
        return TRUNCATED
    edges, vertices = np.full((16, 2), -1, np.int64), np.full(16, -1, np.int64)
    # Positions of the next edge and the next vertex in their queues, the next new index, the last one that was given by
    # a difference, and the position in the stream behind the codes.
    state = np.array([0, 0, 0, 0, 1 + n], np.int64)
    for i in range(n):
        code = nb.int64(source[1 + i])
        high, low = code >> 4, code & 15
        if high < 15:
            edge = state[0] - 1 - high & 15
            a, b = edges[edge]
            c = _third(source, end, low, vertices, state)
            if c < 0 or a < 0:
                return BAD_CODE
            _push_edge(edges, state, c, b)
            _push_edge(edges, state, a, c)
        else:
            if low < 14:
                pair = nb.int64(source[end + low])
                a = _new_index(state)
                explicit = False
            else:
                if state[4] >= end:
                    return TRUNCATED
                pair = nb.int64(source[state[4]])
                state[4] += 1
                if pair == 0:
                    state[2] = 0
                a = _new_index(state) if low == 14 else _given_index(source, end, state)
                explicit = True
            b = _of_pair(source, end, pair >> 4, explicit, vertices, state)
            c = _of_pair(source, end, pair & 15, explicit, vertices, state)
            if a < 0 or b < 0 or c < 0:
                return BAD_CODE
            _push_vertex(vertices, state, a)
            for value, place in ((b, pair >> 4), (c, pair & 15)):
                if place == 0 or (explicit and place == 15):
                    _push_vertex(vertices, state, value)
            _push_edge(edges, state, b, a)
            _push_edge(edges, state, c, b)
            _push_edge(edges, state, a, c)
        target[3 * i], target[3 * i + 1], target[3 * i + 2] = a, b, c
    return 0 if state[4] == end else LEFT_OVER


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _third(source: Bytes, end: int, low: int, vertices: Int64Array, state: Int64Array) -> int:
    """The third corner of a triangle at a known edge; −1 where there is none."""
    if 0 < low < 13:
        return vertices[state[1] - 1 - low & 15]
    if low == 0:
        c = _new_index(state)
    elif low == 15:
        c = _given_index(source, end, state)
    else:
        c = state[3] = state[3] + (-1 if low == 13 else 1) & _MASK
    _push_vertex(vertices, state, c)
    return c


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _of_pair(source: Bytes, end: int, place: int, explicit: bool, vertices: Int64Array, state: Int64Array) -> int:
    """The second or third corner of a triangle without a known edge; −1 where there is none."""
    if place == 0:
        return _new_index(state)
    if explicit and place == 15:
        return _given_index(source, end, state)
    return vertices[state[1] - place & 15]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _new_index(state: Int64Array) -> int:
    index = state[2]
    state[2] = index + 1 & _MASK
    return index


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _given_index(source: Bytes, end: int, state: Int64Array) -> int:
    """An index by its difference to the last such one; −1 at the stream's end."""
    value, at = _read_number(source, state[4], end)
    state[4] = at
    if at < 0:
        return -1
    state[3] = state[3] + _unzig(value) & _MASK
    return state[3]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _read_number(source: Bytes, at: int, end: int) -> tuple[int, int]:
    """A number of 7 bits a byte, and the position behind it, −1 if it does not end."""
    value = nb.int64(0)
    for k in range(5):
        if at < 0 or at >= end:
            return 0, -1
        byte = nb.int64(source[at])
        at += 1
        value |= (byte & 127) << 7 * k
        if byte < 128:
            return value & _MASK, at
    return 0, -1


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _push_edge(edges: Int64Array, state: Int64Array, a: int, b: int) -> None:
    edges[state[0], 0], edges[state[0], 1] = a, b
    state[0] = state[0] + 1 & 15


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _push_vertex(vertices: Int64Array, state: Int64Array, index: int) -> None:
    vertices[state[1]] = index
    state[1] = state[1] + 1 & 15


@nb.njit(cache=True, nogil=True, error_model="numpy")
def decode_indices(source: Bytes, target: UInt32Array) -> int:
    """Decode a sequence of indices into target (N,) [KHR_meshopt_compression, A, mode 2]."""
    end, at, last = len(source) - 4, 1, np.zeros(2, np.int64)
    for i in range(len(target)):
        value, at = _read_number(source, at, end)
        if at < 0:
            return TRUNCATED
        baseline = value & 1
        last[baseline] = last[baseline] + _unzig(value >> 1) & _MASK
        target[i] = last[baseline]
    return 0 if at == end else LEFT_OVER
