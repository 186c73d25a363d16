"""Compiled: the visibility rays of shading points towards objects that are being moved."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core.fast_math import FAST

Float32Array = NDArray[np.float32]
Bits = NDArray[np.uint8]

PARENTS = 16  # triangles of the level of visibility in one of two levels above


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def rays_to_spheres(
    points: NDArray[np.int64], spheres: Float32Array, lifted: Float32Array, frames: Float32Array,
    directions: Float32Array, parents: Float32Array, n_together: int, bits: Bits, asks_free: bool,
    row: NDArray[np.int32], triangle: NDArray[np.int32], origins: Float32Array, ray_directions: Float32Array,
) -> int:  # fmt: skip
    """Fill rays of points (N,) through the triangles of their hemispheres, along directions (U, 3), that meet one of
    some spheres (K, 4): row and triangle (R,) of each, origins and directions (R, 3). Return their number.

    n_together: how many consecutive triangles, 1 or the 4 of a parent, have one ray, along the last one's direction;
    parents (U / 16, 4): axis, and the sine of the radius, of each sixteen. bits (S, U / 2): of triangles that are free
    in part, if asks_free, else of those that are blocked in part. What two spheres cover has two rays.
    """
    n_found = 0
    for n in range(len(points)):
        p = points[n]
        for k in range(len(spheres)):
            # The sphere's direction in the point's frame, and the cone that it fills.
            x, y, z = spheres[k, 0] - lifted[p, 0], spheres[k, 1] - lifted[p, 1], spheres[k, 2] - lifted[p, 2]
            squared = x * x + y * y + z * z
            distance, radius = math.sqrt(squared), spheres[k, 3]
            inside = distance <= radius
            least = -1.0 if inside else math.sqrt(squared - radius * radius) / distance
            sine = 1.0 if inside else radius / distance
            scale = 1.0 / max(distance, 1e-30)
            x, y, z = x * scale, y * scale, z * scale
            a = frames[p, 0, 0] * x + frames[p, 0, 1] * y + frames[p, 0, 2] * z
            b = frames[p, 1, 0] * x + frames[p, 1, 1] * y + frames[p, 1, 2] * z
            c = frames[p, 2, 0] * x + frames[p, 2, 1] * y + frames[p, 2, 2] * z
            if b < -sine and not inside:
                continue
            for t in range(len(parents)):
                # cos(α + β) of the two cones, below which they are apart.
                along = a * parents[t, 0] + b * parents[t, 1] + c * parents[t, 2]
                wide = parents[t, 3]
                if not inside and along < least * math.sqrt(1.0 - wide * wide) - sine * wide:
                    continue
                for j in range(PARENTS * t, PARENTS * (t + 1), n_together):
                    if n_together == 1:
                        known = bits[p, j >> 1] >> (4 * (j & 1)) & 15
                        every = 15
                    else:
                        known = int(bits[p, j >> 1]) << 8 | int(bits[p, (j >> 1) + 1])
                        every = 65535
                    if (known == 0) if asks_free else (known == every):
                        continue
                    d = directions[j + n_together - 1]
                    if a * d[0] + b * d[1] + c * d[2] < least:
                        continue
                    row[n_found], triangle[n_found] = n, j
                    for i in range(3):
                        origins[n_found, i] = lifted[p, i]
                        ray_directions[n_found, i] = (
                            d[0] * frames[p, 0, i] + d[1] * frames[p, 1, i] + d[2] * frames[p, 2, i]
                        )
                    n_found += 1
    return n_found


@njit(cache=True, nogil=True, error_model="numpy")
def set_triangles(
    points: NDArray[np.int64], row: NDArray[np.int32], triangle: NDArray[np.int32], n_together: int,
    which: NDArray[np.bool_], is_free: bool, bits: Bits,
) -> None:  # fmt: skip
    """Set all bits (S, U / 2) of the triangles (R,), n_together from each on, of rays of points (N,) to free, or to
    blocked, where `which` (R,)."""
    for r in range(len(row)):
        if which[r]:
            at = bits[points[row[r]]]
            for j in range(triangle[r], triangle[r] + n_together):
                mask, old = 15 << (4 * (j & 1)), at[j >> 1]
                at[j >> 1] = old | mask if is_free else old & (255 - mask)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def rays_to_patches(
    points: NDArray[np.int64], spheres: Float32Array, lifted: Float32Array, samples: Float32Array,
    stays: NDArray[np.bool_], bits: Bits, asks_free: bool,
    row: NDArray[np.int32], patch: NDArray[np.int32], origins: Float32Array, ray_directions: Float32Array,
) -> int:  # fmt: skip
    """Fill rays of points (N,) to places (L, 3) on those patches that stay (L,), which pass one of some spheres (K, 4);
    patches that the bits (S, ⌈L / 8⌉) say to be free, if asks_free, else those that are blocked. Return their
    number."""
    n_found = 0
    for n in range(len(points)):
        p = points[n]
        for j in range(len(samples)):
            if not stays[j] or (bits[p, j >> 3] >> (j & 7) & 1) != (1 if asks_free else 0):
                continue
            dx, dy, dz = samples[j, 0] - lifted[p, 0], samples[j, 1] - lifted[p, 1], samples[j, 2] - lifted[p, 2]
            squared = max(dx * dx + dy * dy + dz * dz, 1e-30)
            for k in range(len(spheres)):
                x, y, z = spheres[k, 0] - lifted[p, 0], spheres[k, 1] - lifted[p, 1], spheres[k, 2] - lifted[p, 2]
                # The place on the ray that is closest to the centre.
                along = min(max((x * dx + y * dy + z * dz) / squared, 0.0), 1.0)
                x, y, z = x - along * dx, y - along * dy, z - along * dz
                if x * x + y * y + z * z <= spheres[k, 3] * spheres[k, 3]:
                    row[n_found], patch[n_found] = n, j
                    for i in range(3):
                        origins[n_found, i] = lifted[p, i]
                    ray_directions[n_found, 0], ray_directions[n_found, 1] = dx, dy
                    ray_directions[n_found, 2] = dz
                    n_found += 1
                    break
    return n_found
