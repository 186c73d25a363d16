"""The size of the cells of the irradiance cache: as small as the number of its records allows.

A pilot pass chooses the size that the solver begins with. The number of records is only known once rays are traced; if
there would be more than `MAX_RECORDS`, the solver begins anew with larger cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect._cache_kernels import NO_RECORD
from engine.precompute.indirect._ray_kernels import HALF
from engine.precompute.indirect.direction_patterns import sample_counts
from engine.precompute.indirect.gather import gather
from engine.precompute.indirect.irradiance_cache import MAX_RECORDS, CacheFull, IrradianceCache

# Gather points, and rays for each, of the pilot pass.
_PILOT_POINTS, _PILOT_RAYS = 1024, 64
# The least factor by which cells grow after a `CacheFull`; the number of records grows with this power of the number of
# sample sets.
_GROWTH, RECORDS_BY_SETS = 1.26, 0.4
_MOST_GROWTH, _LEAST_POWER, _MOST_POWER = 4.0, 0.5, 2.0
# The fraction of `MAX_RECORDS` that a larger cell size aims at.
FULL = 0.85


class CellSizeTry(NamedTuple):
    """Cells of `size` metres gave too many records after `n_sets` sample sets."""

    size: float
    n_sets: int


class CellSizeSearch:
    """The cell size of one attempt after another. size: of the present one, in metres; n_sets: the number of sample
    sets traced in it so far."""

    def __init__(self, size: float, n_expected: Callable[[], float]) -> None:
        """size: of the first attempt; n_expected: the expected number of sample sets of a whole attempt."""
        self.size, self.n_sets = size, 0
        self._n_expected = n_expected
        self._tries: list[CellSizeTry] = []

    def check_forecast(self, n_records: int, n_sets: int) -> None:
        """Raises CacheFull if the records found by these sample sets predict more than `MAX_RECORDS` for all of them.
        Otherwise this would only become known when nearly all rays are traced."""
        forecast = n_records * (max(self._n_expected(), n_sets) / max(n_sets, 1)) ** RECORDS_BY_SETS
        if forecast > MAX_RECORDS:
            self.n_sets = round(n_sets * (MAX_RECORDS / n_records) ** (1.0 / RECORDS_BY_SETS))
            raise CacheFull(f"{forecast:.0f} to come")

    def enlarge(self) -> None:
        """Chooses the size of the next attempt, after a CacheFull."""
        self._tries.append(CellSizeTry(self.size, self.n_sets))
        self.size *= growth(self._tries, self._n_expected())


def growth(tries: Sequence[CellSizeTry], expected: float) -> float:
    """The factor by which cells grow after the last try, so that the records of the `expected` number of sample sets
    fit. One large step costs less than several restarts.

    n sample sets find C n^0.4 s^-p records in cells of size s. On a plain surface p = 2. Beside polished metal, which
    shows small cells of the whole scene, the number hardly falls with s. Two tries determine p.
    """
    last, power = tries[-1], _MOST_POWER
    if len(tries) > 1:
        first = tries[-2]
        measured_power = RECORDS_BY_SETS * math.log(last.n_sets / first.n_sets) / math.log(last.size / first.size)
        power = min(max(measured_power, _LEAST_POWER), _MOST_POWER)
    too_many = max((expected / last.n_sets) ** RECORDS_BY_SETS, 1.0) / FULL
    return min(max(too_many ** (1.0 / power), _GROWTH), _MOST_GROWTH)


def first_cell_size(placement: Placement, lobe_axes: NDArray[np.int64], n_records: int) -> float:
    """The cell size in metres at which the hits of a pilot pass fall into at most half of n_records, and into half as
    many records as there are hits. lobe_axes (M,): of every object."""
    hits, scene = placement.hits, placement.scene
    rows = np.arange(0, len(hits.pixel), max(1, -(-len(hits.pixel) // _PILOT_POINTS)), dtype=np.int32)
    first_sets, counts = np.zeros(len(rows), np.uint8), sample_counts(_PILOT_RAYS, HALF)
    if not len(scene.triangles):
        return 1.0
    extent = float(np.linalg.norm(np.ptp(scene.vertices[np.unique(scene.triangles)], axis=0)))
    # Bisect the logarithm of the size.
    low, high = extent / 4096.0, extent
    while high / low > 1.1:
        size = (low * high) ** 0.5
        cache = IrradianceCache(scene, placement.caster, size)
        try:
            pilot = gather(hits, cache, rows, first_sets, lobe_axes, counts, focused=False)
            n_hits = sum(int((part.records != NO_RECORD).sum()) for part in pilot)
            too_fine = len(cache) > min(n_records / 2, max(n_hits / 2, 1.0))
        except CacheFull:
            too_fine = True
        low, high = (size, high) if too_fine else (low, size)
    return high
