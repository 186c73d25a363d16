"""Emitters: glowing surfaces of the scene as flat triangular patches, each a small light of its own.

Patches are made even in area by splitting the largest one at the middle of its longest edge until there are enough;
this keeps them well shaped, and no emitter is sampled finer than another. One-sided: a patch shines to the side its
normal points to, given by the order of its corners (counter-clockwise seen from the bright side).
"""

from __future__ import annotations

import heapq
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_N_THREADS = 2


@dataclass(frozen=True, eq=False)
class EmitterPatches:
    """M flat patches: corners (M, 3, 3), centre (M, 3), unit normal (M, 3), radiance (M, 3), area (M,), all float32."""

    corners: NDArray[np.float32]
    centre: NDArray[np.float32]
    normal: NDArray[np.float32]
    radiance: NDArray[np.float32]
    area: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.area)


def emitter_patches(triangles: ArrayLike, radiance: ArrayLike, n_patches: int) -> EmitterPatches:
    """Cut emitting triangles (T, 3, 3), in metres, with radiance (T, 3), into `n_patches` patches of about equal area.

    Triangles without area or without radiance are left out; what remains is never merged, so there are more than
    `n_patches` patches where there are more triangles. Area and radiance are kept: total flux is that of the triangles.
    Raises ValueError for wrong shapes, negative or non-finite values, or n_patches < 1.
    """
    corners, emitted = np.asarray(triangles, np.float64), np.asarray(radiance, np.float64)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or emitted.shape != (len(corners), 3):
        raise ValueError(f"triangles {corners.shape} and radiance {emitted.shape}, expected (T, 3, 3) and (T, 3)")
    if not (np.isfinite(corners).all() and np.isfinite(emitted).all() and (emitted >= 0.0).all()):
        raise ValueError("emitters hold values that are not finite, or negative radiance")
    if n_patches < 1:
        raise ValueError(f"n_patches = {n_patches}, expected at least 1")
    shining = (_areas(corners) > 0.0) & (emitted > 0.0).any(axis=1)
    patches, origin = _split_largest(corners[shining], n_patches)
    normal = _area_vectors(patches)
    area = np.linalg.norm(normal, axis=1)
    return EmitterPatches(
        corners=patches.astype(np.float32),
        centre=patches.mean(axis=1).astype(np.float32),
        normal=(normal / area[:, None]).astype(np.float32),
        radiance=emitted[shining][origin].astype(np.float32),
        area=area.astype(np.float32),
    )


def patch_solid_angles(patches: EmitterPatches, points: ArrayLike) -> NDArray[np.float32]:
    """Solid angle of every patch from every point (P, 3): (P, M) float32, steradians, 0 to 2 pi.

    Exact for flat triangles at any distance [VanOosterom83]; 0 from behind a patch and from within its plane.
    """
    from engine.light import _kernels  # late: patches themselves need no compiler

    places = np.ascontiguousarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3:
        raise ValueError(f"points have shape {places.shape}, expected (P, 3)")
    result = np.empty((len(places), len(patches)), np.float32)
    corners = patches.corners.astype(np.float64)
    bounds = [len(places) * i // _N_THREADS for i in range(_N_THREADS + 1)]
    with ThreadPoolExecutor(_N_THREADS) as pool:
        list(
            pool.map(
                lambda i: _kernels.solid_angles_range(places, corners, bounds[i], bounds[i + 1], result),
                range(_N_THREADS),
            )
        )
    return np.maximum(result, 0.0)


def _area_vectors(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(_area_vectors(corners), axis=1)


def _split_largest(corners: NDArray[np.float64], n_patches: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Halve the largest patch until there are `n_patches`: patches (M, 3, 3) and the triangle each came from (M,).

    Halves stand beside one another in the list, so that every n-th patch is spread over the whole emitter: visibility
    takes some of them as samples. In the order of splitting, every eighth would lie in one eighth of it.
    """
    patches, origin = list(corners), list(range(len(corners)))
    places, widths = [float(i) for i in origin], [1.0] * len(corners)
    queue = [(-float(area), i) for i, area in enumerate(_areas(corners))]
    heapq.heapify(queue)
    while queue and len(patches) < n_patches:
        negative_area, i = heapq.heappop(queue)
        first, second = _halves(patches[i])
        patches[i] = first
        patches.append(second)
        origin.append(origin[i])
        widths[i] /= 2
        places.append(places[i] + widths[i])
        widths.append(widths[i])
        for child in (i, len(patches) - 1):
            heapq.heappush(queue, (0.5 * negative_area, child))
    order = np.argsort(places, kind="stable")
    return np.array(patches).reshape(-1, 3, 3)[order], np.array(origin, dtype=np.intp)[order]


def _halves(patch: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Split (3, 3) at the middle of its longest edge, both halves turned the same way round as the whole."""
    lengths = [np.linalg.norm(patch[(k + 1) % 3] - patch[k]) for k in range(3)]
    k = int(np.argmax(lengths))
    a, b, c = patch[k], patch[(k + 1) % 3], patch[(k + 2) % 3]
    middle = 0.5 * (a + b)
    return np.array([a, middle, c]), np.array([middle, b, c])
