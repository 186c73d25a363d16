"""Error of zonal lobes relative to transfer, as [Sloan05] measures it: of random functions and of a shadowed mesh."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import orthonormal
from engine.core.generators import map_steps
from engine.realtime.zonal_harmonics.transfer import TransferPoints, simulate
from engine.realtime.zonal_harmonics.zonal import MAX_LOBES, fit
from engine.scene.builtin import builtin_scenes
from engine.scene.raycaster import RayCaster, surface_points
from engine.scene.scene_loader import load_scene

Float64Array = NDArray[np.float64]

# [Sloan05]: error of a random vector of order 6 with 6 lobes (figure 2), and of a shadowed mesh with 3 (section 3.3).
PAPERS_RANDOM_6, PAPERS_MESH_3 = 0.00908, 0.045
ORDER = 6
MESH = ("idol", "head")
N_RANDOM, N_POINTS, N_RAYS = 200, 1100, 2000


def random_vectors(count: int = N_RANDOM, n: int = ORDER) -> Float64Array:
    """Unit vectors (P, n^2) in random directions."""
    vectors = np.random.default_rng(7).normal(size=(count, n * n))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def shadowed_mesh(
    n_points: int = N_POINTS, n_rays: int = N_RAYS, n: int = ORDER
) -> Generator[float, None, Float64Array]:
    """Vectors (P, n^2) of about n_points vertices, evenly chosen, of the built-in head with its own shadows. Yields the
    share that is done."""
    scene = load_scene(builtin_scenes()[MESH[0]])
    i = scene.object_index(MESH[1])
    (first, last), (start, stop) = scene.vertex_ranges[i], scene.triangle_ranges[i]
    caster = RayCaster(scene.vertices[first:last], scene.triangles[start:stop] - first)
    chosen = np.arange(first, last, max(1, (last - first) // n_points))
    normals = scene.normals[chosen].astype(np.float64)
    upright = np.tile(np.eye(3), (len(chosen), 1, 1))
    frames = orthonormal(np.concatenate([upright[:, :2], normals[:, None]], axis=1), upright)
    points = surface_points(caster, scene.vertices[chosen], normals)
    none = np.full((stop - start, 3), -1, np.int32)
    return (yield from simulate(TransferPoints(points, frames, none), caster, n, n_rays=n_rays))


def fit_errors(
    vectors: Float64Array, n_lobes: Sequence[int] = tuple(range(1, MAX_LOBES + 1))
) -> Generator[float, None, dict[int, float]]:
    """For each number of lobes the root mean square error over all points, divided by the root mean square of the
    signal [Sloan05, figure 3]. Yields the share that is done."""
    signal = np.linalg.norm(vectors)
    found = {}
    for k, count in enumerate(n_lobes):
        fitting = fit(vectors, count)
        zonal = yield from map_steps(fitting, lambda share, k=k: (k + share) / len(n_lobes))  # type: ignore[misc]
        found[count] = float(np.linalg.norm(zonal.errors) / signal) if signal > 0.0 else 0.0
    return found
