"""Loads the mesh of every object of a description: a primitive, or a file; a GLB file brings its own materials. Makes a
scene of a single mesh.

An object that names a GLB file and has no layers takes the file's: with one material its layers become the object's;
with more, the object becomes one object for each material, marked with its `part` so that it can be read back.

The cost of a small file is limited by the number of objects: each takes well under a millisecond to be placed and
checked, MAX_OBJECTS of them two to three seconds, whether the scene names them or they are materials of a GLB file.

A single mesh stands on a floor, is seen from the front and slightly above, and lit by a built-in sky. The mesh is not
moved, so that its coordinates stay valid: floor and camera are placed around it. Y is up, as everywhere here. A mesh
whose format does not say which axis points up may have Z up: the user says so, and its object is turned.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from engine.core.errors import LoadError, list_names
from engine.core.safe_files import resolve_inside
from engine.light.environment import Environment
from engine.light.suns import Sun
from engine.material.bumps import Bumps, bump_fields
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.area_lamps import area_lamps_of, environment_of
from engine.scene.builtin import ASSETS
from engine.scene.description import (
    IDENTITY,
    MAX_COORDINATE,
    MAX_OBJECTS,
    SCENE_VERSION,
    CameraDescription,
    EnvironmentDescription,
    LayerDescription,
    ObjectDescription,
    SceneDescription,
    VariantDescription,
    free_name,
    valid_name,
)
from engine.scene.loaders.formats import read_model
from engine.scene.loaders.gltf_materials import COLOURED, GREY
from engine.scene.loaders.model import ImportedModel, ImportedPart, ImportedVariant
from engine.scene.mesh import Mesh, join_meshes, with_flat_normals, with_normals
from engine.scene.primitives import PRIMITIVES, quad
from engine.scene.punctual_lights import lamps_of, suns_of
from engine.scene.rig import Rig, join_bindings

# Files whose parts were called by their numbers in sessions of earlier versions.
_ONCE_NUMBERED = (".glb", ".gltf")

# The scene of a single mesh.
DEFAULT_ENVIRONMENT = ASSETS / "environments" / "studio.exr"
FLOOR = LayerDescription(model="lambert", parameters={"albedo": (0.35, 0.35, 0.35)})
FOV_Y = 30.0
SMALLEST = 1e-8
_VIEW_DIRECTION = (0.55, 0.42, 0.72)  # from the mesh to the camera
_MARGIN = 1.08
_FLOOR_SIDE = 40.0  # in radii of the mesh: its edges are out of sight
_Z_UP = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)  # turns Z to Y
_GAP = 1e-4  # in radii, below the mesh: faces in the floor's plane stay visible


@dataclass(frozen=True)
class ObjectMesh:
    """An object's description, with layers, its mesh in its own frame, and its rig, if anything moves it. model: what
    its file contains; material: the name of its material there; suns: those that its file brings, in the world;
    is_imported: whether its material is its file's."""

    description: ObjectDescription
    mesh: Mesh
    rig: Rig | None = None
    model: ImportedModel | None = None
    material: str = ""
    suns: tuple[Sun, ...] = ()
    is_imported: bool = False

    @property
    def unread(self) -> str:
        """The names of materials in its file that are not read."""
        return "" if self.model is None else self.model.unread


def object_meshes(
    description: SceneDescription, folder: Path, path: Path, variants: Mapping[str, str] = MappingProxyType({}),
    is_chosen: bool = False,
) -> tuple[list[ObjectMesh], list[str]]:  # fmt: skip
    """All objects with their meshes, each file read once, with these variants of its sets, and notes; raises
    LoadError. is_chosen: the user chose their files, which may be anywhere; those that a scene's file names are in its
    folder."""
    items: list[ObjectMesh] = []
    notes: list[str] = []
    models: dict[Path, ImportedModel] = {}
    taken = {item.name for item in description.objects}
    for item in description.objects:
        if item.mesh is None:
            items.append(ObjectMesh(item, PRIMITIVES[str(item.primitive)]()))
            continue
        is_full = is_chosen and Path(item.mesh).is_absolute()
        file = Path(item.mesh) if is_full else resolve_inside(folder, item.mesh, path, f"object {item.name!r}: mesh")
        if file not in models:
            models[file] = read_model(file, variants)
            notes += [f"{item.name}: {note}" for note in models[file].notes]
        found = _objects_of(item, models[file], path, taken)
        has_lights = bool(models[file].lights or models[file].lamps)
        if has_lights and item.part is None and not (item.layers or item.emits):
            found = _with_lamps(found, item, models[file], taken, notes)
        items += found
    if len(items) > MAX_OBJECTS:
        raise LoadError(path, "objects", len(items), f"at most {MAX_OBJECTS}")
    return _with_layers(items, notes), notes


