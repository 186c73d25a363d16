"""Geometry and materials of a GLB file: every triangle under its node's transform, sorted by material.

The accessors are checked and read here, not by trimesh or pygltflib, which read what is not there (see `mesh`): counts,
offsets and strides are held against the binary chunk, indices against the vertices. Nodes must form a forest of bounded
depth. What is read is the mesh at rest, without what its skin and its morph targets do to it; where the file has
animations, each part has a rig that says how they move it (`gltf_rig`). Materials are `gltf_materials`'.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from engine.errors import LoadError
from engine.files import read_regular_file, resolve_inside
from engine.material.bumps import NO_BUMPS, Bumps
from engine.material.maps import LayerMaps
from engine.scene.description import LayerDescription
from engine.scene.glb import JsonObject, parse_glb
from engine.scene.gltf_file import FLOATS, INTEGERS, SHARES, GltfFile
from engine.scene.gltf_materials import PartMaterial, read_material
from engine.scene.gltf_nodes import MeshNode, placed_meshes
from engine.scene.gltf_rig import Attached, RigReader
from engine.scene.gltf_textures import GltfImages
from engine.scene.mesh import MAX_MESH_BYTES, Mesh, join_meshes, place_copies, validate_mesh
from engine.scene.rig import Binding, Rig, join_bindings

MAX_COUNT = 2**31 - 1
# Vertices and faces of all copies that nodes make of meshes, one more for every byte: small files must not cost much.
MOST_COPIED = 1_000_000
_HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_")
_TRIANGLES = 4


@dataclass(frozen=True)
class GlbPart:
    """All triangles of one material, in the file's frame."""

    mesh: Mesh
    layers: tuple[LayerDescription, ...]
    emission: tuple[float, float, float] | None
    rig: Rig | None = None
    bumps: Bumps = NO_BUMPS


@dataclass(frozen=True)
class GlbModel:
    """A GLB file's parts, one a material in use, and notes on what was stepped over."""

    parts: tuple[GlbPart, ...]
    notes: tuple[str, ...]


def read_glb(path: Path) -> GlbModel:
    """Read a GLB file; raises LoadError naming the place and what was expected there."""
    root, binary = parse_glb(read_regular_file(path, MAX_MESH_BYTES), path)
    _check_extensions(root)
    _check_uris(root, binary)
    file = GltfFile(
        path,
        binary,
        root.children("bufferViews"),
        root.children("accessors"),
        root.children("meshes"),
        root.children("nodes"),
        len(root.children("materials")),
    )
    rigs = RigReader(file, root) if root.children("animations") else None
    copies, skipped = _Copies(file, rigs), 0
    for mesh_index, placed in placed_meshes(file, root).items():
        for primitive in file.meshes[mesh_index].children("primitives"):
            skipped += 0 if copies.take(primitive, placed) else len(placed)
    by_material = copies.by_material()
    if not by_material:
        raise LoadError(path, "faces", 0, "at least one mesh of triangles in the scene")
    images = GltfImages(root, binary)
    described = root.children("materials")
    used = {k: PartMaterial() if k < 0 else read_material(described[k], images) for k in by_material}
    bindings = copies.bindings()
    skeleton = rigs.skeleton(bindings.values()) if rigs else None
    parts = [
        _part(by_material[k], material, Rig(skeleton, bindings[k], np.eye(4)) if skeleton else None)
        for k, material in used.items()
    ]
    notes = _notes(root, list(used.values()), skipped) + (rigs.notes if rigs else [])
    return GlbModel(tuple(parts), tuple(notes))


def _part(meshes: list[Mesh], material: PartMaterial, rig: Rig | None) -> GlbPart:
    """The joined meshes of one material; without texture coordinates it has no textures."""
    mesh, layers, bumps = join_meshes(meshes), material.layers, material.bumps
    if mesh.uvs is None:
        layers, bumps = tuple(layer.model_copy(update={"maps": LayerMaps()}) for layer in layers), NO_BUMPS
    return GlbPart(mesh, layers, material.emission, rig, bumps)


