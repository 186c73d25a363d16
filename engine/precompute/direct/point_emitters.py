"""The emitter tree for the points of a picture: leaves are distributed by their effect on these points.

Some hundred points, drawn evenly from the picture, determine how finely each emitter must be divided
(`visible_importance`). A few rays from each of them to every emitting triangle estimate its visible share: a lamp
behind a wall gets few leaves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.light.emitters import (
    EmitterTree,
    emitter_patches,
    emitter_tree,
    emitting_triangles,
    merge_triangles,
    visible_importance,
)
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.visibility import _kernels as kernels

N_POINTS = 512
N_RAYS = 8  # from a point to each triangle
UNCERTAIN_SHARE = 0.125  # pseudo-counts of rays that arrived, and of rays that did not
# Emitters of fewer triangles retain them all, however few leaves are requested.
FEWEST_MERGED = 64

Float64Array = NDArray[np.float64]


def emitters_for(scene: Scene, caster: RayCaster, hits: PrimaryHits, n_leaves: int) -> EmitterTree | None:
    """The scene's emitters as a tree of about n_leaves leaves, with many triangles merged; None where nothing emits."""
    emitting = scene.emitters[scene.object_of_triangle]
    if not emitting.any():
        return None
    corners = scene.vertices[scene.triangles[emitting]].astype(np.float64)
    radiance = scene.emission[scene.object_of_triangle[emitting]].astype(np.float64)
    lit = emitting_triangles(corners, radiance)
    corners, radiance = corners[lit], radiance[lit]
    if not len(corners):
        return None
    corners, radiance = merge_triangles(corners, radiance, max(n_leaves // 2, FEWEST_MERGED))
    if len(hits.pixel) == 0:
        return emitter_tree(corners, radiance, n_leaves)
    rows = np.unique(np.linspace(0, len(hits.pixel) - 1, N_POINTS).astype(np.int32))
    tried = emitter_patches(np.repeat(corners, N_RAYS, axis=0), np.repeat(radiance, N_RAYS, axis=0), 1)
    n_seen = _trace_leaves(caster, hits, rows, tried.samples, tried.normal).reshape(len(rows), -1, N_RAYS).sum(axis=2)
    # That none of a few rays arrived does not prove invisibility: light through a gap is often missed by all of them,
    # and was then never divided, whatever the number of leaves. Mostly a point sees all or none of a triangle: for an
    # unknown share with the distribution Beta(a, a) with a small a, the expectation is (k + a) / (n + 2 a). From a =
    # 0.2 on too many leaves go to invisible emitters: the error of a storeroom was 0.53 % instead of 0.30 %.
    seen = (n_seen + UNCERTAIN_SHARE) / (N_RAYS + 2.0 * UNCERTAIN_SHARE)
    points, normals = hits.position[rows].astype(np.float64), hits.horizon[rows].astype(np.float64)
    return emitter_tree(corners, radiance, n_leaves, visible_importance(corners, radiance, points, normals, seen))


def _trace_leaves(
    caster: RayCaster, hits: PrimaryHits, rows: NDArray[np.int32], places: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> NDArray[np.bool_]:  # fmt: skip
    """Whether each of the points (P,) sees each of the positions (M, 3) on emitters with normals (M, 3): (P, M)."""
    towards = places[None] - hits.position[rows][:, None]
    above = np.einsum("pmi,pi->pm", towards, hits.horizon[rows]) > 0.0
    seen: NDArray[np.bool_] = above & (np.einsum("pmi,mi->pm", towards, normals) < 0.0)
    block, target = (index.astype(np.int32) for index in np.nonzero(seen))
    origin, direction = np.empty((len(block), 3), np.float32), np.empty((len(block), 3), np.float32)
    distance = np.empty(len(block), np.float32)
    kernels.write_rays(
        rows, block, target, hits.position, hits.offset_position, places, True, origin, direction, distance
    )
    seen[block, target] = ~caster.occluded(origin, direction, distance)
    return seen
