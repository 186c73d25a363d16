"""The long work on a view, done by a cluster: its light by one worker, the tiles of its layers by all of them.

    worker A   compute_light ──► project_tiles ...        find_indirect
    worker B        └──────► project_tiles ...
    here       visibility    tiles, into their file   indirect light: into the cache as if they were made here

The light stays where it was made and is sent from worker to worker; if the worker that had it is lost, it is computed
again.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from app.cluster.cluster_jobs import ViewJob, compute_light, find_indirect, project_tiles
from app.cluster.dask import Cluster
from app.document.scene_state import LayerState
from app.messages.worker_messages import Progress
from app.worker.executor import IndirectSteps, LightSteps
from engine.precompute.direct.bandstore import BandTile
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import TILE, LayerShape, VisibleLight

if TYPE_CHECKING:
    from distributed import Future

TILES_OF_A_TASK = 16
Result = TypeVar("Result")
StepValue = TypeVar("StepValue")


class ClusterExecutor:
    """Does the long work on the view of a job on a cluster."""

    def __init__(self, cluster: Cluster, job: ViewJob) -> None:
        self._cluster, self._job = cluster, job
        self._lights: dict[int, Future] = {}

    def compute_light(self, placement: Placement, sky: SkyState, quality: Quality) -> LightSteps:
        task = self._cluster.submit(compute_light, self._job, quality)
        light: VisibleLight = yield from self._wait_for_result(task, 0.0)
        placement.sphere.bits[:], placement.sphere.done[:] = light.sphere.bits, light.sphere.done
        self._lights = {id(light): task}
        return light

    def project_tiles(
        self, placement: Placement, rows: np.ndarray, light: VisibleLight, layer: LayerShape,
        skip: frozenset[int] = frozenset(),
    ) -> Iterator[BandTile | None]:  # fmt: skip
        seen = self._lights[id(light)]
        tasks = {}
        for begin, end in _tile_ranges(-(-len(rows) // TILE), skip):
            part = rows[begin * TILE : end * TILE]
            tasks[begin] = self._cluster.submit(project_tiles, self._job, seen, layer, part, begin * TILE)
        for found in self._cluster.results(tasks):
            yield from [None] if found is None else found[1]

    def find_indirect(
        self, layers: Sequence[LayerState], lit_by: str, n_bounces: int, n_rays: int
    ) -> IndirectSteps | None:
        task = self._cluster.submit(find_indirect, self._job, tuple(layers), lit_by, n_bounces, n_rays)
        return self._wait_for_result(task, Progress("indirect light", 0.0, text="on one worker"))

    def _wait_for_result(self, task: Future, meanwhile: StepValue) -> Generator[StepValue, None, Result]:
        """The result of one task."""
        for found in self._cluster.results({0: task}):
            if found is not None:
                return found[1]
            yield meanwhile
        raise AssertionError("a task ends with a result or an error")


def _tile_ranges(n_tiles: int, skip: frozenset[int]) -> Iterator[tuple[int, int]]:
    """First and last (excluded) of consecutive tiles, as many as a task has, without those to skip."""
    begin = 0
    while begin < n_tiles:
        end = begin
        while end < n_tiles and end not in skip and end - begin < TILES_OF_A_TASK:
            end += 1
        if end > begin:
            yield begin, end
        begin = max(end, begin + 1)
