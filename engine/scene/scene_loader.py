"""Loads a scene file into arrays: reads the meshes, places them in the world and joins them, with notes on their
defects.

A `Scene` is frozen and depends on no library: one vertex and one triangle array for everything, the triangles of object
i in a contiguous range. A scene far from the world's origin would lose its small parts in float32; its arrays, the
camera included, are then relative to `Scene.origin`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.core.safe_files import record_files, resolve_inside
from engine.light.cones import all_round, cone_row
from engine.light.environment import Environment
from engine.material.bumps import Bumps
from engine.material.layer import Frame
from engine.material.opacity import Opacity
from engine.scene.bump_normals import BumpNormals
from engine.scene.cutouts import Cutouts, scene_cutouts
from engine.scene.description import (
    Camera,
    ObjectDescription,
    SceneDescription,
    load_description,
)
from engine.scene.emission_textures import EmissionTextures, emission_textures
from engine.scene.loaders.model import ImportedCamera, UnshownProperty, VariantSet
from engine.scene.mesh import MESH_ENDINGS, Mesh, face_normals, join_meshes
from engine.scene.object_meshes import GREY, ObjectMesh, load_mesh_scene, object_meshes
from engine.scene.rig import Animations, Rig
from engine.scene.scene_images import check_image_places, load_images
from engine.scene.scene_placement import (
    find_origin,
    place_cameras,
    place_meshes,
    ranges_of,
    rig_in_scene,
    round_meshes,
    with_suns,
)
from engine.scene.surface_uvs import box_frame
from engine.scene.tangents import TangentRotations
from engine.texture.texture_store import TextureStore

PROJECTED_NOTE = "no texture coordinates, so images are projected from the sides of its box"
DIRECTX_NOTE = "its normal map is for DirectX by its name: if relief looks pressed in, flip its green channel"


@dataclass(frozen=True)
class Scene:
    """The geometry of a scene, ready for rays. V vertices, T triangles, M objects; lengths in metres.

    vertices (V, 3) and normals (V, 3, unit) float32 in the world minus `origin`; triangles (T, 3) int32, counter-
    clockwise seen from the front; object_of_triangle (T,) int32; triangle_ranges (M, 2); geometric_normals (T, 3)
    float32; smooth (M,) bool: whether normals are interpolated; emission (M, 3) float32, zero for objects that do
    not emit, before their textures. uvs (T, 3, 2 K), tangents and colours (T, 3, 4) float32: as in `Mesh`, uvs 0 in
    objects without, None if no object has them; has_uvs (M,) bool; boxes (M, 3, 4): the frames for texture
    coordinates of the others (`engine.scene.surface_uvs`); textures: the scene's images. vertex_ranges (M, 2);
    rigs: for each object how its file's animations move its vertices, in the frame of the arrays, None if none
    does. sky: the image of its environment where that is no file. material_names: of each object, in its file;
    cameras, unshown, variant_sets: what its files contain besides (`engine.scene.import_report`).
    """

    description: SceneDescription
    folder: Path
    resolution: tuple[int, int]
    vertices: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    object_of_triangle: npt.NDArray[np.int32]
    triangle_ranges: npt.NDArray[np.int32]
    geometric_normals: npt.NDArray[np.float32]
    smooth: npt.NDArray[np.bool_]
    emission: npt.NDArray[np.float32]
    origin: npt.NDArray[np.float64]
    file: Path
    uvs: npt.NDArray[np.float32] | None
    tangents: npt.NDArray[np.float32] | None
    colours: npt.NDArray[np.float32] | None
    has_uvs: npt.NDArray[np.bool_]
    boxes: npt.NDArray[np.float64]
    textures: TextureStore
    vertex_ranges: npt.NDArray[np.int32]
    rigs: tuple[Rig | None, ...]
    environment_path: Path | None = None
    sky: Environment | None = None
    notes: tuple[str, ...] = field(default=())
    files: frozenset[Path] = frozenset()
    material_names: tuple[str, ...] = ()
    cameras: tuple[ImportedCamera, ...] = ()
    unshown: tuple[UnshownProperty, ...] = ()
    variant_sets: tuple[VariantSet, ...] = ()

    @cached_property
    def bump_normals(self) -> BumpNormals:
        """The perturbation of normals by its normal and bump maps."""
        # Of a copy without this cached property: a reference cycle would prolong the scene's life.
        return BumpNormals(replace(self))

    @cached_property
    def in_coat_frame(self) -> Scene | None:
        """The scene whose bumps are those of layers of the coat's frame; None where both frames are the same."""
        if all(each.bumps.is_flat and each.bumps.of_coat.is_flat for each in self.description.objects):
            return None
        return self.with_bumps({each.name: each.bumps.of_coat for each in self.description.objects})

    def in_frame(self, frame: Frame) -> Scene:
        """The scene with the shading frames of layers of this frame."""
        return self.in_coat_frame or self if frame == "coat" else self

    @cached_property
    def tangent_rotations(self) -> TangentRotations:
        """The rotations of its tangents by angles and maps."""
        return TangentRotations(replace(self))

    @cached_property
    def _cutouts(self) -> tuple[Cutouts, dict[str, LoadError]]:
        return scene_cutouts(replace(self))

    @property
    def cutouts(self) -> Cutouts:
        """Where rays pass through its surfaces."""
        return self._cutouts[0]

    @cached_property
    def emission_textures(self) -> EmissionTextures:
        """Where the emission of its objects varies over their surfaces."""
        return emission_textures(replace(self))

    @property
    def surface_flaws(self) -> dict[str, LoadError]:
        """Errors in the images of objects that perturb normals, rotate tangents or make holes, by name."""
        of_coats = {} if self.in_coat_frame is None else self.in_coat_frame.bump_normals.flaws
        return self.bump_normals.flaws | of_coats | self.tangent_rotations.flaws | self._cutouts[1]

    def check_surfaces(self) -> None:
        """Raise the LoadError of the first such image that cannot be used."""
        for error in self.surface_flaws.values():
            raise error

    def with_bumps(self, bumps: Mapping[str, Bumps]) -> Scene:
        """The scene with these bumps of objects, by name, instead of their own; unknown names are ignored."""
        changed = tuple(
            each.model_copy(update={"bumps": bumps.get(each.name, each.bumps)}) for each in self.description.objects
        )
        return replace(self, description=self.description.model_copy(update={"objects": changed}))

    def with_opacities(self, opacities: Mapping[str, Opacity]) -> Scene:
        """The scene with these opacities of objects, by name, instead of their own; unknown names are ignored."""
        changed = tuple(
            each.model_copy(update={"opacity": opacities.get(each.name, each.opacity)})
            for each in self.description.objects
        )
        return replace(self, description=self.description.model_copy(update={"objects": changed}))

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """Minimum and maximum of each object in the world (M, 2, 3); NaN for objects without geometry."""
        bounds = np.full((len(self.triangle_ranges), 2, 3), np.nan)
        for box, (start, stop) in zip(bounds, self.triangle_ranges, strict=True):
            if stop > start:
                corners = self.vertices[self.triangles[start:stop]].reshape(-1, 3)
                box[:] = self.origin + np.stack([corners.min(axis=0), corners.max(axis=0)])
        return bounds

    @property
    def animations(self) -> tuple[Animations, ...]:
        """The animations of each object's file."""
        return tuple(() if rig is None else rig.animations for rig in self.rigs)

    @property
    def object_names(self) -> tuple[str, ...]:
        """The names of the objects, in their order."""
        return tuple(described.name for described in self.description.objects)

    def object_index(self, name: str) -> int:
        """The index of an object by its name."""
        return self.object_names.index(name)

    @property
    def shining(self) -> npt.NDArray[np.bool_]:
        """Which objects shine (M,): those that emit in the file, even if they were darkened since, and unlit ones."""
        return np.array([described.emits for described in self.description.objects], bool)

    @cached_property
    def cones(self) -> npt.NDArray[np.float32]:
        """The cones (M, 4) into which objects emit, see `engine.light.cones`: of spots about their +Z."""
        rows = all_round(len(self.description.objects))
        for row, described in zip(rows, self.description.objects, strict=True):
            if (cone := described.cone) is not None:
                axis = np.reshape(described.transform, (4, 4))[:3, 2]
                row[:] = cone_row(axis, math.radians(cone.inner), math.radians(cone.outer))
        return rows

    @property
    def emitters(self) -> npt.NDArray[np.bool_]:
        """Which objects light the scene (M,): those that shine and are not unlit."""
        return np.array([described.emits and not described.unlit for described in self.description.objects], bool)

    @property
    def lights(self) -> npt.NDArray[np.bool_]:
        """Which objects light the scene and reflect nothing (M,)."""
        return np.array([described.is_light for described in self.description.objects], bool)

    @property
    def reflecting(self) -> npt.NDArray[np.bool_]:
        """Which objects reflect light (M,): all except lamps, which have no layers."""
        return np.array([not described.is_lamp for described in self.description.objects], bool)

    def with_emission(self, emission: Mapping[str, tuple[float, float, float]]) -> Scene:
        """The scene with this radiance of emitters, by name, instead of their own; unknown names are ignored."""
        changed = self.emission.copy()
        for i in np.flatnonzero(self.shining):
            changed[i] = emission.get(self.description.objects[i].name, changed[i])
        return replace(self, emission=changed)

    def from_camera(self, camera: Camera | None, resolution: tuple[int, int] | None = None) -> Scene:
        """The scene from another camera, with this resolution (width, height); None: unchanged."""
        return replace(self, description=self.description.from_camera(camera), resolution=resolution or self.resolution)

    @property
    def camera_position(self) -> npt.NDArray[np.float64]:
        """The camera's position in the frame of the arrays (3,)."""
        return np.subtract(self.description.camera.position, self.origin)


