"""A scene whose objects stand in other poses: the same triangles, with their corners and normals moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics import animated_pose
from engine.realtime.zonal_harmonics.pose import Deformation, Moment, Motion, Pose, Poses, check_extent, deform
from engine.scene.local_frames import local_frames, object_tangents
from engine.scene.mesh import face_normals
from engine.scene.scene_loader import MAX_EXTENT, Scene


def pose_scene(scene: Scene, poses: Poses) -> Scene:
    """The scene with these objects, by name, in these poses; names of none do not count. The same scene where nothing
    is moved. Raises InsituError where one of them would reach beyond the largest scene.

    A face that has no area left keeps the normal it had.
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
    """What comes after the moment."""
    return [each for each in row if isinstance(each, Deformation)]


def animation_offset(rest: Pose, moment: Pose) -> NDArray[np.float64]:
    """How far an animation has carried an object as a whole (3,): the box that deformers stand in goes along."""
    return np.asarray((moment.positions - rest.positions).mean(axis=0))


def animate_vertices(scene: Scene, i: int, row: Motion) -> tuple[Pose, Pose]:
    """The vertices of object i in their range, as the scene's file has them and as the row's moment does: the same
    where it has none, or the object no such animation."""
    rest, rig, moment = _rest_vertices(scene, i), scene.rigs[i], moment_of(scene, i, row)
    if rig is None or moment is None:
        return rest, rest
    triangles = scene.triangles[slice(*scene.triangle_ranges[i])] - scene.vertex_ranges[i, 0]
    return rest, animated_pose.animated_pose(rig, rest, triangles, moment.clip, moment.time)


def moment_of(scene: Scene, i: int, row: Motion) -> Moment | None:
    """The row's, where object i has such an animation."""
    clips = [] if (rig := scene.rigs[i]) is None else [clip.name for clip in rig.skeleton.clips]
    return next((each for each in row if isinstance(each, Moment) and each.clip in clips), None)


def _rest_vertices(scene: Scene, i: int) -> Pose:
    which: NDArray[np.int64] = np.arange(*scene.vertex_ranges[i])
    normals = scene.normals[which].astype(np.float64)
    tangents = object_tangents(scene, np.full(len(which), i), normals)
    return Pose(scene.vertices[which].astype(np.float64), local_frames(tangents, normals))
