"""Skins of USD that an animation bends, in the form of `engine.scene.rig`: joints as nodes, influences as weights, and
blend shapes as morph targets.

The mesh at rest is the one that the library has posed; the animation moves it from there, by linear blending. Where
that would not give the library's pose, as under dual quaternions, or what is needed is missing, the mesh rests, and is
listed. A surface by subdivision has the points and weights of its control mesh, refined as its places are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from engine.core.errors import LoadError
from engine.scene.loaders.usd_meshes import Surface
from engine.scene.loaders.usd_prims import Float64Array, Int64Array, UsdPrim, UsdScene
from engine.scene.loaders.usd_rig import Samples, UsdNodes, Weights
from engine.scene.mesh import Mesh, normalize
from engine.scene.rig import Binding, Morph, normal_matrices

MOST_BONES = 8  # of a vertex of a subdivided surface
MOST_WEIGHTS = 1_000_000  # of one, which refining makes sixteen times as many
# Of the extent of a mesh: how far our pose may be from the library's, of polygons and of subdivided surfaces.
_NEAR, _NEAR_SMOOTH = 1e-3, 0.1
_KEY = "skel:skeleton"


@dataclass(frozen=True)
class _Joints:
    """Of a skeleton: its prim, and the nodes (J,) and inverse binds (J, 4, 4) of its joints."""

    prim: UsdPrim
    nodes: Int64Array
    inverses: Float64Array


@dataclass
class UsdBindings:
    """The skins of a stage. skeletons: the nodes that those at rest hang from, by their paths; resting: the animations
    of which some mesh is not played."""

    scene: UsdScene
    nodes: UsdNodes
    skeletons: Mapping[str, int]
    resting: set[str] = field(default_factory=set)
    played: set[str] = field(default_factory=set)
    _joints: dict[str, _Joints] = field(default_factory=dict)
    _worlds: dict[int, Float64Array] = field(default_factory=dict)

    @property
    def are_moving(self) -> bool:
        """Whether anything in the stage is animated."""
        return bool(self.nodes.samples or self._joints)

    def add_joints(self) -> None:
        """Add the joints of all skeletons that move; those that cannot be read are listed."""
        for path, node in self.skeletons.items():
            prim = self.scene.by_path[path]
            if "joints" in prim.own:
                try:
                    self._joints[path] = self._read_joints(prim, node)
                except LoadError as error:
                    prim.not_shown("joints", f"an animation that is not played: {error.reason}")

    def binding(self, surface: Surface, used: Int64Array, mesh: Mesh, n_places: int) -> Binding | None:
        """The binding of some vertices (V,) of a skinned surface, which are those of a mesh in the file's frame; None
        where it is none, or rests. n_places: how often the surface is shown."""
        prim = surface.prim
        own = prim.own.get("skin")
        if not isinstance(own, dict):
            if "posed" in prim.own and self._joints:
                prim.not_shown(_KEY, "a mesh that rests in its pose: its shapes or joints are of another kind")
            return None
        animation = ""
        try:
            joints = self._joints.get(str(own.get("skeleton")))
            if joints is None:
                raise prim.error(_KEY, own.get("skeleton"), "a skeleton that moves")
            animation = str(joints.prim.own["joints"].get("animation"))
            if n_places != 1:
                raise prim.error(_KEY, f"{n_places} instances", "one")
            found = self._bind(surface, own, joints, used, mesh)
        except LoadError as error:
            prim.not_shown(_KEY, f"a mesh that rests in its pose: {error.reason}")
            self.resting.add(animation)
            return None
        self.played.add(animation)
        return found

    def _read_joints(self, prim: UsdPrim, node: int) -> _Joints:
        rows = prim.inner("joints")
        parents = rows.stored("parents")
        times, binds = rows.stored("times"), rows.stored("binds", 16)
        places = rows.stored("locals", 16)
        if parents is None or times is None or binds is None or places is None:
            raise prim.error("joints", "no arrays", "parents, times, places and binds")
        n, keys = len(parents), rows.own.get("n_keys", 0)
        if len(binds) != n or len(places) != n * len(times) or not len(times) or (parents >= np.arange(n)).any():
            raise prim.error("joints", f"{len(places)} places", f"{n} at {len(times)} times, parents first")
        prim.affine_all(binds.reshape(-1, 4, 4))
        by_time = prim.affine_all(places.reshape(-1, 4, 4)).reshape(len(times), n, 4, 4)
        nodes = np.empty(n, np.int64)
        for k, parent in enumerate(parents.astype(int).tolist()):
            own = by_time[:, k]
            samples = Samples(prim, "joints", times, own, int(keys)) if np.ptp(own, axis=0).any() else None
            nodes[k] = self.nodes.add(nodes[parent] if parent >= 0 else node, by_time[0, k], samples)
        try:
            inverses = np.asarray(np.linalg.inv(binds.reshape(-1, 4, 4)), np.float64)
        except np.linalg.LinAlgError:
            raise prim.error("bindTransforms", "a flat transform", "three axes") from None
        return _Joints(prim, nodes, inverses)

    def _bind(
        self, surface: Surface, own: Mapping[str, object], joints: _Joints, used: Int64Array, mesh: Mesh
    ) -> Binding:
        prim, rows = surface.prim, surface.prim.inner("skin")
        points, bind = rows.stored("points", 3), rows.stored("bind")
        n_points = surface.counts[0]
        if points is None or bind is None or len(points) != n_points or bind.size != 16:
            raise prim.error("points", 0 if points is None else len(points), f"{n_points}, as in the pose")
        n = len(points)
        bones, weights = (_wide(rows.stored(key), n) for key in ("bones", "weights"))
        if bones is None or weights is None or bones.shape != weights.shape or not bones.size:
            raise prim.error("primvars:skel:jointIndices", "other numbers", f"rows for {n} points, as the weights have")
        if not (0 <= bones).all() or not (bones < len(joints.nodes)).all() or not (np.abs(weights) <= 1e6).all():
            raise prim.error("primvars:skel:jointIndices", "indices or weights", f"joints to {len(joints.nodes) - 1}")
        shares, chosen = _influences(surface, bones.astype(np.int64), weights, len(joints.nodes), used)
        numbers, chosen = np.unique(chosen, return_inverse=True)
        maps = joints.inverses[numbers] @ prim.affine(bind)
        nodes = joints.nodes[numbers].astype(np.int32)
        places = surface.of_points(points)[used]
        morphs, start = self._morphs(surface, rows, used, joints)
        found = Binding(
            nodes, maps, chosen.reshape(shares.shape).astype(np.int32), shares, places, np.zeros_like(places), morphs
        )
        # G_b B_b at rest, which must give the library's pose.
        at_rest = (np.stack([self._world(node) for node in nodes.tolist()]) @ maps)[:, :3]
        skin = found.blend_matrices(at_rest)
        before, _ = found.morph_vertices(start)
        posed = np.einsum("vab,vb->va", skin[..., :3], before) + skin[..., 3]
        extent = float(np.ptp(mesh.vertices, axis=0).max(initial=0.0))
        distance = float(np.abs(posed - mesh.vertices).max(initial=0.0))
        if not distance <= (_NEAR_SMOOTH if surface.steps else _NEAR) * max(extent, 1e-12):
            raise prim.error("skel:skinningMethod", f"a pose that is {distance:.3g} off", "linear blending")
        if mesh.normals is None:
            return found
        turns = found.blend_matrices(normal_matrices(at_rest))
        is_flat = np.abs(np.linalg.det(turns)) < 1e-12
        turns[is_flat] = np.eye(3)
        normals = np.asarray(np.linalg.solve(turns, mesh.normals[..., None])[..., 0], np.float64)
        return replace(found, normals=normalize(normals, mesh.normals))

    def _morphs(
        self, surface: Surface, rows: UsdPrim, used: Int64Array, joints: _Joints
    ) -> tuple[tuple[Morph, ...], dict[int, Float64Array]]:
        """The blend shapes as morph targets of a node of their own, and their weights at rest by that node."""
        n, offsets = surface.counts[0], rows.stored("offsets", 3)
        times, weights = joints.prim.inner("joints").stored("times"), rows.stored("shapes")
        if offsets is None or weights is None or times is None:
            return (), {}
        if not n or len(offsets) % n or len(weights) * n != len(offsets) * len(times):
            raise rows.error("skel:blendShapes", f"{len(offsets)} offsets", f"{n} for each shape")
        offsets, values = offsets.reshape(-1, n, 3), weights.reshape(len(times), -1)
        if not (np.abs(offsets) <= 1e9).all() or not (np.abs(values) <= 1e6).all():
            raise rows.error("skel:blendShapes", "numbers that are none", "finite offsets and weights")
        node = self.nodes.shaped.get(surface.prim.place)
        if node is None:
            node = self.nodes.add(int(joints.nodes[0]), np.eye(4))
            self.nodes.shaped[surface.prim.place] = node
            self.nodes.weights[node] = Weights(joints.prim, times, values)
        morphs = []
        for k, rows_of in enumerate(offsets):
            refined = surface.of_points(rows_of)[used]
            moved = np.flatnonzero(refined.any(axis=1)).astype(np.int32)
            if len(moved):
                morphs.append(Morph(node, k, moved, refined[moved], None))
        return tuple(morphs), {node: values[0]}

    def _world(self, node: int) -> Float64Array:
        """The matrix (4, 4) of a node to the file's frame."""
        if node not in self._worlds:
            own, parent = self.nodes.matrices[node], self.nodes.parents.get(node)
            self._worlds[node] = own if parent is None else self._world(parent) @ own
        return self._worlds[node]


