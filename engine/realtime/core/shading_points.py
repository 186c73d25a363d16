"""Places the points at which light is computed: at mesh vertices, and between them where a mesh is too coarse for its
shadows; on the sides of objects that light can reach (`engine.realtime.core.lit_sides`).

A triangle that is large relative to its distance from possible occluders is split in four, repeatedly. A floor of two
triangles thus gets its texels, most of them where shadows are sharp. This replaces the atlas of visibility textures of
[Ma06, 3.3]: there is no stretching, there are no seams, and no mesh fails to unwrap.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import sphere_frames
from engine.core.generators import run_to_end
from engine.core.threads import even_parts, on_threads
from engine.core.triangles import quarters
from engine.realtime.core import _placement_kernels as kernels
from engine.realtime.core.lit_sides import lit_sides
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.tangents import object_tangents

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]
# Corners and normals (T, 3, 3), their place within the scene's triangle (T, 3, 2), and that triangle's index (T,).
Parts = tuple[Float64Array, Float64Array, Float64Array, NDArray[np.intp]]

# Detail below 1/32 of the distance to an occluder, about visibility's own 1.4 degrees, shows nothing more.
_HALVINGS = 5
# Factor by which the error threshold for splitting falls.
_STEP = 0.7
# Cosine between two normals of a triangle: triangles that bend further are split.
_MOST_BEND = np.cos(np.radians(15.0))
_TRIANGLES_AT_ONCE = 8192
_INWARDS = 0.1
# Random samples of occluders, chosen by area; as many again are divided evenly over the objects.
_SAMPLES = 20_000
_LEAF = 8  # samples of a leaf of their tree, at most
# Corners of one object become one point if positions agree to this share of the scene's size, and normals to this.
_SAME_PLACE, _SAME_NORMAL = 1e-6, 1e-4


@dataclass(frozen=True, eq=False)
class ShadingPoints:
    """S points and the T triangles between them, which cover the surfaces of all reflecting objects.

    position (S, 3) on the surface; lifted (S, 3), offset from it for shadow rays; normal and tangent (S, 3), unit, on
    the side that the point belongs to; i_object (S,). triangles (T, 2, 3): indices of points, on the side that the
    winding faces and on the other, −1 where light is not computed; corners (T, 3, 3) float64 in world space; source
    (T,): the scene's triangle that contains each, and within (T, 3, 2): u and v of the corners in it. The points of an
    object are consecutive, and neighbours are mostly close in memory. sides (M, 2): the sides of objects that light can
    reach, relays (M,): objects whose backs pass light on, see `lit_sides`. buried (S,):
    points inside something solid, which pictures never show, see `engine.realtime.triple_product.visibility`; None
    before that is known.
    """

    position: Float32Array
    lifted: Float32Array
    normal: Float32Array
    tangent: Float32Array
    i_object: Int32Array
    triangles: Int32Array
    source: Int32Array
    corners: NDArray[np.float64]
    within: Float32Array
    sides: NDArray[np.bool_]
    relays: NDArray[np.bool_]
    buried: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.position)

    @cached_property
    def frames(self) -> Float32Array:
        """(S, 3, 3): rows tangent, normal and across. The dot products of a world direction with the rows are its x, y,
        z on the geodesic sphere.

        The normal is the sphere's +Y, so every triangle of the sphere lies either above the surface or below it.
        """
        return np.asarray(sphere_frames(self.tangent, self.normal), np.float32)

    @cached_property
    def shown(self) -> Int32Array:
        """`triangles` for pictures: replaces each buried corner by the nearest corner that is not buried.

        A floor continues beneath the walls. Its points there are black, and would draw a dark line along each wall.
        """
        if self.buried is None or not self.buried.any():
            return self.triangles
        hidden = (self.triangles >= 0) & self.buried[self.triangles]
        t, side, corner = np.nonzero(hidden & ~hidden.all(axis=2, keepdims=True))
        apart = np.linalg.norm(self.corners[t] - self.corners[t, corner][:, None], axis=2)
        nearest = np.where(hidden[t, side], np.inf, apart).argmin(axis=1)
        shown = self.triangles.copy()
        shown[t, side, corner] = self.triangles[t, side, nearest]
        return shown

    def caster(self, scene: Scene) -> RayCaster:
        """Ray caster against the triangles (T, 3) on the surfaces of a scene."""
        triangles = np.arange(3 * len(self.corners)).reshape(-1, 3)
        return RayCaster(
            self.corners.reshape(-1, 3), triangles, cutouts=scene.cutouts.of_parts(self.source, self.within)
        )


def shading_points(
    scene: Scene, caster: RayCaster, n_points: int, even: NDArray[np.bool_] | None = None, is_whole: bool = False
) -> ShadingPoints:
    """Place about `n_points` points in addition to the meshes' vertices, with an even error on coarse triangles, on the
    side that the winding faces.

    caster: intersects the scene's triangles; even (M,): objects whose triangles are all split equally often, or None;
    is_whole: also split the neighbours of split triangles so that they share corners, and no gap opens when points
    move. Raises ValueError unless n_points ≥ 0.
    """
    return run_to_end(place_points(scene, caster, n_points, even, is_whole))


def place_points(
    scene: Scene, caster: RayCaster, n_points: int, even: NDArray[np.bool_] | None = None, is_whole: bool = False
) -> Generator[None, None, ShadingPoints]:
    """As `shading_points`, in pieces of about 30 ms."""
    if n_points < 0:
        raise ValueError(f"n_points = {n_points}, expected 0 or more")
    if not len(scene.triangles):
        return _no_points()
    reflects = scene.reflecting[scene.object_of_triangle]
    even = np.zeros(len(scene.smooth), bool) if even is None else even
    yield
    sides, relays = lit_sides(scene, caster)
    yield
    parts = yield from _cut_where_coarse(scene, reflects, sides, even, n_points)
    corners, normals, within, source = _joined_at_edges(parts) if is_whole else parts
    mine = np.flatnonzero(reflects[source])
    ids = np.repeat(scene.object_of_triangle[source[mine]], 3)
    stored, number = _joined(corners[mine], normals[mine], ids)
    order = _close_together(corners[mine].reshape(-1, 3)[stored], ids[stored])
    stored, number = stored[order], np.argsort(order)[number]
    triangles = np.full((len(source), 2, 3), -1, np.int32)
    triangles[mine, 0] = number.reshape(-1, 3)
    position, normal = corners[mine].reshape(-1, 3)[stored], normals[mine].reshape(-1, 3)[stored]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inwards = _towards_middles(corners[mine], number.reshape(-1, 3), len(stored))
    inwards -= np.einsum("pk,pk->p", inwards, normal)[:, None] * normal
    inwards += _depth(corners[mine], number.reshape(-1, 3), inwards, normal)[:, None] * normal
    return ShadingPoints(
        position.astype(np.float32),
        caster.offset_origins(position + inwards, normal),
        normal.astype(np.float32),
        object_tangents(scene, ids[stored], normal).astype(np.float32),
        ids[stored].astype(np.int32),
        triangles,
        source.astype(np.int32),
        corners,
        within.astype(np.float32),
        sides,
        relays & scene.reflecting,
    )


def _no_points() -> ShadingPoints:
    """Those of a scene without objects."""
    vectors = np.zeros((0, 3), np.float32)
    return ShadingPoints(
        vectors, vectors, vectors, vectors, np.zeros(0, np.int32), np.zeros((0, 2, 3), np.int32), np.zeros(0, np.int32),
        np.zeros((0, 3, 3)), np.zeros((0, 3, 2), np.float32), np.zeros((0, 2), bool), np.zeros(0, bool),
    )  # fmt: skip


def with_backs(points: ShadingPoints, behind: NDArray[np.bool_]) -> ShadingPoints:
    """Append points for the backs of objects (M,) that have none yet."""
    front, back = points.triangles[:, 0], points.triangles[:, 1]
    mine = (front[:, 0] >= 0) & (back[:, 0] < 0) & behind[points.i_object[front[:, 0]]]
    twins, number = np.unique(front[mine], return_inverse=True)
    triangles = points.triangles.copy()
    triangles[mine, 1] = len(points) + number.reshape(-1, 3)
    position, normal = points.position[twins], -points.normal[twins]
    lift = np.einsum("pk,pk->p", points.lifted[twins] - position, normal)[:, None]
    inwards = points.lifted[twins] - position - lift * normal
    depth = _depth(points.corners[mine], number.reshape(-1, 3), inwards, normal)[:, None].astype(np.float32)
    lifted = points.lifted[twins] + (depth - 2.0 * lift) * normal
    own = position, lifted, normal, points.tangent[twins], points.i_object[twins]
    stored = points.position, points.lifted, points.normal, points.tangent, points.i_object
    position, lifted, normal, tangent, i_object = (np.concatenate(both) for both in zip(stored, own, strict=True))
    return ShadingPoints(
        position, lifted, normal, tangent, i_object, triangles, points.source, points.corners, points.within,
        points.sides, points.relays, points.buried,
    )  # fmt: skip


def with_rotated_tangents(points: ShadingPoints, scene: Scene) -> ShadingPoints:
    """The points with tangents that a scene's angles and maps rotate, on either side."""
    # Each point at the first corner, of T triangles with two sides, where it lies.
    numbers, first = np.unique(points.triangles, return_index=True)
    first = first[numbers >= 0]
    at, corner = first // 6, first % 3
    u, v = points.within[at, corner].T
    found = Intersections(points.source[at], u, v, np.zeros(len(at), np.float32))
    tangents = scene.tangent_rotations.tangents(points.i_object, points.normal.astype(np.float64), found)
    return replace(points, tangent=tangents.astype(np.float32))


