"""What an Orbit for objects at another place takes over of the one before: points that the movement does not concern.

A point is the same where its object, position, normal, tangent and lifted position are, bit for bit. It sees the same
if no ray of its hemisphere meets a moved object, where it was or where it is, before something else: if both are below
its horizon, or the rest of the scene hides them. Such a point keeps its bits, which are those that tracing it again
would find. It keeps its light as well if all that can reach it is the same, and both places are below its horizon: the
rays to bright suns go between the triangles' middles.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import on_threads
from engine.light.emitters import EmitterPatches
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.shading_points import ShadingPoints
from engine.realtime.triple_product import _move_kernels as kernels
from engine.realtime.triple_product.lit_points import EXACTLY, LitPoints
from engine.realtime.triple_product.moved_visibility import cones_around
from engine.realtime.triple_product.visibility import finest_directions, trace_patches, upper_directions
from engine.scene.moved_caster import MovedCaster, RestCaster, movable_part
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.visibility.moved_objects import bounding_spheres, moved_objects, rises_above_horizon

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Rows = NDArray[np.int64]

_AT_ONCE, _OF_A_PART = 4096, 32  # points


@dataclass(frozen=True, eq=False)
class FormerPoints:
    """Points that were precomputed for a scene: lit, and the caster of its triangles; is_sound (S,): those that still
    see what was precomputed for them, is_lit (S,): those lit as then; light, patches: which their light is of."""

    scene: Scene
    caster: RayCaster
    lit: LitPoints
    is_sound: NDArray[np.bool_]
    is_lit: NDArray[np.bool_]
    light: SkyState
    patches: EmitterPatches | None


def keep_points(
    lit: LitPoints, scene: Scene, former: FormerPoints, light: SkyState, patches: EmitterPatches | None
) -> Generator[None, None, None]:
    """Take over in lit, the points of a scene, what former ones know that are the same, in pieces; light, patches: what
    lights them."""
    moved = moved_objects(former.scene, scene)
    if moved.all():
        return
    rows, theirs = _same_points(lit.points, former.lit.points)
    sound = (former.is_sound & former.lit.traced)[theirs]
    rows, theirs = rows[sound], theirs[sound]
    if lit.points.buried is not None:
        sound = ~lit.points.buried[rows]
        rows, theirs = rows[sound], theirs[sound]
    yield
    spheres = np.concatenate([bounding_spheres(each, moved) for each in (former.scene, scene)])
    above = rises_above_horizon(spheres, lit.points.position[rows], lit.points.normal[rows])
    hides = _Hiding(former, scene, moved, spheres)
    same = ~above
    for start in range(0, len(rows), _AT_ONCE):
        some = np.flatnonzero(above[start : start + _AT_ONCE]) + start
        same[some] = hides.from_points(lit.points, rows[some])
        yield
    rows, theirs, above = rows[same], theirs[same], above[same]
    lit.bits[rows] = former.lit.bits[theirs]
    for start in range(0, len(rows) if patches is not None else 0, _AT_ONCE):
        assert patches is not None
        trace_patches(lit.points, lit.caster, patches, rows[start : start + _AT_ONCE], lit.patch_bits)
        yield
    lit.traced[rows] = True
    lit.n_traced += len(rows)
    if former.light == light and _are_same(former.patches, patches):
        is_lit = ~above & former.is_lit[theirs] & (former.lit.state[theirs] == EXACTLY)
        if patches is not None:
            is_lit &= (lit.patch_bits[rows] == former.lit.patch_bits[theirs]).all(axis=1)
        lit.keep_light(rows[is_lit], former.lit, theirs[is_lit])


def _are_same(one: EmitterPatches | None, other: EmitterPatches | None) -> bool:
    """Whether patches of emitters, with their radiance, are the same."""
    if one is None or other is None:
        return one is other
    return all(np.array_equal(a, b) for a, b in zip(vars(one).values(), vars(other).values(), strict=True))


def _same_points(points: ShadingPoints, others: ShadingPoints) -> tuple[Rows, Rows]:
    """Pairs of equal points of the two: their numbers, ascending in the first."""
    words, other_words = _words(points), _words(others)
    factors = np.random.default_rng(5).integers(1, 1 << 62, words.shape[1]) | 1
    with np.errstate(over="ignore"):
        keys, other_keys = words.astype(np.int64) @ factors, other_words.astype(np.int64) @ factors  # sums wrap around
    order = np.argsort(other_keys, kind="stable")
    at = np.minimum(np.searchsorted(other_keys[order], keys), len(order) - 1)
    theirs = order[at]
    same = (words == other_words[theirs]).all(axis=1)
    return np.flatnonzero(same), theirs[same]


def _words(points: ShadingPoints) -> NDArray[np.int32]:
    """All that the visibility of points depends on (S, 13)."""
    arrays = points.position, points.normal, points.tangent, points.lifted
    floats = np.concatenate(arrays, axis=1) + np.float32(0.0)  # −0 as 0
    return np.concatenate([floats.view(np.int32), points.i_object[:, None]], axis=1)


class _Hiding:
    """Whether the rest of the scene hides all that objects cover at points, before and after they move."""

    def __init__(self, former: FormerPoints, scene: Scene, moved: NDArray[np.bool_], spheres: Float64Array) -> None:
        self._spheres = spheres.astype(np.float32)
        numbers = {i: np.arange(*scene.triangle_ranges[i]) for i in np.flatnonzero(moved).tolist()}
        there, here = (
            {i: movable_part(each.vertices, each.triangles, own) for i, own in numbers.items() if len(own)}
            for each in (former.scene, scene)
        )
        self._rest = RestCaster(former.caster, len(former.scene.triangles), there)
        self._casters = [MovedCaster(self._rest, own, dict.fromkeys(own, np.eye(4))) for own in (there, here)]

    def from_points(self, points: ShadingPoints, which: Rows) -> NDArray[np.bool_]:
        """Whether it does so at points (N,). Most where it does not need only the first of two sets of rays."""
        found = np.ones(len(which), bool)
        for directions in (upper_directions(), finest_directions()):
            parents = cones_around(directions)
            rows = np.flatnonzero(found)
            on_threads(
                lambda start, rows=rows, directions=directions, parents=parents: self._ask(
                    points, which, rows[start : start + _OF_A_PART], directions, parents, found
                ),
                range(0, len(rows), _OF_A_PART),
            )
        return found

    def _ask(
        self, points: ShadingPoints, which: Rows, rows: Rows, directions: Float32Array, parents: Float32Array,
        found: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        """Send rays of points (N,) in rows along some directions, and note those that see a moved object."""
        some = which[rows]
        lifted, frames = points.lifted[some], points.frames[some]
        everything = np.full((len(some), len(directions) // 2), 255, np.uint8)
        most = len(some) * len(directions) * len(self._spheres)
        row, triangle, rays = np.empty(most, np.int32), np.empty(most, np.int32), np.empty((2, most, 3), np.float32)
        n = kernels.rays_to_spheres(
            np.arange(len(some)), self._spheres, lifted, frames, directions, parents, 1, everything, True, row,
            triangle, *rays,
        )  # fmt: skip
        origins, along = rays[0, :n], rays[1, :n]
        meets = np.zeros(n, bool)
        for caster in self._casters if n else ():
            meets |= caster.parts_block(origins, along)
        at = np.flatnonzero(meets)
        if len(at):
            free = ~self._rest.occluded(origins[at], along[at])
            found[rows[row[at[free]]]] = False
