"""Compiled: the visibility rays of shading points, and the bits that result."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST

Float32Array = NDArray[np.float32]
Flags = NDArray[np.bool_]
Int32Array = NDArray[np.int32]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _begin_ray(
    point: Float32Array, direction: Float32Array, frame: Float32Array, origin: Float32Array, way: Float32Array
) -> None:
    """Write a ray from a point along a direction of its frame, element by element: for whole rows the compiler
    generates error messages, which takes longer than everything else."""
    for i in range(3):
        origin[i] = point[i]
        way[i] = direction[0] * frame[0, i] + direction[1] * frame[1, i] + direction[2] * frame[2, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def first_rays(points: NDArray[np.int64], lifted: Float32Array, frames: Float32Array, directions: Float32Array,
    origins: Float32Array,
               ray_directions: Float32Array) -> None:  # fmt: skip
    """Fill rays (N · U / 4, 3) of points (N,) through the middle child of each parent: direction 4 j + 3 of (U, 3)."""
    at = 0
    for p in points:
        for j in range(len(directions) // 4):
            _begin_ray(lifted[p], directions[4 * j + 3], frames[p], origins[at], ray_directions[at])
            at += 1


@njit(cache=True, nogil=True, error_model="numpy")
def differing(free: Flags, around: Int32Array, found: Flags) -> int:
    """Set found (N, T) where a triangle's flag (N, T) differs from one of its neighbours' around (T, A), −1 for none;
    return their number."""
    total = 0
    for n in range(free.shape[0]):
        for t in range(free.shape[1]):
            found[n, t] = False
            for other in around[t]:
                if other >= 0 and free[n, other] != free[n, t]:
                    found[n, t] = True
                    total += 1
                    break
    return total


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def more_rays(
    points: NDArray[np.int64], queried: Flags, lifted: Float32Array, frames: Float32Array, directions: Float32Array,
    n_children: int,
    origins: Float32Array, ray_directions: Float32Array,
) -> None:  # fmt: skip
    """Fill rays through the first n_children of the four children of each queried triangle (N, T); directions (4 T,
    3)."""
    at = 0
    for n in range(queried.shape[0]):
        p = points[n]
        for t in range(queried.shape[1]):
            if queried[n, t]:
                for c in range(n_children):
                    _begin_ray(lifted[p], directions[4 * t + c], frames[p], origins[at], ray_directions[at])
                    at += 1


@njit(cache=True, nogil=True, error_model="numpy")
def spread(middle: Flags, queried: Flags, blocked: Flags, free: Flags) -> None:
    """Fill free (N, 4 T): children inherit the middle child's flag (N, T), except for the other three of queried
    parents."""
    at = 0
    for n in range(middle.shape[0]):
        for t in range(middle.shape[1]):
            free[n, 4 * t + 3] = middle[n, t]
            for c in range(3):
                free[n, 4 * t + c] = middle[n, t]
                if queried[n, t]:
                    free[n, 4 * t + c] = not blocked[at]
                    at += 1


@njit(cache=True, nogil=True, error_model="numpy")
def pack(free: Flags, queried: Flags, blocked: Flags, points: NDArray[np.int64], bits: NDArray[np.uint8]) -> None:
    """Write bits (S, U / 2) of points (N,): four bits a triangle, all equal where its children were not queried (N,
    U)."""
    at = 0
    for n in range(free.shape[0]):
        row = bits[points[n]]
        for k in range(0, free.shape[1], 2):
            byte = 0
            for half in range(2):
                if queried[n, k + half]:
                    for c in range(4):
                        byte |= (0 if blocked[at] else 1) << (4 * half + c)
                        at += 1
                elif free[n, k + half]:
                    byte |= 15 << (4 * half)
            row[k >> 1] = byte
