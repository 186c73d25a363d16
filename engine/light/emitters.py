"""Emitters: emissive surfaces of the scene as flat triangular patches, and the tree of which these are the leaves.

Every emitting triangle is a root. A node is bisected at its longest edge, which gives well-shaped patches. An
importance decides which node is bisected next: its area (`emitter_patches`: equal areas, no emitter finer than
another), or its effect at the points that see it (`emitter_tree` with `visible_importance`). By area, large panels far
away use up the patches: the error of a stairwell with thirteen lamps was 9 % with 256 patches and 3 % with 4,096.

Emission is one-sided: a patch emits to the side of its normal, given by the order of its corners (counter-clockwise
seen from the bright side).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.threads import even_parts, on_threads
from engine.light.cones import all_round, cone_shares
from engine.light.environment import LUMINANCE

# The R2 sequence for the samples of patches, of the lowest discrepancy in the plane [Roberts18]: neighbours differ.
R2 = np.array([0.7548776662466927, 0.5698402909980532])

# The largest edge of a merged triangle's sources, relative to the edge of a square of the merged area; and the number
# of triangles above which none are divided further.
OF_A_PIECE, MOST_CUT = 2.0, 1 << 16
# The least number of triangles of a merged object, so that a bulb that is small beside a panel remains round: the error
# of the light around a ball of 64 triangles is 0.7 %, of 32 2 %, of 16 5 %.
FEWEST_OF_AN_OBJECT = 64

Float64Array = NDArray[np.float64]
# The radiance (K, 3) of parts (K, 3, 3) of triangles with these indices (K,), where it varies over them.
Emitted = Callable[[Float64Array, NDArray[np.integer]], Float64Array]
# How important it is to divide such parts (K, 3, 3) with this radiance (K, 3): (K,).
Importance = Callable[[Float64Array, NDArray[np.intp], Float64Array], Float64Array]


class MergedTriangles(NamedTuple):
    """Triangles (K, 3, 3) with radiance (K, 3); source (K,): one of the given triangles that each replaces; is_part
    (K,): whether it is that triangle alone, or a part of it."""

    corners: Float64Array
    radiance: Float64Array
    source: NDArray[np.intp]
    is_part: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class EmitterPatches:
    """M flat patches: corners (M, 3, 3), centre (M, 3), unit normal (M, 3), radiance (M, 3), area (M,), and the cones
    (M, 4) into which they send it (`engine.light.cones`), all float32; owner (M,): the number of the triangle that each
    is part of, or of a scene's patches that of the object."""

    corners: NDArray[np.float32]
    centre: NDArray[np.float32]
    normal: NDArray[np.float32]
    radiance: NDArray[np.float32]
    area: NDArray[np.float32]
    cones: NDArray[np.float32]
    owner: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.area)

    @property
    def samples(self) -> NDArray[np.float32]:
        """A position (M, 3) on each patch, see `spread_places`."""
        return spread_places(self.corners)

    def with_corners(
        self, corners: NDArray[np.float32], moved: NDArray[np.bool_], cones: NDArray[np.float32]
    ) -> EmitterPatches:
        """The same patches, of which some (M,) were moved to these corners (M, 3, 3) and now have these cones
        (M, 4)."""
        there = _patches(corners.astype(np.float64), self.radiance.astype(np.float64), cones, self.owner)
        return EmitterPatches(*(
            np.where(moved.reshape(-1, *[1] * (new.ndim - 1)), new, old).astype(old.dtype)
            for new, old in ((getattr(there, name), getattr(self, name)) for name in (
                "corners", "centre", "normal", "radiance", "area", "cones", "owner"
            ))
        ))  # fmt: skip


@dataclass(frozen=True, eq=False)
class EmitterTree:
    """N nodes, the T emitting triangles first: corners (N, 3, 3), mean radiance (N, 3) and cones (N, 4), float32.

    child (N,) int32: the first of a node's two halves, which are adjacent and come later, or -1; parent (N,) int32, -1
    for roots; first (N,) int64: the first leaf below a node.
    """

    corners: NDArray[np.float32]
    radiance: NDArray[np.float32]
    cones: NDArray[np.float32]
    child: NDArray[np.int32]
    parent: NDArray[np.int32]
    first: NDArray[np.int64]
    n_roots: int
    leaves: EmitterPatches