def _towards_middles(corners: Float64Array, numbers: NDArray[np.intp], n_points: int) -> Float64Array:
    """Move points (S, 3) a tenth of the way to the centres of the triangles around them; corners (T, 3, 3) have the
    indices (T, 3). This moves a point off an edge where two walls meet and a ray might miss both; a point in the middle
    of a surface stays in place."""
    steps, at = corners.mean(axis=1, keepdims=True) - corners, numbers.ravel()
    total = np.stack([np.bincount(at, steps[..., i].ravel(), n_points) for i in range(3)], axis=1)
    return np.asarray(_INWARDS * total / np.bincount(at, minlength=n_points)[:, None])


def _depth(corners: NDArray, numbers: NDArray[np.intp], moved: NDArray, normal: NDArray) -> Float64Array:
    """How deep (S,) points that moved by (S, 3) from a corner of triangles are beneath the triangle that they moved
    over; corners (T, 3, 3) have the indices (T, 3), normal (S, 3). Where the surface is convex that is 0; where it is
    hollow a step along the tangent leads beneath it."""
    depth = np.zeros(len(moved))
    for k in range(3):
        at = numbers[:, k]
        along, across = (corners[:, (k + i) % 3] - corners[:, k] for i in (1, 2))
        step, up = moved[at], normal[at]
        # The step as a along + b across, seen along the normal; it is over the triangle if neither is negative.
        area = np.einsum("tk,tk->t", up, np.cross(along, across))
        area = np.where(area == 0.0, np.inf, area)
        a = np.einsum("tk,tk->t", up, np.cross(step, across)) / area
        b = np.einsum("tk,tk->t", up, np.cross(along, step)) / area
        height = np.einsum("tk,tk->t", up, a[:, None] * along + b[:, None] * across - step)
        np.maximum.at(depth, at, np.where((a >= 0.0) & (b >= 0.0), height, 0.0))
    return depth