def _wide(numbers: Float64Array | None, n: int) -> Float64Array | None:
    """The rows (n, N) of a list of numbers; None where these are none."""
    if numbers is None or not n or numbers.size % n or not np.isfinite(numbers).all():
        return None
    return numbers.reshape(n, -1)


def _influences(
    surface: Surface, bones: Int64Array, weights: Float64Array, n_joints: int, used: Int64Array
) -> tuple[Float64Array, Int64Array]:
    """Weights (V, K), which sum to 1, and joints (V, K) of some vertices (V,) of a surface, by those (P, N) of its
    points. Raises LoadError."""
    if surface.steps:
        numbers, short = np.unique(bones, return_inverse=True)
        if len(bones) * len(numbers) > MOST_WEIGHTS:
            raise surface.prim.error("points", len(bones), f"{MOST_WEIGHTS // len(numbers)} of a subdivided skin")
        dense = np.zeros((len(bones), len(numbers)))
        np.add.at(dense, (np.arange(len(bones))[:, None], short.reshape(bones.shape)), weights)
        dense = surface.of_points(dense)[used]
        order = np.argsort(-dense, axis=1)[:, :MOST_BONES]
        weights, bones = np.take_along_axis(dense, order, axis=1), numbers[order]
    else:
        weights = surface.of_points(weights)[used]
        bones = np.round(surface.of_points(bones.astype(np.float64))[used]).astype(np.int64)
    total = weights.sum(axis=1, keepdims=True)
    if not (np.abs(total) > 1e-9).all():
        raise surface.prim.error("primvars:skel:jointWeights", "points without weights", "a joint for each point")
    return weights / total, bones
