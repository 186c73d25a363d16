"""Triangle lights: the environment as a cut through the geodesic hierarchy, fine where the light is.

Triangles, not points, because editing a BRDF needs the angular extent of the light as much as its power
[BenArtzi07, sect. 4.2.3]; the geodesic triangles, not a fitted set, because visibility is kept on the same tree.

The cut splits the triangle with the largest  luminance integral^1 * solid angle^(1/4)  first [Agarwal03]. That measure
never grows from a parent to its child, so the greedy cut is simply the n largest inner nodes of the tree, found by one
sort; no queue is needed. Ties (black regions) go to the coarser triangle.

Where it is known which share of the picture's points sees each direction, what none of them sees does not count, and
what few see costs little, so that more lights are cut where most of the sky is hidden: each counts by four times its
share (a point in the open sees half of the sky), up to twice as many in all. In the built-in room, whose sky stands in
the windows, edges of windows across lights of one bit each drew stripes of 5 % on the walls; so they are 2 %. Rejected:
luminance times the root of the share, by which the mean square error would go were all surfaces matt. What copper on
the tea tray mirrors at grazing angles few points see, and it was 0.9 % off with 10,000 lights instead of 0.3 %.

A sun is smaller than a triangle of the finest level that is summed, and one ray to it knows no penumbra: behind blinds
its stripes were as sharp as a laser's, and fell between pixels. Lights that still hold much of the whole are split
further, down to `sun_level`, each with its share of the light of the map, which is then interpolated as where it is
shown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import LUMINANCE, Environment, triangle_integrals, upsample_interpolated
from engine.sphere.geodesic import MAX_LEVEL, geodesic, triangle_solid_angles

MIN_LIGHTS = 20
# A light with more than this share of all the power is a sun's, or a piece of one.
PEAK_SHARE = 0.004
# The middles (16, 3) of the parts of a triangle that is cut in four twice.
_STEPS = (np.array([1.0, 4.0, 7.0, 10.0]) / 12.0).tolist()
_WITHIN = np.array(
    [(a, b, 1.0 - a - b) for a in _STEPS for b in _STEPS if a + b < 0.99]
    + [(a + 1 / 12, b + 1 / 12, 5 / 6 - a - b) for a in _STEPS for b in _STEPS if a + b < 0.75]
)
_MOST_TIMES, _OPEN = 2, 4.0


class LightTree(NamedTuple):
    """All triangles of the hierarchy down to a finest level, level by level: N = 20 (4^levels - 1) / 3 rows.

    power (N, 3) float32, the integral of L d omega; centre (N, 3) float32, luminance-weighted mean direction, the
    centroid where dark. The children of row r are 4 r + 20 to 4 r + 23.
    """

    power: NDArray[np.float32]
    centre: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class TriangleLights:
    """M spherical triangles that tile the sphere. Directions are unit, in the world, towards the light.

    level (M,) int8 and index (M,) int32: the geodesic triangle. vertices (N, 3) float32 and corners (M, 3) int32 into
    them, shared corners once. centre (M, 3) float32: luminance-weighted mean direction, the true centroid where dark.
    power (M, 3) float32: the integral of L d omega. solid_angle (M,) float32, steradians.
    tree: what lies below them, down to the level that was integrated; rows (M,) int32: where they stand in it, -1 for
    pieces of suns, which are finer.
    """

    level: NDArray[np.int8]
    index: NDArray[np.int32]
    corners: NDArray[np.int32]
    vertices: NDArray[np.float32]
    centre: NDArray[np.float32]
    power: NDArray[np.float32]
    solid_angle: NDArray[np.float32]
    tree: LightTree
    rows: NDArray[np.int32]

    def scale_by(self, scale: float) -> TriangleLights:
        """The same lights, `scale` times as bright."""
        factor = np.float64(scale)  # beyond single precision the product may still be within it
        tree = self.tree._replace(power=(self.tree.power * factor).astype(np.float32))
        return replace(self, power=(self.power * factor).astype(np.float32), tree=tree)

    def __len__(self) -> int:
        return len(self.index)


def cut_lights(
    environment: Environment,
    n_lights: int,
    rotation: float = 0.0,
    max_level: int = MAX_LEVEL,
    integrals: NDArray[np.float64] | None = None,
    seen: NDArray[np.floating] | None = None,
    peak_level: int = 0,
) -> TriangleLights:
    """The environment, turned by `rotation` degrees, as at most `n_lights` triangles (20 + 3 k of them).

    seen (20 * 4^l,), l at most max_level: the share of points that sees each triangle of a level; None: each sees all.
    With it they may be twice as many, see above.
    sun_level: down to which level suns of the interpolated map are split besides, 0 for neither; see above.
    integrals: (20 * 4^max_level, 3), `triangle_integrals(environment, rotation, max_level)`, where the caller has it;
    cutting the same environment again then costs milliseconds. Total power is that of the environment.
    Raises ValueError for fewer than 20 lights, a level outside 0 to 7, or integrals of another shape.
    """
    if n_lights < MIN_LIGHTS:
        raise ValueError(f"n_lights = {n_lights}, expected at least {MIN_LIGHTS}")
    finest = geodesic(max_level)
    if peak_level:
        environment = upsample_interpolated(environment)
    if integrals is None:
        integrals = triangle_integrals(environment, rotation, max_level)
    if seen is not None and (len(seen) > finest.n_triangles or finest.n_triangles % len(seen)):
        raise ValueError(
            f"seen of shape {seen.shape}, expected one share for each triangle of a level up to {max_level}"
        )
    if integrals.shape != (finest.n_triangles, 3):
        raise ValueError(f"integrals have shape {integrals.shape}, expected {(finest.n_triangles, 3)}")
    luminance = integrals @ LUMINANCE
    powers = _pyramid(integrals, max_level)
    moments = _pyramid(luminance[:, None] * finest.centres, max_level)
    split = _nodes_to_split(*_importance(luminance, seen, max_level), (n_lights - MIN_LIGHTS) // 3)
    kept = [np.flatnonzero(mask) for mask in _leaves(split)]
    lights = _assemble(kept, powers, moments)
    return _with_split_peaks(lights, environment, rotation, max_level, peak_level)


def _with_split_peaks(
    lights: TriangleLights, environment: Environment, rotation: float, finest: int, peak_level: int
) -> TriangleLights:
    """The lights, of which those of the finest level, and their pieces, are split while they hold much of the whole."""
    bright = PEAK_SHARE * float(lights.power.astype(np.float64).sum())
    for level in range(finest, peak_level):
        suns = (lights.level == level) & (lights.power.sum(axis=1) > bright)
        if not suns.any():
            break
        lights = _with_pieces(lights, suns, environment, rotation)
    return lights


def _with_pieces(
    lights: TriangleLights, split: NDArray[np.bool_], environment: Environment, rotation: float
) -> TriangleLights:
    """The lights with four pieces behind the others in the place of each that is split (M,)."""
    a, b, c = lights.vertices[lights.corners[split]].astype(np.float64).transpose(1, 0, 2)
    ab, bc, ca = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (a + b, b + c, c + a))
    pieces = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3, 3)
    power = _power_of_pieces(environment, rotation, pieces, lights.power[split].astype(np.float64))
    middles = pieces.sum(axis=1)
    n, whole = len(pieces), ~split
    index = np.concatenate([lights.index[whole], (4 * lights.index[split, None] + np.arange(4)).ravel()])
    corners = len(lights.vertices) + np.arange(3 * n).reshape(n, 3)
    centre = middles / np.linalg.norm(middles, axis=1, keepdims=True)
    return TriangleLights(
        level=np.concatenate([lights.level[whole], np.repeat(lights.level[split] + np.int8(1), 4)]),
        index=index.astype(np.int32),
        corners=np.concatenate([lights.corners[whole], corners]).astype(np.int32),
        vertices=np.concatenate([lights.vertices, pieces.reshape(-1, 3)]).astype(np.float32),
        centre=np.concatenate([lights.centre[whole], centre]).astype(np.float32),
        power=np.concatenate([lights.power[whole], power]).astype(np.float32),
        solid_angle=np.concatenate([lights.solid_angle[whole], triangle_solid_angles(pieces)]).astype(np.float32),
        tree=lights.tree,
        rows=np.concatenate([lights.rows[whole], np.full(n, -1, np.int32)]),
    )


def _power_of_pieces(
    environment: Environment, rotation: float, pieces: NDArray[np.float64], whole: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What each of the pieces (4 K, 3, 3) has of the power (K, 3) of the four in a row, as the map is interpolated."""
    places = np.einsum("sk,mki->msi", _WITHIN, pieces).reshape(-1, 3)
    seen = environment.evaluate(places, rotation).reshape(len(pieces), -1, 3).mean(axis=1, dtype=np.float64)
    seen = (seen * triangle_solid_angles(pieces)[:, None]).reshape(-1, 4, 3)
    total = seen.sum(axis=1, keepdims=True)
    shares = np.divide(seen, total, out=np.full_like(seen, 0.25), where=total > 0.0)
    return (shares * whole[:, None]).reshape(-1, 3)


