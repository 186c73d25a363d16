"""Estimates the cost of indirect light: runs the solver itself on a few blocks of the picture, with few rays between
cache records.

The number of gather points of a picture is known only once it is lit: from silhouettes and creases alone the estimate
would be between 0.6 and 0.95 of it. So a trial lights the scene roughly and refines some hundred random blocks of the
lattice as the solver refines all. The work at its points is scaled to the number of points, and the work between
irradiance cache records to the number of these and of their rays.

If there would be more records than allowed, the solver restarts with larger cells, several times if the number hardly
falls; its first pass over the picture detects most such cases. A second trial measures how many records larger cells
have; the solver's tries are then simulated.
"""

import math
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.checkpoints import Checkpoints, arrays_of
from engine.precompute.indirect.gather import GatherSamples
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.irradiance_cache import MAX_RECORDS, CacheLight, IrradianceCache
from engine.precompute.indirect.lattice import Lattice
from engine.precompute.indirect.photons import PhotonMap
from engine.precompute.indirect.sampling_settings import FINE, LEVELS, RayBudget, SamplingSettings
from engine.precompute.indirect.solver import FULL, PART_POINTS, RECORDS_BY_SETS, CellSizeTry, Progress, Solver, growth

N_BLOCKS = 192
FEWER = 8
"""As many times fewer are rays between cells, the last ones, and photons."""

# Size of cells in the second trial, relative to the first; the largest number of the solver's tries that are simulated.
COARSER, MOST_TRIES = 1.5, 8
RECORDS_BY_SMALL_SETS = 0.55  # with sets of the fewest rays, records grow with the sets to this power

Value = TypeVar("Value")


class WastedTries(NamedTuple):
    """Tries that are abandoned, and the number of sample sets that are traced in them, relative to the number of
    points."""

    n_tries: int
    sets: float


NO_WASTE = WastedTries(0, 0.0)


@dataclass(frozen=True)
class IndirectCost:
    """Processor seconds, bytes on disk, numbers of gather points and records, and rays of a sample set."""

    seconds: float
    n_bytes: float
    n_points: int
    n_cells: int
    ray_budget: RayBudget | None = None


