"""Geometry, materials and cameras of a glTF file (.glb or .gltf): every triangle under its node's transform, sorted by
material.

The accessors are checked and read here, not by trimesh or pygltflib, which accept invalid files (see `mesh`): counts,
offsets and strides are checked against the buffers, indices against the vertices. Nodes must form a forest of bounded
depth. The result is the mesh at rest, under its skin and the default weights of its morph targets; if the file has
animations, each part has a rig that describes them (`gltf_rig`). `gltf_materials` reads the materials.

Errors other than lengths and indices are repaired or skipped with a note, as in other programs: a normal that is not
finite is computed, a node with two scales of 0 shows nothing. A mesh without normals is flat [glTF20, 3.7.2.1]. What
nothing here asks for is listed as not shown (`gltf_unshown`); a file is refused only where its triangles cannot be
read.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, printable_name
from engine.scene.description import MAX_VARIANTS
from engine.scene.loaders.draco import decode_primitive, has_draco
from engine.scene.loaders.gltf_buffers import open_gltf
from engine.scene.loaders.gltf_cameras import read_cameras
from engine.scene.loaders.gltf_file import INTEGERS, SHARES, GltfFile
from engine.scene.loaders.gltf_images import GltfImages
from engine.scene.loaders.gltf_json import MAX_ITEMS, JsonObject
from engine.scene.loaders.gltf_lights import CONVERTED, read_lights
from engine.scene.loaders.gltf_materials import COLOURED, GREY, PartMaterial, read_material, uv_set
from engine.scene.loaders.gltf_nodes import LONGEST_NAME, MeshNode, placed_meshes, scene_nodes
from engine.scene.loaders.gltf_rig import PrimitiveRig, RigReader
from engine.scene.loaders.gltf_unshown import unknown_requirements, unshown_properties
from engine.scene.loaders.model import ImportedModel, ImportedPart, ImportedVariant
from engine.scene.mesh import (
    MAX_COORDINATE,
    MAX_UV,
    Float64Array,
    Mesh,
    face_normals,
    join_meshes,
    normalize,
    smooth_normals,
    validate_mesh,
    with_flat_normals,
)
from engine.scene.rig import Binding, Rig, Skeleton, join_bindings

Bound = tuple[Mesh, Binding | None]
# The material of a primitive, −1 for none, and those that it has in the file's variants, empty where it has one.
Use = tuple[int, tuple[int, ...]]

# Limit of vertices and faces of all copies that nodes make of meshes, plus one for every byte: small files must not
# cost much.
MOST_COPIED = 1_000_000
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_GEOMETRY = ("attributes", "indices", "targets", "mode", "extensions")


def read_glb(path: Path) -> ImportedModel:
    """Read a glTF file, .glb or .gltf; raises LoadError naming the place and what was expected there."""
    root, buffers = open_gltf(path)
    file = GltfFile.of(root, buffers)
    rigs = RigReader(file, root)
    variants = _variant_names(root)
    described = root.children("materials")
    copies, skipped = _Copies(file, rigs, described, len(variants)), 0
    nodes = scene_nodes(file, root)
    for mesh_index, placed in placed_meshes(file, nodes).items():
        for primitive in file.meshes[mesh_index].children("primitives"):
            skipped += 0 if copies.take(primitive, placed) else len(placed)
    by_material = _with_area(copies.by_material(), root)
    if not by_material:
        why = f": {next(iter(root.notes))}" if root.notes else ""
        raise LoadError(path, "faces", 0, f"at least one mesh of triangles in the scene{why}")
    images = GltfImages(root, buffers)
    read: dict[tuple[int, bool, int], PartMaterial] = {}

    def material(k: int, is_coloured: bool, coordinates: int) -> PartMaterial:
        use = k, is_coloured, coordinates
        if use not in read:
            images.uv_set, plain = coordinates, PartMaterial(COLOURED if is_coloured else GREY)
            read[use] = read_material(described[k], images, is_coloured) if k >= 0 else plain
        return read[use]

    skeleton = None
    if root.children("animations"):
        skeleton = rigs.skeleton(b for bound in by_material.values() for _, b in bound if b is not None)
    parts = []
    for (k, others), bound in by_material.items():
        of = any(mesh.colours is not None for mesh, _ in bound), _uv_set_of(described, k)
        looks = [material(other, *of) for other in others]
        parts.append(_part(bound, material(k, *of), skeleton, dict(zip(variants, looks, strict=False))))
        if material(k, *of).has_images and all(mesh.uvs is None for mesh, _ in bound):
            root.note(f"textures of material {k}", "on meshes without their coordinates", "not shown")
    low, high = (end([end(part.mesh.vertices, axis=0) for part in parts], axis=0) for end in (np.min, np.max))
    cameras, lights = read_cameras(file, nodes, (low + high) / 2.0), read_lights(file, nodes)
    notes = [*root.notes, *_notes(list(read.values()), skipped), *rigs.notes, *([CONVERTED] if lights else [])]
    return ImportedModel(tuple(parts), tuple(notes), cameras, unshown_properties(root), lights=lights)


def _uv_set_of(materials: list[JsonObject], k: int) -> int:
    """The set of texture coordinates of the meshes of a material, −1 for none."""
    return uv_set(materials[k].aside()) if k >= 0 else 0


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
    return ImportedPart(
        mesh, material.layers, material.emission, rig, material.bumps, material.opacity, mesh.normals is not None,
        material.name, tuple(
            ImportedVariant(name, each.layers, each.emission, each.bumps, each.opacity)
            for name, each in variants.items()
        ),
    )  # fmt: skip


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
        if primitive.integer("mode", 0, 6, _TRIANGLES) < _TRIANGLES:
            primitive.leave_out("mode", "points and lines are not drawn")
            return False
        material = primitive.integer("material", -1, self._file.n_materials - 1, -1)
        coordinates = f"TEXCOORD_{_uv_set_of(self._materials, material)}"
        made_of = repr([coordinates, *(primitive.values.get(key) for key in _GEOMETRY)])
        if made_of not in self._read:
            mesh = _read_primitive(self._file, primitive, coordinates)
            attached = self._rigs.attached(primitive, len(mesh.vertices), placed) if mesh else None
            self._read[made_of] = (mesh, attached) if mesh else None
            self._first[made_of] = primitive
        primitive.read_like(self._first[made_of])
        read = self._read[made_of]
        if read is None:
            return True
        self._n += (len(read[0].vertices) + len(read[0].triangles)) * len(placed)
        most = MOST_COPIED + self._file.buffers.n_bytes
        if self._n > most:
            expected = f"at most {most} in a file of this size"
            raise primitive.error("vertices and faces of all copies", self._n, expected)
        use = material, self._in_variants(primitive, material)
        self._placed.setdefault((use, made_of), []).extend(placed)
        return True

    def _in_variants(self, primitive: JsonObject, material: int) -> tuple[int, ...]:
        """The material in each variant: where none is mapped to it, the primitive's own."""
        found = [material] * self._n_variants
        for mapping in primitive.child("extensions").child("KHR_materials_variants").children("mappings"):
            mapped = mapping.integer("material", 0, self._file.n_materials - 1)
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


