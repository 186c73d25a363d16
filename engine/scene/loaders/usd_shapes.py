"""The shapes of USD that are given by numbers [UsdGeom: Sphere, Cube, Cylinder, Cone, Capsule, Plane], as meshes with
exact normals. All but cube and plane are surfaces of revolution."""

from __future__ import annotations

import math

import numpy as np

from engine.scene.loaders.usd_meshes import Surface
from engine.scene.loaders.usd_prims import Float64Array, UsdPrim
from engine.scene.mesh import Mesh, join_meshes, place_copies, validate_mesh
from engine.scene.primitives import PRIMITIVES
from engine.scene.surfaces_of_revolution import revolved, truncated_cone

SHAPES = ("Sphere", "Cube", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")
_ARC = 24  # segments of a quarter of a circle
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
    outlines = _capsule(top, bottom, height) if prim.kind.startswith("Capsule") else truncated_cone(top, bottom, height)
    return _placed(join_meshes([revolved(*outline) for outline in outlines]), turn)


def _radii(prim: UsdPrim) -> tuple[float, float]:
    """The radii at the upper and the lower end."""
    default = 0.5 if prim.kind.startswith("Capsule") else 1.0
    if prim.kind.endswith("_1"):
        return _size(prim, "radiusTop", default, 0.0), _size(prim, "radiusBottom", default, 0.0)
    radius = _size(prim, "radius", default)
    return radius, radius


def _capsule(top: float, bottom: float, height: float) -> list[tuple[Float64Array, Float64Array]]:
    """The outline of a side with caps that are halves of spheres."""
    angle = np.linspace(-math.pi / 2.0, math.pi / 2.0, 2 * _ARC + 1)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lower, upper = normals[: _ARC + 1], normals[_ARC:]
    line = np.concatenate([lower * bottom + (0.0, -height / 2.0), upper * top + (0.0, height / 2.0)])
    return [(line, np.concatenate([lower, upper]))]


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
