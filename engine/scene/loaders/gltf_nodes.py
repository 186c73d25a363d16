"""The nodes of a GLB file: a forest of bounded depth, and the transforms of their meshes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.scene.description import check_transform
from engine.scene.loaders.gltf_file import GltfFile, JsonObject

Float64Array = npt.NDArray[np.float64]

MAX_DEPTH = 256
_TRANSFORM = ("matrix", "translation", "rotation", "scale")


class MeshNode(NamedTuple):
    """A node that has a mesh, its matrix (4, 4) to the file's frame, and whether that is degenerate."""

    node: int
    matrix: Float64Array
    is_flat: bool = False


def placed_meshes(file: GltfFile, root: JsonObject) -> dict[int, list[MeshNode]]:
    """For every mesh in the scene the nodes that have it."""
    children = [node.indices("children", len(file.nodes)) for node in file.nodes]
    parents = _parents(file, children)
    stack = [(k, np.eye(4), False, 0) for k in reversed(_roots(file, root, parents))]
    placed: dict[int, list[MeshNode]] = {}
    reached = 0
    while stack:
        k, above, is_flat, depth = stack.pop()
        reached += 1
        if depth > MAX_DEPTH or reached > len(file.nodes):
            raise LoadError(
                file.path,
                f"nodes {k}: depth",
                "too deep" if depth > MAX_DEPTH else "a loop",
                f"a tree of at most {MAX_DEPTH} levels",
            )
        node = file.nodes[k]
        matrix = above
        if not node.values.keys().isdisjoint(_TRANSFORM):
            matrix = _finite(above @ node_matrix(node), node)
            is_flat = check_transform((*matrix.reshape(-1)[:12].tolist(), 0.0, 0.0, 0.0, 1.0)) is not None
        if node.has("mesh"):
            at = MeshNode(k, matrix, is_flat)
            placed.setdefault(node.integer("mesh", 0, len(file.meshes) - 1), []).append(at)
        stack += [(child, matrix, is_flat, depth + 1) for child in reversed(children[k])]
    return placed


def parents_of(file: GltfFile) -> dict[int, int]:
    """The parent of each node that has one."""
    return _parents(file, [node.indices("children", len(file.nodes)) for node in file.nodes])


def _parents(file: GltfFile, children: list[list[int]]) -> dict[int, int]:
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
    return parents


def _roots(file: GltfFile, root: JsonObject, parents: dict[int, int]) -> list[int]:
    """The top nodes of the scene that is shown."""
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


def node_matrix(node: JsonObject) -> Float64Array:
    """A node's own transform: `matrix` (column-major) or translation · rotation · scale."""
    if node.values.keys().isdisjoint(_TRANSFORM):
        return np.eye(4)
    if node.has("matrix"):
        return np.reshape(node.numbers("matrix", 16, ()), (4, 4)).T
    return matrix_of(*node_parts(node))


def node_parts(node: JsonObject) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Translation (3,), rotation (4,) as a quaternion x, y, z, w, and scale (3,)."""
    rotation = np.array(node.numbers("rotation", 4, (0.0, 0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(rotation))
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
    x, y, z, w = rotation.tolist()
    s = 2.0 / (x * x + y * y + z * z + w * w)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    matrix[:3, :3] *= scale
    matrix[:3, 3] = translation
    return matrix


def _finite(matrix: Float64Array, node: JsonObject) -> Float64Array:
    """Check that a matrix is affine and its entries are of a usable size."""
    if not (np.abs(matrix) <= 1e9).all() or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-6:
        raise node.error("transform", matrix.reshape(-1).tolist(), "an affine matrix with entries up to 1e+09")
    return matrix


class WorldMatrices:
    """The matrices of a file's nodes at rest to its frame, each computed once."""

    def __init__(self, file: GltfFile) -> None:
        self._file, self._parents = file, parents_of(file)
        self._found: dict[int, Float64Array] = {}

    def of(self, node: int) -> Float64Array:
        """(4, 4). Raises LoadError for nodes that are too deep or in a loop."""
        chain = [node]
        while chain[-1] not in self._found and chain[-1] in self._parents:
            chain.append(self._parents[chain[-1]])
            if len(chain) > MAX_DEPTH:
                expected = f"a tree of at most {MAX_DEPTH} levels"
                raise LoadError(self._file.path, f"nodes {node}: depth", "too deep, or a loop", expected)
        for k in reversed(chain):
            if k not in self._found:
                above = self._found[self._parents[k]] if k in self._parents else np.eye(4)
                self._found[k] = _finite(above @ node_matrix(self._file.nodes[k]), self._file.nodes[k])
        return self._found[node]