def load_scene(
    path: str | Path, resolution: tuple[int, int] | None = None, up: Literal["y", "z"] = "y",
    variants: Mapping[str, str] = MappingProxyType({}),
) -> Scene:  # fmt: skip
    """Read a scene file and its meshes, or one mesh as a scene of its own; `resolution` = (width, height) replaces the
    file's; up: the axis of a mesh that points up; variants: of a stage of USD, by the names of their sets. Raises
    LoadError."""
    path = Path(path)
    with record_files() as files:
        if path.suffix.lower() not in MESH_ENDINGS:
            if up != "y":
                raise LoadError(path, "axis that points up", up, "y in a scene file, which places its objects itself")
            if variants:
                raise LoadError(path, "set of variants", next(iter(variants)), "none: only stages of USD have some")
            scene = build_scene(load_description(path), path, resolution)
        else:
            stage = load_mesh_scene(path, up, variants)
            sky_path = stage.sky_path(path.parent)
            scene = _assemble(stage.description, stage.items, stage.notes, path, resolution, sky_path)
            scene = replace(scene, sky=stage.sky)
    environment = () if scene.environment_path is None else (scene.environment_path,)
    return replace(scene, files=frozenset((*files, *environment)))


def build_scene(description: SceneDescription, path: Path, resolution: tuple[int, int] | None = None) -> Scene:
    """The scene of a description that was read from (or would be stored at) `path`."""
    environment_path = None
    if description.environment is not None and description.environment.file is not None:
        environment_path = resolve_inside(path.parent, description.environment.file, path, "environment: file")
    items, notes = object_meshes(description, path.parent, path)
    return _assemble(description, items, notes, path, resolution, environment_path)