def _check_extensions(root: JsonObject) -> None:
    """Refuses files that cannot be read without an extension that changes geometry, or the format of images."""
    required = root.values.get("extensionsRequired", [])
    if not isinstance(required, list):
        raise root.error("extensionsRequired", required, "a list")
    for name in required:
        if not isinstance(name, str) or not name.startswith(_HARMLESS) or name == "KHR_texture_basisu":
            expected = "no required extension of geometry or image files (no Draco, no meshopt, no Basis)"
            raise root.error("extensionsRequired", name, expected)


def _check_uris(root: JsonObject, binary: bytes) -> None:
    """The one buffer is the file's own binary chunk; pictures may be files, but none outside the file's folder."""
    for i, buffer in enumerate(root.children("buffers")):
        uri = buffer.text("uri")
        if uri is not None:
            if not uri.startswith("data:"):
                resolve_inside(root.file.parent, uri, root.file, f"{buffer.place}: uri")
            raise buffer.error("uri", uri, "none: the file's own binary chunk")
        length = buffer.integer("byteLength", 1, MAX_COUNT)
        if i or length > len(binary):
            raise buffer.error(
                "byteLength",
                f"{length} in a binary chunk truncated at byte {len(binary)}" if not i else "a second buffer",
                f"one buffer of at most {len(binary)} bytes",
            )
    for image in root.children("images"):
        uri = image.text("uri")
        if uri is not None and not uri.startswith("data:"):
            resolve_inside(root.file.parent, unquote(uri), root.file, f"{image.place}: uri")


class _Copies:
    """The triangles of a file by material: each list of them read once, and placed once for all its copies, of which a
    file may have no more than its size is worth; and what they hang on, where something moves them."""

    def __init__(self, file: GltfFile, rigs: RigReader | None) -> None:
        self._file, self._rigs = file, rigs
        self._read: dict[str, tuple[Mesh, Attached | None]] = {}
        self._placed: dict[tuple[int, str], list[MeshNode]] = {}
        self._most, self._n = MOST_COPIED + len(file.binary), 0

    def take(self, primitive: JsonObject, placed: list[MeshNode]) -> bool:
        """Read a primitive and note where copies of it stand; False for points and lines, which are left out."""
        mode = primitive.integer("mode", 0, 6, _TRIANGLES)
        if mode < _TRIANGLES:
            return False
        if mode != _TRIANGLES:
            raise primitive.error("mode", mode, f"{_TRIANGLES} (triangles; no strips, no fans)")
        made_of = repr(tuple(primitive.values.get(key) for key in ("attributes", "indices", "targets")))
        if made_of not in self._read:
            mesh = _read_primitive(self._file, primitive)
            attached = self._rigs.attached(primitive, len(mesh.vertices)) if self._rigs else None
            self._read[made_of] = mesh, attached
        mesh = self._read[made_of][0]
        self._n += (len(mesh.vertices) + len(mesh.triangles)) * len(placed)
        if self._n > self._most:
            expected = f"at most {self._most} in a file of this size"
            raise primitive.error("vertices and faces of all copies", self._n, expected)
        material = primitive.integer("material", -1, self._file.n_materials - 1, -1)
        self._placed.setdefault((material, made_of), []).extend(placed)
        return True

    def by_material(self) -> dict[int, list[Mesh]]:
        """All triangles, in the order of the materials, −1 for what has none."""
        found: dict[int, list[Mesh]] = {}
        for (material, made_of), placed in self._placed.items():
            matrices = np.stack([each.matrix for each in placed])
            found.setdefault(material, []).append(place_copies(self._read[made_of][0], matrices))
        return dict(sorted(found.items()))

    def bindings(self) -> dict[int, Binding]:
        """What the vertices of `by_material`'s meshes hang on; empty where nothing moves."""
        found: dict[int, list[Binding]] = {}
        for (material, made_of), placed in self._placed.items():
            mesh, attached = self._read[made_of]
            if self._rigs and attached:
                found.setdefault(material, []).extend(self._rigs.bindings(mesh, attached, placed))
        return {material: join_bindings(bindings) for material, bindings in found.items()}