def spread_places(triangles: NDArray[np.floating]) -> NDArray[np.float32]:
    """A position (M, 3) on each triangle (M, 3, 3), distributed so that no straight shadow edge passes many at once."""
    u = np.modf(0.5 + np.arange(1, len(triangles) + 1)[:, None] * R2)[0]
    root = np.sqrt(u[:, :1])
    weights = np.concatenate([1.0 - root, root * (1.0 - u[:, 1:]), root * u[:, 1:]], axis=1)
    return np.einsum("mk,mki->mi", weights, triangles, dtype=np.float64).astype(np.float32)


def emitter_patches(
    triangles: ArrayLike, radiance: ArrayLike, n_patches: int, cones: ArrayLike | None = None,
    varying: Emitted | None = None,
) -> EmitterPatches:  # fmt: skip
    """Divides emitting triangles (T, 3, 3), in metres, with radiance (T, 3) and cones (T, 4), None for none, into
    `n_patches` patches of about equal area.

    Triangles without area or without radiance are omitted. The others are never merged, so there are more than
    `n_patches` patches if there are more triangles. Total flux is preserved. The patches of one triangle are adjacent,
    so that every n-th patch samples the whole emitter. Raises ValueError for wrong shapes, negative or non-finite
    values, or n_patches < 1. varying: see `emitter_tree`.
    """
    return emitter_tree(triangles, radiance, n_patches, cones=cones, varying=varying).leaves


def emitter_tree(
    triangles: ArrayLike, radiance: ArrayLike, n_leaves: int, importance: Importance | None = None,
    cones: ArrayLike | None = None, varying: Emitted | None = None,
) -> EmitterTree:  # fmt: skip
    """The same patches as leaves of a tree. importance: the node of greatest importance is bisected first, and none
    with 0; None: by area. varying: the radiance of leaves, where it varies over the triangles, whose radiance is its
    mean; a node above has the mean of its halves. Both take indices among the emitting triangles."""
    corners, emitted = np.asarray(triangles, np.float64), np.asarray(radiance, np.float64)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or emitted.shape != (len(corners), 3):
        raise ValueError(f"triangles {corners.shape} and radiance {emitted.shape}, expected (T, 3, 3) and (T, 3)")
    if not (np.isfinite(corners).all() and np.isfinite(emitted).all() and (emitted >= 0.0).all()):
        raise ValueError("emitters hold values that are not finite, or negative radiance")
    if n_leaves < 1:
        raise ValueError(f"n_patches = {n_leaves}, expected at least 1")
    emitting = emitting_triangles(corners, emitted)
    of_triangles = all_round(len(corners)) if cones is None else np.asarray(cones, np.float32)
    corners, emitted, of_triangles = corners[emitting], emitted[emitting], of_triangles[emitting]
    nodes, root, radiance_of, child = _halve(
        corners, n_leaves, importance or (lambda halves, roots, radiance: _areas(halves)),
        varying or (lambda halves, roots: emitted[roots]),
    )  # fmt: skip
    first, split = _first_leaves(child, len(corners)), np.flatnonzero(child >= 0)
    for node in split[::-1]:  # halves come after wholes
        radiance_of[node] = 0.5 * (radiance_of[child[node]] + radiance_of[child[node] + 1])
    parent = np.full(len(child), -1)
    parent[child[split]], parent[child[split] + 1] = split, split
    leaf = np.flatnonzero(child < 0)
    leaf = leaf[np.argsort(first[leaf])]
    return EmitterTree(
        nodes.astype(np.float32), radiance_of.astype(np.float32), of_triangles[root], child.astype(np.int32),
        parent.astype(np.int32), first, len(corners),
        _patches(nodes[leaf], radiance_of[leaf], of_triangles[root[leaf]], np.flatnonzero(emitting)[root[leaf]]),
    )  # fmt: skip


def emitting_triangles(corners: Float64Array, radiance: Float64Array) -> NDArray[np.bool_]:
    """Which triangles (T, 3, 3) have area and radiance (T, 3)."""
    return (_areas(corners) > 0.0) & (radiance > 0.0).any(axis=1)


