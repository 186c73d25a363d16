"""A scene for a single mesh: it stands on a floor, is seen from the front and slightly above, and lit by a built-in
sky.

The mesh is not moved, so that its coordinates stay valid: floor and camera are placed around it. Y is up, as everywhere
here; a mesh from a program with another up axis lies on its side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engine.core.errors import LoadError
from engine.scene.builtin import ASSETS
from engine.scene.description import (
    MAX_COORDINATE,
    MAX_OBJECTS,
    SCENE_VERSION,
    CameraDescription,
    EnvironmentDescription,
    LayerDescription,
    ObjectDescription,
    SceneDescription,
)
from engine.scene.object_meshes import ObjectMesh, free_name, object_meshes
from engine.scene.primitives import quad

DEFAULT_ENVIRONMENT = ASSETS / "environments" / "studio.exr"
FLOOR = LayerDescription(model="lambert", parameters={"albedo": (0.35, 0.35, 0.35)})
FOV_Y = 30.0
SMALLEST = 1e-8
_VIEW_DIRECTION = (0.55, 0.42, 0.72)  # from the mesh to the camera
_MARGIN = 1.08
_FLOOR_SIDE = 40.0  # in radii of the mesh: its edges are out of sight
_GAP = 1e-4  # in radii, below the mesh: faces in the floor's plane stay visible


@dataclass(frozen=True)
class MeshScene:
    """The description of the scene, its objects with their meshes, and notes."""

    description: SceneDescription
    items: Sequence[ObjectMesh]
    notes: Sequence[str]


def load_mesh_scene(path: Path) -> MeshScene:
    """Read a mesh file and make its scene; raises LoadError."""
    alone = _describe_scene(path, [ObjectDescription(name=_name_of(path), mesh=path.name)], np.zeros(3), 1.0)
    items, notes = object_meshes(alone, path.parent, path)
    if len(items) >= MAX_OBJECTS:
        raise LoadError(path, "materials", len(items), f"at most {MAX_OBJECTS - 1}")
    places = np.concatenate([item.mesh.vertices[np.unique(item.mesh.triangles)] for item in items])
    low, high = places.min(axis=0), places.max(axis=0)
    centre = (low + high) / 2.0
    radius = float(np.linalg.norm(places - centre, axis=1).max())
    if not (radius >= SMALLEST and np.abs(centre).max() + 2.0 * _FLOOR_SIDE * radius <= MAX_COORDINATE):
        expected = f"at least {2.0 * SMALLEST:g} m, within {MAX_COORDINATE:g} m of the origin with its floor"
        raise LoadError(path, "extent of the mesh", f"{2.0 * radius:g} m about {centre.tolist()}", expected)
    floor = _floor(free_name("floor", {item.description.name for item in items}), centre, float(low[1]), radius)
    items = [*items, ObjectMesh(floor, quad())]
    return MeshScene(_describe_scene(path, [item.description for item in items], centre, radius), items, notes)


def _describe_scene(
    path: Path, objects: list[ObjectDescription], centre: np.ndarray, radius: float
) -> SceneDescription:
    """The scene of these objects, with a camera for which a sphere of that radius fills the picture."""
    away = np.array(_VIEW_DIRECTION) / math.hypot(*_VIEW_DIRECTION)
    distance = _MARGIN * radius / math.sin(math.radians(FOV_Y) / 2.0)
    camera = CameraDescription(
        position=tuple((centre + distance * away).tolist()), target=tuple(centre.tolist()), fov_y=FOV_Y
    )
    sky = EnvironmentDescription(file=str(DEFAULT_ENVIRONMENT))
    return SceneDescription(
        version=SCENE_VERSION, name=path.stem or "mesh", camera=camera, environment=sky, object=tuple(objects)
    )


def _floor(name: str, centre: np.ndarray, height: float, radius: float) -> ObjectDescription:
    """A square below the mesh: the unit square of the XY plane, rotated to face upwards."""
    side, (x, _, z) = _FLOOR_SIDE * radius, centre.tolist()
    transform = (side, 0.0, 0.0, x, 0.0, 0.0, side, height - _GAP * radius, 0.0, -side, 0.0, z, 0.0, 0.0, 0.0, 1.0)
    return ObjectDescription(name=name, primitive="quad", transform=transform, layer=(FLOOR,))


def _name_of(path: Path) -> str:
    """The file's name, reduced to a valid object name."""
    kept = "".join("_" if c in ".\"'[]=" or not c.isprintable() else c for c in path.stem).strip()
    return kept[:48].strip() or "mesh"
