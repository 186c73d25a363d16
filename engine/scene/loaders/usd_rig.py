"""Animated transforms of a USD stage in the form of `engine.scene.rig`: rigid parts that follow their prims, and the
joints of skins (`usd_bindings`).

A prim's animation comes as matrices at the times of its samples and at every time code between them, from which
translation, rotation and scale follow; these are interpolated linearly, rotations on the sphere. A matrix that shears
has none of these, and the prim rests.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from engine.core.errors import LoadError
from engine.scene.loaders.gltf_nodes import matrices_of
from engine.scene.loaders.usd_prims import Float64Array, UsdPrim, UsdScene
from engine.scene.rig import Binding, Clip, Skeleton, Track

NAME = "stage"  # of the one animation of a file
MOST_KEYS = 2_000_000  # numbers of all tracks
_SHEARED = 1e-4  # of the size of a matrix


@dataclass(frozen=True)
class Samples:
    """How a node moves: its matrices (K, 4, 4) to its parent at time codes (K,), and of how many keys in the file. What
    is not played of it is listed of a prim by a key."""

    prim: UsdPrim
    key: str
    times: Float64Array
    matrices: Float64Array
    n_keys: int


@dataclass(frozen=True)
class Weights:
    """The weights (K, S) of a node's morph targets at time codes (K,), the first at the stage's start."""

    prim: UsdPrim
    times: Float64Array
    values: Float64Array


def samples_of(prim: UsdPrim) -> Samples | None:
    """The animation of a prim's transform; None where it has none. Raises LoadError."""
    if "times" not in prim.own:
        return None
    times, matrices = prim.stored("times"), prim.stored("matrices", 16)
    if times is None or matrices is None or len(times) != len(matrices) or len(times) < 2:
        raise prim.error("samples", "no matrices", "one for each time")
    n_keys = int(prim.own.get("keys", 0))
    return Samples(prim, "xformOpOrder.timeSamples", times, matrices.reshape(-1, 4, 4), n_keys)


@dataclass
class UsdNodes:
    """The prims that the walk over a stage has placed, and joints, as nodes with numbers, parents first: parents,
    matrices to the parents, and how they move; shaped: nodes for the weights of a mesh, by its path."""

    parents: dict[int, int] = field(default_factory=dict)
    matrices: list[Float64Array] = field(default_factory=list)
    samples: dict[int, Samples] = field(default_factory=dict)
    weights: dict[int, Weights] = field(default_factory=dict)
    shaped: dict[str, int] = field(default_factory=dict)

    def add(self, parent: int, matrix: Float64Array, samples: Samples | None = None) -> int:
        """The number of a new node; parent: −1 for none."""
        number = len(self.matrices)
        self.matrices.append(matrix)
        if samples is not None:
            self.samples[number] = samples
        if parent >= 0:
            self.parents[number] = parent
        return number

    def skeleton(self, scene: UsdScene, bindings: Iterable[Binding]) -> Skeleton | None:
        """The nodes of these bindings with all above them, and their animation; None where nothing moves."""
        wanted: set[int] = set()
        for binding in bindings:
            for node in [*binding.nodes.tolist(), *(morph.node for morph in binding.morphs)]:
                while node not in wanted:
                    wanted.add(node)
                    node = self.parents.get(node, node)
        order = sorted(wanted)  # parents have lower numbers
        tracks: list[Track] = []
        parts, n = {}, 0
        for node in order:
            samples = self.samples.get(node)
            if samples is None:
                continue
            prim = samples.prim
            try:
                found = _tracks(samples, node, scene)
                n += sum(track.values.size for track in found)
                if n > MOST_KEYS:
                    raise prim.error("samples", n, f"at most {MOST_KEYS} numbers of all animations")
                translation, rotation, scale = _parts(prim, self.matrices[node][None])
            except LoadError as error:
                prim.not_shown(samples.key, f"an animation that is not played: {error.reason}")
                continue
            tracks += found
            parts[node] = translation[0], rotation[0], scale[0]
        weights = {node: self.weights[node] for node in order if node in self.weights}
        for node, own in weights.items():
            seconds = (own.times - scene.start) * scene.seconds
            n += own.values.size
            if n <= MOST_KEYS and np.ptp(own.values, axis=0).any():
                tracks.append(Track(node, "weights", "LINEAR", seconds, own.values))
        if not tracks:
            return None
        clip = Clip(NAME, max(float(track.times[-1]) for track in tracks), tuple(tracks))
        parents = {node: self.parents[node] for node in order if node in self.parents}
        at_rest = {node: own.values[0] for node, own in weights.items()}
        return Skeleton(tuple(order), parents, {k: self.matrices[k] for k in order}, parts, at_rest, (clip,))


def _tracks(samples: Samples, node: int, scene: UsdScene) -> list[Track]:
    """The tracks of a node; 0 is the stage's start. Raises LoadError."""
    prim, times, matrices = samples.prim, samples.times, samples.matrices
    if samples.n_keys > len(times):
        prim.not_shown(samples.key, f"the first {len(times)} keys of the animation play")
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any() or not (np.abs(matrices) <= 1e9).all():
        raise prim.error("samples", "times that do not ascend, or no numbers", "finite ascending times and matrices")
    seconds = (times - scene.start) * scene.seconds
    is_after = seconds >= 0.0
    if np.count_nonzero(is_after) < 2:
        raise prim.error("samples", "all before the stage's start", "times from the stage's start on")
    values = _parts(prim, matrices[is_after])
    return [
        Track(node, path, "LINEAR", seconds[is_after], each)
        for path, each in zip(("translation", "rotation", "scale"), values, strict=True)
    ]


def _parts(prim: UsdPrim, matrices: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Translations (N, 3), rotations (N, 4) as quaternions x, y, z, w, each near the one before, and scales (N, 3), of
    matrices (N, 4, 4). Raises LoadError where these do not make the matrices."""
    from scipy.spatial.transform import Rotation

    linear = matrices[:, :3, :3]
    scales = np.linalg.norm(linear, axis=1)
    scales[:, 0] *= np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0)
    if not (np.abs(scales) > 1e-12).all():
        raise prim.error("samples", "a scale of 0", "scales other than 0")
    axes = linear / scales[:, None, :]
    if np.abs(axes.swapaxes(1, 2) @ axes - np.eye(3)).max() > _SHEARED:
        raise prim.error("samples", "a matrix that shears", "translations, rotations and scales")
    rotations = Rotation.from_matrix(axes).as_quat()
    turns = np.where((rotations[1:] * rotations[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    rotations[1:] *= np.cumprod(turns)[:, None]
    found = matrices[:, :3, 3], rotations, scales
    assert np.allclose(matrices_of(*found)[:, :3, :3], linear, atol=1e-3 * np.abs(linear).max())
    return found
