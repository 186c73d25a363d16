"""The visibility methods of the thesis side by side [BenArtzi07, ch. 8]: for comparison only, the engine uses
`coherent_grid`.

A variant combines three choices. Order: scanline (S: informed by the pixels to the left, above and above left) or grid
(G: four surrounding pixels, coarse to fine). Estimate: each informer's blockers are copied to the directions in which
the informer saw them (N) or warped to their directions as seen from the new point (W). Correction: rays are traced
along the boundary of the estimated blockers (B) or where the informers disagree (U), and from each ray that contradicts
the estimate on to all its neighbours. FLO is GNU that does not continue in the last step of the grid. OPT is FLO that
continues only to neighbours which then disagree with the ray. TRUE traces everything. Pixels without all their
informers on the same object are traced completely. docs/visibility.md compares cost and accuracy.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from benchmarks import _thesis_visibility_kernels as variant_kernels
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.visibility import _kernels as kernels
from engine.visibility.coherent_grid import grid_steps
from engine.visibility.point_visibility import BLOCK, Targets, Visibility, empty_visibility, horizons

Variant = Literal["SNB", "SNU", "SWB", "SWU", "GNB", "GNU", "GWB", "GWU", "FLO", "OPT", "TRUE"]
VARIANTS: tuple[Variant, ...] = get_args(Variant)
_OF_ANY_NORMAL = -2.0  # a cosine that all pairs exceed: the thesis only requires the same object

Int32Array = NDArray[np.int32]


def voronoi_targets(directions: NDArray[np.floating]) -> Targets:
    """Unit directions (D, 3), D ≥ 4; the neighbours of each are all those whose Voronoi cells touch its own.

    About six each, as in the thesis; they are the edges of the directions' convex hull.
    """
    from scipy.spatial import ConvexHull

    corners = ConvexHull(directions).simplices
    edges = np.concatenate([corners[:, [i, j]] for i in range(3) for j in range(3) if i != j])
    own, other = np.unique(edges, axis=0).T
    counts = np.bincount(own, minlength=len(directions))
    neighbours = np.full((len(directions), counts.max()), -1, np.int32)
    neighbours[own, np.arange(len(own)) - np.repeat(np.cumsum(counts) - counts, counts)] = other
    positions = np.ascontiguousarray(directions, np.float32)
    return Targets(positions, np.zeros_like(positions), neighbours)


def variant_visibility(hits: PrimaryHits, caster: RayCaster, targets: Targets, variant: Variant) -> Visibility:
    """The visibility of D directions from P points by one method, on one thread; `rays` counts the traced rays.

    targets: from `voronoi_targets`. Warping stores P x D distances in single precision meanwhile. Raises ValueError for
    a name that is not in VARIANTS and for finite targets.
    """
    if variant not in VARIANTS or targets.finite:
        requested = f"{variant!r} of {'points' if targets.finite else 'directions'}"
        raise ValueError(f"variant = {requested}, expected one of {', '.join(VARIANTS)}, of directions")
    picture = _VariantState(hits, caster, targets, variant)
    steps = _everything(hits) if variant == "TRUE" else _scanline(hits) if variant[0] == "S" else _grid(hits)
    for rows, informers, last in steps:
        for i in range(0, len(rows), BLOCK):
            picture.evaluate(rows[i : i + BLOCK], informers[i : i + BLOCK], last)
    return picture.visibility


class _VariantState:
    """The results so far and, if blockers are warped, the distance of the blocker in each blocked direction."""

    def __init__(self, hits: PrimaryHits, caster: RayCaster, targets: Targets, variant: Variant) -> None:
        self._hits, self._caster = hits, caster
        self._scanline, self._only_disagreeing = variant[0] == "S", variant == "OPT"
        self._warp, self._boundary = variant[1] == "W", variant[2] == "B"
        self._floods_last = variant not in ("FLO", "OPT")
        self.visibility = empty_visibility(hits, targets)
        n_points, n_targets = len(hits.pixel), len(targets.positions)
        self._distance = np.full((n_points, n_targets), np.inf, np.float32) if self._warp else np.empty((0, 0))
        used = np.zeros(64 * targets.n_words, np.uint8)
        used[:n_targets] = 1
        self._valid = np.packbits(used, bitorder="little").view(np.uint64)

    def evaluate(self, rows: Int32Array, informers: Int32Array, last: bool) -> None:
        """Estimates some points (B,) from finished ones (B, 3 or 4), and corrects the estimate."""
        visibility, targets, hits = self.visibility, self.visibility.targets, self._hits
        bits, neighbours = visibility.bits, targets.neighbours
        horizon = horizons(hits, targets, rows)
        some, every, requested, doubt = (np.zeros_like(horizon) for _ in range(4))
        if self._warp:
            variant_kernels.warp_blockers(
                rows, informers, bits, hits.position, targets.positions, neighbours, self._distance, some, every
            )
        else:
            variant_kernels.copy_blockers(informers, bits, self._valid, some, every)
        variant_kernels.estimate(
            rows, informers, some, every, self._boundary, self._scanline, horizon, neighbours, bits, requested
        )
        if self._only_disagreeing:
            doubt[:] = requested
        n_rays = kernels.count_bits(requested)
        block, target = np.empty(n_rays, np.int32), np.empty(n_rays, np.int32)
        kernels.list_bits(requested, block, target)
        while n_rays:
            visibility.rays.traced += n_rays
            blocked = self._trace(rows, block, target)
            room = n_rays * neighbours.shape[1]
            further = np.empty(room, np.int32), np.empty(room, np.int32)
            if self._only_disagreeing:
                n_rays = kernels.apply_answers(
                    rows, block, target, blocked, doubt, bits, horizon, neighbours, requested, *further
                )
            else:
                n_rays = variant_kernels.flood_around(
                    rows, block, target, blocked, bits, horizon, neighbours, requested, *further
                )
            if last and not self._floods_last:
                break
            block, target = (each[:n_rays] for each in further)
        visibility.rays.possible += kernels.count_bits(horizon)
        visibility.done[rows] = True

    def _trace(self, rows: Int32Array, block: Int32Array, target: Int32Array) -> NDArray[np.bool_]:
        hits, targets, n_rays = self._hits, self.visibility.targets, len(block)
        origin, direction = np.empty((n_rays, 3), np.float32), np.empty((n_rays, 3), np.float32)
        kernels.write_rays(
            rows, block, target, hits.position, hits.offset_position, targets.positions, targets.finite, origin,
            direction, np.empty(0, np.float32),
        )  # fmt: skip
        if not self._warp:
            return self._caster.occluded(origin, direction)
        found = self._caster.intersect(origin, direction)
        self._distance[rows[block], target] = found.distance
        return np.asarray(found.triangle >= 0)


Step = tuple[Int32Array, Int32Array, bool]


def _everything(hits: PrimaryHits) -> Iterator[Step]:
    rows = np.arange(len(hits.pixel), dtype=np.int32)
    yield rows, np.full((len(rows), 1), -1, np.int32), True


def _grid(hits: PrimaryHits) -> Iterator[Step]:
    """Points coarse to fine, the four that inform each, and whether the step is the last: half of the picture."""
    steps = list(grid_steps(hits, alike=_OF_ANY_NORMAL))
    for step in steps:
        yield step.rows, step.informers, step is steps[-1]


def _scanline(hits: PrimaryHits) -> Iterator[Step]:
    """Points along diagonals of the picture, informed from the left, above left and above. All informers of a point lie
    on the two diagonals before its own, so the results equal those of scanlines."""
    width, height = hits.resolution
    around = np.full((height + 1, width + 1), -1, np.int32)
    around[1:, 1:] = hits.row_image
    objects = hits.objects
    for d in range(width + height - 1):
        y = np.arange(max(0, d - width + 1), min(d, height - 1) + 1)
        x = d - y
        rows = around[y + 1, x + 1]
        informers = np.stack([around[y + 1, x], around[y, x], around[y, x + 1]], axis=1)[rows >= 0]
        rows = rows[rows >= 0]
        same = (informers >= 0) & (objects[informers] == objects[rows][:, None])
        yield rows, np.where(same, informers, np.int32(-1)), False
