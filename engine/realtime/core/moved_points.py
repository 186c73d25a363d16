"""Shading points of objects that are moved by hand: they go along, with their normals and axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import sphere_frames
from engine.realtime.core.shading_points import ShadingPoints

Float64Array = NDArray[np.float64]


def move_points(
    points: ShadingPoints, object_of_triangle: NDArray[np.integer], matrices: Mapping[int, Float64Array]
) -> ShadingPoints:
    """The points, and the triangles between them, with the objects of these indices moved by affine matrices (4, 4);
    object_of_triangle: of the scene's triangles.

    Points of all others are the same, bit for bit. A point is lifted as far off its surface as before, whatever the
    scale.
    """
    position, lifted, normal, tangent = (
        each.copy() for each in (points.position, points.lifted, points.normal, points.tangent)
    )
    corners, frames = points.corners.copy(), points.frames.copy()
    object_of_part = object_of_triangle[points.source]
    for i, matrix in matrices.items():
        linear, offset = matrix[:3, :3], matrix[:3, 3]
        which = np.flatnonzero(points.i_object == i)
        # Normals by the cofactors of the linear part, tangents by itself, perpendicular to the normal again.
        up = _unit(points.normal[which].astype(np.float64) @ np.linalg.inv(linear))
        along = points.tangent[which].astype(np.float64) @ linear.T
        along = _unit(along - np.einsum("pk,pk->p", along, up)[:, None] * up)
        place = points.position[which].astype(np.float64) @ linear.T + offset
        step = points.lifted[which].astype(np.float64) - points.position[which]
        height = np.einsum("pk,pk->p", step, points.normal[which])[:, None]
        inwards = (step - height * points.normal[which]) @ linear.T
        position[which], lifted[which] = place, place + inwards + height * up
        normal[which], tangent[which] = up, along
        frames[which] = sphere_frames(tangent[which], normal[which])
        mine = np.flatnonzero(object_of_part == i)
        corners[mine] = points.corners[mine] @ linear.T + offset
    moved = replace(points, position=position, lifted=lifted, normal=normal, tangent=tangent, corners=corners)
    # What is derived of the points, and does not change: computed anew it would take longer than all the rest.
    vars(moved).update(frames=frames, shown=points.shown)
    return moved


def _unit(vectors: Float64Array) -> Float64Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30))
