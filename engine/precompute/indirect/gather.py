"""Gather points: the points of the picture where indirect light is computed, and the records that their rays hit.

Indirect light is smooth, so few points of the picture suffice. They lie on a lattice of every eighth pixel (denser in
small pictures), refined in quarters down to single pixels where a block of the lattice shows a silhouette or a crease,
where the light at its corners differs, or where something is near; the other points interpolate between the corners of
their block. Each gather point has one set of hemisphere samples, and more where it is noisy (`extra_sample_sets` in
`smoothing`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import OrderedSection, run_in_order
from engine.precompute.direct._projection_kernels import ViewedPoints
from engine.precompute.indirect import _ray_kernels as kernels
from engine.precompute.indirect._second_bounce_kernels import GlossyHits
from engine.precompute.indirect.direction_patterns import SampleCounts, direction_tables
from engine.precompute.indirect.irradiance_cache import CHUNK, IrradianceCache, room_for_rays
from engine.precompute.indirect.second_bounce import SecondBounceTracer, join_glossy_hits, no_glossy_hits
from engine.scene.primary_hits import PrimaryHits

# Metres: shorter rays count as this long.
_TOUCHING = np.float32(1e-6)
_OPEN = 1e18  # farther than anything, with a square that fits float32


@dataclass(frozen=True, eq=False)
class GatherSamples:
    """q sample sets of p gather points: rows (q,) int32 of the hits, ascending; nth (q,) uint8: the number of the set
    at its point; records (q, R) uint16: the record that each ray hits; glossy_hits of the rays that end on glossy
    surfaces; clearance (q,) float32: harmonic mean distance of the surroundings."""

    rows: NDArray[np.int32]
    nth: NDArray[np.uint8]
    records: NDArray[np.uint16]
    glossy_hits: GlossyHits
    clearance: NDArray[np.float32]

    @cached_property
    def points(self) -> NDArray[np.int32]:
        """The rows (p,) of the gather points, ascending."""
        return self.rows[self.nth == 0]

    @property
    def n_bytes(self) -> int:
        own = (self.rows, self.nth, self.records, self.clearance)
        return sum(array.nbytes for array in (*own, *self.glossy_hits))


def no_samples(n_rays: int) -> GatherSamples:
    """No sample sets, of n_rays each."""
    none = np.zeros(0, np.float32)
    records = np.zeros((0, n_rays), np.uint16)
    return GatherSamples(none.astype(np.int32), none.astype(np.uint8), records, no_glossy_hits(0), none)


def join_samples(parts: Sequence[GatherSamples]) -> GatherSamples:
    """All sample sets as one, by row; extra sets of a point come in later parts, or later in a part."""
    rows = np.concatenate([part.rows for part in parts])
    order = np.argsort(rows, kind="stable")
    nth = np.concatenate([part.nth for part in parts])[order]
    seen = np.concatenate([part.records for part in parts])[order]
    clearance = np.concatenate([part.clearance for part in parts])[order]
    return GatherSamples(
        rows[order], nth, seen, join_glossy_hits([part.glossy_hits for part in parts], order), clearance
    )


def sets_alike(
    hits: PrimaryHits, rows: NDArray[np.int32], sizes: Sequence[SampleCounts]
) -> Iterator[tuple[NDArray[np.intp], SampleCounts]]:
    """The sample sets (q,) of points `rows` that have as many rays about their lobe axes, and are traced together;
    sizes: of the objects' sample sets."""
    n_lobe = np.array([size.n_lobe for size in sizes])[object_of_rows(hits, rows)]
    for n in np.unique(n_lobe):
        yield np.flatnonzero(n_lobe == n), SampleCounts(sizes[0].n_rays - int(n), int(n))


def gather(
    hits: PrimaryHits, cache: IrradianceCache, rows: NDArray[np.int32], nth: NDArray[np.uint8],
    lobe_axes: NDArray[np.int64],
    size: SampleCounts, second: SecondBounceTracer | None = None, focused: bool = True, first_open: int = 0,
) -> Iterator[GatherSamples]:  # fmt: skip
    """Traces the nth (q,) sample sets of the points `rows` (q,), ascending, two chunks at a time.

    lobe_axes: of every object; second: None to store no glossy hits; focused: whether the size of cells depends on
    distance and kind of ray; first_open: the first record that takes sample positions from these rays. Raises
    CacheFull.
    """
    tables = direction_tables(size, nth)
    surface = ViewedPoints(hits.position, *hits.ray_frames, hits.wo)
    step = max(1, CHUNK // size.n_rays)
    point_poles = lobe_axes[object_of_rows(hits, rows)]

    def trace(begin: int, turn: OrderedSection) -> GatherSamples:
        chunk, which = rows[begin : begin + step], nth[begin : begin + step]
        rays = room_for_rays(len(chunk) * size.n_rays)
        kernels.write_sample_rays(
            chunk, which, point_poles[begin : begin + step], surface, hits.geometric_normal, hits.horizon,
            np.float32(cache.caster.offset), *tables, 0, size.n_rays, rays.origins, rays.directions, rays.there,
        )  # fmt: skip
        mirrored = np.zeros(len(rays.there), np.uint8)
        if focused:
            kernels.mark_glossy_rays(chunk, point_poles[begin : begin + step], surface, rays.directions, mirrored)
        seen, found = cache.records_and_hits(rays, first_open, mirrored, turn)
        records = no_glossy_hits(len(chunk))
        if second is not None:
            records = second.trace(cache, chunk, which, rays, seen, found, first_open, turn)
        distances = found.distance.reshape(len(chunk), -1)[:, : size.n_cosine]
        return GatherSamples(chunk, which, seen.reshape(len(chunk), -1), records, _clearance(distances))

    yield from run_in_order(trace, range(0, len(rows), step), 1 if second is None else 2)


def _clearance(distances: NDArray[np.float32]) -> NDArray[np.float32]:
    """The harmonic mean (p,) of the distances (p, R) of cosine-distributed rays, `_OPEN` where they hit nothing
    [Ward88]: the distance over which a point's irradiance changes by about its own value."""
    nearness = np.mean(1.0 / np.maximum(distances, _TOUCHING), axis=1, dtype=np.float64)
    return np.asarray(1.0 / np.maximum(nearness, 1.0 / _OPEN), np.float32)


def object_of_rows(hits: PrimaryHits, rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """The object of each row."""
    return np.searchsorted(hits.object_ranges[:, 1], rows, "right")
