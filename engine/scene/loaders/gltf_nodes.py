"""The nodes of the scene that a glTF file shows, with the transforms of their meshes and of instances of these."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.scene.loaders.gltf_file import GltfFile
from engine.scene.loaders.gltf_forest import Forest
from engine.scene.loaders.gltf_json import JsonObject

Float64Array = npt.NDArray[np.float64]

MAX_DEPTH = 256
INSTANCING = "EXT_mesh_gpu_instancing"
# Limit of the places of all meshes, plus one for every fourth byte: a place has at least three vertices and a face.
MOST_PLACES = 250_000
_IDENTITY = np.eye(4)
_TRANSFORM = ("matrix", "translation", "rotation", "scale")
_NO_PLACE = "what hangs from it has no place, and is not shown"
# The areas of a transform's faces, relative to the square of its longest axis, below which it leaves no face an area.
_FLATTEST = 1e-12


class MeshNode(NamedTuple):
    """A node's place, or that of one instance of its mesh: its matrix (4, 4) to the file's frame, whether that leaves
    no face an area, and the instance's matrix to the node's frame, None for the node itself."""

    node: int
    matrix: Float64Array
    is_flat: bool = False
    instance: Float64Array | None = None


def scene_nodes(file: GltfFile, forest: Forest) -> list[MeshNode]:
    """All nodes of the scene that is shown."""
    stack = [(k, _IDENTITY, False, 0) for k in reversed(forest.roots)]
    found: list[MeshNode] = []
    while stack:
        k, above, is_flat, depth = stack.pop()
        node = file.nodes[k]
        matrix = above
        if not node.values.keys().isdisjoint(_TRANSFORM):
            placed = node.attempt("transform", _NO_PLACE, partial(_world_matrix, above, node))
            if placed is None:
                node.log.left_out.add(id(node.values))
                continue
            matrix, is_flat = placed, bool(are_flat(placed[None])[0])
        found.append(MeshNode(k, matrix, is_flat))
        if node.has("children"):
            children = _children(file, forest, k, depth)
            stack += [(child, matrix, is_flat, depth + 1) for child in reversed(children)]
        elif not node.has("mesh"):
            node.mark_read()  # the scene has it, even if it only has a name
    return found


def _children(file: GltfFile, forest: Forest, k: int, depth: int) -> list[int]:
    """The nodes that hang from node k, so many levels below a root; what is left out is listed."""
    node = file.nodes[k]
    node.indices("children", len(file.nodes))  # lists what is no index
    for child in forest.cut.get(k, ()):
        node.note("children", child, "left out: a node hangs from one other, and not from itself")
    if k in forest.cut:
        node.not_shown("children", "nodes that hang from several are shown once", len(forest.cut[k]))
    if depth >= MAX_DEPTH:
        node.note("children", node.raw("children"), f"left out: deeper than {MAX_DEPTH} levels")
        node.not_shown("children", f"nodes deeper than {MAX_DEPTH} levels are not shown")
        return []
    return forest.children.get(k, [])


def placed_meshes(file: GltfFile, nodes: Iterable[MeshNode]) -> dict[int, list[MeshNode]]:
    """For every mesh the nodes that have it, or their instances of it."""
    placed: dict[int, list[MeshNode]] = {}
    n_placed = 0
    for each in nodes:
        node = file.nodes[each.node]
        number = _mesh_of(file, node)
        if number is not None:
            mesh = placed.setdefault(number, [])
            instancing = node.child("extensions").child(INSTANCING) if node.has("extensions") else None
            copies = None
            if instancing is not None and instancing.values:
                read = partial(_instances, file, each, instancing, n_placed)
                copies = instancing.attempt("attributes", "one copy of the mesh is shown", read)
            mesh += copies or [each]
            n_placed += len(copies or [each])
    return placed


def _mesh_of(file: GltfFile, node: JsonObject) -> int | None:
    """The number of a node's mesh; None if it has none."""
    if not node.has("mesh"):
        return None
    return node.attempt("mesh", "a mesh that is not there", lambda: node.integer("mesh", 0, len(file.meshes) - 1))


def _instances(file: GltfFile, placed: MeshNode, extension: JsonObject, n_placed: int) -> list[MeshNode]:
    """The instances of a node's mesh, each translation · rotation · scale in the node's frame
    [EXT_mesh_gpu_instancing]. n_placed: the places of other nodes."""
    attributes = extension.child("attributes")
    given = [key for key in ("TRANSLATION", "ROTATION", "SCALE") if attributes.has(key)]
    if not given:
        return [placed]
    rows = {}
    for key in given:
        is_rotation = key == "ROTATION"
        rows[key] = file.read_floats(attributes, key, "VEC4" if is_rotation else "VEC3")
        if not (np.abs(rows[key]) <= 1e9).all() or len(rows[key]) != len(rows[given[0]]):
            raise attributes.error(
                key, f"{len(rows[key])} rows", f"{len(rows[given[0]])} of finite numbers up to 1e+09"
            )
        if is_rotation and not (np.linalg.norm(rows[key], axis=1) > 1e-6).all():
            raise attributes.error(key, "a quaternion of length 0", "unit quaternions")
    n, most = len(rows[given[0]]), MOST_PLACES + file.buffers.n_bytes // 4
    if n_placed + n > most:
        raise attributes.error("places of all meshes", n_placed + n, f"at most {most} in a file of this size")
    matrices = matrices_of(
        rows.get("TRANSLATION", np.zeros((n, 3))),
        rows.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))),
        rows.get("SCALE", np.ones((n, 3))),
    )
    world = _finite(placed.matrix @ matrices, file.nodes[placed.node])
    return list(map(MeshNode, [placed.node] * n, world, are_flat(world).tolist(), matrices))


