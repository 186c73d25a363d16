"""Loads the mesh of every object of a description; a GLB file brings its own materials.

An object that names a GLB file and has no layers takes the file's: with one material its layers become the object's;
with more, the object becomes one object for each material, marked with its `part` so that it can be read back.

The cost of a small file is limited by the number of objects: each takes well under a millisecond to be placed and
checked, MAX_OBJECTS of them two to three seconds, whether the scene names them or they are materials of a GLB file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from engine.core.errors import LoadError
from engine.core.safe_files import resolve_inside
from engine.scene.description import MAX_OBJECTS, LayerDescription, ObjectDescription, SceneDescription
from engine.scene.loaders.gltf import GlbModel, GlbPart, read_glb
from engine.scene.loaders.gltf_materials import GREY
from engine.scene.mesh import Mesh, MeshFile, join_meshes, read_mesh_file, with_flat_normals
from engine.scene.primitives import PRIMITIVES
from engine.scene.rig import Rig, join_bindings


@dataclass(frozen=True)
class ObjectMesh:
    """An object's description, with layers, its mesh in its own frame, and its rig, if anything moves it. unread: the
    names of materials in its file that are not read."""

    description: ObjectDescription
    mesh: Mesh
    rig: Rig | None = None
    unread: str = ""


def object_meshes(description: SceneDescription, folder: Path, path: Path) -> tuple[list[ObjectMesh], list[str]]:
    """All objects with their meshes, each file read once, and notes; raises LoadError."""
    items: list[ObjectMesh] = []
    notes: list[str] = []
    meshes: dict[Path, MeshFile] = {}
    models: dict[Path, GlbModel] = {}
    taken = {item.name for item in description.objects}
    for item in description.objects:
        if item.mesh is None:
            items.append(ObjectMesh(item, PRIMITIVES[str(item.primitive)]()))
            continue
        file = resolve_inside(folder, item.mesh, path, f"object {item.name!r}: mesh")
        if file.suffix.lower() != ".glb":
            if item.part is not None:
                raise LoadError(path, f"object {item.name!r}: part", item.part, "no part: only GLB files have them")
            if file not in meshes:
                meshes[file] = read_mesh_file(file)
                notes += [f"{item.name}: {note}" for note in meshes[file].notes]
            items.append(ObjectMesh(item, meshes[file].mesh, unread=meshes[file].materials))
        else:
            if file not in models:
                models[file] = read_glb(file)
                notes += [f"{item.name}: {note}" for note in models[file].notes]
            items += _glb_objects(item, models[file], path, taken)
    if len(items) > MAX_OBJECTS:
        raise LoadError(path, "objects", len(items), f"at most {MAX_OBJECTS}")
    return _with_layers(items, notes), notes


def _with_layers(items: list[ObjectMesh], notes: list[str]) -> list[ObjectMesh]:
    """Objects that neither emit nor have layers would stay black: they get grey ones, and a note."""
    bare: dict[str, list[str]] = {}
    for item in items:
        if not item.description.layers and not item.description.emits:
            bare.setdefault(item.unread, []).append(item.description.name)
    for unread, names in bare.items():
        why = f"materials of {unread} are not read" if unread else "without a material"
        notes.append(f"{_list_names(names)}: {why}, shown in a grey that can be edited")
    return [
        replace(item, description=item.description.model_copy(update={"layers": GREY}))
        if item.description.name in bare.get(item.unread, ())
        else item
        for item in items
    ]


def _list_names(names: list[str]) -> str:
    """The first few names."""
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _glb_objects(item: ObjectDescription, model: GlbModel, path: Path, taken: set[str]) -> list[ObjectMesh]:
    """The object or, if it has no layers of its own, one object for each material of the file."""
    if item.part is not None and item.part >= len(model.parts):
        raise LoadError(path, f"object {item.name!r}: part", item.part, f"a part from 0 to {len(model.parts) - 1}")
    chosen = range(len(model.parts)) if item.part is None else [item.part]
    if item.layers or item.emits:
        mesh, rig = _join_parts([model.parts[k] for k in chosen])
        flat = {"smooth": item.smooth and mesh.normals is not None}
        return [ObjectMesh(item.model_copy(update=flat), mesh, rig)]
    if len(chosen) == 1:
        part = model.parts[chosen[0]]
        own = _material(item, part)
        return [ObjectMesh(item.model_copy(update=own), part.mesh, part.rig)]
    items = []
    for k in chosen:
        part = model.parts[k]
        own = _material(item, part)
        named = {"name": free_name(f"{item.name[:48]} {k + 1}", taken), "part": k}
        items.append(ObjectMesh(item.model_copy(update=own | named), part.mesh, part.rig))
    return items


def _join_parts(parts: list[GlbPart]) -> tuple[Mesh, Rig | None]:
    """Join parts; those without normals stay flat beside smooth ones."""
    is_mixed = len({part.mesh.normals is None for part in parts}) > 1
    meshes, rigs = [], []
    for part in parts:
        mesh, rig = part.mesh, part.rig
        if is_mixed and mesh.normals is None:
            mesh, vertices = with_flat_normals(mesh)
            rig = rig and replace(rig, binding=rig.binding.select_vertices(vertices))
        meshes.append(mesh)
        rigs += [rig] if rig else []
    binding = join_bindings([rig.binding for rig in rigs]) if rigs else None
    return join_meshes(meshes), replace(rigs[0], binding=binding) if binding else None


def _material(item: ObjectDescription, part: GlbPart) -> dict[str, object]:
    """The material that a part of its file gives an object; its own bumps take precedence. A part without normals is
    flat [glTF20, 3.7.2.1]."""
    bumps = item.bumps
    if part.bumps.file and not bumps.file:
        bumps = replace(part.bumps, normal_map=f"{item.mesh}{part.bumps.normal_map}")
    smooth = item.smooth and part.mesh.normals is not None
    return {"layers": _layers(part, str(item.mesh)), "emission": part.emission, "bumps": bumps, "smooth": smooth}


def _layers(part: GlbPart, file: str) -> tuple[LayerDescription, ...]:
    """A part's layers with the file's name before the numbers of its images."""
    return tuple(
        layer if layer.maps.is_plain
        else layer.model_copy(update={"maps": replace(layer.maps, texture=f"{file}{layer.maps.texture}")})
        for layer in part.layers
    )  # fmt: skip


def free_name(name: str, taken: set[str]) -> str:
    """Make a name unique by a suffix, and mark it as taken."""
    while name in taken:
        name += "+"
    taken.add(name)
    return name
