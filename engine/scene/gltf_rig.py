"""Skins, morph targets and animations of a GLB file: what `engine.scene.rig` describes.

What moves a mesh is worth less than the mesh: a skin or an animation that cannot be read is left out, and the line that
says why becomes a note.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from engine.errors import LoadError
from engine.scene.glb import JsonObject
from engine.scene.gltf_file import ANY_SHARES, FLOATS, SHARES, GltfFile
from engine.scene.gltf_nodes import MAX_DEPTH, MeshNode, node_matrix, node_parts, parents_of
from engine.scene.mesh import Mesh
from engine.scene.rig import INTERPOLATIONS, PATHS, Binding, Clip, Morph, Skeleton, Track

Floats = npt.NDArray[np.float64]
Read = TypeVar("Read")

MAX_TARGETS = 256
MAX_NOTES = 8
# Numbers of all tracks, morph targets and bones, one more for every byte: accessors may be shared, and small files must
# not cost much.
MOST_NUMBERS = 4_000_000
OF_A_COPY = 4_000  # numbers that a bent copy costs the time of


@dataclass(frozen=True, eq=False)
class Attached:
    """What a primitive says of its own: joints by their places in a skin and weights (V, K), or None; its morph targets
    as offsets (V, 3) of places and, or None, of normals."""

    bones: npt.NDArray[np.int32] | None
    weights: Floats | None
    targets: tuple[tuple[Floats, Floats | None], ...]


class RigReader:
    """Reads what moves the meshes of a file; `notes` grow by what is left out."""

    def __init__(self, file: GltfFile, root: JsonObject) -> None:
        self._file, self._root = file, root
        self._skins = root.children("skins")
        self._maps: dict[int, tuple[npt.NDArray[np.int32], Floats]] = {}
        self._left = MOST_NUMBERS + len(file.binary)
        self._notes: dict[str, None] = {}

    @property
    def notes(self) -> list[str]:
        """What was left out, and why; of many lines the first."""
        return list(self._notes)[:MAX_NOTES]

    def attached(self, primitive: JsonObject, n_vertices: int) -> Attached:
        """Joints, weights and morph targets of a primitive."""
        skinned = self._try(primitive.place, lambda: self._influences(primitive, n_vertices))
        targets = self._try(primitive.place, lambda: self._targets(primitive, n_vertices))
        bones, weights = skinned or (None, None)
        return Attached(bones, weights, targets or ())

    def bindings(self, mesh: Mesh, attached: Attached, placed: list[MeshNode]) -> list[Binding]:
        """Of the copies of a primitive that stand where nodes put them, in their order; of those that only follow their
        nodes one for all that stand together, as there may be many."""
        found: list[Binding] = []
        for bends, copies in groupby(placed, lambda each: self._bends(attached, self._file.nodes[each.node])):
            if bends:
                found += [self._binding(mesh, attached, each) for each in copies]
            else:
                found.append(_following(list(copies), len(mesh.vertices)))
        return found

    def _bends(self, attached: Attached, node: JsonObject) -> bool:
        """Whether a copy has a skin or morph targets; no more of them than the file is worth."""
        if not attached.targets and not node.has("skin"):
            return False
        return self._try(node.place, lambda: self._spend(OF_A_COPY, node, "mesh")) is not None

    def _binding(self, mesh: Mesh, attached: Attached, placed: MeshNode) -> Binding:
        own = np.array([placed.node], np.int32), np.eye(4)[None]
        rigid = Binding(*own, np.zeros((len(mesh.vertices), 1), np.int32), np.ones((len(mesh.vertices), 1)))
        skinned = self._try(f"nodes {placed.node}", lambda: self._hung(attached, self._file.nodes[placed.node], own))
        every = np.arange(len(mesh.vertices), dtype=np.int32)
        morphs = tuple(
            Morph(placed.node, k, every, offsets, normals) for k, (offsets, normals) in enumerate(attached.targets)
        )
        return replace(skinned or rigid, morphs=morphs).placed(placed.matrix, mesh.normals)

    def skeleton(self, bindings: Iterable[Binding]) -> Skeleton | None:
        """The nodes that these hang on with all above them, and the animations; None where nothing moves."""
        return self._try("animations", lambda: self._moving(bindings))

    def _moving(self, bindings: Iterable[Binding]) -> Skeleton | None:
        parents, bindings = parents_of(self._file), list(bindings)
        wanted = {int(node) for binding in bindings for node in binding.nodes}
        shaped = sorted({morph.node for binding in bindings for morph in binding.morphs})
        depths: dict[int, int] = {}
        for node in wanted:
            way = [node]
            while way[-1] in parents and len(way) <= MAX_DEPTH:
                way.append(parents[way[-1]])
            if len(way) > MAX_DEPTH:
                self._note(f"nodes {node}: deeper than {MAX_DEPTH} levels, nothing is animated")
                return None
            depths.update({above: len(way) - 1 - i for i, above in enumerate(way)})
        return self._skeleton(sorted(depths, key=lambda node: (depths[node], node)), parents, shaped)

    def _skeleton(self, order: list[int], parents: dict[int, int], shaped: list[int]) -> Skeleton | None:
        """Of these nodes, parents before their children; their numbers stay the file's in bindings and tracks."""
        nodes = self._file.nodes
        clips = self._clips(set(order))
        if not any(clip.tracks for clip in clips):
            return None
        moved = {track.node for clip in clips for track in clip.tracks}
        return Skeleton(
            tuple(order),
            {k: parents[k] for k in order if k in parents},
            {k: node_matrix(nodes[k]) for k in order},
            {k: node_parts(nodes[k]) for k in moved},
            {k: self._rest_weights(nodes[k]) for k in shaped},
            tuple(clips),
        )

    def _clips(self, nodes: set[int]) -> list[Clip]:
        """All animations that can be read, each by a name of its own."""
        clips: list[Clip] = []
        taken: set[str] = set()
        for i, animation in enumerate(self._root.children("animations")):
            tracks = self._try(animation.place, lambda a=animation: self._tracks(a, nodes))  # type: ignore[misc]
            if tracks is None:
                continue
            name = (animation.text("name") or "").strip() or f"animation {i}"
            while name in taken:
                name += "+"
            taken.add(name)
            clips.append(Clip(name, max((float(t.times[-1]) for t in tracks), default=0.0), tuple(tracks)))
        return clips

    def _tracks(self, animation: JsonObject, nodes: set[int]) -> list[Track]:
        samplers = animation.children("samplers")
        tracks, taken = [], set()
        for channel in animation.children("channels"):
            target = channel.child("target")
            path = target.text("path")
            if not target.has("node") or path not in (*PATHS, "weights"):
                continue  # an extension's; a reader without it passes it over
            node = target.integer("node", 0, len(self._file.nodes) - 1)
            if node not in nodes:
                continue
            if (node, path) in taken:
                raise channel.error("target", f"{path} of nodes {node} a second time", "each once")
            taken.add((node, path))
            if path != "weights" and self._file.nodes[node].has("matrix"):
                raise channel.error("target", f"nodes {node}, which has a matrix", "translation, rotation, scale")
            sampler = samplers[channel.integer("sampler", 0, len(samplers) - 1)]
            width = PATHS.get(path) or self._n_targets(self._file.nodes[node])
            if width:
                tracks.append(self._track(sampler, node, path, width))
        return tracks

    def _track(self, sampler: JsonObject, node: int, path: str, width: int) -> Track:
        interpolation = sampler.text("interpolation") or "LINEAR"
        if interpolation not in INTERPOLATIONS:
            raise sampler.error("interpolation", interpolation, f"one of {', '.join(INTERPOLATIONS)}")
        times = self._file.read(sampler, "input", "SCALAR", FLOATS).astype(np.float64)[:, 0]
        if not np.isfinite(times).all() or (times < 0.0).any() or (np.diff(times) <= 0.0).any():
            raise sampler.error("input", "times that do not ascend from 0", "finite ascending seconds")
        kind = {3: "VEC3", 4: "VEC4"}[width] if path != "weights" else "SCALAR"
        components = FLOATS if path in ("translation", "scale") else ANY_SHARES
        values = self._file.read_shares(sampler, "output", kind, components)
        shape = (len(times), 3, width) if interpolation == "CUBICSPLINE" else (len(times), width)
        if values.size != np.prod(shape):
            raise sampler.error("output", f"{values.size} numbers", f"{np.prod(shape)} for {len(times)} keys")
        if not (np.abs(values) <= 1e9).all():
            raise sampler.error("output", "values that are not finite", "finite numbers up to 1e+09")
        self._spend(values.size, sampler, "output")
        values = values.reshape(shape)
        keys = values[:, 1] if interpolation == "CUBICSPLINE" else values
        if path == "rotation" and not (np.linalg.norm(keys, axis=1) > 1e-6).all():
            raise sampler.error("output", "a quaternion of length 0", "unit quaternions")
        return Track(node, str(path), interpolation, times, values)

    def _n_targets(self, node: JsonObject) -> int:
        """How many morph targets a node's mesh has."""
        if not node.has("mesh"):
            return 0
        mesh = self._file.meshes[node.integer("mesh", 0, len(self._file.meshes) - 1)]
        return max((len(primitive.children("targets")) for primitive in mesh.children("primitives")), default=0)

    def _rest_weights(self, node: JsonObject) -> Floats:
        """Of a node's morph targets where no animation says them: its own, or its mesh's, or 0."""
        count = self._n_targets(node)
        mesh = self._file.meshes[node.integer("mesh", 0, len(self._file.meshes) - 1)]
        owner = node if node.has("weights") else mesh
        return np.array(owner.numbers("weights", count, (0.0,) * count))

    def _influences(self, primitive: JsonObject, n_vertices: int) -> tuple[npt.NDArray[np.int32], Floats] | None:
        """Joints (V, K) and weights (V, K), which sum to 1 or are all 0; None where the file has none."""
        attributes = primitive.child("attributes")
        joints: list[npt.NDArray[np.int32]] = []
        weights: list[Floats] = []
        while attributes.has(f"JOINTS_{len(joints)}") and attributes.has(f"WEIGHTS_{len(joints)}"):
            k = len(joints)
            joints.append(self._file.read(attributes, f"JOINTS_{k}", "VEC4", (5121, 5123)).astype(np.int32))
            weights.append(self._file.read_shares(attributes, f"WEIGHTS_{k}", "VEC4", SHARES))
            if not len(joints[k]) == len(weights[k]) == n_vertices:
                found = f"{len(joints[k])} and {len(weights[k])}"
                raise attributes.error(f"JOINTS_{k}, WEIGHTS_{k}", found, f"{n_vertices}, as there are positions")
        if not joints:
            return None
        shares = np.concatenate(weights, axis=1)
        if not ((shares >= 0.0) & (shares <= 1e9)).all():
            k = int(np.argmin(((shares >= 0.0) & (shares <= 1e9)).all(axis=1)))
            raise attributes.error(f"WEIGHTS of vertex {k}", shares[k].tolist(), "finite numbers of at least 0")
        total = shares.sum(axis=1, keepdims=True)
        return np.concatenate(joints, axis=1), np.where(
            total > 1e-12, shares / np.where(total > 1e-12, total, 1.0), 0.0
        )

    def _targets(self, primitive: JsonObject, n_vertices: int) -> tuple[tuple[Floats, Floats | None], ...]:
        """Offsets (V, 3) of places and of normals, None without, of each morph target."""
        targets = primitive.children("targets")
        if len(targets) > MAX_TARGETS:
            raise primitive.error("targets", len(targets), f"at most {MAX_TARGETS}")
        self._spend(6 * n_vertices * len(targets), primitive, "targets")
        return tuple((_or_zero(self._offsets(each, "POSITION", n_vertices), n_vertices),
                      self._offsets(each, "NORMAL", n_vertices)) for each in targets)  # fmt: skip

    def _offsets(self, target: JsonObject, key: str, n_vertices: int) -> Floats | None:
        if not target.has(key):
            return None
        offsets = self._file.read(target, key, "VEC3", FLOATS).astype(np.float64)
        if len(offsets) != n_vertices or not (np.abs(offsets) <= 1e9).all():
            raise target.error(key, f"{len(offsets)} offsets", f"{n_vertices} finite ones, as there are positions")
        return offsets

    def _hung(self, attached: Attached, node: JsonObject, own: tuple[npt.NDArray[np.int32], Floats]) -> Binding | None:
        """On the joints of a node's skin; a vertex without weights stays on the node itself, which is bone 0."""
        if not node.has("skin"):
            return None
        skin = node.integer("skin", 0, len(self._skins) - 1)
        if attached.bones is None or attached.weights is None:
            self._note(f"{node.place}: a mesh without joints and weights follows its node and not its skin")
            return None
        joints, maps = self._skin(skin)
        self._spend(maps.size, node, "skin")
        outside = (attached.bones >= len(joints)) & (attached.weights > 0.0)
        if outside.any():
            k = int(np.argmax(outside.any(axis=1)))
            expected = f"joints from 0 to {len(joints) - 1}"
            raise node.error(f"joint of vertex {k}", int(attached.bones[k][outside[k]][0]), expected)
        weights = attached.weights.copy()
        bones = np.where(weights > 0.0, attached.bones + 1, 0).astype(np.int32)
        weights[~(weights > 0.0).any(axis=1), 0] = 1.0
        return Binding(np.concatenate([own[0], joints]), np.concatenate([own[1], maps]), bones, weights)

    def _skin(self, number: int) -> tuple[npt.NDArray[np.int32], Floats]:
        """A skin's joints (J,) and inverse bind matrices (J, 4, 4)."""
        if number not in self._maps:
            skin = self._skins[number]
            joints = skin.indices("joints", len(self._file.nodes))
            if not joints:
                raise skin.error("joints", "none", "at least one")
            maps = np.broadcast_to(np.eye(4), (len(joints), 4, 4))
            if skin.has("inverseBindMatrices"):
                columns = self._file.read(skin, "inverseBindMatrices", "MAT4", FLOATS).astype(np.float64)
                if len(columns) < len(joints) or not (np.abs(columns) <= 1e9).all():
                    expected = f"{len(joints)} finite ones, as there are joints"
                    raise skin.error("inverseBindMatrices", f"{len(columns)} matrices", expected)
                maps = columns[: len(joints)].reshape(-1, 4, 4).swapaxes(1, 2)
            self._maps[number] = np.array(joints, np.int32), maps
        return self._maps[number]

    def _try(self, place: str, read: Callable[[], Read]) -> Read | None:
        try:
            return read()
        except LoadError as error:
            self._note(f"{error.what} = {error.value}, expected {error.expected}: {place} rests")
            return None

    def _note(self, line: str) -> None:
        self._notes[line] = None

    def _spend(self, count: int, owner: JsonObject, key: str) -> int:
        """What is left then."""
        self._left -= count
        if self._left < 0:
            raise owner.error(key, f"{count} numbers more", "fewer in a file of this size")
        return self._left


def _following(placed: list[MeshNode], n_vertices: int) -> Binding:
    """Of copies that stand on their nodes, each of so many vertices."""
    nodes = np.array([each.node for each in placed], np.int32)
    bones = np.repeat(np.arange(len(placed), dtype=np.int32), n_vertices)[:, None]
    maps = np.linalg.inv(np.stack([each.matrix for each in placed]))
    return Binding(nodes, maps, bones, np.ones(bones.shape))


def _or_zero(offsets: Floats | None, n_vertices: int) -> Floats:
    return np.zeros((n_vertices, 3)) if offsets is None else offsets
