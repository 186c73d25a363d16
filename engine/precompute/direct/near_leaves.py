"""Traces extra rays to emitter leaves that a point sees partly or from close by, to find the visible share of each.

One ray per leaf suffices where leaves are many and small. Beside a lamp's frame one leaf is half of the visible part,
and so are a few leaves in a narrow penumbra: there the shadow's edge would reveal each of them. A leaf that could
contribute more than `LEAST` of a point's light, and either has both visible and hidden neighbours or is larger than
`NEAR`, is divided into four parts of equal size on the point's sphere, with one ray each, weighted by solid angle and
cosine. It is divided into 16 or 64 where those leaves contribute much of the light, as behind a narrow gap that shows a
strip of a lamp.

Rays of all points go to the same positions of a leaf. With a shift per point [Cranley76] the error of a stairwell was
2.3 % instead of 2.1, and of light through a gap 4.4 as before: the remaining error lies in leaves that contribute less
than `LEAST`, and in partly visible leaves whose neighbours are all alike, of which one bit is known. Twelve neighbours
per leaf miss fewer than six did: the error of a stairwell behind bars is 0.90 % instead of 1.11, of a room behind a
door that is ajar 0.70 instead of 0.77, and of light through a gap 3.1 instead of 4.4; without the points that had
missed a part of the gap's strip (`lighting.WEAK_SENTINELS`) it is 2.3. 0.001 for `LEAST` was rejected: the stairwell
had 0.77 %, a storeroom 0.35 instead of 0.29, in a seventh more time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import map_ahead, pool
from engine.precompute.direct import _near_kernels as kernels
from engine.precompute.direct._emitter_kernels import Emitters
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.visibility.point_visibility import Visibility

LEAST, NEAR = np.float32(0.002), np.float32(0.35)
MOST = 256  # leaves listed per point
BLOCK, AT_ONCE = 1024, 8

_BlockLeaves = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class NearLeaves:
    """Extra visibility of P points: start (P + 1,) of each point's range, node (K,) in the tree, and delta (K,), not 0:
    the visible share minus the visibility bit."""

    start: NDArray[np.int32]
    node: NDArray[np.int32]
    delta: NDArray[np.float32]


def no_near_leaves(n_points: int) -> NearLeaves:
    """For points of which only one bit per leaf is known."""
    return NearLeaves(np.zeros(n_points + 1, np.int32), np.zeros(0, np.int32), np.zeros(0, np.float32))


class NearLight:
    """Finds the near leaves of the given rows, ascending, whose visibility bits are known. Run `find_steps` to its end
    before `leaves`."""

    def __init__(
        self, hits: PrimaryHits, caster: RayCaster, emitters: Emitters, visibility: Visibility,
        rows: NDArray[np.integer],
    ) -> None:  # fmt: skip
        self._work = (hits, caster, emitters, visibility)
        rows = np.asarray(rows if emitters.n_roots else rows[:0], np.int32)
        self._blocks = [rows[i : i + BLOCK] for i in range(0, len(rows), BLOCK)]
        self._found: list[_BlockLeaves] = []

    def find_steps(self) -> Iterator[float]:
        """Processes the rows, a block of 1,024 points per step, up to eight of them at once; yields the fraction
        done."""
        with pool() as threads:
            for found in map_ahead(threads, partial(_find_in_block, *self._work), self._blocks, AT_ONCE):
                self._found.append(found)
                yield len(self._found) / len(self._blocks)

    def leaves(self) -> NearLeaves:
        """All leaves found."""
        none = no_near_leaves(len(self._work[0].pixel))
        counts = np.zeros_like(none.start)
        for block, (count, _, _) in zip(self._blocks, self._found, strict=True):
            counts[block + 1] = count
        nodes, deltas = ([part[k] for part in self._found] for k in (1, 2))
        start = np.cumsum(counts, dtype=np.int32)
        return NearLeaves(start, np.concatenate([none.node, *nodes]), np.concatenate([none.delta, *deltas]))


def near_leaves(
    hits: PrimaryHits, caster: RayCaster, emitters: Emitters, visibility: Visibility, rows: NDArray[np.integer]
) -> NearLeaves:
    """Finds all near leaves at once."""
    near = NearLight(hits, caster, emitters, visibility, rows)
    for _ in near.find_steps():
        pass
    return near.leaves()


def _find_in_block(
    hits: PrimaryHits, caster: RayCaster, emitters: Emitters, visibility: Visibility, rows: NDArray[np.int32]
) -> _BlockLeaves:
    """The near leaves of one block of rows: counts (B,), nodes (K,) and deltas (K,)."""
    counts, depths, nodes = (np.empty(shape, np.int32) for shape in (len(rows), len(rows), (len(rows), MOST)))
    kernels.list_near(rows, hits.position, hits.horizon, visibility.bits, emitters, LEAST, NEAR, counts, nodes, depths)
    pairs, depth = np.repeat(rows, counts), np.repeat(depths, counts)
    listed = nodes[np.arange(MOST) < counts[:, None]]
    deltas = np.empty(len(pairs), np.float32)
    for each in range(1, kernels.MOST_DEPTH + 1):
        some = depth == each
        deltas[some] = _deltas(hits, caster, emitters, visibility, pairs[some], listed[some], each)
    is_changed = deltas != 0.0  # most leaves beside an edge agree with their bit
    counts = np.bincount(np.repeat(np.arange(len(rows)), counts)[is_changed], minlength=len(rows)).astype(np.int32)
    return counts, listed[is_changed], deltas[is_changed]


def _deltas(
    hits: PrimaryHits, caster: RayCaster, emitters: Emitters, visibility: Visibility, rows: NDArray[np.int32],
    nodes: NDArray[np.int32], depth: int,
) -> NDArray[np.float32]:  # fmt: skip
    """The visible shares of the leaves nodes (K,) from the points rows (K,), by 4^depth rays each, minus their bits."""
    n_parts = 4**depth
    n_rays = len(rows) * n_parts
    origins, directions = np.empty((n_rays, 3), np.float32), np.empty((n_rays, 3), np.float32)
    distances, weights = np.empty(n_rays, np.float32), np.empty(n_rays, np.float32)
    kernels.near_rays(
        rows, nodes, hits.position, hits.offset_position, hits.horizon, emitters.corners, depth, origins, directions,
        distances, weights,
    )  # fmt: skip
    blocked = caster.occluded(origins, directions, distances)
    visibility.rays.traced += n_rays
    deltas = np.empty(len(rows), np.float32)
    kernels.near_shares(rows, nodes, visibility.bits, emitters.first, blocked, weights, n_parts, deltas)
    return deltas
