"""Objects that a user adds to a scene: shapes, and the objects of files. They stand on the ground at the point that the
camera looks at, or where something stands there already, in front of that. Lights hang above all that stands there and
shine down; their radiance gives the ground below the irradiance π, in which white is as bright as under a sky of
radiance 1."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.scene.composition import ADDABLE, LIGHTS, PROPS, SHAPES
from engine.scene.description import Camera, ConeDescription, ObjectDescription, Primitive, valid_name
from engine.scene.ground_boxes import find_ground_boxes
from engine.scene.mesh import MESH_ENDINGS
from engine.scene.object_meshes import ObjectMesh
from engine.scene.props import BASE_PLACE, BASE_SCALE, SWEEP_HEIGHT, SWEEP_RADIUS
from engine.scene.rig import Animations
from engine.scene.scene_loader import Scene, place_objects, read_meshes

Matrix = npt.NDArray[np.float64]
Part = tuple[Scene, int]  # an object of a scene, by its index there
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


class Reading(NamedTuple):
    """Objects that were read, notes on them, and where each is, by what it is read from."""

    objects: tuple[AddedObject, ...]
    notes: tuple[str, ...]
    parts: dict[ObjectDescription, Part]


def read_added(what: str, scene: Scene, at: Sequence[float] | None = None, size: float | None = None) -> Reading:
    """A shape or a light, by its name in `SHAPES` or `LIGHTS`, or all objects of a mesh file, by its full path, and
    notes on that. at: where the middle of its box stands, of a light the middle itself; None for the free place on the
    ground. size: the largest side of the box in metres; None for a share of the scene's, or as large as the file says.
    Raises LoadError."""
    if what in LIGHTS:
        return _reading(scene, [_light(what, scene, at, size)])
    if what == "backdrop":
        return _reading(scene, [_backdrop(scene, at, size)])
    named = _named(what)
    read = read_meshes(named, scene)
    boxes = np.array([_box_of(item) for item in read.items])
    is_solid = np.array([not item.description.is_lamp for item in read.items])
    solid = boxes[is_solid] if is_solid.any() else boxes
    low, high = solid[:, 0].min(axis=0), solid[:, 1].max(axis=0)
    others = _standing_boxes(scene)
    is_shape = named[0].mesh is None
    if size is None and is_shape:
        size = _share_of(others, SHARE, scene.description.camera)
    factor = 1.0 if size is None else size / float((high - low).max())
    foot = np.array([(low[0] + high[0]) / 2.0, low[1], (low[2] + high[2]) / 2.0])
    extent = factor * (high - low)
    stand = _free_place(scene.description.camera, others, extent) if at is None else np.array(at, np.float64)
    if what == "plane":
        stand = stand + (0.0, LIFT * factor, 0.0)
    matrix = np.eye(4)
    matrix[:3, :3] *= factor
    matrix[:3, 3] = stand - factor * foot
    moved = [replace(item, description=_moved(item.description, matrix)) for item in read.items]
    sources = [_source(item.description) for item in moved]
    if is_shape:
        return _reading(scene, sources)
    placed = place_objects(replace(read, items=moved), scene)
    suns = ("its suns are left out: the scene has its own",) if _has_suns(placed) else ()
    found = _read_of(sources, placed, (*placed.notes, *suns))
    # Lamps are placed alone, as they are when they are read again.
    lamps = _reading(scene, [each for each in sources if each.mesh is None])
    alone = {each.source: each for each in lamps.objects}
    objects = tuple(alone.get(each.source, each) for each in found.objects)
    return Reading(objects, found.notes, found.parts | lamps.parts)


def read_again(sources: Iterable[ObjectDescription], scene: Scene) -> Reading:
    """Objects that were added before, and a line on each file that cannot be read, whose objects are left out. The
    objects of a file are placed together, whichever are wanted: each is as it was when all of them were added."""
    found = Reading((), (), {})
    groups: dict[object, list[ObjectDescription]] = {}
    for source in dict.fromkeys(sources):
        groups.setdefault(source if source.mesh is None else (source.mesh, source.transform), []).append(source)
    for own in groups.values():
        try:
            read = _reading(scene, own) if own[0].mesh is None else _read_parts(scene, own)
        except LoadError as error:
            found = found._replace(notes=(*found.notes, " ".join(str(error).split())))
            continue
        found = Reading((*found.objects, *read.objects), (*found.notes, *read.notes), found.parts | read.parts)
    return found


def _reading(scene: Scene, sources: Sequence[ObjectDescription]) -> Reading:
    """Shapes and lights in the frame of a scene's arrays, each placed alone: it is the same whatever else is added."""
    found = Reading((), (), {})
    for source in sources:
        read = _read_of([source], place_objects(read_meshes([source], scene), scene))
        found = Reading((*found.objects, *read.objects), (), found.parts | read.parts)
    return found