def are_flat(matrices: Float64Array) -> npt.NDArray[np.bool_]:
    """Which transforms (N, 4, 4) leave no face an area: at most one axis has a length. With two, solids become flat
    shapes, which are seen."""
    axes = matrices[:, :3, :3].swapaxes(1, 2)
    areas = np.linalg.norm(np.cross(axes, axes[:, [1, 2, 0]]), axis=2).max(axis=1)
    return areas <= _FLATTEST * (axes**2).sum(axis=2).max(axis=1)


def node_matrix(node: JsonObject) -> Float64Array:
    """A node's own transform: `matrix` (column-major) or translation · rotation · scale."""
    if node.values.keys().isdisjoint(_TRANSFORM):
        return np.eye(4)
    if node.has("matrix"):
        return np.reshape(node.numbers("matrix", 16, tuple(_IDENTITY.ravel())), (4, 4)).T
    return matrix_of(*node_parts(node))


def node_parts(node: JsonObject) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Translation (3,), rotation (4,) as a quaternion x, y, z, w, and scale (3,)."""
    rotation = np.array(node.numbers("rotation", 4, (0.0, 0.0, 0.0, 1.0)))
    length = math.hypot(*rotation.tolist())
    if not 1e-6 < length < 1e9:
        node.note("rotation", rotation.tolist(), "taken as none: no direction of a quaternion")
        rotation = np.array([0.0, 0.0, 0.0, 1.0])
    elif not 0.7 < length < 1.4:
        node.note("rotation", rotation.tolist(), "taken at length 1")
        rotation = rotation / length
    scale = np.array(node.numbers("scale", 3, (1.0, 1.0, 1.0)))
    return np.array(node.numbers("translation", 3, (0.0, 0.0, 0.0))), rotation, scale


def matrix_of(translation: Float64Array, rotation: Float64Array, scale: Float64Array) -> Float64Array:
    """Translation · rotation · scale (4, 4), with a quaternion of any length except 0."""
    return matrices_of(translation[None], rotation[None], scale[None])[0]


def matrices_of(translations: Float64Array, rotations: Float64Array, scales: Float64Array) -> Float64Array:
    """The same of several, (N, 4, 4) from (N, 3), (N, 4) and (N, 3)."""
    x, y, z, w = rotations.T
    s = 2.0 / (rotations**2).sum(axis=1)
    matrices = np.zeros((len(rotations), 4, 4))
    matrices[:, :3, :3] = np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    matrices[:, :3, :3] *= scales[:, None]
    matrices[:, :3, 3] = translations
    matrices[:, 3, 3] = 1.0
    return matrices


def _world_matrix(above: Float64Array, node: JsonObject) -> Float64Array:
    """A node's matrix to the file's frame by that of the node above it."""
    return _finite(above @ node_matrix(node), node)


def _finite(matrix: Float64Array, node: JsonObject) -> Float64Array:
    """Check that a matrix, or each of several (..., 4, 4), is affine and its entries are of a usable size."""
    if not (np.abs(matrix) <= 1e9).all() or np.abs(matrix[..., 3, :] - (0, 0, 0, 1)).max() > 1e-6:
        found = matrix.reshape(-1)[:16].tolist()
        raise node.error("transform", found, "an affine matrix with entries up to 1e+09")
    return matrix


class WorldMatrices:
    """The matrices of a file's nodes at rest to its frame, each computed once; parents: those of its forest."""

    def __init__(self, file: GltfFile, parents: Mapping[int, int]) -> None:
        self._file, self._parents = file, parents
        self._found: dict[int, Float64Array] = {}

    def of(self, node: int) -> Float64Array:
        """(4, 4). Raises LoadError for nodes that are too deep."""
        chain = [node]
        while chain[-1] not in self._found and chain[-1] in self._parents:
            chain.append(self._parents[chain[-1]])
            if len(chain) > MAX_DEPTH:
                expected = f"a tree of at most {MAX_DEPTH} levels"
                raise LoadError(self._file.path, f"nodes {node}: depth", "too deep", expected)
        for k in reversed(chain):
            if k not in self._found:
                above = self._found[self._parents[k]] if k in self._parents else np.eye(4)
                self._found[k] = _world_matrix(above, self._file.nodes[k])
        return self._found[node]