def merge_triangles(
    corners: Float64Array, radiance: Float64Array, most: int, kinds: NDArray[np.integer] | None = None
) -> MergedTriangles:
    """Merges many emitting triangles (T, 3, 3) with radiance (T, 3) into at most about `most`.

    Adjacent triangles of similar orientation and of one kind (T,), by default of equal radiance, become one with the
    direction of the sum of their area vectors, the sum of their areas, their mean radiance, and the centre and the two
    extents of the whole. It passes through their outermost corner, so that they do not hide it. Each kind retains at
    least one triangle. The length of the summed vectors as area was rejected: it omits the part of a curved patch that
    is visible from its side, and a ball of 64 triangles was 1.5 % too dark.

    Slivers are divided first: otherwise up to 7 % of the light of a tube with 384 sides, each as long as the tube, was
    misplaced.
    """
    source = np.arange(len(corners))
    if len(corners) <= most:
        return unmerged(corners, radiance)
    if kinds is None:
        kinds = np.unique(radiance, axis=0, return_inverse=True)[1].ravel()
    corners, source = _without_slivers(corners, source, OF_A_PIECE * math.sqrt(_areas(corners).sum() / most))
    radiance, kinds = radiance[source], kinds[source]
    vectors, middles = _area_vectors(corners), corners.mean(axis=1)
    areas = np.linalg.norm(vectors, axis=1)
    extent = float(np.linalg.norm(np.ptp(middles, axis=0))) or 1.0
    brightness = radiance @ LUMINANCE
    shade = 0.5 * brightness / max(float(brightness.max()), 1e-300)  # dark ones are not merged with bright ones
    features = np.concatenate([middles / extent, 0.5 * vectors / areas[:, None], shade[:, None]], axis=1)
    power = areas * brightness
    _, kinds = np.unique(kinds, return_inverse=True)
    order = np.argsort(kinds, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(kinds))[:-1])
    spread = [_weighted_variance(features[group], power[group]) for group in groups]
    while len(groups) < most:
        widest = int(np.argmax(spread))
        group = groups[widest]
        values = features[group][:, np.argmax(np.ptp(features[group], axis=0))]
        below = values < np.average(values, weights=areas[group])
        if spread[widest] <= 0.0 or below.all() or not below.any():
            break
        for place, half in ((widest, group[below]), (len(groups), group[~below])):
            groups[place : place + 1], spread[place : place + 1] = (
                [half],
                [_weighted_variance(features[half], power[half])],
            )
    return MergedTriangles(
        np.array([_merge_group(corners[group], vectors[group]) for group in groups]),
        np.array([_mean(radiance[group], areas[group]) for group in groups]),
        source[[group[0] for group in groups]],
        np.array([len(group) == 1 for group in groups]),
    )


def unmerged(corners: Float64Array, radiance: Float64Array) -> MergedTriangles:
    """Triangles (T, 3, 3) with radiance (T, 3) as they are."""
    return MergedTriangles(corners, radiance, np.arange(len(corners)), np.ones(len(corners), bool))


def merged_by_object(
    corners: Float64Array, radiance: Float64Array, objects: NDArray[np.integer], most: int
) -> tuple[MergedTriangles, NDArray[np.integer]]:
    """The same for triangles (T, 3, 3) of objects (T,), with any radiance (T, 3), also none: each object becomes its
    share of `most` by area, and at least `FEWEST_OF_AN_OBJECT`. Triangles without area are omitted. Also returns the
    objects."""
    areas = _areas(corners)
    none = MergedTriangles(np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0, np.intp), np.zeros(0, bool))
    found, owners = [none], [objects[:0]]
    for one in np.unique(objects[areas > 0.0]):
        mine = np.flatnonzero((objects == one) & (areas > 0.0))
        wanted = max(round(most * areas[mine].sum() / areas.sum()), FEWEST_OF_AN_OBJECT)
        pieces = merge_triangles(corners[mine], radiance[mine], wanted, np.zeros(len(mine), np.intp))
        found.append(pieces._replace(source=mine[pieces.source]))
        owners.append(np.full(len(pieces.corners), one, objects.dtype))
    return MergedTriangles(*map(np.concatenate, zip(*found, strict=True))), np.concatenate(owners)


def _without_slivers(
    corners: Float64Array, source: NDArray[np.intp], longest: float
) -> tuple[Float64Array, NDArray[np.intp]]:
    """The same surface (T, 3, 3) in triangles whose edges are at most `longest`, unless these would be too many; and
    the source (T,) of each."""
    while len(corners) < MOST_CUT:
        edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
        long = edges > longest
        if not long.any():
            break
        corners = np.concatenate([corners[~long], _halves(corners[long])])
        source = np.concatenate([source[~long], np.repeat(source[long], 2)])
    return corners, source