def _cut_where_coarse(
    scene: Scene, reflects: NDArray[np.bool_], sides: NDArray[np.bool_], even: NDArray[np.bool_], n_points: int
) -> Generator[None, None, Parts]:
    """Split the scene's triangles in four where they are large relative to their distance from possible occluders, on
    the sides (M, 2) that light reaches. Objects in even (M,) are split as a whole.

    The scale on which a shadow varies is proportional to the distance of its occluder. So the error of a triangle is
    estimated as its area times its longest edge over that distance, and the largest is split, until there are n_points
    more points.
    """
    casters = _SampleTree(_samples(scene))
    n = len(scene.triangles)
    within = np.tile([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], (n, 1, 1))
    parts = scene.vertices[scene.triangles].astype(np.float64), _corner_normals(scene), within, np.arange(n)
    i_object = scene.object_of_triangle
    whole = parts
    yield
    errors = yield from _errors(casters, parts[0], parts[1], sides[i_object])
    errors = np.where(reflects[parts[3]], errors, 0.0)
    most, bound = n + 2 * n_points, errors.max(initial=0.0)
    while bound > 0.0:
        cut = errors > bound
        if not cut.any():
            bound = _STEP * bound if bound > 1e-9 * errors.max() > 0.0 else 0.0
            continue
        if len(cut) + 3 * cut.sum() > most:
            break
        n_whole, parts = int((~cut).sum()), _cut(parts, cut)
        corners, normals, source = parts[0][n_whole:], parts[1][n_whole:], parts[3][n_whole:]
        of_new = yield from _errors(casters, corners, normals, sides[i_object[source]])
        errors = np.concatenate([errors[~cut], of_new])
    # The others were split as if this object's parts existed; replace its parts by an even split.
    for i in np.flatnonzero(even):
        parts = _with_even(parts, i_object == i, whole, n_points)
    return parts


