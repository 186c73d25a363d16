"""Geometry, materials and cameras of a glTF file (.glb or .gltf): every triangle under its node's transform, sorted by
material.

The accessors are checked and read here (`gltf_primitives`), not by trimesh or pygltflib, which accept invalid files
(see `mesh`): counts, offsets and strides are checked against the buffers, indices against the vertices. Nodes must form
a forest of bounded depth. The result is the mesh at rest, under its skin and the default weights of its morph targets;
if the file has animations, each part has a rig that describes them (`gltf_rig`). `gltf_materials` reads the materials.

Errors are repaired or skipped with a note, as in other programs: a normal that is not finite is computed, a node with
two scales of 0 shows nothing. What cannot be read, or is not there (an image, a material, an attribute, a primitive),
is left out and listed as not shown, as is what nothing here asks for (`gltf_unshown`); a file is refused only where no
triangle can be read. A mesh without normals is flat [glTF20, 3.7.2.1].
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from engine.core.errors import LoadError, printable_name
from engine.scene.description import MAX_VARIANTS
from engine.scene.loaders.gltf_buffers import open_gltf
from engine.scene.loaders.gltf_cameras import read_cameras
from engine.scene.loaders.gltf_file import GltfFile
from engine.scene.loaders.gltf_forest import LONGEST_NAME, read_forest
from engine.scene.loaders.gltf_images import GltfImages
from engine.scene.loaders.gltf_json import MAX_ITEMS, JsonObject
from engine.scene.loaders.gltf_lights import CONVERTED, read_lights
from engine.scene.loaders.gltf_materials import BLACK, COLOURED, GREY, PartMaterial, read_material, uv_sets
from engine.scene.loaders.gltf_nodes import MeshNode, placed_meshes, scene_nodes
from engine.scene.loaders.gltf_primitives import TRIANGLES, read_primitive
from engine.scene.loaders.gltf_rig import PrimitiveRig, RigReader
from engine.scene.loaders.gltf_unshown import unshown_properties
from engine.scene.loaders.model import NO_EMISSION, ImportedModel, ImportedPart, ImportedVariant
from engine.scene.mesh import Mesh, face_normals, join_meshes, with_flat_normals
from engine.scene.rig import Binding, Rig, Skeleton, join_bindings

Bound = tuple[Mesh, Binding | None]
# The material of a primitive, −1 for none, and those that it has in the file's variants, empty where it has one.
Use = tuple[int, tuple[int, ...]]

# Limit of vertices and faces of all copies that nodes make of meshes, plus one for every byte: small files must not
# cost much.
MOST_COPIED = 1_000_000
_GEOMETRY = ("attributes", "indices", "targets", "mode", "extensions")


def read_gltf(path: Path) -> ImportedModel:
    """Read a glTF file, .glb or .gltf; raises LoadError naming the place and what was expected there."""
    root, buffers = open_gltf(path)
    file = GltfFile.of(root, buffers)
    forest = read_forest(file, root)
    rigs = RigReader(file, root, forest.parents)
    variants = _variant_names(root)
    described = root.children("materials")
    copies, skipped = _Copies(file, rigs, described, len(variants)), 0
    nodes = scene_nodes(file, forest)
    for mesh_index, placed in placed_meshes(file, nodes).items():
        for primitive in file.meshes[mesh_index].children("primitives"):
            taken = primitive.attempt(
                "attributes", "a mesh that cannot be read", partial(copies.take, primitive, placed)
            )
            if taken is None:
                primitive.log.left_out.add(id(primitive.values))
            skipped += len(placed) if taken is False else 0
            copies.check_number()
    by_material = _with_area(copies.by_material(), root)
    if not by_material:
        why = f": {'; '.join(list(root.notes)[-2:])}" if root.notes else ""
        raise LoadError(path, "faces", 0, f"at least one mesh of triangles in the scene{why}")
    images = GltfImages(root, buffers)
    read: dict[tuple[int, bool, tuple[int, ...]], PartMaterial] = {}

    def material(k: int, is_coloured: bool, sets: tuple[int, ...]) -> PartMaterial:
        use = k, is_coloured, sets
        if use not in read:
            images.uv_sets, plain = sets, PartMaterial(COLOURED if is_coloured else GREY)
            read[use] = read_material(described[k], images, is_coloured) if k >= 0 else plain
        return read[use]

    skeleton = None
    if root.children("animations"):
        skeleton = rigs.skeleton(b for bound in by_material.values() for _, b in bound if b is not None)
    parts, names = [], copies.names()
    for (k, others), bound in by_material.items():
        of = any(mesh.colours is not None for mesh, _ in bound), uv_sets(described, (k, *others))
        looks = [material(other, *of) for other in others]
        part = _part(bound, material(k, *of), skeleton, dict(zip(variants, looks, strict=False)))
        parts.append(replace(part, object_name=names[k, others]))
        if material(k, *of).has_images and all(mesh.uvs is None for mesh, _ in bound):
            root.note(f"textures of material {k}", "on meshes without their coordinates", "not shown")
    low, high = (end([end(part.mesh.vertices, axis=0) for part in parts], axis=0) for end in (np.min, np.max))
    cameras, lights = read_cameras(file, nodes, (low + high) / 2.0), read_lights(file, nodes)
    unshown = unshown_properties(root)
    notes = [*root.notes, *_notes(list(read.values()), skipped), *rigs.notes, *([CONVERTED] if lights else [])]
    return ImportedModel(tuple(parts), tuple(notes), cameras, unshown, lights=lights)


def _with_area(by_material: dict[Use, list[Bound]], root: JsonObject) -> dict[Use, list[Bound]]:
    """What has faces with an area, if anything has: it is shown without the rest, with a note."""
    solid = {use: bound for use, bound in by_material.items() if any(_has_area(mesh) for mesh, _ in bound)}
    if solid:
        for material, _ in by_material.keys() - solid.keys():
            root.note(f"faces of material {material}", "none with an area", "left out")
    return solid or by_material


def _has_area(mesh: Mesh) -> bool:
    """Whether any face has an area; a few tell it of nearly all meshes."""
    return any(face_normals(mesh.vertices, faces)[1].any() for faces in (mesh.triangles[:100], mesh.triangles))


def _variant_names(root: JsonObject) -> list[str]:
    """The names of the file's variants [glTF20, KHR_materials_variants]; those without, or with another's, get a
    number."""
    names: list[str] = []
    for fields in root.child("extensions").child("KHR_materials_variants").children("variants"):
        if len(names) >= MAX_VARIANTS:
            fields.leave_out("name", f"looks after the first {MAX_VARIANTS} are not offered")
            continue
        given, number = printable_name(fields.text("name") or "", LONGEST_NAME), len(names) + 1
        name = given or f"variant {number}"
        while name in names:
            name, number = f"{given or 'variant'} {number}", number + 1
        names.append(name)
    return names


def _part(
    bound: list[Bound], material: PartMaterial, skeleton: Skeleton | None, variants: Mapping[str, PartMaterial]
) -> ImportedPart:
    """Join the meshes of one material; without texture coordinates it has no textures. If some have normals, those
    without get separate vertices for every face, so that they stay flat."""
    if any(mesh.normals is not None for mesh, _ in bound):
        bound = [each if each[0].normals is not None else _with_flat_normals(*each) for each in bound]
    mesh, rig = join_meshes([mesh for mesh, _ in bound]), None
    if mesh.uvs is None:
        material, variants = material.without_images(), {name: each.without_images() for name, each in variants.items()}
    if skeleton is not None:
        rig = Rig(skeleton, join_bindings([binding for _, binding in bound if binding is not None]), np.eye(4))
    layers = material.layers or (BLACK if variants else ())
    return ImportedPart(
        mesh, layers, material.emission, rig, material.bumps, material.opacity, mesh.normals is not None,
        material.name, _variants(material, variants),
    )  # fmt: skip


def _variants(material: PartMaterial, variants: Mapping[str, PartMaterial]) -> tuple[ImportedVariant, ...]:
    """The materials of variants, of which those shine that have the emission texture of the part's own: an object has
    one texture."""
    return tuple(
        ImportedVariant(name, each.layers or BLACK, emission.radiance, each.bumps, each.opacity)
        for name, each in variants.items()
        for emission in [each.emission if each.emission.is_like(material.emission) else NO_EMISSION]
    )


def _with_flat_normals(mesh: Mesh, binding: Binding | None) -> Bound:
    """The same with flat normals."""
    facets, vertices = with_flat_normals(mesh)
    return facets, None if binding is None else binding.select_vertices(vertices)


class _Copies:
    """The triangles of a file by material: each primitive is read once, and placed once for all its copies, whose
    number is limited relative to the file's size; and their bindings, if something moves them."""

    def __init__(self, file: GltfFile, rigs: RigReader, materials: list[JsonObject], n_variants: int) -> None:
        self._file, self._rigs, self._materials, self._n_variants = file, rigs, materials, n_variants
        self._read: dict[str, tuple[Mesh, PrimitiveRig | None] | None] = {}
        self._first: dict[str, JsonObject] = {}
        self._placed: dict[tuple[Use, str], list[MeshNode]] = {}
        self._n = 0

    def take(self, primitive: JsonObject, placed: list[MeshNode]) -> bool:
        """Read a primitive and record the places of its copies; returns False for points and lines, which are
        skipped."""
        if primitive.integer("mode", 0, 6, TRIANGLES) < TRIANGLES:
            primitive.leave_out("mode", "points and lines are not drawn")
            return False
        material = self._material_of(primitive, -1)
        others = self._in_variants(primitive, material)
        sets = uv_sets(self._materials, (material, *others))
        made_of = repr([sets, *(primitive.values.get(key) for key in _GEOMETRY)])
        if made_of not in self._read:
            mesh = read_primitive(self._file, primitive, sets)
            attached = self._rigs.attached(primitive, len(mesh.vertices), placed) if mesh else None
            self._read[made_of] = (mesh, attached) if mesh else None
            self._first[made_of] = primitive
        primitive.read_like(self._first[made_of])
        read = self._read[made_of]
        if read is None:
            return True
        self._n += (len(read[0].vertices) + len(read[0].triangles)) * len(placed)
        self._placed.setdefault(((material, others), made_of), []).extend(placed)
        return True

    def names(self) -> dict[Use, str]:
        """What the parts are called: the name of a node, or of its mesh, whose triangles are all of a part, and all
        that the part has; else the material's name, else that of the only mesh of the part."""
        nodes_of: dict[Use, dict[int, None]] = {}
        for (use, _), placed in self._placed.items():
            nodes_of.setdefault(use, {}).update(dict.fromkeys(each.node for each in placed))
        n_parts = Counter(node for nodes in nodes_of.values() for node in nodes)
        found = {}
        for use, nodes in nodes_of.items():
            described = [self._file.nodes[node] for node in nodes]
            meshes = {each.values["mesh"] for each in described}
            of_mesh = self._file.meshes[meshes.pop()].text("name") if len(meshes) == 1 else None
            of_material = self._materials[use[0]].text("name") if use[0] >= 0 else None
            only, whole = described[0] if len(nodes) == 1 else None, len(nodes) == 1 and n_parts[next(iter(nodes))] == 1
            of_node = only.text("name") if only else None
            found[use] = (of_node or of_mesh if whole else of_material) or of_material or of_node or of_mesh or ""
        return found

    def check_number(self) -> None:
        """Refuse copies that would cost too much; raises LoadError."""
        most = MOST_COPIED + self._file.buffers.n_bytes
        if self._n > most:
            expected = f"at most {most} in a file of this size"
            raise LoadError(self._file.path, "vertices and faces of all copies", self._n, expected)

    def _material_of(self, owner: JsonObject, otherwise: int) -> int:
        """The material that a primitive or a mapping names, −1 for none; otherwise: in place of one that is not
        there."""
        read = partial(owner.integer, "material", -1, self._file.n_materials - 1, otherwise)
        found = owner.attempt("material", "a material that is not there: another stands for it", read)
        return otherwise if found is None else found

    def _in_variants(self, primitive: JsonObject, material: int) -> tuple[int, ...]:
        """The material in each variant: where none is mapped to it, the primitive's own."""
        found = [material] * self._n_variants
        for mapping in primitive.child("extensions").child("KHR_materials_variants").children("mappings"):
            mapped = self._material_of(mapping, material)
            for variant in mapping.indices("variants", MAX_ITEMS):
                if variant < self._n_variants:
                    found[variant] = mapped
        return tuple(found) if set(found) != {material} else ()

    def by_material(self) -> dict[Use, list[Bound]]:
        """All triangles at rest, in the order of the materials, and their bindings."""
        found: dict[Use, list[Bound]] = {}
        for (material, made_of), placed in self._placed.items():
            read = self._read[made_of]
            if read and (copies := self._rigs.copies(*read, placed)):
                found.setdefault(material, []).extend(copies)
        return dict(sorted(found.items()))


def _notes(materials: list[PartMaterial], skipped: int) -> list[str]:
    """Notes on what the file contains but is not shown."""
    lines = []
    if skipped:
        lines.append(f"{skipped} primitives of points or lines left out")
    lines += dict.fromkeys(note for material in materials for note in material.notes)
    return lines
