"""Surfaces of revolution as meshes with exact normals: an outline of radius and height along the axis Z, in parts
between which the normal jumps. u runs around the axis, v along the outline."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import Mesh

Float64Array = npt.NDArray[np.float64]
_AROUND = 96  # segments around the axis


def truncated_cone(top: float, bottom: float, height: float) -> list[tuple[Float64Array, Float64Array]]:
    """The outlines (N, 2) of a truncated cone, as radius and height, with the normals there: disc, side, disc."""
    half = height / 2.0
    slant = math.hypot(height, bottom - top)
    side = [height / slant, (bottom - top) / slant]
    parts: list[tuple[list[list[float]], list[float]]] = [
        ([[0.0, -half], [bottom, -half]], [0.0, -1.0]), ([[bottom, -half], [top, half]], side),
        ([[top, half], [0.0, half]], [0.0, 1.0]),
    ]  # fmt: skip
    return [(np.array(line), np.tile(normal, (2, 1))) for line, normal in parts if np.ptp(line, axis=0).any()]


def revolved(outline: Float64Array, normals: Float64Array) -> Mesh:
    """An outline (N, 2), from below upwards on the outside, revolved about Z."""
    n = len(outline)
    phi = np.linspace(0.0, 2.0 * math.pi, _AROUND + 1)
    round_ = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    vertices = np.concatenate(
        [outline[:, None, :1] * round_, np.broadcast_to(outline[:, None, 1:], (n, _AROUND + 1, 1))], axis=2
    ).reshape(-1, 3)
    directions = np.concatenate(
        [normals[:, None, :1] * round_, np.broadcast_to(normals[:, None, 1:], (n, _AROUND + 1, 1))], axis=2
    ).reshape(-1, 3)
    k = (np.arange(n - 1)[:, None] * (_AROUND + 1) + np.arange(_AROUND)).ravel()
    right, up = k + 1, k + _AROUND + 1
    triangles = np.stack([np.stack([k, right, up + 1], 1), np.stack([k, up + 1, up], 1)], axis=1).reshape(-1, 3)
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    triangles = triangles[area > 1e-12 * area.max()].astype(np.int32)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(outline, axis=0).T))])
    uv = np.stack(np.broadcast_arrays(phi / (2.0 * math.pi), (along / along[-1])[:, None]), axis=2).reshape(-1, 2)
    return Mesh(vertices, triangles, directions, uv[triangles].astype(np.float32))
