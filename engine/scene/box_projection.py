"""Texture coordinates for meshes that have none: images are projected from the six sides of the mesh's bounding box.

Each triangle takes the side that it faces most, in the mesh's own frame, so that an image follows an object that is
rotated or stretched. On each side u grows to the right and v upwards; up is +Y, on the top −Z, on the bottom +Z, as if
both were unfolded from the front. An image covers the longest edge of the box once, and no side stretches it. Rejected:
blending between sides where a surface turns from one to the next; a path that looks the image up at a point could
follow that, but means over a surface and a mesh that another program reads could not.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import Mesh

# For the sides +X, +Y, +Z, −X, −Y, −Z: which coordinates are u and v, and whether each is reversed.
_U, _V = np.array([2, 0, 0, 2, 0, 0]), np.array([1, 2, 1, 1, 2, 1])
_U_TURNED = np.array([True, False, False, False, False, True])
_V_TURNED = np.array([False, True, False, False, False, False])

Float64Array = npt.NDArray[np.float64]


def box_frame(mesh: Mesh, transform: Float64Array, origin: Float64Array) -> Float64Array:
    """Transform (3, 4) from the scene's frame to that of a mesh's box: its lowest corner at 0, its longest edge 1.

    transform (4, 4) places the mesh in the world; the scene's frame is the world minus `origin`.
    """
    used = mesh.vertices[np.unique(mesh.triangles)]
    low, edge = used.min(axis=0), float(np.ptp(used, axis=0).max()) or 1.0
    linear = np.linalg.inv(transform[:3, :3])
    shift = linear @ (origin - transform[:3, 3]) - low
    return np.concatenate([linear, shift[:, None]], axis=1) / edge


def box_uvs(corners: npt.NDArray[np.floating], frames: Float64Array) -> Float64Array:
    """Texture coordinates (N, 3, 2) of triangles' corners (N, 3, 3) in the scene's frame, by the frames (N, 3, 4) of
    their boxes."""
    placed = np.einsum("nij,nkj->nki", frames[:, :, :3], corners.astype(np.float64)) + frames[:, None, :, 3]
    normals = np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0])
    normals *= np.where(np.linalg.det(frames[:, :, :3]) < 0.0, -1.0, 1.0)[:, None]  # a mirror keeps fronts in front
    axis = np.abs(normals).argmax(axis=1)
    rows = np.arange(len(axis))
    side = axis + 3 * (normals[rows, axis] < 0.0)
    u, v = placed[rows, :, _U[side]], placed[rows, :, _V[side]]
    u = np.where(_U_TURNED[side][:, None], 1.0 - u, u)
    return np.stack([u, np.where(_V_TURNED[side][:, None], 1.0 - v, v)], axis=2)