def _read_primitive(file: GltfFile, primitive: JsonObject, coordinates: str) -> Mesh | None:
    """Read one list, strip or fan of triangles, with these texture coordinates; None if it has none."""
    attributes = primitive.child("attributes")
    if not attributes.has("POSITION"):
        raise attributes.error("POSITION", "nothing", "an accessor of positions")
    is_compressed = has_draco(primitive)
    if is_compressed:
        decode_primitive(file, primitive)
    _check_positions(file, attributes)
    vertices = file.read_floats(attributes, "POSITION", "VEC3")
    normals = None
    if attributes.has("NORMAL"):
        normals = file.read_floats(attributes, "NORMAL", "VEC3")
        if len(normals) != len(vertices):
            raise attributes.error("NORMAL", f"{len(normals)} normals", f"{len(vertices)}, as there are positions")
    if primitive.has("indices"):
        corners = file.read(primitive, "indices", "SCALAR", INTEGERS).astype(np.int64)[:, 0]
    else:
        corners = np.arange(len(vertices))
    if len(corners) and corners.max() >= len(vertices):
        k = int(np.argmax(corners >= len(vertices)))
        raise primitive.error(f"index {k}", int(corners[k]), f"an index from 0 to {len(vertices) - 1}")
    triangles = _triangles(primitive, corners, _TRIANGLES if is_compressed else None)
    is_place = np.abs(vertices) <= MAX_COORDINATE  # false for NaN too
    if not is_place.all():
        is_whole = is_place[triangles].all(axis=(1, 2))
        primitive.note("faces", f"{np.count_nonzero(~is_whole)} with a corner that is no number", "left out")
        triangles, vertices = triangles[is_whole], np.where(is_place, vertices, 0.0)
    if not len(triangles):
        primitive.note("faces", 0, "left out")
        return None
    uvs = _read_uvs(file, attributes, coordinates, len(vertices), triangles)
    tangents = None
    if normals is not None:
        normals = _mend_normals(normals, vertices, triangles, attributes)
        if uvs is not None:  # tangents need both others [glTF20, 3.7.2.1]
            tangents = _read_tangents(file, attributes, len(vertices), triangles)
    colours = _read_colours(file, attributes, len(vertices), triangles)
    mesh = Mesh(vertices, triangles, normals, uvs, tangents, colours)
    return validate_mesh(mesh, file.path, f"{primitive.place}: ")


def _check_positions(file: GltfFile, attributes: JsonObject) -> None:
    """Refuse positions that are nowhere in the file, as where an unknown extension has them."""
    accessor = file.accessors[attributes.integer("POSITION", 0, len(file.accessors) - 1)]
    if not accessor.has("bufferView") and not accessor.has("sparse") and not file.is_decoded(attributes, "POSITION"):
        unknown = unknown_requirements(file.root)
        if unknown:
            raise file.root.error("extensionsRequired", unknown[0], "extensions of geometry that Insitu knows")
        raise accessor.error("bufferView", "nothing", "a view of positions")


