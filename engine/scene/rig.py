"""Describes how the vertices of a mesh are bound to the nodes of its file, and how animations move these [glTF20, 3.7,
3.11].

Contains descriptions in arrays, and the mesh at rest; `engine.realtime.zonal_harmonics.posed_scene` moves it. A
*bone* is a node together with the map that takes the mesh as its accessors store it into the node's own axes (a skin's
inverse bind matrix). A mesh without a skin is bound to one bone, its node, by the identity. A vertex x with weights
w_b, bones at G_b with inverse bind matrices B_b, and morph targets d_m of weights u_m is at

    Σ_b w_b G_b B_b (x + Σ_m u_m d_m),

also at rest: the node of a skinned mesh has no influence on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import Mesh, cross, normalize, smooth_normals

Float64Array = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]

# And their numbers of components; weights have as many as there are targets.
PATHS = {"translation": 3, "rotation": 4, "scale": 3}
INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")


@dataclass(frozen=True, eq=False)
class Track:
    """One property of a node over time: times (K,), ascending, seconds; values (K, W), of splines (K, 3, W): the
    in-tangent of the key, its value, its out-tangent. path: a key of `PATHS`, or weights."""

    node: int
    path: str
    interpolation: str
    times: Float64Array
    values: Float64Array


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation by its name; it begins at 0 and lasts `duration` seconds."""

    name: str
    duration: float
    tracks: tuple[Track, ...]


class Animation(NamedTuple):
    """The part of a clip that the window knows: its name, and its length in seconds."""

    name: str
    duration: float


Animations = tuple[Animation, ...]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Nodes by their numbers in the file, parents before their children: order; parents, of those that have one;
    matrices (4, 4) at rest, to the parent; parts: translation (3,), rotation (4,) and scale (3,) of nodes that a track
    moves; weights: of the morph targets of a node's mesh."""

    order: tuple[int, ...]
    parents: dict[int, int]
    matrices: dict[int, Float64Array]
    parts: dict[int, tuple[Float64Array, Float64Array, Float64Array]]
    weights: dict[int, Float64Array]
    clips: tuple[Clip, ...]

    def clip(self, name: str) -> Clip:
        """The clip of a name. Raises ValueError if there is none."""
        for clip in self.clips:
            if clip.name == name:
                return clip
        raise ValueError(f"animation {name!r}, expected one of {', '.join(clip.name for clip in self.clips)}")


@dataclass(frozen=True, eq=False)
class Morph:
    """How some vertices (n,) move at weight 1 of target `number` of a node's mesh: offsets (n, 3) of their positions
    and, if the file has them, of their unit normals."""

    node: int
    number: int
    vertices: Int32Array
    offsets: Float64Array
    normals: Float64Array | None


@dataclass(frozen=True, eq=False)
class Binding:
    """The binding of V vertices. places (V, 3) and unit normals (V, 3), 0 if the file has none: as in the accessors,
    before anything moves them. Bones, as nodes (B,) and maps (B, 4, 4) into their axes; for each vertex the indices of
    some of them (V, K) and weights (V, K) that sum to 1."""

    nodes: Int32Array
    maps: Float64Array
    bones: Int32Array
    weights: Float64Array
    places: Float64Array
    normals: Float64Array
    morphs: tuple[Morph, ...] = ()

    def blend_matrices(self, matrices: Float64Array) -> Float64Array:
        """Blend the bones' matrices (B, 3, N) by each vertex's weights, (V, 3, N)."""
        total = np.zeros((len(self.bones), *matrices.shape[1:]))
        for bones, weights in zip(self.bones.T, self.weights.T, strict=True):
            total += weights[:, None, None] * matrices[bones]
        return total

    def morph_vertices(self, weights: Mapping[int, Float64Array]) -> tuple[Float64Array, Float64Array]:
        """Positions and normals (V, 3) under morph targets with these weights, by node; 0 for nodes without."""
        places, normals = self.places, self.normals
        for morph in self.morphs:
            weight = morph_weight(morph, weights)
            if weight == 0.0:
                continue
            if places is self.places:
                places, normals = places.copy(), normals.copy()
            places[morph.vertices] += weight * morph.offsets
            if morph.normals is not None:
                normals[morph.vertices] += weight * morph.normals
        return places, normals

    def select_vertices(self, vertices: npt.NDArray[np.integer]) -> Binding:
        """The binding of copies of some vertices (n,)."""
        every = np.argsort(vertices, kind="stable")
        morphs = []
        for morph in self.morphs:
            of = np.full(len(self.places), -1)
            of[morph.vertices] = np.arange(len(morph.vertices))
            own = every[of[vertices[every]] >= 0]
            rows = of[vertices[own]]
            normals = None if morph.normals is None else morph.normals[rows]
            morphs.append(replace(morph, vertices=own.astype(np.int32), offsets=morph.offsets[rows], normals=normals))
        return replace(
            self, bones=self.bones[vertices], weights=self.weights[vertices], places=self.places[vertices],
            normals=self.normals[vertices], morphs=tuple(morphs),
        )  # fmt: skip


def morph_weight(morph: Morph, weights: Mapping[int, Float64Array]) -> float:
    """The weight of a target among those of its node; 0 if there is none."""
    own = weights.get(morph.node)
    return float(own[morph.number]) if own is not None and morph.number < len(own) else 0.0


