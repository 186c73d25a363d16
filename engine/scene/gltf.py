"""Geometry and materials of a GLB file: every triangle under its node's transform, sorted by material.

The accessors are checked and read here, not by trimesh or pygltflib, which read what is not there (see `mesh`): counts,
offsets and strides are held against the binary chunk, indices against the vertices. Nodes must form a forest of bounded
depth. Skins, morph targets and animations are stepped over with a note: what is shown is the bind pose. Materials are
`gltf_materials`'.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from engine.errors import LoadError
from engine.files import read_regular_file, resolve_inside
from engine.material.maps import LayerMaps
from engine.scene.description import LayerDescription
from engine.scene.glb import JsonObject, parse_glb
from engine.scene.gltf_materials import PartMaterial, read_material
from engine.scene.gltf_textures import GltfImages
from engine.scene.mesh import MAX_MESH_BYTES, Mesh, join_meshes, place_copies, validate_mesh
from engine.scene.transform import check_transform

MAX_DEPTH = 256
MAX_COUNT = 2**31 - 1
# Vertices and faces of all copies that nodes make of meshes, one more for every byte: small files must not cost much.
MOST_COPIED = 1_000_000
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_")
_TRIANGLES = 4
_TRANSFORM = ("matrix", "translation", "rotation", "scale")


@dataclass(frozen=True)
class GlbPart:
    """All triangles of one material, in the file's frame."""

    mesh: Mesh
    layers: tuple[LayerDescription, ...]
    emission: tuple[float, float, float] | None