def _read_primitive(file: GltfFile, primitive: JsonObject) -> Mesh:
    """One list of triangles."""
    attributes = primitive.child("attributes")
    if not attributes.has("POSITION"):
        raise attributes.error("POSITION", "nothing", "an accessor of positions")
    vertices = file.read(attributes, "POSITION", "VEC3", FLOATS).astype(np.float64)
    normals = None
    if attributes.has("NORMAL"):
        normals = file.read(attributes, "NORMAL", "VEC3", FLOATS).astype(np.float64)
        if len(normals) != len(vertices):
            raise attributes.error("NORMAL", f"{len(normals)} normals", f"{len(vertices)}, as there are positions")
    if primitive.has("indices"):
        corners = file.read(primitive, "indices", "SCALAR", INTEGERS).astype(np.int64)[:, 0]
    else:
        corners = np.arange(len(vertices))
    if len(corners) % 3:
        raise primitive.error("indices", f"{len(corners)} corners", "a multiple of 3")
    if len(corners) and corners.max() >= len(vertices):
        k = int(np.argmax(corners >= len(vertices)))
        raise primitive.error(f"index {k}", int(corners[k]), f"an index from 0 to {len(vertices) - 1}")
    triangles = corners.reshape(-1, 3).astype(np.int32)
    uvs = _read_uvs(file, attributes, len(vertices), triangles)
    tangents = None  # of use beside both others alone [glTF 2.0, 3.7.2.1]
    if normals is not None and uvs is not None:
        tangents = _read_tangents(file, attributes, len(vertices), triangles)
    mesh = Mesh(vertices, triangles, normals, uvs, tangents)
    return validate_mesh(mesh, file.path, f"{primitive.place}: ")


def _read_uvs(
    file: GltfFile, attributes: JsonObject, n_vertices: int, triangles: npt.NDArray[np.int32]
) -> npt.NDArray[np.float32] | None:
    """Texture coordinates of the corners, (T, 3, 2), v turned upwards: in glTF it grows downwards."""
    if not attributes.has("TEXCOORD_0"):
        return None
    values = file.read(attributes, "TEXCOORD_0", "VEC2", SHARES)
    if len(values) != n_vertices:
        found = f"{len(values)} texture coordinates"
        raise attributes.error("TEXCOORD_0", found, f"{n_vertices}, as there are positions")
    scale = 1.0 if values.dtype.kind == "f" else 1.0 / np.iinfo(values.dtype).max
    uvs = values.astype(np.float32) * np.float32(scale)
    uvs[:, 1] = np.float32(1.0) - uvs[:, 1]
    return uvs[triangles]


def _notes(root: JsonObject, materials: list[PartMaterial], skipped: int) -> list[str]:
    """What the file holds that is not shown."""
    lines = []
    if skipped:
        lines.append(f"{skipped} primitives of points or lines left out")
    lines += dict.fromkeys(note for material in materials for note in material.notes)
    if root.children("skins") and not root.children("animations"):
        lines.append("a skin without an animation: shown at rest")
    return lines


def _read_tangents(
    file: GltfFile, attributes: JsonObject, n_vertices: int, triangles: npt.NDArray[np.int32]
) -> npt.NDArray[np.float32] | None:
    """Tangents and hands of the corners, (T, 3, 4): bitangents are hand × normal × tangent, to where images go up."""
    if not attributes.has("TANGENT"):
        return None
    values = file.read(attributes, "TANGENT", "VEC4", FLOATS)
    if len(values) != n_vertices:
        raise attributes.error("TANGENT", f"{len(values)} tangents", f"{n_vertices}, as there are positions")
    return np.asarray(values[triangles], np.float32)