def normal_matrices(matrices: Float64Array) -> Float64Array:
    """Matrices for normals under matrices (B, 3, 4): the inverse transposes (B, 3, 3) of their linear parts, blended in
    the same way [glTF20, 3.7.3.3]; if there is no inverse, the cofactors, which have its directions."""
    linear = matrices[..., :3]
    cofactor = cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]])
    volume = np.einsum("bk,bk->b", linear[:, 0], cofactor[:, 0])
    is_flat = np.abs(volume) <= 1e-9 * np.linalg.norm(linear, axis=1).prod(axis=1)
    return cofactor / np.where(is_flat, 1.0, volume)[:, None, None]


def rest_mesh(mesh: Mesh, binding: Binding, matrices: Float64Array, weights: Mapping[int, Float64Array]) -> Mesh:
    """A mesh under its bones and morph targets: matrices (B, 3, 4) of the bones, G_b B_b; weights of morph targets by
    node. The winding of what a bone mirrors is reversed, so that fronts stay fronts."""
    places, normals = binding.morph_vertices(weights)
    skin = binding.blend_matrices(matrices)
    linear = skin[..., :3]
    vertices = np.einsum("vab,vb->va", linear, places) + skin[..., 3]
    handedness = np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0)
    mirrored = handedness[mesh.triangles].sum(axis=1) < 0.0

    def wound(corners: npt.NDArray) -> npt.NDArray:
        return np.where(mirrored.reshape(-1, *[1] * (corners.ndim - 1)), corners[:, ::-1], corners)

    corners = {name: wound(own) for name, own in mesh.corner_values.items()}
    if mesh.tangents is not None:
        along = np.einsum("tcij,tcj->tci", linear[mesh.triangles], mesh.tangents[..., :3].astype(np.float64))
        length = np.linalg.norm(along, axis=2, keepdims=True)
        sides = np.where(mirrored, -1.0, 1.0)[:, None, None] * np.sign(mesh.tangents[..., 3:])
        both = np.concatenate([along / np.where(length > 0.0, length, 1.0), sides], axis=2)
        corners["tangents"] = wound(both.astype(np.float32))
    triangles = wound(mesh.triangles)
    rotated = None
    if mesh.normals is not None:
        rotated = np.einsum("vab,vb->va", binding.blend_matrices(normal_matrices(matrices)), normals)
        rotated = normalize(rotated, smooth_normals(vertices, triangles))
    return Mesh(vertices, triangles, rotated, **corners)


class RestPose(NamedTuple):
    """A rig's mesh at rest: its bones' matrices (B, 3, 4), the linear parts for its vertices (V, 3, 3), and their
    inverses."""

    matrices: Float64Array
    linear: Float64Array
    inverse: Float64Array


@dataclass(frozen=True, eq=False)
class Rig:
    """A mesh's binding to a file's skeleton; frame (4, 4) maps the skeleton's space to that of the mesh."""

    skeleton: Skeleton
    binding: Binding
    frame: Float64Array

    @property
    def animations(self) -> Animations:
        """The animations that move any part of it."""
        return tuple(Animation(clip.name, clip.duration) for clip in self.skeleton.clips if clip.tracks)

    def bone_matrices(self, moved: Mapping[int, Float64Array]) -> Float64Array:
        """The bones' matrices (B, 3, 4), G_b B_b, if some nodes have other matrices (4, 4) to their parents."""
        skeleton, matrices = self.skeleton, dict[int, Float64Array]()
        for node in skeleton.order:
            own = moved.get(node, skeleton.matrices[node])
            parent = skeleton.parents.get(node)
            matrices[node] = own if parent is None else matrices[parent] @ own
        there = self.frame @ np.stack([matrices[int(node)] for node in self.binding.nodes])
        return np.ascontiguousarray((there @ self.binding.maps)[:, :3])

    @cached_property
    def rest_pose(self) -> RestPose:
        """See `RestPose`; where bones flatten a vertex's neighbourhood there is no inverse, and the identity replaces
        it."""
        matrices = self.bone_matrices({})
        linear = np.ascontiguousarray(self.binding.blend_matrices(matrices)[..., :3])
        is_flat = np.abs(np.linalg.det(linear)) <= 1e-9 * np.linalg.norm(linear, axis=1).prod(axis=1)
        inverse = np.linalg.inv(np.where(is_flat[:, None, None], np.eye(3), linear))
        return RestPose(matrices, linear, inverse)

    def transformed_by(self, matrix: Float64Array) -> Rig:
        """The rig of the mesh under an affine transform (4, 4)."""
        return Rig(self.skeleton, self.binding, matrix @ self.frame)


def join_bindings(bindings: Sequence[Binding]) -> Binding:
    """Join the bindings of several meshes, see `mesh.join_meshes`."""
    width = max(binding.bones.shape[1] for binding in bindings)
    n_bones = np.cumsum([0] + [len(binding.nodes) for binding in bindings])
    n_vertices = np.cumsum([0] + [len(binding.bones) for binding in bindings])
    bones, weights, morphs = [], [], []
    for binding, first_bone, first in zip(bindings, n_bones.tolist(), n_vertices.tolist(), strict=False):
        none = ((0, 0), (0, width - binding.bones.shape[1]))
        bones.append(np.pad(binding.bones, none) + first_bone)
        weights.append(np.pad(binding.weights, none))
        morphs += [replace(morph, vertices=(morph.vertices + first).astype(np.int32)) for morph in binding.morphs]
    return Binding(
        np.concatenate([binding.nodes for binding in bindings]),
        np.concatenate([binding.maps for binding in bindings]),
        np.concatenate(bones).astype(np.int32),
        np.concatenate(weights),
        np.concatenate([binding.places for binding in bindings]),
        np.concatenate([binding.normals for binding in bindings]),
        tuple(morphs),
    )
