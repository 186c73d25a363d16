"""Texture coordinates of points on surfaces, and the footprints of pixels.

The footprint is found by intersecting the rays of the pixels to the right and below with the plane of a point's own
triangle [Igehy99], so that silhouettes and seams do not matter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import pixel_directions
from engine.scene.box_projection import box_uvs
from engine.scene.raycaster import Intersections

if TYPE_CHECKING:
    from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]


def corner_uvs(scene: Scene, triangle: NDArray[np.integer]) -> Float64Array:
    """Texture coordinates (N, 3, 2) of the corners of triangles (N,), for some meshes by their box."""
    objects = scene.object_of_triangle[triangle]
    uvs = np.zeros((len(triangle), 3, 2)) if scene.uvs is None else scene.uvs[triangle].astype(np.float64)
    bare = np.flatnonzero(~scene.has_uvs[objects])
    if len(bare):
        uvs[bare] = box_uvs(scene.vertices[scene.triangles[triangle[bare]]], scene.boxes[objects[bare]])
    return uvs


def uvs_at(scene: Scene, triangle: NDArray[np.integer], u: NDArray, v: NDArray) -> Float64Array:
    """Texture coordinates (N, 2) of points (1 − u − v) A + u B + v C of triangles (N,)."""
    return between(corner_uvs(scene, triangle), u, v)


def positions_at(scene: Scene, triangle: NDArray[np.integer], u: NDArray, v: NDArray) -> NDArray[np.float32]:
    """Positions (N, 3) of such points in the scene's frame."""
    return between(scene.vertices[scene.triangles[triangle]], u, v).astype(np.float32)


def between(corners: NDArray, u: NDArray, v: NDArray) -> Float64Array:
    """Interpolate values at corners (N, 3, k) at such points of the triangles."""
    corners = corners.astype(np.float64)
    u, v = np.asarray(u, np.float64)[:, None], np.asarray(v, np.float64)[:, None]
    return np.asarray((1.0 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2])


def pixel_footprints(
    scene: Scene, found: Intersections, places: Float64Array, resolution: tuple[int, int]
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Texture coordinates at the hits of rays that pass through a picture at places (p, 2), columns and rows in pixels
    from its upper left corner, and their change over a pixel to the right and downwards, (p, 2)."""
    uv = uvs_at(scene, found.triangle, found.u, found.v)
    columns, lines = places.T
    beside = []
    for dx, dy in ((1.0, 0.0), (0.0, 1.0)):
        towards = pixel_directions(scene.description.camera, resolution, columns + dx, lines + dy)
        beside.append(_uvs_in_plane(scene, found, towards.astype(np.float64)) - uv)
    return uv, beside[0], beside[1]


def _uvs_in_plane(scene: Scene, found: Intersections, directions: Float64Array) -> Float64Array:
    """Texture coordinates (p, 2) where rays from the camera meet the planes of the triangles found; large where they
    are nearly parallel."""
    corners = scene.vertices[scene.triangles[found.triangle]].astype(np.float64)
    a, one, two = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(one, two)
    slope = np.einsum("pk,pk->p", normal, directions)
    least = 1e-9 * np.linalg.norm(normal, axis=1)
    slope = np.where(np.abs(slope) > least, slope, np.copysign(least, slope))
    distance = np.einsum("pk,pk->p", normal, a - scene.camera_position) / slope
    place = scene.camera_position + distance[:, None] * directions - a
    squared = np.einsum("pk,pk->p", normal, normal)
    u = np.einsum("pk,pk->p", normal, np.cross(place, two)) / squared
    v = np.einsum("pk,pk->p", normal, np.cross(one, place)) / squared
    return uvs_at(scene, found.triangle, u, v)
