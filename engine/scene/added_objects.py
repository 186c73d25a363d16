"""Objects that a user adds to a scene: shapes, and the objects of files. They stand on the ground at the point that the
camera looks at, or where something stands there already, in front of that."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.scene.composition import SHAPES
from engine.scene.description import Camera, ObjectDescription, valid_name
from engine.scene.ground_boxes import find_ground_boxes
from engine.scene.mesh import MESH_ENDINGS
from engine.scene.rig import Animations
from engine.scene.scene_loader import Scene, read_objects

Matrix = npt.NDArray[np.float64]
SHARE = 0.25  # of the scene's largest side: that of a shape, rounded to 1, 2 or 5 times a power of ten
IN_SIGHT, STEPS = 0.35, 128  # the place is at most this share of the field of view off its middle, and tried in steps
LIFT = 1e-3  # of its size: a plane lies so high above the ground, which it would share its points with
_FLAT = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))  # turns the front of a quad, +Z, up


@dataclass(frozen=True, eq=False)
class AddedObject:
    """An object that was read. source: what to read it from again; description: with the material of its file; box
    (2, 3): in the world; animations: of its file."""

    source: ObjectDescription
    description: ObjectDescription
    box: Matrix
    animations: Animations = ()


def read_added(
    what: str, scene: Scene, at: Sequence[float] | None = None, size: float | None = None
) -> tuple[tuple[AddedObject, ...], tuple[str, ...]]:
    """A shape, by its name in `SHAPES`, or all objects of a mesh file, by its full path, and notes on that. at: where
    the middle of its box stands, None for the free place on the ground. size: the largest side of the box in metres;
    None for a share of the scene's, or as large as the file says. Raises LoadError."""
    named, notes = _named(what), tuple[str, ...]()
    read = read_objects([named], scene)
    if named.mesh is not None:
        notes = read.notes + (("its suns are left out: the scene has its own",) if _has_suns(read) else ())
    boxes = read.bounds
    is_solid = np.array([not each.is_lamp for each in read.description.objects])
    solid = boxes[is_solid] if is_solid.any() else boxes
    low, high = solid[:, 0].min(axis=0), solid[:, 1].max(axis=0)
    others = _standing_boxes(scene)
    if size is None and named.mesh is None:
        size = _shape_size(others)
    factor = 1.0 if size is None else size / float((high - low).max())
    foot = np.array([(low[0] + high[0]) / 2.0, low[1], (low[2] + high[2]) / 2.0])
    extent = factor * (high - low)
    stand = _free_place(scene.description.camera, others, extent) if at is None else np.array(at, np.float64)
    if what == "plane":
        stand = stand + (0.0, LIFT * factor, 0.0)
    matrix = np.eye(4)
    matrix[:3, :3] *= factor
    matrix[:3, 3] = stand - factor * foot
    animations = read.animations
    return tuple(
        AddedObject(_source(each, k, matrix), _moved(each, matrix), factor * (boxes[k] - foot) + stand, animations[k])
        for k, each in enumerate(read.description.objects)
    ), notes


def read_again(sources: Iterable[ObjectDescription], scene: Scene) -> tuple[tuple[AddedObject, ...], tuple[str, ...]]:
    """Objects that were added before, and a line on each file that cannot be read, whose objects are left out."""
    found, problems = list[AddedObject](), list[str]()
    of_files: dict[str | None, list[ObjectDescription]] = {}
    for source in dict.fromkeys(sources):
        of_files.setdefault(source.mesh, []).append(source)
    for own in of_files.values():
        try:
            read = read_objects(own, scene)
        except LoadError as error:
            problems.append(" ".join(str(error).split()))
            continue
        found += map(AddedObject, own, read.description.objects, read.bounds, read.animations)
    return tuple(found), tuple(problems)


def added_files(objects: Iterable[AddedObject]) -> frozenset[Path]:
    """The files that objects are read from."""
    return frozenset(Path(each.source.mesh) for each in objects if each.source.mesh is not None)


def _named(what: str) -> ObjectDescription:
    """What to read, at the origin and in its own size."""
    if what in SHAPES:
        matrix = np.eye(4)
        if what == "plane":
            matrix[:3, :3] = _FLAT
        return ObjectDescription(name=what, primitive=SHAPES[what], transform=tuple(matrix.ravel().tolist()))
    if Path(what).suffix.lower() not in MESH_ENDINGS:
        raise LoadError(what, "file", Path(what).name, f"one of {', '.join(SHAPES)}, or a {', '.join(MESH_ENDINGS)}")
    return ObjectDescription(name=valid_name(Path(what).stem, "object"), mesh=what)


def _standing_boxes(scene: Scene) -> Matrix:
    """The boxes (N, 2, 3) of what stands on the ground: without lamps, grounds and backdrops."""
    boxes = scene.bounds[[not each.is_lamp for each in scene.description.objects]]
    boxes = boxes[np.isfinite(boxes).all(axis=(1, 2))]
    return boxes[~find_ground_boxes(boxes)] if len(boxes) else boxes


def _shape_size(boxes: Matrix) -> float:
    """The size of a shape beside these."""
    side = SHARE * float(np.ptp(boxes, axis=(0, 1)).max()) if len(boxes) else 0.0
    if side <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(side))
    return min((factor * power for factor in (1.0, 2.0, 5.0, 10.0)), key=lambda step: abs(math.log(step / side)))


def _free_place(camera: Camera, boxes: Matrix, extent: Matrix) -> Matrix:
    """Where a box of this extent (3,) stands: below the point looked at, or nearer to the camera until these boxes
    leave room for it, but still in sight. A box that the camera is in is a room and in no one's way."""
    point, position = np.array(camera.target), np.array(camera.position)
    if not len(boxes):
        return point
    point[1] = boxes[:, 0, 1].min()
    axis = (camera.target - position) / np.linalg.norm(camera.target - position)
    is_room = ((boxes[:, 0] <= position) & (position <= boxes[:, 1])).all(axis=1)
    stand, least = point, math.cos(math.radians(IN_SIGHT * camera.fov_y))
    for way in np.linspace(0.0, 1.0, STEPS):
        tried = point - way * axis * (1.0, 0.0, 1.0) * np.linalg.norm(camera.target - position)
        seen = tried - position
        if seen @ axis < least * np.linalg.norm(seen):
            break
        stand = tried
        low = tried - extent * (0.5, 0.0, 0.5)
        is_apart = (low >= boxes[:, 1]) | (low + extent <= boxes[:, 0])
        if (is_apart.any(axis=1) | is_room).all():
            break
    return stand


def _moved(described: ObjectDescription, matrix: Matrix) -> ObjectDescription:
    placed = matrix @ np.reshape(described.transform, (4, 4))
    return described.model_copy(update={"transform": tuple(placed.ravel().tolist())})


def _source(described: ObjectDescription, number: int, matrix: Matrix) -> ObjectDescription:
    """What an object is read from: a part of its file, or, of a lamp of the file, its shape and what it emits."""
    placed = _moved(described, matrix)
    if described.mesh is not None:
        return ObjectDescription(
            name=described.name, mesh=described.mesh, part=described.part or 0, transform=placed.transform
        )
    return ObjectDescription(
        name=described.name, primitive=described.primitive, transform=placed.transform, emission=described.emission,
        cone=described.cone,
    )  # fmt: skip


def _has_suns(read: Scene) -> bool:
    environment = read.description.environment
    return environment is not None and bool(environment.suns)