def _weighted_variance(features: Float64Array, weights: Float64Array) -> float:
    """Weighted squared distance of features (K, D) from their mean; 0 where nothing has any weight."""
    if not weights.any():
        return 0.0
    middle = np.average(features, axis=0, weights=weights)
    return float(weights @ ((features - middle) ** 2).sum(axis=1))


def _mean(radiance: Float64Array, areas: Float64Array) -> Float64Array:
    """Mean radiance (3,) of triangles (K,); exactly theirs where it is equal."""
    is_equal = (radiance == radiance[0]).all()
    return radiance[0] if is_equal else np.asarray(np.average(radiance, axis=0, weights=areas))


def _merge_group(corners: Float64Array, vectors: Float64Array) -> Float64Array:
    """The triangle (3, 3) that replaces triangles (K, 3, 3) with area vectors (K, 3), see `merge_triangles`."""
    if len(corners) == 1:
        return corners[0]
    vector = vectors.sum(axis=0)
    area = float(np.linalg.norm(vectors, axis=1).sum())
    normal = vector / max(float(np.linalg.norm(vector)), 1e-30)
    middle = np.average(corners.mean(axis=1), axis=0, weights=np.linalg.norm(vectors, axis=1))
    away = corners.reshape(-1, 3) - middle
    height = away @ normal
    _, sizes, axes = np.linalg.svd(away - height[:, None] * normal, full_matrices=False)
    u = axes[0] - (axes[0] @ normal) * normal
    u /= max(float(np.linalg.norm(u)), 1e-30)
    longer = math.sqrt(max(sizes[0] / max(sizes[1], 1e-3 * sizes[0], 1e-30), 1.0))
    angle = 2.0 * np.pi / 3.0 * np.arange(3)[:, None]
    shape = longer * np.cos(angle) * u + np.sin(angle) / longer * np.cross(normal, u)
    scale = math.sqrt(area / (0.75 * math.sqrt(3.0)))
    return np.asarray(middle + height.max() * normal + scale * shape)


def visible_importance(
    triangles: Float64Array, radiance: Float64Array, points: Float64Array, normals: Float64Array, seen: Float64Array,
    cones: NDArray[np.float32] | None = None,
) -> Importance:  # fmt: skip
    """The effect of patches of the triangles (T, 3, 3) with radiance (T, 3) and cones (T, 4), None for none, at points
    (P, 3): an importance for `emitter_tree`.

    seen (P, T): the visible share of each triangle from each point. A patch contributes to a point the share

        w = L V Omega cos / (E + mean of E)

    of its irradiance. One ray determines its visibility, so its error is as large where its triangle is partly visible,
    and the squared errors of n patches add. The importance is the mean of w² over the points.
    """

    def contribution(corners: Float64Array, roots: NDArray[np.intp], radiance: Float64Array) -> Float64Array:
        towards = corners.mean(axis=1)[None] - points[:, None]
        distance = np.maximum(np.linalg.norm(towards, axis=2), 1e-12)
        cosine = np.maximum(np.einsum("pmi,pi->pm", towards, normals) / distance, 0.02)
        shares = 1.0 if cones is None else cone_shares(cones[roots], towards / distance[..., None])
        return solid_angles(corners, points) * cosine * seen[:, roots] * (radiance @ LUMINANCE) * shares

    total = contribution(triangles, np.arange(len(triangles)), radiance).sum(axis=1)
    scale = 1.0 / np.maximum(total + total.mean(), 1e-300)
    # Half visibility has the largest error; a fully visible triangle needs few rays, except for what the rays to it
    # missed.
    partly = 0.1 + 4.0 * seen * (1.0 - seen)

    def importance(corners: Float64Array, roots: NDArray[np.intp], radiance: Float64Array) -> Float64Array:
        share = contribution(corners, roots, radiance) * scale[:, None]
        return np.mean(share * share * partly[:, roots], axis=0)

    return importance


