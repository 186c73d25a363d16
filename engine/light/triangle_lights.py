"""Triangle lights: the environment as a cut through the geodesic hierarchy, fine where the light is.

Lights are triangles, not points, because editing a BRDF requires the angular extent of the light as much as its power
[BenArtzi07, sect. 4.2.3]. They are geodesic triangles, not a fitted set, because visibility is stored on the same tree.

The cut first splits the triangle with the largest  luminance integral^1 * solid angle^(1/4)  [Agarwal03]. That measure
never increases from a parent to its child, so the greedy cut consists of the n largest inner nodes of the tree, found
by one sort without a queue. Ties (black regions) prefer the coarser triangle.

If the share of the picture's points that see each direction is known, directions that none of them sees do not count,
and those that few see cost little, so that more lights are cut where most of the sky is hidden: each costs four times
its share (an unoccluded point sees half of the sky), at most twice as many lights in all. In the built-in room, whose
sky is visible through the windows, edges of windows across lights of one bit each drew stripes of 5 % on the walls, now
2 %. Luminance times the square root of the share was rejected, although it would minimise the mean square error if all
surfaces were diffuse: few points see what copper on the tea tray reflects at grazing angles, and its error was 0.9 %
with 10,000 lights instead of 0.3 %.

A sun is smaller than a triangle of the finest level that is summed, and one ray to it gives no penumbra: behind blinds
its stripes were perfectly sharp, and fell between pixels. Lights that still hold much of the total power are split
further, down to `peak_level`. The power of each piece follows from the interpolated map, as it is displayed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.triangles import quarters
from engine.light.environment import LUMINANCE, Environment, downsample, triangle_integrals, upsample_interpolated
from engine.light.suns import sun_lights
from engine.sphere.geodesic import MAX_LEVEL, geodesic, locate, triangle_solid_angles

MIN_LIGHTS = 20
# A light with more than this share of the total power is a peak, such as the sun or a piece of it.
PEAK_SHARE = 0.004
# The centres (16, 3) of the parts of a triangle that is split in four twice, in barycentric coordinates.
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
    """M spherical triangles that tile the sphere. Directions are unit, in world space, towards the light.

    level (M,) int8 and index (M,) int32: the geodesic triangle. vertices (N, 3) float32 and corners (M, 3) int32,
    indices into them, shared corners once. centre (M, 3) float32: luminance-weighted mean direction, the true centroid
    where dark. power (M, 3) float32: the integral of L d omega. solid_angle (M,) float32, steradians. tree: the
    hierarchy below them, down to the level that was integrated; rows (M,) int32: their rows in it, -1 for pieces of
    suns, which are finer.
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


def turned(directions: NDArray[np.floating], degrees: float) -> NDArray[np.float32]:
    """Directions (N, 3) of an environment that is rotated by so many degrees more."""
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    # The azimuth in the world, atan2(x, −z), is that in the map minus the rotation.
    x, y, z = directions.astype(np.float64).T
    return np.stack([x * cosine + z * sine, y, z * cosine - x * sine], axis=1).astype(np.float32)


