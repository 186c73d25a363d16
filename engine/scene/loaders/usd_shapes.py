"""The shapes of USD that are given by numbers [UsdGeom: Sphere, Cube, Cylinder, Cone, Capsule, Plane], as meshes with
exact normals.

All but cube and plane are surfaces of revolution: an outline of radius and height along the axis, in parts between
which the normal jumps. u runs around the axis, v along the outline.
"""

from __future__ import annotations

import math

import numpy as np

from engine.scene.loaders.usd_meshes import Surface
from engine.scene.loaders.usd_prims import Float64Array, UsdPrim
from engine.scene.mesh import Mesh, join_meshes, place_copies, validate_mesh
from engine.scene.primitives import PRIMITIVES

SHAPES = ("Sphere", "Cube", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")
_AROUND, _ARC = 96, 24  # segments around the axis, and of a quarter of a circle
# Turn the axis Z into X, Y or Z; a plane's width stays along X where it can.
_AXES = {
    "X": [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
    "Y": [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
    "Z": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
}  # fmt: skip


def read_shape(prim: UsdPrim) -> Surface:
    """The surface of a shape. Raises LoadError for sizes that are none."""
    mesh = validate_mesh(_mesh(prim), prim.file, f"{prim.place}: ")
    prim.mark_read("extent")
    n, points = len(mesh.triangles), mesh.triangles.ravel().astype(np.int64)
    return Surface(
        prim, mesh, np.arange(3 * n).reshape(n, 3), np.full(n, 3), np.arange(n), points, np.arange(3 * n),
        (len(mesh.vertices), n, 3 * n),
    )  # fmt: skip


def _mesh(prim: UsdPrim) -> Mesh:
    if prim.kind == "Cube":
        return _placed(PRIMITIVES["cube"](), np.eye(3) * _size(prim, "size", 2.0))
    turn = _turn(prim)
    if prim.kind == "Sphere":
        return _placed(PRIMITIVES["sphere"](), np.eye(3) * 2.0 * _size(prim, "radius", 1.0))
    if prim.kind == "Plane":
        return _placed(PRIMITIVES["quad"](), turn * (_size(prim, "width", 2.0), _size(prim, "length", 2.0), 1.0))
    height = _size(prim, "height", 1.0 if prim.kind.startswith("Capsule") else 2.0)
    top, bottom = _radii(prim)
    if prim.kind == "Cone":
        top = 0.0
    outlines = _capsule(top, bottom, height) if prim.kind.startswith("Capsule") else _truncated(top, bottom, height)
    return _placed(join_meshes([_revolved(*outline) for outline in outlines]), turn)


def _radii(prim: UsdPrim) -> tuple[float, float]:
    """The radii at the upper and the lower end."""
    default = 0.5 if prim.kind.startswith("Capsule") else 1.0
    if prim.kind.endswith("_1"):
        return _size(prim, "radiusTop", default, 0.0), _size(prim, "radiusBottom", default, 0.0)
    radius = _size(prim, "radius", default)
    return radius, radius


def _truncated(top: float, bottom: float, height: float) -> list[tuple[Float64Array, Float64Array]]:
    """The outlines (N, 2) of a truncated cone, as radius and height, with the normals there: disc, side, disc."""
    half = height / 2.0
    slant = math.hypot(height, bottom - top)
    side = [height / slant, (bottom - top) / slant]
    parts: list[tuple[list[list[float]], list[float]]] = [
        ([[0.0, -half], [bottom, -half]], [0.0, -1.0]), ([[bottom, -half], [top, half]], side),
        ([[top, half], [0.0, half]], [0.0, 1.0]),
    ]  # fmt: skip
    return [(np.array(line), np.tile(normal, (2, 1))) for line, normal in parts if np.ptp(line, axis=0).any()]


def _capsule(top: float, bottom: float, height: float) -> list[tuple[Float64Array, Float64Array]]:
    """The outline of a side with caps that are halves of spheres."""
    angle = np.linspace(-math.pi / 2.0, math.pi / 2.0, 2 * _ARC + 1)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lower, upper = normals[: _ARC + 1], normals[_ARC:]
    line = np.concatenate([lower * bottom + (0.0, -height / 2.0), upper * top + (0.0, height / 2.0)])
    return [(line, np.concatenate([lower, upper]))]


def _revolved(outline: Float64Array, normals: Float64Array) -> Mesh:
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


def _placed(mesh: Mesh, linear: Float64Array) -> Mesh:
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    return place_copies(mesh, matrix[None])


def _turn(prim: UsdPrim) -> Float64Array:
    axis = prim.word("axis", "Z")
    if axis not in _AXES:
        raise prim.error("axis", axis, "X, Y or Z")
    return np.array(_AXES[axis])


def _size(prim: UsdPrim, key: str, default: float, least: float = 1e-9) -> float:
    value = prim.number(key, default)
    if not least <= value <= 1e9:
        raise prim.error(key, value, f"a size from {least:g} to 1e+09")
    return value