def _read_parts(scene: Scene, sources: Sequence[ObjectDescription]) -> Reading:
    """Parts of one file in one place. Raises LoadError where it has no longer one of them."""
    whole = ObjectDescription(name=sources[0].name, mesh=sources[0].mesh, transform=sources[0].transform)
    placed = place_objects(read_meshes([whole], scene), scene)
    places = {each.part or 0: i for i, each in enumerate(placed.description.objects) if each.mesh is not None}
    for source in sources:
        if (source.part or 0) not in places:
            raise LoadError(str(source.mesh), "part", source.part, f"a part from 0 to {len(places) - 1}")
    return _read_of(sources, placed, (), [places[source.part or 0] for source in sources])


def _read_of(
    sources: Sequence[ObjectDescription], placed: Scene, notes: tuple[str, ...] = (),
    places: Sequence[int] | None = None,
) -> Reading:  # fmt: skip
    """What was read from these, at these places among the objects of a scene; None: they are all of them."""
    boxes, animations, objects = placed.bounds, placed.animations, placed.description.objects
    there = list(zip(sources, range(len(sources)) if places is None else places, strict=True))
    found = tuple(
        AddedObject(
            source, objects[i].model_copy(update={"name": source.name, "part": source.part}), boxes[i], animations[i]
        )
        for source, i in there
    )
    return Reading(found, notes, {source: (placed, i) for source, i in there})


def _box_of(item: ObjectMesh) -> Matrix:
    """The box (2, 3) of an object in the world."""
    matrix = np.reshape(item.description.transform, (4, 4))
    places = item.mesh.vertices[np.unique(item.mesh.triangles)] @ matrix[:3, :3].T + matrix[:3, 3]
    return np.stack([places.min(axis=0), places.max(axis=0)])


def added_files(objects: Iterable[AddedObject]) -> frozenset[Path]:
    """The files that objects are read from."""
    return frozenset(Path(each.source.mesh) for each in objects if each.source.mesh is not None)


def _named(what: str) -> list[ObjectDescription]:
    """What to read, at the origin and in its own size."""
    if what == "shader ball":
        base = np.diag([BASE_SCALE, BASE_SCALE, BASE_SCALE, 1.0])
        base[1, 3] = BASE_PLACE
        return [_placed(what, "shader_ball", np.eye(4)), _placed(f"{what} base", "shader_ball_base", base)]
    if what in PROPS:
        return [_placed(what, PROPS[what][0], np.eye(4))]
    if what in SHAPES:
        matrix = np.eye(4)
        if what == "plane":
            matrix[:3, :3] = _FLAT
        return [_placed(what, SHAPES[what], matrix)]
    if Path(what).suffix.lower() not in MESH_ENDINGS:
        raise LoadError(what, "file", Path(what).name, f"one of {', '.join(ADDABLE)}, or a {', '.join(MESH_ENDINGS)}")
    return [ObjectDescription(name=valid_name(Path(what).stem, "object"), mesh=what)]


def _placed(name: str, primitive: Primitive, matrix: Matrix) -> ObjectDescription:
    return ObjectDescription(name=name, primitive=primitive, transform=tuple(matrix.ravel().tolist()))


def _backdrop(scene: Scene, at: Sequence[float] | None, size: float | None) -> ObjectDescription:
    """The sweep that faces the camera: all that stands there is on its floor, and before its wall."""
    camera, boxes = scene.description.camera, _standing_boxes(scene)
    boxes = boxes[~_are_around(boxes, camera)]
    middle = np.array(camera.target, np.float64)
    least = 2.0 * _sight(camera) * math.tan(math.radians(camera.fov_y) / 2.0)  # as high as the picture
    if len(boxes):
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        middle = np.array([(low[0] + high[0]) / 2.0, low[1], (low[2] + high[2]) / 2.0])
        # The circle around all of it fits on the flat part of the floor, with room before the wall, and under its top.
        radius = math.hypot(high[0] - low[0], high[2] - low[2]) / 2.0
        least = max(3.0 * radius / (0.5 - SWEEP_RADIUS), 1.5 * (high[1] - low[1]) / SWEEP_HEIGHT)
    width = _nice(least, up=True) if size is None else size
    if at is not None:
        middle = np.array(at, np.float64)
    elif _has_floor(scene, middle[1], LIFT * width):
        middle[1] += 0.1 * LIFT * width
    x, _, z = camera.position - np.array(camera.target)
    length = math.hypot(x, z)
    x, z = (x / length, z / length) if length > 1e-6 * _sight(camera) else (0.0, 1.0)
    matrix = np.eye(4)
    turn = np.array([[z, 0.0, x], [0.0, 1.0, 0.0], [-x, 0.0, z]])  # of +Z, its front, to the camera
    matrix[:3, :3], matrix[:3, 3] = width * turn, middle + (0.0, width * SWEEP_HEIGHT / 2.0, 0.0)
    return _placed("backdrop", "backdrop", matrix)


