"""Positions of everything that is drawn of a scene in a pose; updates only what moved since the last pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.pose import Motion, Pose, Poses, check_extent, deform
from engine.realtime.zonal_harmonics.posed_scene import animate_vertices, animation_offset, deformers, moment_of
from engine.realtime.zonal_harmonics.uv_axes import SurfaceAxes
from engine.scene.scene_loader import MAX_EXTENT, Scene

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]


class PosedPoints:
    """The points of a scene, pose by pose."""

    def __init__(self, scene: Scene, points: BendingPoints) -> None:
        self._scene, self._points = scene, points
        self._poses: dict[int, tuple[object, Pose]] = {}
        self._shifts: dict[int, NDArray[np.float64]] = {}
        self._axes: dict[int, SurfaceAxes] = {}
        self._axes_now: dict[int, tuple[object, Float32Array]] = {}

    def at(self, poses: Poses) -> tuple[Float32Array, Float32Array]:
        """Positions (V, 3) of everything that is drawn, and axes (S, 3, 3) of points. Raises InsituError if an object
        would extend beyond the largest allowed scene."""
        scene = self._scene
        rows = {scene.object_index(name): row for name, row in poses if name in scene.object_names}
        for i in range(len(scene.smooth)):
            row = rows.get(i, ())
            if i not in self._poses or self._poses[i][0] != row:
                self._poses[i] = row, self._pose(i, row)
                self._points.set_pose(i, self._poses[i][1])
        return self._points.places, self._points.frames

    def animation_offsets(self, poses: Poses) -> dict[str, tuple[float, float, float]]:
        """Translations (x, y, z) by animations of the objects in these poses, by name; unknown names are ignored,
        because a document may have an object before the scene is opened with it."""
        self.at(poses)
        names = [name for name, _ in poses if name in self._scene.object_names]
        shifts = {name: self._shifts[self._scene.object_index(name)] for name in names}
        return {name: (float(x), float(y), float(z)) for name, (x, y, z) in shifts.items() if x or y or z}

    def axes_of(self, i: int) -> tuple[Int32Array, Float32Array]:
        """Indices of the axes along texture coordinates at the corners of an object's triangles, and the current axes,
        see `SurfaceAxes`."""
        if i not in self._axes:
            self._axes[i] = SurfaceAxes(self._scene, self._points, i)
        pose, own = self._poses[i][1], self._axes[i]
        if i not in self._axes_now or self._axes_now[i][0] is not pose:
            self._axes_now[i] = pose, own.now()
        return own.numbers, self._axes_now[i][1]

    def _pose(self, i: int, row: Motion) -> Pose:
        """Compute the pose of everything that is drawn of an object."""
        carried = resting = self._points.rest_geometry(i)
        self._shifts[i] = np.zeros(3)
        if moment_of(self._scene, i, row) is not None:
            rest, moment = animate_vertices(self._scene, i, row)
            carried, self._shifts[i] = (
                self._points.move_with_mesh(i, resting, rest, moment),
                animation_offset(rest, moment),
            )
        pose = deform(carried, deformers(row), resting.box + self._shifts[i])
        check_extent(self._scene.object_names[i], pose.positions, MAX_EXTENT)
        return pose
