"""Visibility of the points of a picture, coarse to fine, most of it without rays [BenArtzi07, ch. 8].

`coherent_visibility` evaluates the picture coarse to fine (16, 8, 4, 2, 1; square then diamond steps). Where the four
evaluated neighbours of a point on the same object agree, their value is the prediction. Where they disagree a ray is
traced, and where the result contradicts the prediction (the majority; a tie contradicts any result), the adjacent
targets that now disagree are traced too. It differs from the thesis' OPT in three ways, each measured on the reference
tea tray: neighbours must have similar normals (0.8 in cosine); flooding continues in the last step, without which thin
shadows vanish; and it starts from contradicted majorities only and crosses edges only, which saves half of the rays.
Points beside a pixel's centre, at edges, use the nearest centre on their surface as prediction, except for targets
below its horizon; where none is near, all of their rays are traced. All points of a block go to Embree as one batch per
round; the bit operations between rounds are compiled.

Where a silhouette leaves a point with two or three informers, the thesis traces every ray. Here their prediction is
used, and its boundary is traced as well, and with it every sixteenth target with two informers and every 64th with
three: every fourth found little more (reference bunny at 256x256: 156 rays a point with 0.008 % errors, instead of 118
with 0.009 %). In the last step it is enough that three of four points see a target, except for every fourth target,
which floods where it contradicts: a straight shadow edge that separates one corner of a square from the others leaves
its centre with those three (106 rays, 0.014 %; *shapes* 0.014 %, reference tea tray 0.014 %). Relying on three that do
not see it saves less and has as many errors. The remaining rays lie along silhouettes, where a ray costs Embree three
times the mean.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from engine.core.threads import map_ahead, pool
from engine.scene.edges import nearest_centres
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic
from engine.visibility import _kernels as kernels
from engine.visibility.point_visibility import (
    BLOCK,
    VISIBILITY_LEVEL,
    Guess,
    Visibility,
    evaluate_block,
    guess_nothing,
    horizons,
)

COARSEST_STEP = 16
AT_ONCE = 8
ALIKE_COSINE = 0.8


@dataclass(frozen=True)
class GridStep:
    """One step towards a lattice of `stride` pixels: rows (B,), and the rows (B, 4) that inform each (-1: none).

    beside: the points lie beside their pixels' centres, and all four informers of one are the same.
    """

    stride: int
    rows: np.ndarray
    informers: np.ndarray
    beside: bool = False


def grid_steps(hits: PrimaryHits, until: int = 1, alike: float = ALIKE_COSINE) -> Iterator[GridStep]:
    """Square and diamond steps over the pixels that show a surface, down to a lattice of every `until`-th pixel; for
    every pixel, a last step for points beside their centres.

    [BenArtzi07, fig. 8.4]; until: a power of two, 1 to 16; alike: the cosine between normals that must be exceeded for
    one point to inform another.
    """
    row_of_pixel = hits.row_image
    step = COARSEST_STEP
    yield _grid_step(hits, row_of_pixel, (0, 0, step, step), (), step, alike)
    while step > until:
        half = step // 2
        diagonal = ((-half, -half), (-half, half), (half, -half), (half, half))
        yield _grid_step(hits, row_of_pixel, (half, half, step, step), diagonal, half, alike)
        axis = ((-half, 0), (half, 0), (0, -half), (0, half))
        first = _grid_step(hits, row_of_pixel, (0, half, step, step), axis, half, alike)
        second = _grid_step(hits, row_of_pixel, (half, 0, step, step), axis, half, alike)
        yield GridStep(
            half,
            np.concatenate([first.rows, second.rows]),
            np.concatenate([first.informers, second.informers]),
        )
        step = half
    if until == 1 and not hits.is_centred.all():
        rows, nearest = nearest_centres(hits, hits.horizon, np.full(len(hits.object_ranges), ALIKE_COSINE))
        yield GridStep(1, rows, np.repeat(nearest[:, None], 4, axis=1), beside=True)


def _grid_step(
    hits: PrimaryHits,
    row_of_pixel: np.ndarray,
    lattice: tuple[int, int, int, int],
    offsets: Sequence[tuple[int, int]],
    stride: int,
    alike: float,
) -> GridStep:
    """The rows on a lattice (first row and column, their spacing), informed by pixels at the offsets."""
    y0, x0, dy, dx = lattice
    height, width = row_of_pixel.shape
    y, x = (axis.ravel() for axis in np.mgrid[y0:height:dy, x0:width:dx])
    rows = row_of_pixel[y, x]
    y, x, rows = y[rows >= 0], x[rows >= 0], rows[rows >= 0]
    informers = np.full((len(rows), 4), -1, np.int32)
    for k, (oy, ox) in enumerate(offsets):
        ny, nx = y + oy, x + ox
        inside = (ny >= 0) & (ny < height) & (nx >= 0) & (nx < width)
        found = np.where(inside, row_of_pixel[ny % height, nx % width], -1)
        informers[:, k] = np.where((found >= 0) & _alike(hits, found, rows, alike), found, -1)
    return GridStep(stride, rows, informers)


def _alike(hits: PrimaryHits, a: np.ndarray, b: np.ndarray, cosine: float) -> np.ndarray:
    """Whether points a can inform points b: on one object, with similar normals."""
    objects = hits.objects
    facing = np.einsum("ij,ij->i", hits.horizon[a], hits.horizon[b])
    return (objects[a] == objects[b]) & (facing > cosine)


class _Prediction:
    """Predicts the bits of points from those of their informers."""

    def __init__(self, hits: PrimaryHits, visibility: Visibility, sphere: Visibility | None) -> None:
        """sphere: see `coherent_visibility`."""
        targets = visibility.targets
        self._hits, self._visibility, self._sphere = hits, visibility, sphere
        self._always, self._weak, self._weakest = (
            targets.sentinels(step) for step in (targets.sentinel_step, targets.weak_step, targets.weakest_step)
        )
        self._around = geodesic(VISIBILITY_LEVEL).neighbours
        # Targets that three of four informers see are traced; in the last step most of them are believed.
        self._nothing = targets.sentinels(0)[0]
        self._last_believed = ~targets.sentinels(targets.doubt_step)[0] if targets.doubt_step else self._nothing

    def guess_by(self, informers: np.ndarray, step: GridStep) -> Guess:
        """The prediction of a step's points by these informers, as a function for `evaluate_block`."""
        believed = self._last_believed if step.stride == 1 else self._nothing
        targets, bits, sphere = self._visibility.targets, self._visibility.bits, self._sphere

        def guess(rows: np.ndarray, horizon: np.ndarray, todo: np.ndarray, doubt: np.ndarray) -> None:
            kernels.predict(
                rows, informers, bits, horizon, believed, self._always, self._weak, self._weakest, targets.neighbours,
                todo, doubt,
            )  # fmt: skip
            if sphere is not None:
                kernels.check_against_sphere(
                    rows, informers, sphere.bits, targets.parents, self._around, bits, horizon, todo
                )
            if targets.bright is not None:
                todo |= horizon & targets.bright_words
            if step.beside:
                known = np.flatnonzero(informers[:, 0] >= 0)
                todo[known] |= horizon[known] & ~horizons(self._hits, targets, informers[known, 0])

        return guess


