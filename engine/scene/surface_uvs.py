"""Texture coordinates and vertex colours of points on surfaces, and the footprints of pixels.

The footprint is found by intersecting the rays of the pixels to the right and below with the plane of a point's own
triangle [Igehy99], so that silhouettes and seams do not matter.

For meshes without texture coordinates, images are projected from the six sides of the mesh's bounding box. Each
triangle takes the side that it faces most, in the mesh's own frame, so that an image follows an object that is rotated
or stretched. On each side u grows to the right and v upwards; up is +Y, on the top −Z, on the bottom +Z, as if both
were unfolded from the front. An image covers the longest edge of the box once, and no side stretches it. Rejected:
blending between sides where a surface turns from one to the next; a path that looks the image up at a point could
follow that, but means over a surface and a mesh that another program reads could not.

A mesh may have several sets of texture coordinates, side by side in its arrays; each image has its own
(`Pyramid.in_own_set`), the first where the mesh has no other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import pixel_directions
from engine.scene.raycaster import Intersections

if TYPE_CHECKING:
    from engine.scene.mesh import Mesh
    from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
# Texture coordinates of pixels, and their change over a pixel to two of its sides, (p, 2 K) in K sets.
Footprints = tuple[Float64Array, Float64Array, Float64Array]

# For the sides +X, +Y, +Z, −X, −Y, −Z: which coordinates are u and v, and whether each is reversed.
_U, _V = np.array([2, 0, 0, 2, 0, 0]), np.array([1, 2, 1, 1, 2, 1])
_U_REVERSED = np.array([True, False, False, False, False, True])
_V_REVERSED = np.array([False, True, False, False, False, False])


def corner_uvs(scene: Scene, triangle: NDArray[np.integer]) -> Float64Array:
    """Texture coordinates (N, 3, 2 K) in all K sets of the corners of triangles (N,), for some meshes by their box."""
    objects = scene.object_of_triangle[triangle]
    uvs = np.zeros((len(triangle), 3, 2)) if scene.uvs is None else scene.uvs[triangle].astype(np.float64)
    bare = np.flatnonzero(~scene.has_uvs[objects])
    if len(bare):
        of_box = box_uvs(scene.vertices[scene.triangles[triangle[bare]]], scene.boxes[objects[bare]])
        uvs[bare] = np.tile(of_box, uvs.shape[2] // 2)
    return uvs


def corner_uvs_of_set(scene: Scene, triangle: NDArray[np.integer], uv_set: int) -> Float64Array:
    """The same (N, 3, 2) in one set, the first where the scene has no other."""
    uvs = corner_uvs(scene, triangle)
    first = min(2 * uv_set, uvs.shape[2] - 2)
    return uvs[..., first : first + 2]


def uvs_at(scene: Scene, triangle: NDArray[np.integer], u: NDArray, v: NDArray) -> Float64Array:
    """Texture coordinates (N, 2 K) of points (1 − u − v) A + u B + v C of triangles (N,)."""
    return between(corner_uvs(scene, triangle), u, v)


def corner_colours(scene: Scene, triangle: NDArray[np.integer]) -> NDArray[np.float32]:
    """Vertex colours and opacities (N, 3, 4) of the corners of triangles (N,), linear; ones where a mesh has none."""
    return np.ones((len(triangle), 3, 4), np.float32) if scene.colours is None else scene.colours[triangle]


def colours_at(scene: Scene, triangle: NDArray[np.integer], u: NDArray, v: NDArray) -> NDArray[np.float32]:
    """Vertex colours and opacities (N, 4) at such points, linear; ones where a mesh has none."""
    if scene.colours is None:
        return np.ones((len(triangle), 4), np.float32)
    return between(scene.colours[triangle], u, v).astype(np.float32)


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
) -> Footprints:
    """Texture coordinates at the hits of rays that pass through a picture at places (p, 2), columns and rows in pixels
    from its upper left corner, and their change over a pixel to the right and downwards, (p, 2 K)."""
    uv = uvs_at(scene, found.triangle, found.u, found.v)
    columns, lines = places.T
    beside = []
    for dx, dy in ((1.0, 0.0), (0.0, 1.0)):
        towards = pixel_directions(scene.description.camera, resolution, columns + dx, lines + dy)
        beside.append(_uvs_in_plane(scene, found, towards.astype(np.float64)) - uv)
    return uv, beside[0], beside[1]


def _uvs_in_plane(scene: Scene, found: Intersections, directions: Float64Array) -> Float64Array:
    """Texture coordinates (p, 2 K) where rays from the camera meet the planes of the triangles found; large where they
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


def box_frame(mesh: Mesh, transform: Float64Array, origin: Float64Array) -> Float64Array:
    """Transform (3, 4) from the scene's frame to that of a mesh's box: its lowest corner at 0, its longest edge 1.

    transform (4, 4) places the mesh in the world; the scene's frame is the world minus `origin`.
    """
    used = mesh.vertices[np.unique(mesh.triangles)]
    low, edge = used.min(axis=0), float(np.ptp(used, axis=0).max()) or 1.0
    linear = np.linalg.inv(transform[:3, :3])
    shift = linear @ (origin - transform[:3, 3]) - low
    return np.concatenate([linear, shift[:, None]], axis=1) / edge


def box_uvs(corners: NDArray[np.floating], frames: Float64Array) -> Float64Array:
    """Texture coordinates (N, 3, 2) of triangles' corners (N, 3, 3) in the scene's frame, by the frames (N, 3, 4) of
    their boxes."""
    placed = np.einsum("nij,nkj->nki", frames[:, :, :3], corners.astype(np.float64)) + frames[:, None, :, 3]
    normals = np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0])
    normals *= np.where(np.linalg.det(frames[:, :, :3]) < 0.0, -1.0, 1.0)[:, None]  # a mirror keeps fronts in front
    axis = np.abs(normals).argmax(axis=1)
    rows = np.arange(len(axis))
    side = axis + 3 * (normals[rows, axis] < 0.0)
    u, v = placed[rows, :, _U[side]], placed[rows, :, _V[side]]
    u = np.where(_U_REVERSED[side][:, None], 1.0 - u, u)
    return np.stack([u, np.where(_V_REVERSED[side][:, None], 1.0 - v, v)], axis=2)
