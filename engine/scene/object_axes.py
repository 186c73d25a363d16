"""The axes of objects in the world, and the tangents that follow from them at points of their surfaces.

Kernels that construct a point's frame themselves and the exported script use the same convention.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from engine.scene.scene_loader import Scene

Float64Array = npt.NDArray[np.float64]


def object_axes(scene: Scene) -> Float64Array:
    """Each object's axes in the world, unit, (M, 3, 3): rows X, Y, Z."""
    axes = np.array([np.reshape(o.transform, (4, 4))[:3, :3].T for o in scene.description.objects])
    return axes / np.linalg.norm(axes, axis=2, keepdims=True)


def object_tangents(scene: Scene, ids: npt.NDArray[np.integer], normals: Float64Array) -> Float64Array:
    """normalize(Y × n) with the object's Y axis in the world; its X axis, made perpendicular to n, where Y ∥ n.

    ids (P,) of the objects, normals (P, 3) unit.
    """
    axes = object_axes(scene)
    across = np.cross(axes[ids, 1], normals)
    x = axes[ids, 0]
    along = x - np.einsum("pk,pk->p", x, normals)[:, None] * normals
    length = np.linalg.norm(across, axis=1, keepdims=True)
    tangent = np.where(length > 1e-4, across, along)
    return tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
