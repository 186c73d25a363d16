"""Leaves of emitters that a point sees in part, or from close by: rays of the point's own say how much of each it sees.

One ray a leaf is enough where leaves are many and small. Beside a lamp's frame one leaf is half of all there is, and in
a narrow penumbra a few leaves are: there the shadow's edge would show each of them. A leaf that could bring more than
`LEAST` of a point's light, while of those beside it some are seen and some are not, or it is larger than `NEAR`, is cut
into four parts that are even on the point's sphere, one ray each, and their sum is taken by solid angle and cosine;
into 16 or 64 where those leaves bring much of all light, as behind a narrow gap, which shows a strip of a lamp.

Rays of all points go to the same places of a leaf. Shifted for each point [Cranley76], a stairwell was 2.3 % off for
2.1, and light through a gap 4.4 as before: what was left is in leaves that bring less than `LEAST`, and in those that
are seen in part though all beside them are alike, of which one bit is known. Twelve beside a leaf miss fewer than six
did: a stairwell behind bars is 0.90 % off for 1.11, a room behind a door that is ajar 0.70 for 0.77, and light through
a gap 3.1 for 4.4; without the points that had missed a part of the gap's strip (`lighting.WEAK_SENTINELS`) it is 2.3.
0.001 for `LEAST` was rejected: the stairwell was 0.77 % off, a storeroom 0.35 for 0.29, in a seventh more time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import pool
from engine.precompute.direct import _near_kernels as kernels
from engine.precompute.direct._emitter_kernels import Emitters
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.visibility.point_visibility import Visibility

LEAST, NEAR = np.float32(0.002), np.float32(0.35)
MOST = 256  # leaves of a point that are looked at
BLOCK, AT_ONCE = 1024, 8

_BlockLeaves = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class NearLeaves:
    """Of P points: start (P + 1,) into node (K,), numbers in the tree, and delta (K,), not 0: the share seen less the
    bit."""

    start: NDArray[np.int32]
    node: NDArray[np.int32]
    delta: NDArray[np.float32]


def no_near_leaves(n_points: int) -> NearLeaves:
    """Where one bit a leaf is all that is known."""
    return NearLeaves(np.zeros(n_points + 1, np.int32), np.zeros(0, np.int32), np.zeros(0, np.float32))


class NearLight:
    """Finds those of the given rows, ascending, whose bits are known: `find_steps` must be driven to its end before."""

    def __init__(
        self, hits: PrimaryHits, caster: RayCaster, emitters: Emitters, visibility: Visibility,
        rows: NDArray[np.integer],
    ) -> None:  # fmt: skip
        self._work = (hits, caster, emitters, visibility)
        rows = np.asarray(rows if emitters.n_roots else rows[:0], np.int32)
        self._blocks = [rows[i : i + BLOCK] for i in range(0, len(rows), BLOCK)]
        self._found: list[_BlockLeaves] = []

    def find_steps(self) -> Iterator[float]:
        """Find them, eight blocks of 1,024 points between two yields of the fraction done."""
        with pool() as threads:
            for i in range(0, len(self._blocks), AT_ONCE):
                group = self._blocks[i : i + AT_ONCE]
                self._found += threads.map(lambda block: _find_in_block(*self._work, block), group)
                yield len(self._found) / len(self._blocks)

    def leaves(self) -> NearLeaves:
        """All that was found."""
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
    """The same at once."""
    near = NearLight(hits, caster, emitters, visibility, rows)
    for _ in near.find_steps():
        pass
    return near.leaves()


def _find_in_block(
    hits: PrimaryHits, caster: RayCaster, emitters: Emitters, visibility: Visibility, rows: NDArray[np.int32]
) -> _BlockLeaves:
    counts, depths, nodes = (np.empty(shape, np.int32) for shape in (len(rows), len(rows), (len(rows), MOST)))
    kernels.list_near(rows, hits.position, hits.horizon, visibility.bits, emitters, LEAST, NEAR, counts, nodes, depths)
    pairs, depth = np.repeat(rows, counts), np.repeat(depths, counts)
    listed = nodes[np.arange(MOST) < counts[:, None]]
    deltas = np.empty(len(pairs), np.float32)
    for each in range(1, kernels.MOST_DEPTH + 1):
        some = depth == each
        deltas[some] = _deltas(hits, caster, emitters, visibility, pairs[some], listed[some], each)
    told = deltas != 0.0  # most leaves beside an edge are what their bit says
    counts = np.bincount(np.repeat(np.arange(len(rows)), counts)[told], minlength=len(rows)).astype(np.int32)
    return counts, listed[told], deltas[told]


def _deltas(
    hits: PrimaryHits, caster: RayCaster, emitters: Emitters, visibility: Visibility, rows: NDArray[np.int32],
    nodes: NDArray[np.int32], depth: int,
) -> NDArray[np.float32]:  # fmt: skip
    """What the points rows (K,) see of the leaves nodes (K,), by 4^depth rays each, less their bits."""
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