def _pyramid(finest: NDArray[np.float64], max_level: int) -> list[NDArray[np.float64]]:
    """Sums over the descendants for every level 0..max_level, coarsest first."""
    levels = [finest]
    for _ in range(max_level):
        levels.append(levels[-1].reshape(-1, 4, finest.shape[1]).sum(axis=1))
    return levels[::-1]


def _importance(
    luminance: NDArray[np.float64], seen: NDArray[np.floating] | None, max_level: int
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Of every triangle that has children, level by level: what it counts when it is split, and what that costs."""
    if seen is None:
        levels = _pyramid(luminance[:, None], max_level)
        return _inner(levels), [np.ones(len(level)) for level in levels[:-1]]
    share = np.repeat(np.asarray(seen, np.float64), len(luminance) // len(seen))
    # The mean over what is below; of children that are finer than what is known, that of their parent.
    means = [total[:, 0] * len(total) / len(share) for total in _pyramid(share[:, None], max_level)[:-1]]
    seen_by_any = np.where(share > 0.0, luminance, 0.0)
    return _inner(_pyramid(seen_by_any[:, None], max_level)), [np.minimum(_OPEN * m, 1) for m in means]


def _inner(levels: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    return [level[:, 0] * geodesic(i).solid_angles ** 0.25 for i, level in enumerate(levels[:-1])]


def _nodes_to_split(
    importance: list[NDArray[np.float64]], costs: list[NDArray[np.float64]], n_splits: int
) -> list[NDArray[np.bool_]]:
    """Which triangles of each level above the finest are split: the most important ones that cost `n_splits` in all."""
    ranked = np.argsort(-np.concatenate([*importance, np.empty(0)]), kind="stable")  # stable: ties stay coarse first
    cost = np.cumsum(np.concatenate([*costs, np.empty(0)])[ranked[: _MOST_TIMES * n_splits]])
    chosen = np.zeros(len(ranked), bool)
    chosen[ranked[: np.searchsorted(cost, n_splits, "right")]] = True
    return np.split(chosen, np.cumsum([len(level) for level in importance]))[: len(importance)]


def _leaves(split: list[NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """Triangles of each level that exist in the cut and are not split further."""
    existing = np.ones(20, bool)
    leaves = []
    for mask in split:
        leaves.append(existing & ~mask)
        existing = np.repeat(existing & mask, 4)
    return [*leaves, existing]


def _assemble(
    kept: list[NDArray[np.intp]], powers: list[NDArray[np.float64]], moments: list[NDArray[np.float64]]
) -> TriangleLights:
    spheres = [geodesic(level) for level in range(len(kept))]
    triangles = np.concatenate([sphere.triangles[rows] for sphere, rows in zip(spheres, kept, strict=True)])
    used, which = np.unique(triangles, return_inverse=True)  # vertices keep their number from level to level
    corners: NDArray[np.int32] = which.reshape(-1, 3).astype(np.int32)
    vertices = spheres[-1].vertices[used]
    tree = LightTree(np.concatenate(powers).astype(np.float32), _tree_centres(moments))
    level = np.repeat(np.arange(len(kept), dtype=np.int8), [len(rows) for rows in kept])
    index = np.concatenate(kept).astype(np.int32)
    rows_in_tree = (20 * (4 ** level.astype(np.int64) - 1) // 3 + index).astype(np.int32)
    solid_angle = np.concatenate([sphere.solid_angles[rows] for sphere, rows in zip(spheres, kept, strict=True)])
    return TriangleLights(
        level=level,
        index=index,
        corners=corners,
        vertices=vertices.astype(np.float32),
        centre=tree.centre[rows_in_tree],
        power=tree.power[rows_in_tree],
        solid_angle=solid_angle.astype(np.float32),
        tree=tree,
        rows=rows_in_tree,
    )


def _tree_centres(moments: list[NDArray[np.float64]]) -> NDArray[np.float32]:
    """Unit moments of all levels; the centroid of the triangle where there is no light to weigh by."""
    return np.concatenate([_mean_directions(moment, geodesic(i).centres) for i, moment in enumerate(moments)])


def _mean_directions(moments: NDArray[np.float64], centroids: NDArray[np.float64]) -> NDArray[np.float32]:
    largest = np.abs(moments).max(axis=1, keepdims=True)
    # Scaled first: the squares of a faint light's moment may underflow.
    chosen = np.where(largest > 0.0, moments / np.where(largest > 0.0, largest, 1.0), centroids)
    chosen /= np.linalg.norm(chosen, axis=1, keepdims=True)
    return chosen.astype(np.float32)