@dataclass(frozen=True)
class GlbModel:
    """A GLB file's parts, one a material in use, and notes on what was stepped over."""

    parts: tuple[GlbPart, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _File:
    """The lists of a file that refer to each other."""

    path: Path
    binary: bytes
    views: list[JsonObject]
    accessors: list[JsonObject]
    meshes: list[JsonObject]
    nodes: list[JsonObject]
    n_materials: int


def read_glb(path: Path) -> GlbModel:
    """Read a GLB file; raises LoadError naming the place and what was expected there."""
    root, binary = parse_glb(read_regular_file(path, MAX_MESH_BYTES), path)
    _check_extensions(root)
    _check_uris(root, binary)
    file = _File(
        path,
        binary,
        root.children("bufferViews"),
        root.children("accessors"),
        root.children("meshes"),
        root.children("nodes"),
        len(root.children("materials")),
    )
    copies, skipped = _Copies(file), 0
    for mesh_index, matrices in _placed_meshes(file, root).items():
        for primitive in file.meshes[mesh_index].children("primitives"):
            skipped += 0 if copies.take(primitive, matrices) else len(matrices)
    by_material = copies.by_material()
    if not by_material:
        raise LoadError(path, "faces", 0, "at least one mesh of triangles in the scene")
    images = GltfImages(root, binary)
    described = root.children("materials")
    used = {k: PartMaterial() if k < 0 else read_material(described[k], images) for k in by_material}
    parts = [_part(by_material[k], material) for k, material in used.items()]
    return GlbModel(tuple(parts), tuple(_notes(root, list(used.values()), skipped)))


def _part(meshes: list[Mesh], material: PartMaterial) -> GlbPart:
    """The joined meshes of one material; without texture coordinates it has no textures."""
    mesh, layers = join_meshes(meshes), material.layers
    if mesh.uvs is None:
        layers = tuple(layer.model_copy(update={"maps": LayerMaps()}) for layer in layers)
    return GlbPart(mesh, layers, material.emission)


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


def _placed_meshes(file: _File, root: JsonObject) -> dict[int, list[npt.NDArray[np.float64]]]:
    """Of every mesh in the scene the matrices to the file's frame of the nodes that have it."""
    children = [node.indices("children", len(file.nodes)) for node in file.nodes]
    parents: dict[int, int] = {}
    for k, below in enumerate(children):
        for child in below:
            if child in parents or child == k:
                raise LoadError(
                    file.path,
                    f"nodes {child}: parents",
                    f"{parents.get(child, k)} and {k}",
                    "one parent: nodes in a tree without a loop",
                )
            parents[child] = k
    stack = [(k, np.eye(4), 0) for k in reversed(_roots(file, root, parents))]
    placed: dict[int, list[npt.NDArray[np.float64]]] = {}
    reached = 0
    while stack:
        k, above, depth = stack.pop()
        reached += 1
        if depth > MAX_DEPTH or reached > len(file.nodes):
            raise LoadError(
                file.path,
                f"nodes {k}: depth",
                "too deep" if depth > MAX_DEPTH else "a loop",
                f"a tree of at most {MAX_DEPTH} levels",
            )
        node = file.nodes[k]
        matrix = above if node.values.keys().isdisjoint(_TRANSFORM) else _finite(above @ _node_matrix(node), node)
        if node.has("mesh"):
            placed.setdefault(node.integer("mesh", 0, len(file.meshes) - 1), []).append(matrix)
        stack += [(child, matrix, depth + 1) for child in reversed(children[k])]
    return placed


def _roots(file: _File, root: JsonObject, parents: dict[int, int]) -> list[int]:
    """The nodes at the top of the scene that is to be shown."""
    scenes = root.children("scenes")
    if scenes:
        roots = scenes[root.integer("scene", 0, len(scenes) - 1, 0)].indices("nodes", len(file.nodes))
    else:
        roots = [k for k in range(len(file.nodes)) if k not in parents]
    for k in roots:
        if k in parents:
            raise LoadError(file.path, f"nodes {k}", f"a root below nodes {parents[k]}", "roots without a parent")
    if file.nodes and not roots:
        raise LoadError(file.path, "scene: nodes", "none, or a loop", "at least one root node")
    return roots


def _node_matrix(node: JsonObject) -> npt.NDArray[np.float64]:
    """A node's own transform: `matrix` (column-major) or translation · rotation · scale."""
    if node.has("matrix"):
        return np.reshape(node.numbers("matrix", 16, ()), (4, 4)).T
    x, y, z, w = node.numbers("rotation", 4, (0.0, 0.0, 0.0, 1.0))
    norm = x * x + y * y + z * z + w * w
    if not 0.5 < norm < 2.0:
        raise node.error("rotation", [x, y, z, w], "a unit quaternion")
    s = 2.0 / norm
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    matrix[:3, :3] *= node.numbers("scale", 3, (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.numbers("translation", 3, (0.0, 0.0, 0.0))
    return matrix


def _finite(matrix: npt.NDArray[np.float64], node: JsonObject) -> npt.NDArray[np.float64]:
    """The matrix if its entries are of a usable size and it is affine."""
    if not (np.abs(matrix) <= 1e9).all() or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-6:
        raise node.error("transform", matrix.reshape(-1).tolist(), "an affine matrix with entries up to 1e+09")
    if check_transform((*matrix.reshape(-1)[:12].tolist(), 0.0, 0.0, 0.0, 1.0)):
        raise node.error("transform", "a matrix that flattens", "an invertible matrix")
    return matrix


class _Copies:
    """The triangles of a file by material: each list of them read once, and placed once for all its copies, of which a
    file may have no more than its size is worth."""

    def __init__(self, file: _File) -> None:
        self._file = file
        self._read: dict[str, Mesh] = {}
        self._matrices: dict[tuple[int, str], list[npt.NDArray[np.float64]]] = {}
        self._most, self._n = MOST_COPIED + len(file.binary), 0

    def take(self, primitive: JsonObject, matrices: list[npt.NDArray[np.float64]]) -> bool:
        """Read a primitive and note where copies of it stand; False for points and lines, which are left out."""
        mode = primitive.integer("mode", 0, 6, _TRIANGLES)
        if mode < _TRIANGLES:
            return False
        if mode != _TRIANGLES:
            raise primitive.error("mode", mode, f"{_TRIANGLES} (triangles; no strips, no fans)")
        made_of = repr((primitive.values.get("attributes"), primitive.values.get("indices")))
        mesh = self._read.get(made_of) or self._read.setdefault(made_of, _read_primitive(self._file, primitive))
        self._n += (len(mesh.vertices) + len(mesh.triangles)) * len(matrices)
        if self._n > self._most:
            expected = f"at most {self._most} in a file of this size"
            raise primitive.error("vertices and faces of all copies", self._n, expected)
        material = primitive.integer("material", -1, self._file.n_materials - 1, -1)
        self._matrices.setdefault((material, made_of), []).extend(matrices)
        return True

    def by_material(self) -> dict[int, list[Mesh]]:
        """All triangles, in the order of the materials, −1 for what has none."""
        found: dict[int, list[Mesh]] = {}
        for (material, made_of), matrices in self._matrices.items():
            found.setdefault(material, []).append(place_copies(self._read[made_of], np.stack(matrices)))
        return dict(sorted(found.items()))


def _read_primitive(file: _File, primitive: JsonObject) -> Mesh:
    """One list of triangles."""
    attributes = primitive.child("attributes")
    if not attributes.has("POSITION"):
        raise attributes.error("POSITION", "nothing", "an accessor of positions")
    vertices = _read_accessor(file, attributes, "POSITION", "VEC3", (5126,)).astype(np.float64)
    normals = None
    if attributes.has("NORMAL"):
        normals = _read_accessor(file, attributes, "NORMAL", "VEC3", (5126,)).astype(np.float64)
        if len(normals) != len(vertices):
            raise attributes.error("NORMAL", f"{len(normals)} normals", f"{len(vertices)}, as there are positions")
    if primitive.has("indices"):
        corners = _read_accessor(file, primitive, "indices", "SCALAR", (5121, 5123, 5125)).astype(np.int64)[:, 0]
    else:
        corners = np.arange(len(vertices))
    if len(corners) % 3:
        raise primitive.error("indices", f"{len(corners)} corners", "a multiple of 3")
    if len(corners) and corners.max() >= len(vertices):
        k = int(np.argmax(corners >= len(vertices)))
        raise primitive.error(f"index {k}", int(corners[k]), f"an index from 0 to {len(vertices) - 1}")
    triangles = corners.reshape(-1, 3).astype(np.int32)
    mesh = Mesh(vertices, triangles, normals, _read_uvs(file, attributes, len(vertices), triangles))
    return validate_mesh(mesh, file.path, f"{primitive.place}: ")


def _read_uvs(
    file: _File, attributes: JsonObject, n_vertices: int, triangles: npt.NDArray[np.int32]
) -> npt.NDArray[np.float32] | None:
    """Texture coordinates of the corners, (T, 3, 2), v turned upwards: in glTF it grows downwards."""
    if not attributes.has("TEXCOORD_0"):
        return None
    values = _read_accessor(file, attributes, "TEXCOORD_0", "VEC2", (5126, 5121, 5123))
    if len(values) != n_vertices:
        found = f"{len(values)} texture coordinates"
        raise attributes.error("TEXCOORD_0", found, f"{n_vertices}, as there are positions")
    scale = 1.0 if values.dtype.kind == "f" else 1.0 / np.iinfo(values.dtype).max
    uvs = values.astype(np.float32) * np.float32(scale)
    uvs[:, 1] = np.float32(1.0) - uvs[:, 1]
    return uvs[triangles]


def _read_accessor(file: _File, owner: JsonObject, key: str, kind: str, components: tuple[int, ...]) -> npt.NDArray:
    """The rows (count, width) of the accessor that `owner` names under `key`."""
    accessor = file.accessors[owner.integer(key, 0, len(file.accessors) - 1)]
    if accessor.text("type") != kind:
        raise accessor.error("type", accessor.text("type") or "nothing", f"{kind} for {key}")
    component = accessor.integer("componentType", 5120, 5126)
    if component not in components:
        raise accessor.error("componentType", component, f"one of {', '.join(map(str, components))} for {key}")
    if accessor.has("sparse") or not accessor.has("bufferView"):
        raise accessor.error("sparse", "a sparse accessor", "values in a buffer view")
    layout = np.dtype(_COMPONENTS[component])
    row = layout.itemsize * _WIDTHS[kind]
    view = file.views[accessor.integer("bufferView", 0, len(file.views) - 1)]
    view.integer("buffer", 0, 0)
    start = view.integer("byteOffset", 0, len(file.binary), 0)
    length = view.integer("byteLength", 1, len(file.binary) - start)
    stride = view.integer("byteStride", max(4, row), 252) if view.has("byteStride") else row
    offset = accessor.integer("byteOffset", 0, length, 0)
    count = accessor.integer("count", 1, max(0, length - offset - row) // stride + (1 if length - offset >= row else 0))
    window = np.frombuffer(file.binary, np.uint8, (count - 1) * stride + row, start + offset)
    rows = np.lib.stride_tricks.as_strided(window, (count, row), (stride, 1))
    return np.ascontiguousarray(rows).view(layout)


def _notes(root: JsonObject, materials: list[PartMaterial], skipped: int) -> list[str]:
    """What the file holds that is not shown."""
    lines = []
    if skipped:
        lines.append(f"{skipped} primitives of points or lines left out")
    lines += dict.fromkeys(note for material in materials for note in material.notes)
    if root.children("skins") or root.children("animations"):
        lines.append("skins and animations are not read, the bind pose is shown")
    if any(p.has("targets") for mesh in root.children("meshes") for p in mesh.children("primitives")):
        lines.append("morph targets are not read")
    return lines
