"""Indirect light of one view for another, in which objects were moved: until it is found anew.

Points of the picture that show what they did before keep their gather points. Others, on the objects that were moved
and on what these hid before, take the nearest gather points of their own object, by place on it and normal: those move
with the object, and so do its records. Rays between surfaces stay those of before.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance_cache import IrradianceCache
from engine.precompute.indirect.sampling_settings import FINE
from engine.scene.scene_loader import Scene

# Fine light of a view in which objects were moved since; where lamps were, few samples light its records anew.
CARRIED = replace(FINE, name="carried", n_samples=16)
N_NEAREST = 4
# How far apart opposite normals are, in sizes of the object.
TURNED = 0.5
_MOST_VERTICES = 512

Float64Array = NDArray[np.float64]


def moved_light(light: IndirectLight, before: Scene, after: Placement, same: NDArray[np.int32]) -> IndirectLight | None:
    """The light for the picture of `after`; same (P,): the point of the picture before that each point shows, −1 for
    none. None where an object in it has no gather point."""
    hits, samples = after.hits, light.points.samples
    known = same >= 0
    rows, weights = np.zeros((len(same), N_NEAREST), np.int32), np.zeros((len(same), N_NEAREST), np.float32)
    rows[known], weights[known] = (each[same[known]] for each in light.footprint)
    gathered = light.points.hits
    for i, (begin, end) in enumerate(hits.object_ranges):
        new = begin + np.flatnonzero(~known[begin:end])
        first, last = np.searchsorted(samples.points, gathered.object_ranges[i])
        if not len(new):
            continue
        if first == last:
            return None
        own, back = samples.points[first:last], _motion(after.scene, before, i)
        place = hits.position[new] @ back[:, :3].T + back[:, 3]
        normal = hits.normal[new] @ back[:, :3].T
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        found = _nearest((gathered.position[own], gathered.normal[own]), (place, normal))
        rows[new], weights[new] = first + found[0], found[1]
    return replace(light, footprint=(rows, weights), ranges=hits.object_ranges, cache=_moved_cache(light.cache, after))


def _moved_cache(cache: IrradianceCache, after: Placement) -> IrradianceCache:
    """The records on their surfaces of now: places on triangles move with these."""
    moved, scene = copy.copy(cache), after.scene
    moved.caster, moved._scene = after.caster, scene
    moved.mesh = cache.mesh._replace(
        vertices=scene.vertices, normals=scene.normals, face_normals=np.ascontiguousarray(scene.geometric_normals)
    )
    return moved


def _motion(scene: Scene, to: Scene, i: int) -> Float64Array:
    """The affine motion (3, 4) of an object from its place in one scene to that in the other, by least squares."""
    begin, end = scene.vertex_ranges[i]
    step = max(1, (end - begin) // _MOST_VERTICES)
    old, new = (each.vertices[begin:end:step].astype(np.float64) for each in (scene, to))
    middle = old.mean(axis=0)
    turn, *_ = np.linalg.lstsq(old - middle, new - new.mean(axis=0), rcond=None)
    return np.column_stack([turn.T, new.mean(axis=0) - turn.T @ middle])


def _nearest(
    known: tuple[NDArray, NDArray], wanted: tuple[NDArray, NDArray]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """The nearest of known points, by position and normal (K, 3), to wanted ones, and their weights: (N, 4) each."""
    from scipy.spatial import cKDTree

    size = max(float(np.linalg.norm(np.ptp(known[0], axis=0))), 1e-12)
    places = [np.hstack([each[0] / size, TURNED * each[1]]) for each in (known, wanted)]
    distance, found = cKDTree(places[0]).query(places[1], N_NEAREST, workers=1)
    there = np.isfinite(distance)
    weight = np.where(there, 1.0 / (1e-4 + np.where(there, distance, 1.0)), 0.0)
    weight /= weight.sum(axis=1, keepdims=True)
    return np.where(there, found, 0).astype(np.int32), weight.astype(np.float32)
