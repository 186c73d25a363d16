"""The long work on a cluster: the jobs of its workers, and the executor that sends them out.

    worker A   compute_light ──► project_tiles ...        find_indirect
    worker B        └──────► project_tiles ...
    here       visibility    tiles, into their file   indirect light: into the cache as if they were made here

A worker opens the project that a job names, from the files that came with it, and stores what it has opened last, so
that the tasks of one scene open it once. It runs one task at a time, on all the cores that its process may use. The
light stays where it was made and is sent from worker to worker; if the worker that had it is lost, it is computed
again.
"""

from __future__ import annotations

import contextlib
import platform
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from app.cluster.dask import Cluster
from app.cluster.program import describe_mismatch, program_digest
from app.cluster.scene_bundle import FileCache, SceneBundle, fetch_piece
from app.document.scene_state import LayerState, SceneState
from app.messages.worker_messages import OpenScene, Progress, SetCamera
from app.worker.cache import ArrayCache
from app.worker.executor import IndirectSteps, LightSteps
from engine.core.errors import InsituError
from engine.core.safe_files import redirect_files
from engine.core.stored_arrays import Arrays
from engine.precompute.direct.bandstore import BandTile
from engine.precompute.direct.linking import LightGroup, light_groups
from engine.precompute.direct.pipeline import Placement, Quality
from engine.precompute.direct.projection import TILE, LayerShape, VisibleLight, project_layer

if TYPE_CHECKING:
    import numpy as np
    from distributed import Future

    from app.project.project import ProjectSpec
    from app.stills.frame_sequence import Drawer, Frames, Picture
    from app.worker.tasks import WorkerContext


_one_task_at_a_time = threading.Lock()
_opened_by_job: dict[str, object] = {}
_places_of: dict[str, dict[str, Path]] = {}
Opened = TypeVar("Opened")


@dataclass(frozen=True)
class Job:
    """The part that all tasks of one command share: a unique name, the files of its scene, and the digest of its
    Insitu."""

    name: str
    bundle: SceneBundle
    program: str


@dataclass(frozen=True)
class FrameJob(Job):
    """Frames of a project."""

    words: ProjectSpec
    frames: Frames


@dataclass(frozen=True, eq=False)
class ViewJob(Job):
    """One view of a scene, opened as the editor's worker opens it, under the light and the emitters of a document."""

    open: OpenScene
    camera_request: SetCamera
    scene: SceneState


def draw_frame(job: FrameJob, i: int) -> Picture:
    """Frame i: linear radiance (H, W, 3)."""
    with _exclusive_task(job):
        return _open_once(job, lambda: _drawer(job)).draw(i)


def compute_light(job: ViewJob, quality: Quality, number: int) -> VisibleLight:
    """The light of a view that reaches a group of its objects, by the group's number, and from where it is seen."""
    from engine.core.generators import run_to_end

    with _exclusive_task(job):
        context = _open_once(job, lambda: _worker_context(job))
        group = light_groups(context.open_placement, context.sky(job.scene.light))[number]
        return run_to_end(group.placement.light(group.sky, quality))


def project_tiles(job: ViewJob, light: VisibleLight, layer: LayerShape, rows: np.ndarray, begin: int) -> list[BandTile]:
    """The tiles of consecutive points of a layer; `begin`: which of the layer's the first is."""
    with _exclusive_task(job):
        hits = _open_once(job, lambda: _worker_context(job)).open_placement.hits
        return [replace(tile, begin=begin + tile.begin) for tile in project_layer(hits, rows, light, layer)]


def find_indirect(job: ViewJob, layers: Sequence[LayerState], lit_by: str, n_bounces: int, n_rays: int) -> Arrays:
    """The fine indirect light of a view, as it is cached on disk."""
    from app.worker.indirect_tasks import IndirectTasks
    from engine.precompute.indirect.checkpoints import arrays_of

    with _exclusive_task(job):
        context = _open_once(job, lambda: _worker_context(job))
        tasks = IndirectTasks(context.open_placement, context.store, context.view_key, context.view_id)
        for _ in tasks.find(layers, context.sky(job.scene.light), lit_by, n_bounces, True, n_rays):
            pass
        assert tasks.light is not None
        return arrays_of(tasks.light)


@contextlib.contextmanager
def _exclusive_task(job: Job) -> Iterator[None]:
    """Run one task at a time, with the files of its job and no others."""
    if job.program != program_digest():
        raise InsituError(describe_mismatch(f"a worker on {platform.node()}"))
    with _one_task_at_a_time:
        with redirect_files(_local_files(job)):
            yield


def _local_files(job: Job) -> dict[str, Path]:
    """The job's files on this worker; searched for once."""
    if job.name not in _places_of:
        try:
            found = FileCache().places(job.bundle, fetch_piece)
        except OSError as error:
            raise InsituError(f"a worker on {platform.node()} cannot keep the scene: {error.strerror}") from error
        _places_of.clear()
        _places_of[job.name] = found
    return _places_of[job.name]


def _open_once(job: Job, make: Callable[[], Opened]) -> Opened:
    """The project of the newest job; what another job had opened is released first."""
    if job.name not in _opened_by_job:
        _opened_by_job.clear()
        _opened_by_job[job.name] = make()
    return _opened_by_job[job.name]  # type: ignore[return-value]


def _drawer(job: FrameJob) -> Drawer:
    from app.stills.frame_sequence import drawer_of

    drawer = drawer_of(job.words.open(), job.frames)
    drawer.prepare(lambda step: None)
    return drawer


def _worker_context(job: ViewJob) -> WorkerContext:
    """A worker context with the open view, and the tables of its measured layers read."""
    from app.worker.file_tasks import ensure_tables
    from app.worker.tasks import RequestDispatcher

    tasks = RequestDispatcher(ArrayCache(), fills=True)
    for request in (job.open, job.camera_request):
        for _ in tasks.handle(request):
            pass
    for _ in ensure_tables((state.layer for state in job.scene.layers), tasks.context.store):
        pass
    tasks.context.open_placement.set_emission(dict(job.scene.emission))
    return tasks.context


TILES_OF_A_TASK = 16
Result = TypeVar("Result")
StepValue = TypeVar("StepValue")


class ClusterExecutor:
    """Does the long work on the view of a job on a cluster."""

    def __init__(self, cluster: Cluster, job: ViewJob) -> None:
        self._cluster, self._job = cluster, job
        self._lights: dict[int, Future] = {}

    def compute_light(self, group: LightGroup, quality: Quality) -> LightSteps:
        placement, task = group.placement, self._cluster.submit(compute_light, self._job, quality, group.number)
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