def solid_angles(corners: Float64Array, points: ArrayLike) -> NDArray[np.float32]:
    """Solid angle of every triangle (M, 3, 3) from every point (P, 3): (P, M) float32, steradians, 0 to 2 pi.

    Exact at any distance [VanOosterom83]; 0 from behind a triangle and from within its plane.
    """
    from engine.light import _kernels  # imported late: patches alone need no compiler

    places = np.ascontiguousarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3:
        raise ValueError(f"points have shape {places.shape}, expected (P, 3)")
    result = np.empty((len(places), len(corners)), np.float32)
    on_threads(lambda i, j: _kernels.solid_angles_range(places, corners, i, j, result), *even_parts(len(places)))
    return np.maximum(result, 0.0)


def _patches(
    corners: Float64Array, radiance: Float64Array, cones: NDArray[np.float32], owner: NDArray[np.integer]
) -> EmitterPatches:
    """Patches of triangles (M, 3, 3) with area."""
    normal = _area_vectors(corners)
    area = np.linalg.norm(normal, axis=1)
    return EmitterPatches(
        corners=corners.astype(np.float32),
        centre=corners.mean(axis=1).astype(np.float32),
        normal=(normal / area[:, None]).astype(np.float32),
        radiance=radiance.astype(np.float32),
        area=area.astype(np.float32),
        cones=np.ascontiguousarray(cones),
        owner=owner.astype(np.int32),
    )


def _area_vectors(corners: Float64Array) -> Float64Array:
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _areas(corners: Float64Array) -> Float64Array:
    return np.linalg.norm(_area_vectors(corners), axis=1)


def _halve(
    corners: Float64Array, n_leaves: int, importance: Importance, emitted: Emitted
) -> tuple[Float64Array, NDArray[np.intp], Float64Array, NDArray[np.intp]]:
    """Bisects the most important leaves until there are `n_leaves`: nodes (N, 3, 3), the root (N,) of each, its
    radiance (N, 3) by `emitted`, and its first half (N,).

    All leaves with more than half of the largest importance are bisected at once: their halves usually have less.
    """
    nodes, root, child = [corners], [np.arange(len(corners))], [np.full(len(corners), -1)]
    radiance = [emitted(corners, root[0])]
    leaves, weights = np.arange(len(corners)), importance(corners, root[0], radiance[0])
    n_nodes = len(corners)
    while 0 < len(leaves) < n_leaves and weights.max() > 0.0:
        chosen = np.flatnonzero(weights > (0.5 + 1e-6) * weights.max())
        order = np.lexsort((chosen, -np.round(np.log2(weights[chosen]), 6)))
        chosen = chosen[order][: n_leaves - len(leaves)]
        every, roots, links = np.concatenate(nodes), np.concatenate(root), np.concatenate(child)
        halves, origin = _halves(every[leaves[chosen]]), np.repeat(roots[leaves[chosen]], 2)
        links[leaves[chosen]] = n_nodes + 2 * np.arange(len(chosen))
        nodes, root, child = [every, halves], [roots, origin], [links, np.full(len(halves), -1)]
        # First halves replace the wholes, so that among equals the bisected ones are distributed over all emitters.
        radiance.append(emitted(halves, origin))
        found, first = importance(halves, origin, radiance[-1]), n_nodes + 2 * np.arange(len(chosen))
        leaves[chosen], weights[chosen] = first, found[::2]
        leaves, weights = np.concatenate([leaves, first + 1]), np.concatenate([weights, found[1::2]])
        n_nodes += len(halves)
    return np.concatenate(nodes), np.concatenate(root), np.concatenate(radiance), np.concatenate(child)


def _halves(corners: Float64Array) -> Float64Array:
    """Bisects triangles (K, 3, 3) at their longest edges, (2 K, 3, 3) in pairs, with the same orientation."""
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turn = (np.argmax(lengths, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(corners, turn[:, :, None], axis=1).transpose(1, 0, 2)
    middle = 0.5 * (a + b)
    return np.stack([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=1).reshape(-1, 3, 3)


def _first_leaves(child: NDArray[np.intp], n_roots: int) -> NDArray[np.int64]:
    """First leaf below each node (N,), leaves counted depth first; halves come after wholes."""
    n_leaves = np.ones(len(child), np.int64)
    split = np.flatnonzero(child >= 0)
    for node in split[::-1]:
        n_leaves[node] = n_leaves[child[node]] + n_leaves[child[node] + 1]
    first = np.zeros(len(child), np.int64)
    first[:n_roots] = np.cumsum(n_leaves[:n_roots]) - n_leaves[:n_roots]
    for node in split:
        first[child[node]], first[child[node] + 1] = first[node], first[node] + n_leaves[child[node]]
    return first