def _has_floor(scene: Scene, height: float, distance: float) -> bool:
    """Whether the top of an object is about so high: a floor there would share its points with that."""
    tops = scene.bounds[[not each.is_lamp for each in scene.description.objects], 1, 1]
    return bool((np.abs(tops - height) < distance).any())


def _standing_boxes(scene: Scene) -> Matrix:
    """The boxes (N, 2, 3) of what stands on the ground: without lamps, grounds and backdrops."""
    stands = [not each.is_lamp and each.primitive != "backdrop" for each in scene.description.objects]
    boxes = scene.bounds[stands]
    boxes = boxes[np.isfinite(boxes).all(axis=(1, 2))]
    return boxes[~find_ground_boxes(boxes)] if len(boxes) else boxes


def _light(what: str, scene: Scene, at: Sequence[float] | None, size: float | None) -> ObjectDescription:
    """A light that shines down, on the ground below it."""
    camera, boxes = scene.description.camera, _standing_boxes(scene)
    centre = np.array(_place_above(camera, boxes) if at is None else at, np.float64)
    height = centre[1] - (boxes[:, 0, 1].min() if len(boxes) else centre[1] - _sight(camera))
    distance = max(height, 1e-3 * _share_of(boxes, 1.0, camera))  # one that stands on the ground shines somewhere else
    share = LIGHT_SHARES.get(what)
    size = size or (POINT_SHARE * distance if share is None else _share_of(boxes, share, camera))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = size * np.array(_DOWN), centre
    # E = L A / d², of the area A that is seen from below, a square or a circle.
    area = size**2 * (1.0 if LIGHTS[what] == "quad" else math.pi / 4.0)
    radiance = float(f"{math.pi * distance**2 / area:.3g}")
    return ObjectDescription(
        name=what, primitive=LIGHTS[what], transform=tuple(matrix.ravel().tolist()), emission=(radiance,) * 3,
        cone=SPOT if what == "spot light" else None,
    )  # fmt: skip


def _place_above(camera: Camera, boxes: Matrix) -> Matrix:
    """The place of a light above the point looked at: half of the scene's height and width above all that stands there,
    but within a room that the camera is in."""
    if not len(boxes):
        return np.array(camera.target) + (0.0, _sight(camera), 0.0)
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


def _share_of(boxes: Matrix, share: float, camera: Camera) -> float:
    """A share of the largest side of all these, or, where nothing stands, of the way to the point looked at; rounded to
    1, 2 or 5 times a power of ten."""
    whole = float(np.ptp(boxes, axis=(0, 1)).max()) if len(boxes) else 0.0
    if not whole > 0.0:
        whole = _sight(camera)
    return _nice(share * whole)


def _sight(camera: Camera) -> float:
    """How far the point looked at is away, metres."""
    return float(np.linalg.norm(camera.position - np.array(camera.target)))


def _nice(side: float, up: bool = False) -> float:
    """1, 2 or 5 times a power of ten: the nearest, or the next from a length on."""
    power = 10.0 ** math.floor(math.log10(side))
    steps = [factor * power for factor in (1.0, 2.0, 5.0, 10.0)]
    return next(step for step in steps if step >= side * (1.0 - 1e-9)) if up else min(
        steps, key=lambda step: abs(math.log(step / side))
    )  # fmt: skip


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


def _source(described: ObjectDescription) -> ObjectDescription:
    """What an object is read from: a part of its file, or, of a lamp of the file, its shape and what it emits."""
    if described.mesh is not None:
        return ObjectDescription(
            name=described.name, mesh=described.mesh, part=described.part or 0, transform=described.transform
        )
    return ObjectDescription(
        name=described.name, primitive=described.primitive, transform=described.transform,
        emission=described.emission, cone=described.cone, emission_texture=described.emission_texture,
    )  # fmt: skip


def _has_suns(read: Scene) -> bool:
    environment = read.description.environment
    return environment is not None and bool(environment.suns)