def _with_even(parts: Parts, mine: NDArray[np.bool_], whole: Parts, n_points: int) -> Parts:
    """Replace the parts of one object, given by `mine` (T,), by an even split of its original triangles `whole`."""
    own = whole[0][mine], whole[1][mine], whole[2][mine], whole[3][mine]
    while 0 < 4 * len(own[3]) <= n_points:
        own = _cut(own, np.ones(len(own[3]), bool))
    others = ~mine[parts[3]]
    corners, normals, within = (
        np.concatenate([each[others], its]) for each, its in zip(parts[:3], own[:3], strict=True)
    )
    return corners, normals, within, np.concatenate([parts[3][others], own[3]])


def _cut(parts: Parts, cut: NDArray[np.bool_]) -> Parts:
    """Return the parts that are not split, followed by the four parts of each that is."""
    corners, normals, within = (
        np.concatenate([a[~cut], quarters(a[cut]).reshape(-1, *a.shape[1:])]) for a in parts[:3]
    )
    return corners, normals, within, np.concatenate([parts[3][~cut], np.repeat(parts[3][cut], 4)])


def _joined_at_edges(parts: Parts) -> Parts:
    """Halve parts until no other part has a corner inside one of their edges. This adds no corner."""
    there, halved = np.unique(_places(parts[0], parts[0])), parts
    while (hangs := _has_hanging_vertices(halved[0], parts[0], there)).any():
        which = hangs.any(axis=1)
        turn = (np.argmax(hangs[which], axis=1)[:, None] + np.arange(3)) % 3  # start at that edge
        corners, normals, within = (
            np.concatenate([a[~which], _halves(np.take_along_axis(a[which], turn[..., None], 1))]) for a in halved[:3]
        )
        halved = corners, normals, within, np.concatenate([halved[3][~which], np.tile(halved[3][which], 2)])
    return halved


