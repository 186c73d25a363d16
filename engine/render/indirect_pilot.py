"""What indirect light will cost: the solver itself on a few blocks of the picture, with few rays between cells.

Which places of a picture need a gather point is only known once it is lit: by silhouettes and creases alone it would be
between 0.6 and 0.95 of them. So a trial lights the scene roughly and refines some hundred blocks of the lattice, chosen
at random, just as the solver refines all; what took place at its points is multiplied by how many there will be, what
between its cells by theirs and their rays.

Where there will be more cells than there may be, the solver begins anew with larger ones, several times where these
hardly become fewer; its first look foresees most such ends. How many cells there are of larger ones a second trial
tells; the tries are then gone through as the solver does.
"""

import math
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.checkpoints import Checkpoints
from engine.precompute.indirect.gather import GatherSamples
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.irradiance import CacheLight
from engine.precompute.indirect.irradiance_cache import MAX_RECORDS, IrradianceCache
from engine.precompute.indirect.lattice import Lattice
from engine.precompute.indirect.photons import PhotonMap
from engine.precompute.indirect.sampling_settings import FINE, LEVELS, RayBudget, SamplingSettings
from engine.precompute.indirect.solver import FULL, PART_POINTS, RECORDS_BY_SETS, CellSizeTry, Progress, Solver, growth
from engine.precompute.indirect.stored_light import arrays_of

N_BLOCKS = 192
FEWER = 8
"""As many times fewer are rays between cells, the last ones, and photons."""

# How much larger cells are in a second trial; of the solver's tries, those that are gone through at most.
COARSER, MOST_TRIES = 1.5, 8
RECORDS_BY_SMALL_SETS = 0.55  # with what power fans of the fewest rays show more cells: 0.4 to 0.6

Value = TypeVar("Value")


class WastedTries(NamedTuple):
    """Tries that are given up, and how many times as many fans as there are points are traced in them."""

    n_tries: int
    sets: float


NO_WASTE = WastedTries(0, 0.0)


@dataclass(frozen=True)
class IndirectCost:
    """Processor seconds, bytes on disk, how many gather points and cells there will be, and rays a fan."""

    seconds: float
    n_bytes: float
    n_points: int
    n_cells: int
    ray_budget: RayBudget | None = None


class _Trial(Solver):
    """The solver on some blocks; seconds: of the processor, by what it was at work on."""

    def __init__(
        self, placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
        settings: SamplingSettings, n_blocks: int, larger: float = 1.0, other_light: float | None = None,
    ) -> None:  # fmt: skip
        """larger: by how much cells are than the solver would have them at first. `n_rays_traced`: of all fans."""
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
        """As the solver does: noise of cells would be taken for that of the picture."""
        whole = self._whole
        return replace(self._most, n_record_rays=whole.n_record_rays // 4, n_samples=whole.n_samples // 4)

    @property
    def n_first(self) -> int:
        """How many fans the first look of the whole picture has."""
        return len(self._whole_lattice().missing_rows())

    def _forecast(self, cells: IrradianceCache, n_fans: int) -> None:
        """Nothing: of some blocks there are never too many."""

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
    """What `Solver(placement, models, sky, n_bounces, fineness, other_light=other_light)` will cost for these layers;
    yields its progress."""
    seconds = first = 0.0
    for n_blocks in (2, N_BLOCKS):  # the first reads kernels
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
    # A try that is given up ends with its first look, and most know by then how many rays are needed.
    by_fan = tried["fans"] * found.ray_budget.n_rays / max(trial.n_rays_traced, 1)
    reading = max(first - tried["size"] - tried["photons"], 0.0)
    total = (
        reading
        + tried["size"]
        + (1 + lost.n_tries) * (FEWER * tried["photons"] + by_cell * tried["rough"])
        + by_point * (tried["fans"] + rest)
        + lost.sets * n_points * by_fan
        + by_cell * FEWER * tried["cells"]
    )
    arrays = arrays_of(found).items()
    n_bytes = sum(array.nbytes * _times(name, len(array), n_tried_cells, by_point, by_cell) for name, array in arrays)
    return IndirectCost(total, n_bytes, round(n_points), round(n_cells), found.ray_budget)


def expected_waste(wanted: float, n_fans: float, n_first: int, power: float) -> WastedTries:
    """What is lost until cells are large enough: wanted: cells of the first size after all fans, which the first look,
    of n_first, foresees; of s times larger ones there are s^-power as many."""
    size, n_lost, tries = 1.0, 0.0, list[CellSizeTry]()
    while (n_cells := wanted * size**-power) > MAX_RECORDS and len(tries) < MOST_TRIES:
        done = n_fans * (MAX_RECORDS / n_cells) ** (1.0 / RECORDS_BY_SETS)
        n_lost += min(done, n_first)
        tries.append(CellSizeTry(size, round(done) + PART_POINTS // 2))
        size *= growth(tries, n_fans)
    return WastedTries(len(tries), n_lost / max(n_fans, 1.0))


def _times(name: str, length: int, n_cells: int, by_point: float, by_cell: float) -> float:
    """By how much longer an array of the light will be than that of the trial."""
    if name == "cell_seen":
        return FEWER * by_cell
    if name == "direct" or name.startswith("cells."):
        return by_cell if length == n_cells else 1.0
    return 1.0 if name.startswith("footprint") else by_point