def cut_lights(
    environment: Environment,
    n_lights: int,
    rotation: float = 0.0,
    max_level: int = MAX_LEVEL,
    integrals: NDArray[np.float64] | None = None,
    seen: NDArray[np.floating] | None = None,
    peak_level: int = 0,
) -> TriangleLights:
    """The environment, rotated by `rotation` degrees, as at most `n_lights` triangles (20 + 3 k of them).

    seen (20 * 4^l,), l at most max_level: the share of points that see each triangle of a level; None: all points see
    all. With it there may be twice as many lights, see above. peak_level: the level down to which suns of the
    interpolated map are split, 0 to use the map as it is; see above. integrals: (20 * 4^max_level, 3),
    `triangle_integrals(environment, rotation, max_level)`, if the caller has them; cutting the same environment again
    then costs milliseconds. Total power is that of the environment. Raises ValueError for fewer than 20 lights, a level
    outside 0 to 7, or integrals of another shape.
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


def quick_integrals(
    environment: Environment, rotation: float, level: int, n_rows: int | None = None
) -> NDArray[np.float64]:
    """The integral of L d omega over each triangle (20 * 4^level, 3), as `triangle_integrals` has it of the map,
    averaged to n_rows, and of suns by the directions that stand for them. So those of a map are found once for all
    places of its suns, while the light is dragged."""
    base = environment if environment.base is None else environment.base
    integrals = triangle_integrals(base if n_rows is None else downsample(base, n_rows), rotation, level)
    if environment.suns:
        integrals = integrals.copy()
        for directions, power in map(sun_lights, environment.suns):
            np.add.at(integrals, locate(turned(directions, rotation), level), power)
    return integrals


def powers_in(lights: TriangleLights, environment: Environment, rotation: float) -> NDArray[np.float32]:
    """The power (M, 3) of another environment in the triangles of lights, which were cut down to MAX_LEVEL."""
    powers = _pyramid(triangle_integrals(environment, rotation, MAX_LEVEL), MAX_LEVEL)
    return np.concatenate(powers)[lights.rows].astype(np.float32)


def _with_split_peaks(
    lights: TriangleLights, environment: Environment, rotation: float, finest: int, peak_level: int
) -> TriangleLights:
    """Splits lights of the finest level, and their pieces, while they hold much of the total power."""
    bright = PEAK_SHARE * float(lights.power.astype(np.float64).sum())
    for level in range(finest, peak_level):
        peaks = (lights.level == level) & (lights.power.sum(axis=1) > bright)
        if not peaks.any():
            break
        lights = _with_pieces(lights, peaks, environment, rotation)
    return lights


def _with_pieces(
    lights: TriangleLights, split: NDArray[np.bool_], environment: Environment, rotation: float
) -> TriangleLights:
    """Replaces each light to split (M,) by four pieces, appended to the others."""
    wholes = lights.vertices[lights.corners[split]].astype(np.float64)
    pieces = quarters(wholes, on_sphere=True).reshape(-1, 3, 3)
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
    """The power of the pieces (4 K, 3, 3): the power (K, 3) of each light divided among its four, by the interpolated
    map."""
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
    """For every triangle with children, level by level: its importance and the cost of splitting it."""
    if seen is None:
        levels = _pyramid(luminance[:, None], max_level)
        return _inner(levels), [np.ones(len(level)) for level in levels[:-1]]
    share = np.repeat(np.asarray(seen, np.float64), len(luminance) // len(seen))
    # The mean over the descendants; children finer than the known level use their parent's value.
    means = [total[:, 0] * len(total) / len(share) for total in _pyramid(share[:, None], max_level)[:-1]]
    seen_by_any = np.where(share > 0.0, luminance, 0.0)
    return _inner(_pyramid(seen_by_any[:, None], max_level)), [np.minimum(_OPEN * m, 1) for m in means]


def _inner(levels: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    return [level[:, 0] * geodesic(i).solid_angles ** 0.25 for i, level in enumerate(levels[:-1])]


def _nodes_to_split(
    importance: list[NDArray[np.float64]], costs: list[NDArray[np.float64]], n_splits: int
) -> list[NDArray[np.bool_]]:
    """Which triangles of each level above the finest are split: the most important ones with a total cost of
    `n_splits`."""
    # The sort is stable, so that ties prefer coarser triangles.
    ranked = np.argsort(-np.concatenate([*importance, np.empty(0)]), kind="stable")
    cost = np.cumsum(np.concatenate([*costs, np.empty(0)])[ranked[: _MOST_TIMES * n_splits]])
    chosen = np.zeros(len(ranked), bool)
    chosen[ranked[: np.searchsorted(cost, n_splits, "right")]] = True
    return np.split(chosen, np.cumsum([len(level) for level in importance]))[: len(importance)]


def _leaves(split: list[NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """The triangles of each level that exist in the cut and are not split further."""
    existing = np.ones(20, bool)
    leaves = []
    for mask in split:
        leaves.append(existing & ~mask)
        existing = np.repeat(existing & mask, 4)
    return [*leaves, existing]


def _assemble(
    kept: list[NDArray[np.intp]], powers: list[NDArray[np.float64]], moments: list[NDArray[np.float64]]
) -> TriangleLights:
    """The lights of a cut: `kept` triangles of each level, with the tree below them."""
    spheres = [geodesic(level) for level in range(len(kept))]
    triangles = np.concatenate([sphere.triangles[rows] for sphere, rows in zip(spheres, kept, strict=True)])
    used, which = np.unique(triangles, return_inverse=True)  # vertices retain their number from level to level
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
    """Unit mean directions of all levels; the centroid of the triangle where there is no light."""
    return np.concatenate([_mean_directions(moment, geodesic(i).centres) for i, moment in enumerate(moments)])


def _mean_directions(moments: NDArray[np.float64], centroids: NDArray[np.float64]) -> NDArray[np.float32]:
    """Normalised moments (N, 3); the centroid where there is no light."""
    largest = np.abs(moments).max(axis=1, keepdims=True)
    # Scaled first: the squares of a faint light's moment may underflow.
    chosen = np.where(largest > 0.0, moments / np.where(largest > 0.0, largest, 1.0), centroids)
    chosen /= np.linalg.norm(chosen, axis=1, keepdims=True)
    return chosen.astype(np.float32)
