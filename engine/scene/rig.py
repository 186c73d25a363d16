"""How the vertices of a mesh hang on the nodes of its file, and how animations move these [glTF20, 3.7, 3.11].

Descriptions alone, in arrays; `engine.deform.animation` evaluates them. A *bone* is a node together with the map that
takes the mesh at rest into the node's own axes; one that has not moved changes nothing. What has no skin hangs on one
bone, the node that has the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import cross

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

PATHS = {"translation": 3, "rotation": 4, "scale": 3}  # and their numbers; weights have as many as there are targets
INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")


@dataclass(frozen=True, eq=False)
class Track:
    """One property of a node over time: times (K,) that ascend, seconds; values (K, W), of splines (K, 3, W): the
    tangent into the key, its value, the tangent out of it. path: a key of `PATHS`, or weights."""

    node: int
    path: str
    interpolation: str
    times: Floats
    values: Floats


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation by its name; it begins at 0 and is `duration` seconds long."""

    name: str
    duration: float
    tracks: tuple[Track, ...]


class Animation(NamedTuple):
    """What of a clip the window knows: its name, and how long it is, seconds."""

    name: str
    duration: float


Animations = tuple[Animation, ...]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Nodes by their numbers in the file, parents before their children: order; parents, of those that have one;
    matrices (4, 4) at rest, to the parent; parts: translation (3,), rotation (4,) and scale (3,) of those that a track
    moves; weights: of the morph targets of a node's mesh."""

    order: tuple[int, ...]
    parents: dict[int, int]
    matrices: dict[int, Floats]
    parts: dict[int, tuple[Floats, Floats, Floats]]
    weights: dict[int, Floats]
    clips: tuple[Clip, ...]

    def clip(self, name: str) -> Clip:
        """Raises ValueError where there is none of that name."""
        for clip in self.clips:
            if clip.name == name:
                return clip
        raise ValueError(f"animation {name!r}, expected one of {', '.join(clip.name for clip in self.clips)}")


@dataclass(frozen=True, eq=False)
class Morph:
    """How some vertices (n,) move at weight 1 of target `number` of a node's mesh: offsets (n, 3) of their places and,
    where the file has them, of their unit normals."""

    node: int
    number: int
    vertices: Indices
    offsets: Floats
    normals: Floats | None


@dataclass(frozen=True, eq=False)
class Binding:
    """What V vertices hang on: bones, as nodes (B,) and maps (B, 4, 4) from the mesh at rest to their axes; for each
    vertex some of them (V, K) and weights (V, K) that sum to 1."""

    nodes: Indices
    maps: Floats
    bones: Indices
    weights: Floats
    morphs: tuple[Morph, ...] = ()

    def placed(self, matrix: Floats, normals: Floats | None) -> Binding:
        """Of vertices under an affine transform (4, 4); normals (V, 3): theirs before it, of length 1."""
        morphs = tuple(_placed(morph, matrix, normals) for morph in self.morphs)
        return replace(self, maps=self.maps @ np.linalg.inv(matrix), morphs=morphs)


@dataclass(frozen=True, eq=False)
class Rig:
    """A mesh's binding to a file's skeleton; frame (4, 4) takes the skeleton's space to that of the mesh."""

    skeleton: Skeleton
    binding: Binding
    frame: Floats

    @property
    def animations(self) -> Animations:
        """All that move anything of it."""
        return tuple(Animation(clip.name, clip.duration) for clip in self.skeleton.clips if clip.tracks)

    def placed(self, matrix: Floats, normals: Floats | None) -> Rig:
        """Of the mesh under an affine transform, see `Binding.placed`."""
        return Rig(self.skeleton, self.binding.placed(matrix, normals), matrix @ self.frame)


def join_bindings(bindings: Sequence[Binding]) -> Binding:
    """Of several meshes as one, see `mesh.join_meshes`."""
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
        tuple(morphs),
    )


def _placed(morph: Morph, matrix: Floats, normals: Floats | None) -> Morph:
    linear = matrix[:3, :3]
    offsets, turned = morph.offsets @ linear.T, None
    if morph.normals is not None and normals is not None:
        cofactor = cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
        lengths = np.linalg.norm(normals[morph.vertices] @ cofactor.T, axis=1, keepdims=True)
        # A mirror turns normals round with the winding.
        sign = np.sign(np.linalg.det(linear))
        turned = sign * (morph.normals @ cofactor.T) / np.where(lengths > 0.0, lengths, 1.0)
    return replace(morph, offsets=offsets, normals=turned)
