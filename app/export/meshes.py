"""One object of a scene as a binary PLY file, in the frame of the scene's arrays: the world less `Scene.origin`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.scene.scene_loader import Scene


def ply_bytes(scene: Scene, index: int) -> bytes:
    """The object's triangles with vertex normals, and texture coordinates where it has them."""
    first, last = scene.triangle_ranges[index]
    triangles: NDArray[np.integer] = scene.triangles[first:last]
    names = ["x", "y", "z", "nx", "ny", "nz"]
    if scene.has_uvs[index] and scene.uvs is not None:  # vertices of their own: coordinates differ between triangles
        corners, triangles = triangles.ravel(), np.arange(triangles.size).reshape(-1, 3)
        columns = [scene.uvs[first:last].reshape(-1, 2)]
        names += ["u", "v"]
    else:
        corners, triangles = np.unique(triangles, return_inverse=True)
        triangles, columns = triangles.reshape(-1, 3), []
    rows = np.concatenate([scene.vertices[corners], scene.normals[corners], *columns], axis=1).astype("<f4")
    faces = np.empty(len(triangles), np.dtype([("n", "u1"), ("corners", "<i4", 3)]))
    faces["n"], faces["corners"] = 3, triangles
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(head).encode() + rows.tobytes() + faces.tobytes()
