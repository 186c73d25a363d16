"""What indirect light will cost: the solver itself on a few blocks of the picture, with few rays between cells.

Which places of a picture need a gather point is only known once it is lit: by silhouettes and creases alone it would be
between 0.6 and 0.95 of them. So a trial lights the scene roughly and refines some hundred blocks of the lattice, chosen
at random, just as the solver refines all; what took place at its points is multiplied by how many there will be, what
between its cells by theirs and their rays.
"""

import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.indirect.cells import MOST_CELLS, Cells
from engine.indirect.gather import Gathered
from engine.indirect.irradiance import CellLight
from engine.indirect.lattice import Lattice
from engine.indirect.layers import IndirectLayer
from engine.indirect.parts import Parts
from engine.indirect.photons import PhotonMap
from engine.indirect.solver import CELLS_BY_FANS, FINE, FULL, Fineness, Progress, Solver
from engine.indirect.stored import arrays_of
from engine.transport.pipeline import Placement, SkyState

N_BLOCKS = 192
FEWER = 8
"""As many times fewer are rays between cells, and photons."""

Value = TypeVar("Value")


@dataclass(frozen=True)
class IndirectCost:
    """Processor seconds, bytes on disk, and how many gather points and cells there will be."""

    seconds: float
    n_bytes: float
    n_points: int
    n_cells: int


class _Trial(Solver):
    """The solver on some blocks; seconds: of the processor, by what it was at work on."""

    def __init__(
        self, placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
        fineness: Fineness, n_blocks: int,
    ) -> None:  # fmt: skip
        super().__init__(placement, models, sky, n_bounces, fineness)
        self._n_blocks = n_blocks
        self.seconds = dict.fromkeys(("size", "photons", "fans", "cells"), 0.0)
        self.lattice: Lattice | None = None

    def _lattice(self) -> Lattice:
        self.lattice = super()._lattice()
        self.lattice.thin(self._n_blocks, np.random.default_rng(1))
        return self.lattice

    def _cell_size(self) -> float:
        return self._timed("size", super()._cell_size)

    def _photons(self, cells: Cells) -> PhotonMap:
        return self._timed("photons", super()._photons, cells)

    def _gather(
        self, cells: Cells, before: Gathered, rows: NDArray[np.int32], nth: NDArray[np.uint8], parts: Parts,
        span: tuple[float, float], first_open: int = 0,
    ) -> Generator[Progress, None, Gathered]:  # fmt: skip
        return (yield from self._steps("fans", super()._gather(cells, before, rows, nth, parts, span, first_open)))

    def _light(
        self, cells: Cells, fineness: Fineness, parts: Parts, span: tuple[float, float]
    ) -> Generator[Progress, None, CellLight]:
        return (yield from self._steps("cells", super()._light(cells, fineness, parts, span)))

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
    layers: Sequence[IndirectLayer], fineness: Fineness = FINE,
) -> Generator[Progress, None, IndirectCost]:  # fmt: skip
    """What `Solver(placement, models, sky, n_bounces, fineness)` will cost for these layers; yields its progress."""
    fewer = replace(
        fineness, n_cell_rays=fineness.n_cell_rays // FEWER, n_samples=fineness.n_samples // FEWER,
        n_photons=fineness.n_photons // FEWER,
    )  # fmt: skip
    for n_blocks in (2, N_BLOCKS):  # the first reads kernels
        trial = _Trial(placement, models, sky, n_bounces, fewer, n_blocks)
        started = time.process_time()
        found = yield from trial.solve(layers)
        seconds = time.process_time() - started
    if trial.lattice is None:
        raise ValueError(f"fineness {fineness.name!r}: expected one that refines a lattice")
    tried = trial.seconds
    n_points, n_tried_cells = trial.lattice.n_expected, max(len(found.cells), 1)
    by_point = n_points / max(len(found.points.gathered.points), 1)
    wanted = n_tried_cells * max(by_point, 1.0) ** CELLS_BY_FANS
    # Where there are too many, what was done until then is done once more, by larger cells.
    too_many = wanted > MOST_CELLS
    n_cells = FULL * MOST_CELLS if too_many else wanted
    again = (MOST_CELLS / wanted) ** (1.0 / CELLS_BY_FANS) if too_many else 0.0
    by_cell = n_cells / n_tried_cells
    rest = seconds - sum(tried.values())
    total = (
        tried["size"]
        + FEWER * tried["photons"]
        + (1.0 + again) * by_point * tried["fans"]
        + by_cell * FEWER * tried["cells"]
        + by_point * rest
    )
    arrays = arrays_of(found).items()
    n_bytes = sum(array.nbytes * _times(name, len(array), n_tried_cells, by_point, by_cell) for name, array in arrays)
    return IndirectCost(total, n_bytes, round(n_points), round(n_cells))


def _times(name: str, length: int, n_cells: int, by_point: float, by_cell: float) -> float:
    """By how much longer an array of the light will be than that of the trial."""
    if name == "cell_seen":
        return FEWER * by_cell
    if name == "direct" or name.startswith("cells."):
        return by_cell if length == n_cells else 1.0
    return 1.0 if name.startswith("footprint") else by_point
