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
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.attempt import PART_POINTS
from engine.precompute.indirect.cell_size import FULL, RECORDS_BY_SETS, CellSizeTry, growth
from engine.precompute.indirect.checkpoints import arrays_of
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.irradiance_cache import MAX_RECORDS
from engine.precompute.indirect.progress import Progress
from engine.precompute.indirect.ray_budget import LEVELS, RayBudget
from engine.precompute.indirect.sampling_settings import FINE, SamplingSettings
from engine.precompute.indirect.solver import Solver, Trial

N_BLOCKS = 192
FEWER = 8
"""As many times fewer are rays between cells, the last ones, and photons."""

# Size of cells in the second trial, relative to the first; the largest number of the solver's tries that are simulated.
COARSER, MOST_TRIES = 1.5, 8
RECORDS_BY_SMALL_SETS = 0.55  # with sets of the fewest rays, records grow with the sets to this power


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


def indirect_cost(
    placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
    layers: Sequence[IndirectLayer], settings: SamplingSettings = FINE, other_light: float | None = None,
) -> Generator[Progress, None, IndirectCost]:  # fmt: skip
    """Estimate the cost of the solver with these arguments for these layers; yields its progress."""

    def solver(n_blocks: int, larger: float = 1.0) -> Solver:
        trial = Trial(n_blocks, FEWER, larger)
        return Solver(placement, models, sky, n_bounces, settings, other_light=other_light, trial=trial)

    seconds = first = 0.0
    for n_blocks in (2, N_BLOCKS):  # the first loads kernels
        tried = solver(n_blocks)
        started, first = time.process_time(), seconds
        found = yield from tried.solve(layers)
        seconds = time.process_time() - started
    if tried.lattice is None:
        raise ValueError(f"sampling settings {settings.name!r}: expected some that refine a lattice")
    spent = tried.stopwatch.seconds
    n_points, n_tried_cells = tried.lattice.n_expected, max(len(found.cells), 1)
    by_point = n_points / max(len(found.points.samples.points), 1)
    is_small = found.ray_budget.n_rays <= found.ray_budget.max_rays // LEVELS[0]
    wanted = n_tried_cells * max(by_point, 1.0) ** (RECORDS_BY_SMALL_SETS if is_small else RECORDS_BY_SETS)
    lost = NO_WASTE
    if wanted > MAX_RECORDS:
        n_coarser = len((yield from solver(N_BLOCKS, COARSER).solve(layers)).cells)
        power = math.log(n_tried_cells / max(n_coarser, 1)) / math.log(COARSER)
        lost = expected_waste(wanted, n_points, tried.n_first_sets, power)
    n_cells = min(wanted, FULL * MAX_RECORDS) if lost.n_tries else wanted
    by_cell = n_cells / n_tried_cells
    rest = seconds - sum(spent.values())
    # An abandoned try ends with its first pass, and most know by then how many rays are needed.
    by_sample_set = spent["samples"] * found.ray_budget.n_rays / max(tried.n_rays_traced, 1)
    reading = max(first - spent["size"] - spent["photons"], 0.0)
    total = (
        reading
        + spent["size"]
        + (1 + lost.n_tries) * (FEWER * spent["photons"] + by_cell * spent["rough"])
        + by_point * (spent["samples"] + rest)
        + lost.sets * n_points * by_sample_set
        + by_cell * FEWER * spent["records"]
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
