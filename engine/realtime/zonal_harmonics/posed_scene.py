"""A scene with objects in other poses: the same triangles, with moved vertices and normals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import local_frames
from engine.realtime.zonal_harmonics import animated_pose
from engine.realtime.zonal_harmonics.pose import Deformation, Moment, Motion, Pose, Poses, check_extent, deform
from engine.scene.mesh import face_normals
from engine.scene.object_axes import object_tangents
from engine.scene.scene_loader import MAX_EXTENT, Scene


def pose_scene(scene: Scene, poses: Poses) -> Scene:
    """Return the scene with these objects, by name, in these poses; unknown names are ignored. Returns the same scene
    if nothing moves. Raises InsituError if an object would extend beyond the largest allowed scene.

    A face that loses all its area keeps its normal.
    """
    moving = [(scene.object_index(name), row) for name, row in poses if name in scene.object_names]
    if not moving:
        return scene
    vertices, normals = scene.vertices.copy(), scene.normals.copy()
    for i, row in moving:
        rest, moment = animate_vertices(scene, i, row)
        shift = animation_offset(rest, moment)
        which = np.unique(scene.triangles[slice(*scene.triangle_ranges[i])])
        mine = which - scene.vertex_ranges[i, 0]
        box = Pose(rest.positions[mine], rest.frames[mine]).box + shift
        pose = deform(Pose(moment.positions[mine], moment.frames[mine]), deformers(row), box)
        check_extent(scene.object_names[i], pose.positions, MAX_EXTENT)
        vertices[which], normals[which] = pose.positions, pose.frames[:, 2]
    geometric, solid = face_normals(vertices, scene.triangles)
    geometric = np.where(solid[:, None], geometric, scene.geometric_normals)
    return replace(scene, vertices=vertices, normals=normals, geometric_normals=geometric.astype(np.float32))


def deformers(row: Motion) -> list[Deformation]:
    """The deformers of a motion, without its moment."""
    return [each for each in row if isinstance(each, Deformation)]


def animation_offset(rest: Pose, moment: Pose) -> NDArray[np.float64]:
    """Translation (3,) of an object as a whole by an animation: the deformers' box moves along."""
    return np.asarray((moment.positions - rest.positions).mean(axis=0))


def animate_vertices(scene: Scene, i: int, row: Motion) -> tuple[Pose, Pose]:
    """The vertices of object i in their range, as in the scene's file and at the motion's moment; both are the same if
    there is none, or the object has no such animation."""
    rest, rig, moment = _rest_vertices(scene, i), scene.rigs[i], moment_of(scene, i, row)
    if rig is None or moment is None:
        return rest, rest
    triangles = scene.triangles[slice(*scene.triangle_ranges[i])] - scene.vertex_ranges[i, 0]
    return rest, animated_pose.animated_pose(rig, rest, triangles, moment.clip, moment.time)


def moment_of(scene: Scene, i: int, row: Motion) -> Moment | None:
    """The moment of a motion, if object i has that animation."""
    clips = [] if (rig := scene.rigs[i]) is None else [clip.name for clip in rig.skeleton.clips]
    return next((each for each in row if isinstance(each, Moment) and each.clip in clips), None)


def _rest_vertices(scene: Scene, i: int) -> Pose:
    which: NDArray[np.int64] = np.arange(*scene.vertex_ranges[i])
    normals = scene.normals[which].astype(np.float64)
    tangents = object_tangents(scene, np.full(len(which), i), normals)
    return Pose(scene.vertices[which].astype(np.float64), local_frames(tangents, normals))
