"""Compiled: patches of lamps as a shading point sees them, and its coefficients of light without them.

Coefficients put a patch into one triangle of 2.8 degrees, and slices are means over it. Sharp gloss asks the layers'
formulas towards patches instead, of what remains it looks up slices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_local
from engine.core.fast_math import FAST
from engine.realtime.triple_product._incident_kernels import N_ROOTS, child_at, towards_patch

Float32Array = NDArray[np.float32]


class PatchLights(NamedTuple):
    """Patches of lamps, whose light the points' coefficients contain: position (S, 3) of the points and bits (S,
    ⌈L / 8⌉), the patches that each sees; triangle (U,), as `Hemisphere.number`; corners (L, 3, 3), centre, normal and
    flux (L, 3), which is radiance × area, area (L,) and cones (L, 4) of the patches; little: share of the reflected
    radiance by which neighbouring slices may disagree about them before they count as sharp."""

    position: Float32Array
    bits: NDArray[np.uint8]
    triangle: NDArray[np.int32]
    corners: Float32Array
    centre: Float32Array
    normal: Float32Array
    flux: Float32Array
    area: Float32Array
    cones: Float32Array
    little: float


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def visible_patches(
    patches: PatchLights, p: int, frame: Float32Array, children: NDArray[np.int16], place: NDArray[np.int64],
    power: Float32Array,
) -> int:  # fmt: skip
    """List the upper triangles of a point's frame that contain the patches it sees, and their power (L, 3), as
    `_incident_kernels.add_patches`; return their number."""
    n, at = 0, patches.position[p]
    for j in range(len(patches.flux)):
        if patches.bits[p, j >> 3] >> (j & 7) & 1:
            a, b = patches.centre[j, 0] - at[0], patches.centre[j, 1] - at[1]
            c = patches.centre[j, 2] - at[2]
            a, b, c, solid = towards_patch(j, a, b, c, patches.normal, patches.cones)
            x, y, z = to_local(frame, a, b, c)
            if solid > 0.0 and y > 0.0:
                place[n] = child_at(x, y, z, children) >> 2
                for i in range(3):
                    power[n, i] = solid * patches.flux[j, i]
                n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def remove_patches(
    place: NDArray[np.int64], power: Float32Array, triangle: NDArray[np.int32], number: NDArray[np.int16], n: int,
    wavelets: Float32Array, value: Float32Array,
) -> None:  # fmt: skip
    """Subtract from a point's first n coefficients, value (3 n + 1,) with number (n,), what patches in upper triangles
    place (K,) with power (K, 3) add to each. triangle: see `PatchLights`; wavelets (5120, 3): 0 before and after."""
    quarter = np.float32(0.25)
    for is_over in (False, True):
        for m in range(len(place)):
            at, parents, share = triangle[place[m]], len(wavelets) // 4, np.float32(1.0)
            while parents >= N_ROOTS:
                # As `_incident_kernels._transform`: one child's part of its parent's mean and three wavelets.
                parent, child, share = at >> 2, at & 3, quarter * share
                for w in range(3):
                    k, sign = parents + 3 * parent + w, share if child in (w, 3) else -share
                    for i in range(3):
                        wavelets[k, i] = np.float32(0.0) if is_over else wavelets[k, i] + sign * power[m, i]
                at, parents = parent, parents // 4
            for i in range(3):
                wavelets[at, i] = np.float32(0.0) if is_over else wavelets[at, i] + share * power[m, i]
        for k in range(0 if is_over else n):
            for i in range(3):
                value[3 * k + i] -= wavelets[number[k], i]
                wavelets[number[k], i] = np.float32(0.0)  # entries that are not filled repeat number 0