@dataclass(frozen=True)
class ObjectsRead:
    """Objects that were read and are not placed yet, notes on them, and their files."""

    items: Sequence[ObjectMesh]
    notes: Sequence[str]
    files: frozenset[Path]


def read_meshes(objects: Sequence[ObjectDescription], base: Scene) -> ObjectsRead:
    """Read objects that a scene's file does not have. The user chose their files, by full paths; one without layers
    becomes as many objects as its file has materials, and a shape is grey. Raises LoadError."""
    described = tuple(
        each if each.mesh or each.layers or each.emits else each.model_copy(update={"layers": GREY}) for each in objects
    )
    description = base.description.model_copy(update={"environment": None, "objects": described})
    with record_files() as files:
        items, notes = object_meshes(description, base.folder, base.file, is_chosen=True)
    return ObjectsRead(items, notes, frozenset(files))


def place_objects(read: ObjectsRead, base: Scene) -> Scene:
    """These objects as a scene of their own in the frame of the arrays of `base`, with its images. Raises LoadError."""
    description = base.description.model_copy(update={"environment": None})
    with record_files() as files:
        added = _assemble(description, read.items, read.notes, base.file, base.resolution, None, base)
    return replace(added, files=read.files | files)


def _assemble(
    description: SceneDescription, items: Sequence[ObjectMesh], notes: Sequence[str], path: Path,
    resolution: tuple[int, int] | None, environment_path: Path | None, base: Scene | None = None,
) -> Scene:  # fmt: skip
    """Build the arrays of objects that were read; the description takes over their final form. base: the scene that
    they are added to, None for a scene of their own."""
    placed, place_notes = place_meshes(items, path)
    description, sun_notes = with_suns(description, [sun for item in items for sun in item.suns])
    description = description.model_copy(update={"objects": tuple(item.description for item in items)})
    if base is not None:
        origin = base.origin
    else:
        lit = [mesh for mesh, item in zip(placed, items, strict=True) if not item.description.is_lamp]
        origin = find_origin(lit or placed, path)
    vertices, placed, lost_notes = round_meshes(placed, origin, items, path)
    joined = join_meshes(placed)
    triangles, ranges = np.ascontiguousarray(joined.triangles), ranges_of([len(mesh.triangles) for mesh in placed])
    geometric, _ = face_normals(vertices, triangles)
    counts = ranges[:, 1] - ranges[:, 0]
    objects = description.objects
    models = {id(item.model): item.model for item in items if item.model is not None}.values()
    emission = np.array([o.emission if o.emission is not None else (0.0, 0.0, 0.0) for o in objects], np.float32)
    emission = emission.reshape(-1, 3)
    boxes = [box_frame(item.mesh, np.reshape(item.description.transform, (4, 4)), origin) for item in items]
    scene = Scene(
        description=description,
        folder=path.parent,
        resolution=resolution or description.camera.resolution,
        vertices=vertices,
        normals=np.asarray(joined.normals, np.float32),
        triangles=triangles,
        object_of_triangle=np.repeat(np.arange(len(objects), dtype=np.int32), counts),
        triangle_ranges=ranges,
        geometric_normals=geometric.astype(np.float32),
        smooth=np.array([o.smooth for o in objects], bool),
        emission=emission,
        origin=origin,
        file=path,
        uvs=joined.uvs,
        tangents=joined.tangents,
        colours=joined.colours,
        boxes=np.array(boxes).reshape(-1, 3, 4),
        has_uvs=np.array([mesh.uvs is not None for mesh in placed], bool),
        textures=TextureStore(path) if base is None else base.textures,
        vertex_ranges=ranges_of([len(mesh.vertices) for mesh in placed]),
        rigs=tuple(rig_in_scene(item, origin) for item in items),
        environment_path=environment_path,
        notes=(*notes, *sun_notes, *place_notes, *lost_notes, *_map_notes(description, placed)),
        material_names=tuple(item.material for item in items),
        cameras=place_cameras(items),
        unshown=tuple(each for model in models for each in model.unshown),
        variant_sets=tuple(each for model in models for each in model.variant_sets),
    )
    if base is None:
        check_image_places(scene)
    scene = load_images(scene, [item.is_imported for item in items])
    shrunk = scene.textures.take_notes()
    return replace(scene, notes=(*scene.notes, *shrunk)) if shrunk else scene


def _map_notes(description: SceneDescription, placed: list[Mesh]) -> list[str]:
    """Notes on objects whose images are projected by their box, and on normal maps whose names say DirectX."""
    every = list(zip(description.objects, placed, strict=True))
    shown = [(each, mesh) for each, mesh in every if not each.is_lamp]
    projected = [f"{each.name}: {PROJECTED_NOTE}" for each, mesh in every if mesh.uvs is None and each.is_of_files]
    return projected + [
        f"{each.name}: {DIRECTX_NOTE}"
        for each, _ in shown
        if "directx" in each.bumps.normal_map.lower() and not each.bumps.flip_green
    ]
