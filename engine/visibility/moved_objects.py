"""Which points an object's movement can affect: those above whose horizon it was, or is.

Light of a point comes from above its horizon alone. An object that is below it before and after it moves, as a ball is
for the far side of another, neither shades the point nor shows it anything; all that is known there stays as it is, bit
for bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
_ROOM = 1e-3  # share of its radius by which a sphere is larger, for rounding


def moved_objects(before: Scene, after: Scene) -> NDArray[np.bool_]:
    """Which objects (M,) have other vertices or normals in another pose of the same scene; all where it is another."""
    every = np.ones(len(after.smooth), bool)
    if not have_same_triangles(before, after):
        return every
    differs = (before.vertices != after.vertices).any(axis=1) | (before.normals != after.normals).any(axis=1)
    return np.array([differs[slice(*own)].any() for own in after.vertex_ranges], bool)


def have_same_triangles(before: Scene, after: Scene) -> bool:
    """Whether two scenes are poses of one: the same triangles of the same objects, in the same frame."""
    if before.triangles is after.triangles and before.object_of_triangle is after.object_of_triangle:
        return True
    same = ("triangles", "object_of_triangle", "smooth", "vertex_ranges", "origin")
    if len(before.vertices) != len(after.vertices):
        return False
    return all(np.array_equal(getattr(before, name), getattr(after, name)) for name in same)


def bounding_spheres(scene: Scene, objects: NDArray[np.bool_]) -> Float64Array:
    """Spheres (K, 4) around some objects (M,) of a scene, centre and radius, in the frame of its arrays; none around
    those without triangles."""
    found = [np.zeros((0, 4))]
    for i in np.flatnonzero(objects):
        used = scene.vertices[scene.triangles[slice(*scene.triangle_ranges[i])].ravel()].astype(np.float64)
        if len(used):
            centre = 0.5 * (used.min(axis=0) + used.max(axis=0))
            radius = np.linalg.norm(used - centre, axis=1).max()
            found.append(np.append(centre, (1.0 + _ROOM) * radius)[None])
    return np.concatenate(found)


def rises_above_horizon(
    spheres: Float64Array, position: NDArray[np.floating], normal: NDArray[np.floating]
) -> NDArray[np.bool_]:
    """Whether one of some spheres (K, 4) is in part above the horizon of points (P,): position (P, 3) and unit normal
    (P, 3)."""
    found = np.zeros(len(position), bool)
    height = np.einsum("pk,pk->p", position, normal)
    for sphere in spheres:
        found |= normal @ sphere[:3].astype(normal.dtype) - height > -sphere[3]
    return found