def _with_layers(items: list[ObjectMesh], notes: list[str]) -> list[ObjectMesh]:
    """Objects that neither emit nor have layers would stay black: they get the colours of their vertices, or grey
    ones and a note."""
    items = [
        replace(item, description=item.description.model_copy(update={"layers": COLOURED}))
        if item.mesh.colours is not None and not item.description.layers and not item.description.emits
        else item
        for item in items
    ]
    bare: dict[str, list[str]] = {}
    for item in items:
        if not item.description.layers and not item.description.emits:
            bare.setdefault(item.unread, []).append(item.description.name)
    for unread, names in bare.items():
        why = f"materials of {unread} are not read" if unread else "without a material"
        notes.append(f"{list_names(names, 3)}: {why}, shown in a grey that can be edited")
    return [
        replace(item, description=item.description.model_copy(update={"layers": GREY}))
        if item.description.name in bare.get(item.unread, ())
        else item
        for item in items
    ]


def _objects_of(item: ObjectDescription, model: ImportedModel, path: Path, taken: set[str]) -> list[ObjectMesh]:
    """The object or, if it has no layers of its own, one object for each material of the file."""
    if item.part is not None and item.part >= len(model.parts):
        expected = f"a part from 0 to {len(model.parts) - 1}" if len(model.parts) > 1 else "no part: its file has one"
        raise LoadError(path, f"object {item.name!r}: part", item.part, expected)
    chosen = range(len(model.parts)) if item.part is None else [item.part]
    if item.layers or item.emits:
        mesh, rig, is_smooth = _join_parts([model.parts[k] for k in chosen])
        return [ObjectMesh(item.model_copy(update={"smooth": item.smooth and is_smooth}), mesh, rig, model)]
    items, numbers = [], dict[str, int]()
    for k in chosen:
        part = model.parts[k]
        own = _material(item, part)
        if len(chosen) > 1:
            own |= {"name": _part_name(item, part, k, taken, numbers), "part": k}
        described = item.model_copy(update=own)
        if len(chosen) > 1 and str(item.mesh).lower().endswith(_ONCE_NUMBERED):
            described = described.with_former_name(f"{item.name[:48]} {k + 1}")
        items.append(ObjectMesh(described, part.mesh, part.rig, model, part.name, is_imported=True))
    return items


