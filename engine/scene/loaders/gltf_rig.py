"""Skins, morph targets and animations of a glTF file, in the form of `engine.scene.rig`, and the meshes at rest.

An invalid rig does not invalidate its mesh: a skin or a channel of an animation that cannot be read is skipped, and the
reason becomes a note.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, printable_name
from engine.scene.loaders.gltf_file import FLOATS, QUANTIZED, SHARES, GltfFile
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.gltf_nodes import MAX_DEPTH, MeshNode, WorldMatrices, node_matrix, node_parts
from engine.scene.mesh import Mesh, place_copies
from engine.scene.rig import INTERPOLATIONS, PATHS, Binding, Clip, Morph, Skeleton, Track, rest_mesh

Float64Array = npt.NDArray[np.float64]
Read = TypeVar("Read")

MAX_TARGETS = 256
MAX_NOTES = 8
LONGEST_NAME = 64  # of an animation, in characters; sessions store it
# Limit of numbers of all tracks, morph targets and bones, plus one for every byte: accessors may be shared, and small
# files must not cost much.
MOST_NUMBERS = 4_000_000
_RESTS, _NOT_PLAYED = "what cannot be read of it does not move", "a channel that is not played: it cannot be read"
OF_A_COPY = 4_000  # numbers whose reading takes as long as one bent copy


@dataclass(frozen=True, eq=False)
class PrimitiveRig:
    """A primitive's own data: joints by their index in a skin and weights (V, K), or None; its morph targets as offsets
    (V, 3) of positions and, or None, of normals."""

    bones: npt.NDArray[np.int32] | None
    weights: Float64Array | None
    targets: tuple[tuple[Float64Array, Float64Array | None], ...]


class RigReader:
    """Reads what moves the meshes of a file, and their state at rest; adds omissions to `notes`. parents: those
    of the file's forest."""

    def __init__(self, file: GltfFile, root: JsonObject, parents: Mapping[int, int]) -> None:
        self._file, self._root, self._parents = file, root, parents
        self._skins = root.children("skins")
        self._is_animated = bool(root.children("animations"))
        self._maps: dict[int, tuple[npt.NDArray[np.int32], Float64Array]] = {}
        self._spent = 0
        self._notes: dict[str, None] = {}

    @cached_property
    def _world(self) -> WorldMatrices:
        return WorldMatrices(self._file, self._parents)

    @property
    def notes(self) -> list[str]:
        """What was left out, and why; the first of many lines."""
        return list(self._notes)[:MAX_NOTES]

    def attached(self, primitive: JsonObject, n_vertices: int, placed: list[MeshNode]) -> PrimitiveRig | None:
        """Joints, weights and morph targets of a primitive; None if nothing moves it, now or at rest."""
        nodes = [self._file.nodes[each.node] for each in placed]
        has_skin = any(node.has("skin") for node in nodes)
        skinned = (
            self._try(primitive, "attributes", lambda: self._influences(primitive, n_vertices)) if has_skin else None
        )
        targets = None
        if primitive.has("targets") and (self._is_animated or any(any(self._weights(node)) for node in nodes)):
            targets = self._try(primitive, "targets", lambda: self._targets(primitive, n_vertices))
        if skinned is None and not targets and not self._is_animated:
            return None
        bones, weights = skinned or (None, None)
        return PrimitiveRig(bones, weights, targets or ())

    def copies(
        self, mesh: Mesh, attached: PrimitiveRig | None, placed: list[MeshNode]
    ) -> list[tuple[Mesh, Binding | None]]:
        """The copies of a primitive at rest, in the order of their nodes, and their bindings, None if nothing moves
        them; copies that only follow their nodes become one mesh, because there may be many."""
        found: list[tuple[Mesh, Binding | None]] = []
        for bends, group in groupby(placed, lambda each: self._bends(attached, self._file.nodes[each.node])):
            rigid: list[MeshNode] = []
            for each in group:
                bound = self._bind_copy(mesh, attached, each) if bends and attached else None
                if bound is not None:
                    found.append(bound)
                elif each.is_flat:
                    node = self._file.nodes[each.node]
                    node.note("transform", "flat, as two scales of 0", "its mesh is not shown")
                else:
                    rigid.append(each)
            if rigid:
                matrices = np.stack([each.matrix for each in rigid])
                found.append((place_copies(mesh, matrices), place_copies_at_nodes(mesh, rigid) if attached else None))
        return found

    def _bends(self, attached: PrimitiveRig | None, node: JsonObject) -> bool:
        """Whether a copy has a skin or morph targets; limited in number by the file's size."""
        if attached is None or not (attached.targets or node.has("skin")):
            return False
        return self._try(node, "mesh", lambda: self._spend_numbers(OF_A_COPY, node, "mesh")) is not None

    def _bind_copy(self, mesh: Mesh, attached: PrimitiveRig, placed: MeshNode) -> tuple[Mesh, Binding] | None:
        """Bind a copy to its skin and its morph targets; None if it has neither after all."""
        node = self._file.nodes[placed.node]
        skinned = self._try(node, "skin", lambda: self._hung(mesh, attached, node))
        if skinned is None and not attached.targets:
            return None
        every = np.arange(len(mesh.vertices), dtype=np.int32)
        morphs = tuple(
            Morph(placed.node, k, every, offsets, normals) for k, (offsets, normals) in enumerate(attached.targets)
        )
        weights = {placed.node: np.array(self._weights(node))}
        if skinned is None and not weights[placed.node].any():
            if placed.is_flat:
                return None
            return place_copies(mesh, placed.matrix[None]), replace(
                place_copies_at_nodes(mesh, [placed]), morphs=morphs
            )
        binding = replace(skinned or place_copies_at_nodes(mesh, [placed]), morphs=morphs)
        world = self._try(node, "skin", lambda: np.stack([self._world.of(k) for k in binding.nodes.tolist()]))
        if world is None:
            return None
        return rest_mesh(mesh, binding, (world @ binding.maps)[:, :3], weights), binding

    def skeleton(self, bindings: Iterable[Binding]) -> Skeleton | None:
        """The nodes that these bindings refer to with all their ancestors, and the animations; None if nothing
        moves."""
        return self._try(self._root, "animations", lambda: self._moving(bindings))

    def _moving(self, bindings: Iterable[Binding]) -> Skeleton | None:
        parents, bindings = self._parents, list(bindings)
        shaped = sorted({morph.node for binding in bindings for morph in binding.morphs})
        wanted = {int(node) for binding in bindings for node in binding.nodes} | set(shaped)
        depths: dict[int, int] = {}
        for node in wanted:
            chain = [node]
            while chain[-1] in parents and len(chain) <= MAX_DEPTH:
                chain.append(parents[chain[-1]])
            if len(chain) > MAX_DEPTH:
                self._note(f"nodes {node}: deeper than {MAX_DEPTH} levels, nothing is animated")
                return None
            depths.update({above: len(chain) - 1 - i for i, above in enumerate(chain)})
        return self._skeleton(sorted(depths, key=lambda node: (depths[node], node)), parents, shaped)

    def _skeleton(self, order: list[int], parents: Mapping[int, int], shaped: list[int]) -> Skeleton | None:
        """A skeleton of these nodes, parents before their children; bindings and tracks use the file's node numbers."""
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
            {k: np.array(self._weights(nodes[k])) for k in shaped},
            tuple(clips),
        )

    def _clips(self, nodes: set[int]) -> list[Clip]:
        """All animations that can be read, with unique names."""
        clips: list[Clip] = []
        taken: set[str] = set()
        n_of: dict[str, int] = {}
        for i, animation in enumerate(self._root.children("animations")):
            tracks = self._tracks(animation, nodes)
            if tracks is None:
                animation.log.left_out.add(id(animation.values))
                continue
            name = own = printable_name(animation.text("name") or "", LONGEST_NAME) or f"animation {i}"
            while name in taken:
                n_of[own] = n_of.get(own, 1) + 1
                name = f"{own} ({n_of[own]})"
            taken.add(name)
            clips.append(Clip(name, max((float(t.times[-1]) for t in tracks), default=0.0), tuple(tracks)))
        return clips

    def _tracks(self, animation: JsonObject, nodes: set[int]) -> list[Track] | None:
        """The tracks of an animation; None if it has channels, and none of them can be read."""
        samplers, channels = animation.children("samplers"), animation.children("channels")
        tracks: dict[tuple[int, str], Track] = {}
        n_faulty = 0
        for channel in channels:
            read = partial(self._channel, channel, samplers, nodes, tracks.keys())
            found = self._try(channel, "target", read, _NOT_PLAYED)
            if found is None:
                channel.log.left_out.add(id(channel.values))
            n_faulty += found is None
            tracks |= {(track.node, track.path): track for track in found or ()}
        return None if channels and n_faulty == len(channels) else list(tracks.values())

    def _channel(
        self, channel: JsonObject, samplers: list[JsonObject], nodes: set[int], taken: Collection[tuple[int, str]]
    ) -> list[Track]:
        """The track of a channel, none where nothing shown moves by it; taken: nodes and paths of others."""
        target = channel.child("target")
        path = target.text("path")
        if not target.has("node") or path not in (*PATHS, "weights"):
            channel.leave_out("target", "a property that does not move: only nodes and morph targets do")
            return []
        node = target.integer("node", 0, len(self._file.nodes) - 1)
        if node not in nodes:
            channel.leave_out("target", "a node that does not move: no mesh hangs from it")
            return []
        if (node, path) in taken:
            raise channel.error("target", f"{path} of nodes {node} a second time", "each once")
        if path != "weights" and self._file.nodes[node].has("matrix"):
            raise channel.error("target", f"nodes {node}, which has a matrix", "translation, rotation, scale")
        sampler = samplers[channel.integer("sampler", 0, len(samplers) - 1)]
        width = PATHS.get(path) or self._n_targets(self._file.nodes[node])
        return [self._track(sampler, node, path, width)] if width else []

    def _track(self, sampler: JsonObject, node: int, path: str, width: int) -> Track:
        interpolation = sampler.text("interpolation") or "LINEAR"
        if interpolation not in INTERPOLATIONS:
            raise sampler.error("interpolation", interpolation, f"one of {', '.join(INTERPOLATIONS)}")
        times = self._file.read(sampler, "input", "SCALAR", FLOATS).astype(np.float64)[:, 0]
        if not np.isfinite(times).all() or (times < 0.0).any() or (np.diff(times) <= 0.0).any():
            raise sampler.error("input", "times that do not ascend from 0", "finite ascending seconds")
        kind = {3: "VEC3", 4: "VEC4"}[width] if path != "weights" else "SCALAR"
        components = FLOATS if path in ("translation", "scale") else QUANTIZED
        values = self._file.read_shares(sampler, "output", kind, components)
        shape = (len(times), 3, width) if interpolation == "CUBICSPLINE" else (len(times), width)
        if values.size != np.prod(shape):
            raise sampler.error("output", f"{values.size} numbers", f"{np.prod(shape)} for {len(times)} keys")
        if not (np.abs(values) <= 1e9).all():
            raise sampler.error("output", "values that are not finite", "finite numbers up to 1e+09")
        self._spend_numbers(values.size, sampler, "output")
        values = values.reshape(shape)
        keys = values[:, 1] if interpolation == "CUBICSPLINE" else values
        if path == "rotation" and not (np.linalg.norm(keys, axis=1) > 1e-6).all():
            raise sampler.error("output", "a quaternion of length 0", "unit quaternions")
        return Track(node, str(path), interpolation, times, values)

    def _n_targets(self, node: JsonObject) -> int:
        """Number of morph targets of a node's mesh."""
        if not node.has("mesh"):
            return 0
        mesh = self._file.meshes[node.integer("mesh", 0, len(self._file.meshes) - 1)]
        return max((len(primitive.children("targets")) for primitive in mesh.children("primitives")), default=0)

    def _weights(self, node: JsonObject) -> tuple[float, ...]:
        """Default weights of a node's morph targets: its own, or its mesh's, or 0."""
        count = self._n_targets(node)
        if not count:
            return ()
        mesh = self._file.meshes[node.integer("mesh", 0, len(self._file.meshes) - 1)]
        owner, none = node if node.has("weights") else mesh, (0.0,) * count
        mesh.mark_read("weights")  # a node's own replace them
        return owner.numbers("weights", count, none)

    def _influences(self, primitive: JsonObject, n_vertices: int) -> tuple[npt.NDArray[np.int32], Float64Array] | None:
        """Joints (V, K) and weights (V, K), which sum to 1 or are all 0; None if the file has none."""
        attributes = primitive.child("attributes")
        joints: list[npt.NDArray[np.int32]] = []
        weights: list[Float64Array] = []
        while attributes.has(f"JOINTS_{len(joints)}") and attributes.has(f"WEIGHTS_{len(joints)}"):
            k = len(joints)
            self._spend_numbers(4 * n_vertices, attributes, f"JOINTS_{k}")
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

    def _targets(self, primitive: JsonObject, n_vertices: int) -> tuple[tuple[Float64Array, Float64Array | None], ...]:
        """Offsets (V, 3) of positions and of normals, None if missing, of each morph target."""
        targets = primitive.children("targets")
        if len(targets) > MAX_TARGETS:
            raise primitive.error("targets", len(targets), f"at most {MAX_TARGETS}")
        self._spend_numbers(6 * n_vertices * len(targets), primitive, "targets")
        return tuple((_or_zero(self._offsets(each, "POSITION", n_vertices), n_vertices),
                      self._offsets(each, "NORMAL", n_vertices)) for each in targets)  # fmt: skip

    def _offsets(self, target: JsonObject, key: str, n_vertices: int) -> Float64Array | None:
        if not target.has(key):
            return None
        offsets = self._file.read_floats(target, key, "VEC3")
        if len(offsets) != n_vertices or not (np.abs(offsets) <= 1e9).all():
            raise target.error(key, f"{len(offsets)} offsets", f"{n_vertices} finite ones, as there are positions")
        return offsets

    def _hung(self, mesh: Mesh, attached: PrimitiveRig, node: JsonObject) -> Binding | None:
        """Bind a mesh to the joints of a node's skin; a vertex without weights to the first joint that it names."""
        if not node.has("skin"):
            return None
        skin = node.integer("skin", 0, len(self._skins) - 1)
        if attached.bones is None or attached.weights is None:
            self._note(f"{node.place}: a mesh without joints and weights follows its node and not its skin")
            return None
        joints, maps = self._skin(skin)
        self._spend_numbers(maps.size, node, "skin")
        weights = attached.weights.copy()
        weights[~(weights > 0.0).any(axis=1), 0] = 1.0
        outside = (attached.bones >= len(joints)) & (weights > 0.0)
        if outside.any():
            k = int(np.argmax(outside.any(axis=1)))
            expected = f"joints from 0 to {len(joints) - 1}"
            raise node.error(f"joint of vertex {k}", int(attached.bones[k][outside[k]][0]), expected)
        bones = np.where(weights > 0.0, attached.bones, 0).astype(np.int32)
        return Binding(joints, maps, bones, weights, mesh.vertices, _or_zero(mesh.normals, len(mesh.vertices)))

    def _skin(self, number: int) -> tuple[npt.NDArray[np.int32], Float64Array]:
        """A skin's joints (J,) and inverse bind matrices (J, 4, 4)."""
        if number not in self._maps:
            skin = self._skins[number]
            joints = skin.indices("joints", len(self._file.nodes))
            if not joints or joints != skin.raw("joints"):
                raise skin.error("joints", "no nodes" if joints else "none", "at least one, all of them nodes")
            maps = np.broadcast_to(np.eye(4), (len(joints), 4, 4))
            if skin.has("inverseBindMatrices"):
                columns = self._file.read(skin, "inverseBindMatrices", "MAT4", FLOATS).astype(np.float64)
                if len(columns) < len(joints) or not (np.abs(columns) <= 1e9).all():
                    expected = f"{len(joints)} finite ones, as there are joints"
                    raise skin.error("inverseBindMatrices", f"{len(columns)} matrices", expected)
                maps = columns[: len(joints)].reshape(-1, 4, 4).swapaxes(1, 2)
            self._maps[number] = np.array(joints, np.int32), maps
        return self._maps[number]

    def _try(self, owner: JsonObject, key: str, read: Callable[[], Read], effect: str = _RESTS) -> Read | None:
        """What `read` returns; None where the file is wrong, which is listed under the key."""
        try:
            return read()
        except LoadError as error:
            self._note(f"{error.reason}: {owner.place or key} rests")
            owner.not_shown(key, effect)
            return None

    def _note(self, line: str) -> None:
        self._notes[line] = None

    def _spend_numbers(self, count: int, owner: JsonObject, key: str) -> int:
        """Check that these numbers do not exceed the limit; returns how many are left."""
        self._spent += count
        left = MOST_NUMBERS + self._file.buffers.n_bytes - self._spent
        if left < 0:
            raise owner.error(key, f"{count} numbers more", "fewer in a file of this size")
        return left


def place_copies_at_nodes(mesh: Mesh, placed: list[MeshNode]) -> Binding:
    """Bindings of copies of a mesh that follow their nodes."""
    nodes = np.array([each.node for each in placed], np.int32)
    bones = np.repeat(np.arange(len(placed), dtype=np.int32), len(mesh.vertices))[:, None]
    maps = np.broadcast_to(np.eye(4), (len(placed), 4, 4))
    if any(each.instance is not None for each in placed):
        maps = np.stack([np.eye(4) if each.instance is None else each.instance for each in placed])
    places = np.tile(mesh.vertices, (len(placed), 1))
    normals = np.tile(_or_zero(mesh.normals, len(mesh.vertices)), (len(placed), 1))
    return Binding(nodes, maps, bones, np.ones(bones.shape), places, normals)


def _or_zero(vectors: Float64Array | None, n_vertices: int) -> Float64Array:
    return np.zeros((n_vertices, 3)) if vectors is None else vectors