def coherent_visibility(
    hits: PrimaryHits, caster: RayCaster, visibility: Visibility, until: int = 1, sphere: Visibility | None = None
) -> Iterator[float]:
    """Fills `visibility` coarse to fine, down to every `until`-th pixel; yields the fraction done.

    Yields after each block of 1,024 points; up to eight are evaluated at once. Finished rows are skipped, so a call
    continues where an earlier one stopped. Without targets it finishes at once.

    sphere: for targets with parents, the finished visibility of those. A cluster of bright lights is so small that the
    points around a thin shadow can agree on all of it; the point's own coarser visibility then reveals the error.
    """
    if len(visibility.targets.positions) == 0:
        visibility.done[:] = True
        return
    steps = list(grid_steps(hits, until))
    n_done, n_points = 0, max(1, sum(int((~visibility.done[step.rows]).sum()) for step in steps))
    prediction = _Prediction(hits, visibility, sphere)
    with pool() as threads:
        for step in steps:
            fresh = ~visibility.done[step.rows]
            rows, informers = step.rows[fresh], step.informers[fresh]
            blocks = [slice(i, i + BLOCK) for i in range(0, len(rows), BLOCK)]

            def evaluate(
                block: slice, step: GridStep = step, rows: np.ndarray = rows, informers: np.ndarray = informers
            ) -> tuple[int, int]:
                # Where rays pass at random, neighbours that agree would make the more frequent answer the only one.
                guess = guess_nothing(visibility) if caster.blends else prediction.guess_by(informers[block], step)
                return evaluate_block(hits, caster, visibility, rows[block], guess)

            for block, count in zip(blocks, map_ahead(threads, evaluate, blocks, AT_ONCE), strict=True):
                visibility.rays.traced += count[0]
                visibility.rays.possible += count[1]
                visibility.done[rows[block]] = True
                n_done += len(rows[block])
                yield n_done / n_points
