"""A scene whose objects stand in other poses: the same triangles, with their corners and normals moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.deform.pose import Pose, Poses, deformed
from engine.scene.frames import local_frames, object_tangents
from engine.scene.load import Scene
from engine.scene.mesh import face_normals


def posed(scene: Scene, poses: Poses) -> Scene:
    """The scene with these objects, by name, deformed; names of none do not count. The same scene where nothing is.

    A face that has no area left keeps the normal it had.
    """
    moving = [(scene.object_index(name), row) for name, row in poses if name in scene.object_names]
    if not moving:
        return scene
    vertices, normals = scene.vertices.copy(), scene.normals.copy()
    for i, deformations in moving:
        which = np.unique(scene.triangles[slice(*scene.triangle_ranges[i])])
        pose = deformed(_resting(scene, i, which), deformations)
        vertices[which], normals[which] = pose.positions, pose.frames[:, 2]
    geometric, solid = face_normals(vertices, scene.triangles)
    geometric = np.where(solid[:, None], geometric, scene.geometric_normals)
    return replace(scene, vertices=vertices, normals=normals, geometric_normals=geometric.astype(np.float32))


def _resting(scene: Scene, i: int, which: NDArray[np.integer]) -> Pose:
    """The vertices (V,) of object i as the scene's file has them."""
    normals = scene.normals[which].astype(np.float64)
    tangents = object_tangents(scene, np.full(len(which), i), normals)
    return Pose(scene.vertices[which].astype(np.float64), local_frames(tangents, normals))