def _with_lamps(
    items: list[ObjectMesh], item: ObjectDescription, model: ImportedModel, taken: set[str], notes: list[str]
) -> list[ObjectMesh]:
    """The objects of a file with those of its lights; its suns are the first object's."""
    matrix = np.reshape(item.transform, (4, 4)).astype(np.float64)
    places = np.concatenate([part.mesh.vertices[np.unique(part.mesh.triangles)] for part in model.parts])
    low, high = places.min(axis=0), places.max(axis=0)
    lamps, left_out = lamps_of(model.lights, matrix, (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0)
    area_lamps, without_size = area_lamps_of(model.lamps, matrix, partial(_image_name, str(item.mesh)))
    left_out += without_size
    notes += [f"{item.name}: lamp {name} is left out, too small or too far away" for name in left_out]
    for lamp in (*lamps, *area_lamps):
        named = lamp.model_copy(update={"name": free_name(lamp.name, taken)})
        items.append(ObjectMesh(named, PRIMITIVES[str(lamp.primitive)]()))
    items[0] = replace(items[0], suns=suns_of(model.lights, matrix))
    return items


def _part_name(item: ObjectDescription, part: ImportedPart, k: int, taken: set[str], numbers: dict[str, int]) -> str:
    """A name for the object of a part, marked as taken: the file's, with a number where another object has it, as
    Blender numbers objects, but for the point, which separates paths; without one the number of the part. numbers: the
    last of each."""
    called = part.object_name or part.name
    name = own = valid_name(called, f"{item.name[:48]} {k + 1}") if called else f"{item.name[:48]} {k + 1}"
    stem = own[:44].strip()
    while name in taken:
        numbers[stem] = numbers.get(stem, 0) + 1
        name = f"{stem}_{numbers[stem]:03}"
    taken.add(name)
    return name


def _join_parts(parts: list[ImportedPart]) -> tuple[Mesh, Rig | None, bool]:
    """Join parts, and whether the result is smooth; those without normals stay flat beside smooth ones."""
    is_mixed = len({part.mesh.normals is None for part in parts}) > 1
    meshes, rigs = [], []
    for part in parts:
        mesh, rig = part.mesh, part.rig
        if is_mixed and part.smooth:
            mesh = with_normals(mesh)
        elif is_mixed and mesh.normals is None:
            mesh, vertices = with_flat_normals(mesh)
            rig = rig and replace(rig, binding=rig.binding.select_vertices(vertices))
        meshes.append(mesh)
        rigs += [rig] if rig else []
    binding = join_bindings([rig.binding for rig in rigs]) if rigs else None
    joined = replace(rigs[0], binding=binding) if binding else None
    return join_meshes(meshes), joined, any(part.smooth for part in parts)


def _material(item: ObjectDescription, part: ImportedPart) -> dict[str, Any]:
    """The material that a part of its file gives an object; its own bumps and opacity take precedence."""
    own = _surface(item, part)
    glows = any(each.emission is not None for each in part.variants) or part.emission.radiance is not None
    variants = tuple(
        VariantDescription(
            name=each.name, layer=_layers(each.layers, str(item.mesh)),
            emission=(each.emission or (0.0, 0.0, 0.0)) if glows else None, **_surface(item, each),
        )
        for each in part.variants
    )  # fmt: skip
    return {
        "bumps": item.bumps, "opacity": item.opacity, **own, "layers": _layers(part.layers, str(item.mesh)),
        "variants": variants, "emission": part.emission.radiance, "unlit": part.emission.unlit,
        "emission_texture": part.emission.texture.with_files(lambda name: _image_name(str(item.mesh), name)),
        "smooth": item.smooth and part.smooth,
    }  # fmt: skip


def _surface(item: ObjectDescription, part: ImportedPart | ImportedVariant) -> dict[str, Any]:
    """The bumps and the opacity of a part or a variant of it, where its object has none of its own."""
    file, found = str(item.mesh), dict[str, Any]()
    of_part = part.bumps.with_files(lambda name: _image_name(file, name))
    takes_tangents = part.bumps.rotates_tangents and not item.bumps.rotates_tangents
    takes_images = not (item.bumps.file or item.bumps.coat_normal_map)
    taken = [name for name in bump_fields() if (takes_tangents if name.startswith("tangent") else takes_images)]
    if taken:
        found["bumps"] = replace(item.bumps, **{name: getattr(of_part, name) for name in taken})
    if item.opacity == OPAQUE:
        found["opacity"] = replace(part.opacity, opacity_map=_image_name(file, part.opacity.opacity_map))
    return found


def part_material(part: ImportedPart, file: str) -> tuple[tuple[LayerDescription, ...], Bumps, Opacity]:
    """The layers, the bumps and the opacity of a part of a file, with images named from where `file` is."""
    bumps = part.bumps.with_files(lambda name: _image_name(file, name))
    opacity = replace(part.opacity, opacity_map=_image_name(file, part.opacity.opacity_map))
    return _layers(part.layers, file), bumps, opacity


def _layers(layers: tuple[LayerDescription, ...], file: str) -> tuple[LayerDescription, ...]:
    """A part's layers with images named from the scene's folder."""
    return tuple(
        layer.model_copy(update={
            "maps": layer.maps.with_files(lambda name: _image_name(file, name)),
            "parameter_maps": {
                name: table | {"map": _image_name(file, table["map"])} for name, table in layer.parameter_maps.items()
            },
        })
        for layer in layers
    )  # fmt: skip


def _image_name(file: str, image: str) -> str:
    """An image of a part by its name in the scene: "#N" is the Nth in the part's file, others are named from its
    folder; "" stays."""
    if not image or image.startswith("#"):
        return image and f"{file}{image}"
    return str(PurePosixPath(file).parent / image)


@dataclass(frozen=True)
class MeshScene:
    """The description of the scene, its objects with their meshes, and notes; sky: the image of the environment where
    that is no file."""

    description: SceneDescription
    items: Sequence[ObjectMesh]
    notes: Sequence[str]
    sky: Environment | None = None

    def sky_path(self, folder: Path) -> Path | None:
        """The file of the environment of a scene in this folder; None where it has none."""
        environment = self.description.environment
        is_file = environment is not None and environment.file is not None and self.sky is None
        return folder / str(environment.file) if environment is not None and is_file else None


def load_mesh_scene(
    path: Path, up: Literal["y", "z"] = "y", variants: Mapping[str, str] = MappingProxyType({})
) -> MeshScene:
    """Read a mesh file and make its scene; up: the axis of the file that points up; variants: those of its sets. Raises
    LoadError."""
    turn = IDENTITY if up == "y" else _Z_UP
    item = ObjectDescription(name=valid_name(path.stem), mesh=path.name, transform=turn)
    sky = EnvironmentDescription(file=str(DEFAULT_ENVIRONMENT))
    items, notes = object_meshes(_describe_scene(path, [item], np.zeros(3), 1.0, sky), path.parent, path, variants)
    if len(items) >= MAX_OBJECTS:
        raise LoadError(path, "materials", len(items), f"at most {MAX_OBJECTS - 1}")
    places = np.concatenate(
        [item.mesh.vertices[np.unique(item.mesh.triangles)] for item in items if item.description.mesh is not None]
    )
    places = places @ np.reshape(turn, (4, 4))[:3, :3].T
    low, high = places.min(axis=0), places.max(axis=0)
    centre = (low + high) / 2.0
    radius = float(np.linalg.norm(places - centre, axis=1).max())
    if not (radius >= SMALLEST and np.abs(centre).max() + 2.0 * _FLOOR_SIDE * radius <= MAX_COORDINATE):
        expected = f"at least {2.0 * SMALLEST:g} m, within {MAX_COORDINATE:g} m of the origin with its floor"
        raise LoadError(path, "extent of the mesh", f"{2.0 * radius:g} m about {centre.tolist()}", expected)
    floor = _floor(free_name("floor", {item.description.name for item in items}), centre, float(low[1]), radius)
    items = [*items, ObjectMesh(floor, quad())]
    dome = None if items[0].model is None else items[0].model.dome
    if dome is not None:
        sky = environment_of(dome, path.name)
    described = _describe_scene(path, [item.description for item in items], centre, radius, sky)
    return MeshScene(described, items, notes, None if dome is None else dome.image)


def _describe_scene(
    path: Path, objects: list[ObjectDescription], centre: np.ndarray, radius: float, sky: EnvironmentDescription
) -> SceneDescription:
    """The scene of these objects, with a camera for which a sphere of that radius fills the picture."""
    away = np.array(_VIEW_DIRECTION) / math.hypot(*_VIEW_DIRECTION)
    distance = _MARGIN * radius / math.sin(math.radians(FOV_Y) / 2.0)
    camera = CameraDescription(
        position=tuple((centre + distance * away).tolist()), target=tuple(centre.tolist()), fov_y=FOV_Y
    )
    return SceneDescription(
        version=SCENE_VERSION, name=path.stem or "mesh", camera=camera, environment=sky, object=tuple(objects)
    )


def _floor(name: str, centre: np.ndarray, height: float, radius: float) -> ObjectDescription:
    """A square below the mesh: the unit square of the XY plane, rotated to face upwards."""
    side, (x, _, z) = _FLOOR_SIDE * radius, centre.tolist()
    transform = (side, 0.0, 0.0, x, 0.0, 0.0, side, height - _GAP * radius, 0.0, -side, 0.0, z, 0.0, 0.0, 0.0, 1.0)
    return ObjectDescription(name=name, primitive="quad", transform=transform, layer=(FLOOR,))
