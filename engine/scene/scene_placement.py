"""Places what was read in the world: meshes about one origin in single precision, cameras and suns beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.light.suns import Sun
from engine.light.triangle_lights import turned
from engine.scene.coplanar_faces import lift_overlapping_faces
from engine.scene.description import MAX_RADIANCE, MAX_SUNS, EnvironmentDescription, SceneDescription, SunDescription
from engine.scene.loaders.model import ImportedCamera
from engine.scene.mesh import Mesh, face_normals, place_copies, select_faces, with_normals
from engine.scene.mesh_defects import find_defects
from engine.scene.object_meshes import ObjectMesh
from engine.scene.rig import Rig

MAX_EXTENT = 1e9
MAX_TRIANGLES = 50_000_000
_FAR, _FAR_IN_SCENE = 16.0, 1024.0


def with_suns(description: SceneDescription, suns: Sequence[Sun]) -> tuple[SceneDescription, list[str]]:
    """The scene with these suns, whose directions are those of the world, in its environment: a black one if it has
    none; and a note on suns that are too many."""
    if not suns:
        return description, []
    environment = description.environment
    if environment is None or environment.scale == 0.0:
        environment = EnvironmentDescription(radiance=(0.0, 0.0, 0.0))
    in_map = turned(np.array([sun.direction for sun in suns]), -environment.rotation)
    added = tuple(
        SunDescription(
            name=sun.name or None,
            direction=tuple(towards),
            irradiance=tuple(np.minimum(np.divide(sun.irradiance, environment.scale), MAX_RADIANCE)),
            diameter=sun.diameter,
        )
        for sun, towards in zip(suns, in_map.tolist(), strict=True)
    )
    every = (*environment.suns, *added)
    lit = environment.model_copy(update={"suns": every[:MAX_SUNS]})
    n_more = len(every) - MAX_SUNS
    notes = [f"{n_more} suns after the first {MAX_SUNS} are left out"] if n_more > 0 else []
    return description.model_copy(update={"environment": lit}), notes


def place_cameras(items: Sequence[ObjectMesh]) -> tuple[ImportedCamera, ...]:
    """The cameras of all files in the world, each under the transform of the first object of its file."""
    first = {id(item.model): item for item in reversed(items) if item.model is not None}
    return tuple(
        each.under(np.reshape(item.description.transform, (4, 4)))
        for item in items
        if item.model is not None and first[id(item.model)] is item
        for each in item.model.cameras
    )


def place_meshes(items: Sequence[ObjectMesh], path: Path) -> tuple[list[Mesh], list[str]]:
    """Every object's mesh in world coordinates (float64), and its defects."""
    # Too many triangles are rejected before each object that shares a mesh gets a copy of it.
    total = sum(len(item.mesh.triangles) for item in items)
    if total > MAX_TRIANGLES:
        raise LoadError(path, "triangles", total, f"at most {MAX_TRIANGLES}")
    placed, notes = [], []
    for item in items:
        mesh = place_copies(item.mesh, np.reshape(item.description.transform, (1, 4, 4)))
        extent = float(np.abs(mesh.vertices).max())
        where = f"object {item.description.name!r}"
        if not extent <= MAX_EXTENT:
            raise LoadError(path, f"{where}: coordinates once placed", f"{extent:g}", f"at most {MAX_EXTENT:g} m")
        defects = find_defects(mesh, has_two_sides=not item.description.emits)
        mesh = select_faces(mesh, defects.sound)
        if not len(mesh.triangles):
            raise LoadError(path, f"{where}: faces with an area", 0, "at least one")
        placed.append(with_normals(mesh))
        notes += [f"{item.description.name}: {line}" for line in defects.notes()]
    return lift_overlapping_faces(placed, [item.rig is None for item in items], _looks(items)), notes


def _looks(items: Sequence[ObjectMesh]) -> list[int]:
    """Equal numbers for objects of equal, plain materials; −1 for those with images or coloured vertices."""
    seen: list[object] = []
    found = []
    for item in items:
        described = item.description
        look = described.layers, described.emission, described.variants
        if look not in seen:
            seen.append(look)
        is_plain = not described.is_of_files and item.mesh.colours is None
        found.append(seen.index(look) if is_plain else -1)
    return found


def find_origin(placed: Sequence[Mesh], path: Path) -> npt.NDArray[np.float64]:
    """The point (3,) to which all vertices are relative: zero unless the scene is far away. placed: what is lit.

    Far away is more than 16 times its half extent; each such factor of two costs a bit of float32. Then the origin is
    that of the scene's median object; and so it is if this object alone is 1024 of its own half extents away: a figure
    on a wide floor must keep its detail. A room with a small lamp in it stays in place, and its strokes with it.
    """
    if not placed:
        return np.zeros(3)
    boxes = np.array([_box(mesh.vertices[mesh.triangles].reshape(-1, 3)) for mesh in placed])
    low, high = _box(boxes.reshape(-1, 3))
    size = float((high - low).max())
    if not size >= 2e-9:
        raise LoadError(path, "extent of the scene", f"{size:g} m", "at least 2e-09 m")
    centre = np.quantile(boxes.mean(axis=1), 0.5, axis=0, method="lower")
    half = np.quantile((boxes[:, 1] - boxes[:, 0]).max(axis=1), 0.5, method="lower") / 2
    is_far = np.abs(low + high).max() > _FAR * size or np.abs(centre).max() > _FAR_IN_SCENE * half
    return centre if is_far else np.zeros(3)


def _box(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Minimum and maximum of points (N, 3), as (2, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])


def round_meshes(
    placed: Sequence[Mesh], origin: npt.NDArray[np.float64], items: Sequence[ObjectMesh], path: Path
) -> tuple[npt.NDArray[np.float32], list[Mesh], list[str]]:
    """All vertices minus `origin` as float32, the meshes without faces that lose their area by rounding, and notes.

    The file is not at fault for these faces: their object is too far from the others for its size.
    """
    rounded, kept, notes = [], [], []
    for item, mesh in zip(items, placed, strict=True):
        vertices = (mesh.vertices - origin).astype(np.float32)
        _, solid = face_normals(vertices, mesh.triangles)
        if not solid.all():
            away = f"{float(np.abs(vertices).max()):g} m from the scene's centre"
            if not solid.any():
                what = f"object {item.description.name!r}: faces that single precision tells apart"
                raise LoadError(path, what, f"0 at {away}", "at least one; place it nearer to the others")
            lost = int((~solid).sum())
            notes.append(f"{item.description.name}: {lost} faces left out, too small to tell apart {away}")
            mesh = select_faces(mesh, solid)
        rounded.append(vertices)
        kept.append(mesh)
    return np.concatenate([np.zeros((0, 3), np.float32), *rounded]), kept, notes


def ranges_of(counts: Sequence[int]) -> npt.NDArray[np.int32]:
    """Begin and end (M, 2) of consecutive groups of these sizes."""
    ends = np.cumsum(counts)
    return np.stack([ends - counts, ends], axis=1).astype(np.int32)


def rig_in_scene(item: ObjectMesh, origin: npt.NDArray[np.float64]) -> Rig | None:
    """An object's rig in the world minus `origin`."""
    if item.rig is None:
        return None
    matrix = np.reshape(item.description.transform, (4, 4)).astype(np.float64)
    matrix[:3, 3] -= origin
    return item.rig.transformed_by(matrix)
