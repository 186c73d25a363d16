"""Objects that a user adds to a scene: shapes, and the objects of files. They stand on the ground at the point that the
camera looks at, or where something stands there already, in front of that. Lights hang above all that stands there and
shine down; their radiance gives the ground below the irradiance π, in which white is as bright as under a sky of
radiance 1."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.scene.composition import ADDABLE, LIGHTS, SHAPES
from engine.scene.description import Camera, ConeDescription, ObjectDescription, valid_name
from engine.scene.ground_boxes import find_ground_boxes
from engine.scene.mesh import MESH_ENDINGS
from engine.scene.rig import Animations
from engine.scene.scene_loader import Scene, read_objects

Matrix = npt.NDArray[np.float64]
SHARE = 0.25  # of the scene's largest side: that of a shape
IN_SIGHT, STEPS = 0.35, 128  # the place is at most this share of the field of view off its middle, and tried in steps
LIFT = 1e-3  # of its size: a plane lies so high above the ground, which it would share its points with
# Of lamps, as shares of the scene's largest side, rounded alike; of points and spots, of the height, as those of files.
LIGHT_SHARES = {"rectangle light": 0.5, "disc light": 0.5, "sphere light": 0.1}
POINT_SHARE = 0.02
SPOT = ConeDescription(inner=20.0, outer=30.0)
_DOWN = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))  # turns +Z, a quad's front and a spot's axis, down
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
    """A shape or a light, by its name in `SHAPES` or `LIGHTS`, or all objects of a mesh file, by its full path, and
    notes on that. at: where the middle of its box stands, of a light the middle itself; None for the free place on the
    ground. size: the largest side of the box in metres; None for a share of the scene's, or as large as the file says.
    Raises LoadError."""
    if what in LIGHTS:
        return (_light(what, scene, at, size),), ()
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
        size = _share_of(others, SHARE)
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
        raise LoadError(what, "file", Path(what).name, f"one of {', '.join(ADDABLE)}, or a {', '.join(MESH_ENDINGS)}")
    return ObjectDescription(name=valid_name(Path(what).stem, "object"), mesh=what)


def _standing_boxes(scene: Scene) -> Matrix:
    """The boxes (N, 2, 3) of what stands on the ground: without lamps, grounds and backdrops."""
    boxes = scene.bounds[[not each.is_lamp for each in scene.description.objects]]
    boxes = boxes[np.isfinite(boxes).all(axis=(1, 2))]
    return boxes[~find_ground_boxes(boxes)] if len(boxes) else boxes


def _light(what: str, scene: Scene, at: Sequence[float] | None, size: float | None) -> AddedObject:
    """A light that shines down, on the ground below it."""
    boxes = _standing_boxes(scene)
    centre = np.array(_place_above(scene.description.camera, boxes) if at is None else at, np.float64)
    height = centre[1] - (boxes[:, 0, 1].min() if len(boxes) else centre[1] - 1.0)
    distance = max(height, 1e-3 * _share_of(boxes, 1.0))  # one that stands on the ground shines somewhere else
    share = LIGHT_SHARES.get(what)
    size = size or (POINT_SHARE * distance if share is None else _share_of(boxes, share))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = size * np.array(_DOWN), centre
    # E = L A / d², of the area A that is seen from below, a square or a circle.
    area = size**2 * (1.0 if LIGHTS[what] == "quad" else math.pi / 4.0)
    radiance = float(f"{math.pi * distance**2 / area:.3g}")
    source = ObjectDescription(
        name=what, primitive=LIGHTS[what], transform=tuple(matrix.ravel().tolist()), emission=(radiance,) * 3,
        cone=SPOT if what == "spot light" else None,
    )  # fmt: skip
    return AddedObject(source, source, read_objects([source], scene).bounds[0])


def _place_above(camera: Camera, boxes: Matrix) -> Matrix:
    """The place of a light above the point looked at: half of the scene's height and width above all that stands there,
    but within a room that the camera is in."""
    if not len(boxes):
        return np.array(camera.target) + (0.0, 1.0, 0.0)
    is_room = _are_around(boxes, camera)
    there = boxes[~is_room] if not is_room.all() else boxes
    top = there[:, 1, 1].max() + 0.5 * float(np.ptp(there, axis=(0, 1)).max())
    for low, high in boxes[is_room]:
        top = min(top, low[1] + 0.9 * (high[1] - low[1]))
    return np.array([camera.target[0], top, camera.target[2]])


def _are_around(boxes: Matrix, camera: Camera) -> npt.NDArray[np.bool_]:
    """Which boxes (N,) the camera is in."""
    position = np.array(camera.position)
    return np.all((boxes[:, 0] <= position) & (position <= boxes[:, 1]), axis=1)


def _share_of(boxes: Matrix, share: float) -> float:
    """A share of the largest side of all these, rounded to 1, 2 or 5 times a power of ten."""
    side = share * float(np.ptp(boxes, axis=(0, 1)).max()) if len(boxes) else 0.0
    if side <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(side))
    return min((factor * power for factor in (1.0, 2.0, 5.0, 10.0)), key=lambda step: abs(math.log(step / side)))


def _free_place(camera: Camera, boxes: Matrix, extent: Matrix) -> Matrix:
    """Where a box of this extent (3,) stands: below the point looked at, or nearer to the camera until these boxes
    leave room for it, but still in sight; without boxes at height 0. A box that the camera is in is a room and in no
    one's way."""
    point, position = np.array(camera.target), np.array(camera.position)
    if not len(boxes):
        return point * (1.0, 0.0, 1.0)
    point[1] = boxes[:, 0, 1].min()
    axis = (camera.target - position) / np.linalg.norm(camera.target - position)
    is_room = _are_around(boxes, camera)
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
