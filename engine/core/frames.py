"""Local frames at points of surfaces, as matrices (..., 3, 3) whose rows are unit vectors: world to local.

Two orders are in use. Layers, exporters and transfer take tangent, bitangent, normal. Orbit's shading points take
tangent, normal, across, because +Y is the normal of the geodesic sphere; across is minus the bitangent.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]

_SHORT = 1e-12


def local_frames(tangent: npt.NDArray[np.floating], normal: npt.NDArray[np.floating]) -> Float64Array:
    """Matrices (P, 3, 3) whose rows are tangent, bitangent, normal: world to local; tangents and normals (P, 3)."""
    tangent, normal = tangent.astype(np.float64), normal.astype(np.float64)
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)


def sphere_frames(tangent: npt.NDArray[np.floating], normal: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Matrices (P, 3, 3) whose rows are tangent, normal, across = tangent × normal, in the precision of tangents and
    normals (P, 3). They map world directions to those of the geodesic sphere, whose +Y is the normal."""
    return np.stack([tangent, normal, np.cross(tangent, normal)], axis=1)


def orthonormal(frames: Float64Array, instead: Float64Array) -> Float64Array:
    """Orthonormalize axes (V, 3, 3), rows tangent, bitangent, normal: keep the normals' directions, and tangents as
    close as possible; where a vector has no length, take it from `instead`."""
    normal = _unit(frames[:, 2], instead[:, 2])
    tangent = _unit(_across(frames[:, 0], normal), _across(instead[:, 0], normal))
    tangent = _unit(tangent, np.cross(instead[:, 1], normal))
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)


def _across(vectors: Float64Array, normal: Float64Array) -> Float64Array:
    """The part of vectors (V, 3) perpendicular to normals (V, 3)."""
    return vectors - np.einsum("vc,vc->v", vectors, normal)[:, None] * normal


def _unit(vectors: Float64Array, instead: Float64Array) -> Float64Array:
    """Normalize vectors (V, 3); where they have no length, take those of `instead` (V, 3)."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    others = np.linalg.norm(instead, axis=1, keepdims=True)
    has_length = lengths > _SHORT
    return np.where(has_length, vectors / np.where(has_length, lengths, 1.0), instead / np.maximum(others, _SHORT))