class _Trial(Solver):
    """The solver on some blocks; seconds: of processor time, by the kind of work."""

    def __init__(
        self, placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
        settings: SamplingSettings, n_blocks: int, larger: float = 1.0, other_light: float | None = None,
    ) -> None:  # fmt: skip
        """larger: factor from the solver's first cell size. `n_rays_traced`: of all sample sets."""
        fewer = replace(
            settings, n_record_rays=settings.n_record_rays // FEWER, n_samples=settings.n_samples // FEWER,
            n_photons=settings.n_photons // FEWER,
        )  # fmt: skip
        super().__init__(placement, models, sky, n_bounces, fewer, other_light=other_light)
        self._whole = settings
        self._n_blocks, self._larger = n_blocks, larger
        self.seconds = dict.fromkeys(("size", "photons", "fans", "rough", "cells"), 0.0)
        self.n_rays_traced = 0
        self.lattice: Lattice | None = None

    def _lattice(self) -> Lattice:
        self.lattice = super()._lattice()
        self.lattice.thin(self._n_blocks, np.random.default_rng(1))
        return self.lattice

    def _rough_settings(self) -> SamplingSettings:
        """As in the solver: noise of the records would count as contrast of the picture."""
        whole = self._whole
        return replace(self._most, n_record_rays=whole.n_record_rays // 4, n_samples=whole.n_samples // 4)

    @property
    def n_first(self) -> int:
        """Number of sample sets in the first pass over the whole picture."""
        return len(self._whole_lattice().missing_rows())

    def _forecast(self, cells: IrradianceCache, n_sample_sets: int) -> None:
        """Does nothing: some blocks never have too many records."""

    def _cell_size(self) -> float:
        return self._larger * self._timed("size", super()._cell_size)

    def _photons(self, cells: IrradianceCache) -> PhotonMap:
        return self._timed("photons", super()._photons, cells)

    def _gather(
        self, cells: IrradianceCache, before: GatherSamples, rows: NDArray[np.int32], nth: NDArray[np.uint8],
        parts: Checkpoints,
        span: tuple[float, float], first_open: int = 0,
    ) -> Generator[Progress, None, GatherSamples]:  # fmt: skip
        self.n_rays_traced += len(rows) * self._settings.n_rays
        return (yield from self._steps("fans", super()._gather(cells, before, rows, nth, parts, span, first_open)))

    def _light(
        self, cells: IrradianceCache, settings: SamplingSettings, parts: Checkpoints, span: tuple[float, float]
    ) -> Generator[Progress, None, CacheLight]:
        what = "cells" if settings is self._settings else "rough"
        return (yield from self._steps(what, super()._light(cells, settings, parts, span)))

    def _timed(self, what: str, work: Callable[..., Value], *arguments: object) -> Value:
        started = time.process_time()
        value = work(*arguments)
        self.seconds[what] += time.process_time() - started
        return value

    def _steps(self, what: str, steps: Generator[Progress, None, Value]) -> Generator[Progress, None, Value]:
        while True:
            started = time.process_time()
            try:
                step = next(steps)
            except StopIteration as end:
                return end.value
            finally:
                self.seconds[what] += time.process_time() - started
            yield step


def indirect_cost(
    placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
    layers: Sequence[IndirectLayer], settings: SamplingSettings = FINE, other_light: float | None = None,
) -> Generator[Progress, None, IndirectCost]:  # fmt: skip
    """Estimate the cost of the solver with these arguments for these layers; yields its progress."""
    seconds = first = 0.0
    for n_blocks in (2, N_BLOCKS):  # the first loads kernels
        trial = _Trial(placement, models, sky, n_bounces, settings, n_blocks, other_light=other_light)
        started, first = time.process_time(), seconds
        found = yield from trial.solve(layers)
        seconds = time.process_time() - started
    if trial.lattice is None:
        raise ValueError(f"fineness {settings.name!r}: expected one that refines a lattice")
    tried = trial.seconds
    n_points, n_tried_cells = trial.lattice.n_expected, max(len(found.cells), 1)
    by_point = n_points / max(len(found.points.samples.points), 1)
    is_small = found.ray_budget.n_rays <= found.ray_budget.max_rays // LEVELS[0]
    wanted = n_tried_cells * max(by_point, 1.0) ** (RECORDS_BY_SMALL_SETS if is_small else RECORDS_BY_SETS)
    lost = NO_WASTE
    if wanted > MAX_RECORDS:
        coarser = _Trial(placement, models, sky, n_bounces, settings, N_BLOCKS, COARSER, other_light)
        n_coarser = len((yield from coarser.solve(layers)).cells)
        lost = expected_waste(
            wanted, n_points, trial.n_first, math.log(n_tried_cells / max(n_coarser, 1)) / math.log(COARSER)
        )
    n_cells = min(wanted, FULL * MAX_RECORDS) if lost.n_tries else wanted
    by_cell = n_cells / n_tried_cells
    rest = seconds - sum(tried.values())
    # An abandoned try ends with its first pass, and most know by then how many rays are needed.
    by_sample_set = tried["fans"] * found.ray_budget.n_rays / max(trial.n_rays_traced, 1)
    reading = max(first - tried["size"] - tried["photons"], 0.0)
    total = (
        reading
        + tried["size"]
        + (1 + lost.n_tries) * (FEWER * tried["photons"] + by_cell * tried["rough"])
        + by_point * (tried["fans"] + rest)
        + lost.sets * n_points * by_sample_set
        + by_cell * FEWER * tried["cells"]
    )
    arrays = arrays_of(found).items()
    n_bytes = sum(array.nbytes * _times(name, len(array), n_tried_cells, by_point, by_cell) for name, array in arrays)
    return IndirectCost(total, n_bytes, round(n_points), round(n_cells), found.ray_budget)


def expected_waste(wanted: float, n_sample_sets: float, n_first: int, power: float) -> WastedTries:
    """The tries before cells are large enough. wanted: records of the first cell size after all sample sets, which the
    first pass, of n_first sets, detects; with cells s times larger their number is s^-power times that."""
    size, n_lost, tries = 1.0, 0.0, list[CellSizeTry]()
    while (n_cells := wanted * size**-power) > MAX_RECORDS and len(tries) < MOST_TRIES:
        done = n_sample_sets * (MAX_RECORDS / n_cells) ** (1.0 / RECORDS_BY_SETS)
        n_lost += min(done, n_first)
        tries.append(CellSizeTry(size, round(done) + PART_POINTS // 2))
        size *= growth(tries, n_sample_sets)
    return WastedTries(len(tries), n_lost / max(n_sample_sets, 1.0))


def _times(name: str, length: int, n_cells: int, by_point: float, by_cell: float) -> float:
    """Factor between the length of an array of the light and that of the trial's."""
    if name == "cell_seen":
        return FEWER * by_cell
    if name == "direct" or name.startswith("cells."):
        return by_cell if length == n_cells else 1.0
    return 1.0 if name.startswith("footprint") else by_point