def _has_hanging_vertices(corners: Float64Array, among: Float64Array, there: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which edges (T, 3) contain one of these positions in their interior; edges of zero length never do."""
    ends, middles = _places(corners, among), _places(_middles(corners), among)
    return np.isin(middles, there) & (middles != ends) & (middles != np.roll(ends, -1, axis=1))


def _halves(corners: NDArray) -> NDArray:
    """(2 T, 3, k): values at the corners after triangles (T, 3, k) are halved at their first edge."""
    a, b, c = np.moveaxis(corners, 1, 0)
    middle = (a + b) / 2.0
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _places(places: Float64Array, among: Float64Array) -> NDArray[np.int64]:
    """Index positions (..., 3) so that equal positions get equal indices; among: (..., 3), whose box contains them."""
    low = among.min(axis=(0, 1))
    size = float((among.max(axis=(0, 1)) - low).max()) or 1.0
    x, y, z = np.moveaxis(np.round((places - low) / size * (2**20 - 1)).astype(np.int64), -1, 0)
    return np.asarray((x << 40) + (y << 20) + z)


def _errors(
    casters: _SampleTree, corners: Float64Array, normals: Float64Array, lit: NDArray[np.bool_]
) -> Generator[None, None, NDArray[np.float64]]:
    """Estimate the errors of parts (T, 3, 3) that are not split: area × longest edge / distance to occluders, at most
    the area; the area where normals bend; 0 where the part is fine enough. Of the occluders on the lit sides, lit
    (T, 2), the nearer one counts."""
    sides = corners - np.roll(corners, 1, axis=1)
    twice = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    up = normals.mean(axis=1)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    bend = np.einsum("tki,tki->tk", normals, np.roll(normals, 1, axis=1)).min(axis=1)
    middles, nearness = corners.mean(axis=1), np.zeros(len(corners))
    for side, sign in enumerate((1.0, -1.0)):
        of_side = np.flatnonzero(lit[:, side])
        found = yield from _nearness(casters, middles[of_side], sign * up[of_side], longest[of_side])
        nearness[of_side] = np.maximum(nearness[of_side], found)
    return twice / 2.0 * np.where(bend < _MOST_BEND, 1.0, nearness)


def _nearness(
    casters: _SampleTree, places: Float64Array, normals: Float64Array, lengths: NDArray[np.float64]
) -> Generator[None, None, NDArray[np.float64]]:
    """Lengths (N,) over the distance of possible occluders from places (N, 3), rounded to 1, ½, ¼, ... or 0.

    The test is whether a ball that touches the surface from above, with the distance as its radius, contains a sample.
    Samples of the surface itself, flat or convex, are never inside.
    """
    found = np.zeros(len(places))
    what = places, normals, lengths, casters.boxes, casters.leaves, _HALVINGS, found
    for first in range(0, len(places), _TRIANGLES_AT_ONCE):
        starts, stops = even_parts(min(_TRIANGLES_AT_ONCE, len(places) - first))
        on_threads(
            lambda start, stop, first=first: kernels.nearness_range(first + start, first + stop, *what), starts, stops
        )
        yield
    return found


class _SampleTree:
    """A binary tree over samples (N, 3) along a Z-order curve, see `nearness_range`."""

    def __init__(self, samples: Float64Array) -> None:
        n_leaves = 1 << max(math.ceil(math.log2(len(samples) / _LEAF)), 0)
        order = _close_together(samples, np.zeros(len(samples), np.int64))
        # Leaves of even size; the last sample fills up.
        spread = np.minimum(np.arange(n_leaves * -(-len(samples) // n_leaves)), len(samples) - 1)
        self.leaves = samples[order[spread]].reshape(n_leaves, -1, 3)
        levels = [np.stack([self.leaves.min(axis=1), self.leaves.max(axis=1)], axis=1)]
        while len(levels[-1]) > 1:
            low, high = levels[-1][:, 0].reshape(-1, 2, 3), levels[-1][:, 1].reshape(-1, 2, 3)
            levels.append(np.stack([low.min(axis=1), high.max(axis=1)], axis=1))
        self.boxes = np.concatenate(levels[::-1])


def _samples(scene: Scene) -> Float64Array:
    """Random positions all over the surfaces, always the same."""
    random = np.random.default_rng(1)
    corners = scene.vertices[scene.triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    ranges = scene.triangle_ranges[
        scene.triangle_ranges[:, 1] > scene.triangle_ranges[:, 0]
    ]  # hidden objects have none
    total = area.sum()
    by_area = random.choice(len(area), _SAMPLES, p=area / total if total > 0.0 else None)
    by_object = random.integers(*ranges[random.integers(len(ranges), size=_SAMPLES)].T)
    weights = random.dirichlet((1.0, 1.0, 1.0), 2 * _SAMPLES)
    return np.einsum("nk,nki->ni", weights, corners[np.concatenate([by_area, by_object])])


def _close_together(positions: Float64Array, i_object: NDArray[np.integer]) -> NDArray[np.intp]:
    """Order points by object, and within each object along a Z-order curve."""
    low = positions.min(axis=0, initial=np.inf)
    size = float((positions.max(axis=0, initial=-np.inf) - low).max(initial=0.0)) if len(positions) else 1.0
    places = ((positions - low) / (size or 1.0) * 1023.0).astype(np.int64)
    code = np.zeros(len(positions), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (places[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.lexsort((code, i_object))


def _middles(corners: Float64Array) -> Float64Array:
    return (corners + np.roll(corners, -1, axis=1)) / 2.0


def _corner_normals(scene: Scene) -> NDArray[np.float64]:
    """(T, 3, 3): vertex normals if the object is smooth and they are usable, else face normals; always on the side that
    the winding faces."""
    faces = np.repeat(scene.geometric_normals[:, None].astype(np.float64), 3, axis=1)
    own = scene.normals[scene.triangles].astype(np.float64)
    along = np.einsum("tki,tki->tk", own, faces)
    sign = np.where(along.sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    usable = scene.smooth[scene.object_of_triangle][:, None] & (sign * along > 1e-3)
    return np.where(usable[..., None], sign[..., None] * own, faces)


def _joined(
    corners: NDArray[np.float64], normals: NDArray[np.float64], i_object: NDArray[np.integer]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Merge corners that share position, normal and object: return one representative for each, and each corner's index
    among these."""
    flat = corners.reshape(-1, 3)
    size = float(np.abs(flat).max(initial=0.0)) or 1.0
    keys = np.concatenate([
        np.round(flat / (size * _SAME_PLACE)),
        np.round(normals.reshape(-1, 3) / _SAME_NORMAL),
        i_object[:, None],
    ], axis=1).astype(np.int64)  # fmt: skip
    packed = np.ascontiguousarray(keys).view(np.dtype((np.void, keys.dtype.itemsize * keys.shape[1]))).ravel()
    _, places, points = np.unique(packed, return_index=True, return_inverse=True)
    return places, points.ravel()