def _triangles(primitive: JsonObject, corners: npt.NDArray[np.int64], mode: int | None = None) -> npt.NDArray[np.int32]:
    """Triangles (T, 3) of a list, a strip or a fan [glTF20, 3.7.2.1]; degenerate ones of a strip, which repeat a corner
    to turn it, are dropped. mode: which of them, None as the primitive says."""
    mode, n = mode or primitive.integer("mode", _TRIANGLES, _FAN, _TRIANGLES), len(corners)
    if mode == _TRIANGLES:
        if n % 3:
            raise primitive.error("indices", f"{n} corners", "a multiple of 3")
        return corners.reshape(-1, 3).astype(np.int32)
    i = np.arange(max(n - 2, 0))
    if mode == _STRIP:  # v_i, v_(i + 1 + i mod 2), v_(i + 2 − i mod 2)
        triangles = corners[np.stack([i, i + 1 + i % 2, i + 2 - i % 2], axis=1)]
    else:
        triangles = corners[np.stack([i + 1, i + 2, np.zeros_like(i)], axis=1)]
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)].astype(np.int32)


def _mend_normals(
    normals: Float64Array, vertices: Float64Array, triangles: npt.NDArray[np.int32], attributes: JsonObject
) -> Float64Array:
    """Unit normals (V, 3); those that are not finite are computed from the faces around."""
    is_usable = np.asarray(np.isfinite(normals).all(axis=1))
    around = smooth_normals(vertices, triangles)
    if not is_usable.all():
        attributes.note("NORMAL", f"{np.count_nonzero(~is_usable)} that are no numbers", "computed from the faces")
    return normalize(np.where(is_usable[:, None], normals, around), around)


def _read_uvs(
    file: GltfFile, attributes: JsonObject, key: str, n_vertices: int, triangles: npt.NDArray[np.int32]
) -> npt.NDArray[np.float32] | None:
    """Texture coordinates of the corners, (T, 3, 2), v flipped to grow upwards: in glTF it grows downwards."""
    if not attributes.has(key):
        return None
    values = file.read_floats(attributes, key, "VEC2")
    if len(values) != n_vertices:
        found = f"{len(values)} texture coordinates"
        raise attributes.error(key, found, f"{n_vertices}, as there are positions")
    uvs = values.astype(np.float32)
    uvs[:, 1] = np.float32(1.0) - uvs[:, 1]
    is_usable = np.abs(uvs) <= MAX_UV
    if not is_usable.all():
        attributes.note(key, f"{np.count_nonzero(~is_usable)} numbers beyond {MAX_UV:g}", "taken as 0")
        uvs = np.where(is_usable, uvs, np.float32(0.0))
    return uvs[triangles]


def _read_colours(
    file: GltfFile, attributes: JsonObject, n_vertices: int, triangles: npt.NDArray[np.int32]
) -> npt.NDArray[np.float32] | None:
    """Colours and opacities of the corners, (T, 3, 4), linear [glTF20, 3.7.2.1]; opaque where the file has three
    numbers."""
    if not attributes.has("COLOR_0"):
        return None
    accessor = file.accessors[attributes.integer("COLOR_0", 0, len(file.accessors) - 1)]
    kind = "VEC3" if accessor.text("type") == "VEC3" else "VEC4"
    values = file.read_shares(attributes, "COLOR_0", kind, SHARES)
    if len(values) != n_vertices:
        raise attributes.error("COLOR_0", f"{len(values)} colours", f"{n_vertices}, as there are positions")
    colours = np.ones((n_vertices, 4), np.float32)
    # NaN and numbers beyond the largest float become a share as well.
    colours[:, : values.shape[1]] = np.clip(np.nan_to_num(values, nan=1.0), 0.0, 1.0)
    if n_clamped := np.count_nonzero(~((values >= 0.0) & (values <= 1.0))):
        attributes.note("COLOR_0", f"{n_clamped} numbers that are not from 0 to 1", "clamped")
    return colours[triangles]


def _notes(materials: list[PartMaterial], skipped: int) -> list[str]:
    """Notes on what the file contains but is not shown."""
    lines = []
    if skipped:
        lines.append(f"{skipped} primitives of points or lines left out")
    lines += dict.fromkeys(note for material in materials for note in material.notes)
    return lines


def _read_tangents(
    file: GltfFile, attributes: JsonObject, n_vertices: int, triangles: npt.NDArray[np.int32]
) -> npt.NDArray[np.float32] | None:
    """Tangents and handedness of the corners, (T, 3, 4): bitangents are hand × normal × tangent, in the images' upward
    direction."""
    if not attributes.has("TANGENT"):
        return None
    values = file.read_floats(attributes, "TANGENT", "VEC4")
    if len(values) != n_vertices:
        raise attributes.error("TANGENT", f"{len(values)} tangents", f"{n_vertices}, as there are positions")
    is_usable = np.isfinite(values).all(axis=1)
    if not is_usable.all():
        attributes.note("TANGENT", f"{np.count_nonzero(~is_usable)} that are no numbers", "all are computed")
        return None
    return np.asarray(values[triangles], np.float32)
