"""Local frames at points of surfaces, as matrices (..., 3, 3) whose rows are unit vectors: world to local.

Two orders are in use. Layers, exporters and transfer take tangent, bitangent, normal. Orbit's shading points take
tangent, normal, across, because +Y is the normal of the geodesic sphere; across is minus the bitangent.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from engine.core._frame_kernels import orthonormal_range
from engine.core.threads import even_parts, on_threads

Float64Array = npt.NDArray[np.float64]


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
    frames, instead = (np.require(each, np.float64, ["C", "W"]) for each in (frames, instead))
    out = np.empty(frames.shape)
    on_threads(lambda start, stop: orthonormal_range(start, stop, frames, instead, out), *even_parts(len(out)))
    return out
