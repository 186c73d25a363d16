"""Fills the cache: runs the worker's own computation in this process, for the transport that the editor will request;
and what that costs, for `insitu plan --check`.

The requests are the editor's (`app.modes.placement.transport_controller`), so that what is computed is what the editor
looks up. Stopped half-way, it resumes after the last complete tile.

The cost is that of a process of its own, with an empty cache, until all is there that the editor would look for; what
the error's estimate takes afterwards is no part of the plan. Time is that of the processors, by which a machine that
others use as well can be measured. What an editor then holds is counted in a second process, which reads that cache.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from app.document.scene_state import SceneState
from app.messages.worker_messages import (
    OpenScene,
    Progress,
    RequestFailed,
    Response,
    SceneOpened,
    SetCamera,
    ViewTraced,
)
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import (
    ErrorEstimated,
    EstimateError,
    FreezeIndirect,
    IndirectFrozen,
    PrepareRelighting,
    RelightingPrepared,
    StageDone,
)
from app.modes.placement.transport_controller import TransportController
from app.project.project import Project, ProjectSpec
from app.system.lazy_import import qualified
from app.worker.cache import CACHE_VARIABLE, ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.errors import InsituError
from engine.render.error_estimate import WHAT
from engine.render.picture_error import ErrorEstimate

if TYPE_CHECKING:
    from app.cluster.cluster_project import ClusterProject


Report = Callable[[Progress], None]
Answer = TypeVar("Answer", bound=Response)


@dataclass(frozen=True)
class CacheContents:
    """The size and quality of the cached data: bytes of transport and indirect light, and the error of their
    picture."""

    n_bytes: int
    error: ErrorEstimate


@dataclass(frozen=True)
class FilledCache:
    """The worker that has filled a cache, the transport it was asked for, and how many bytes there are of it."""

    client: InProcessClient
    transport: int
    scene: SceneState
    n_bytes: int


def precompute(
    project: Project, report: Report, store: ArrayCache | None = None, cluster: ClusterProject | None = None
) -> CacheContents:
    """Compute all transport of a project into the cache, and its indirect light.

    store: None for the editor's; cluster: who does the long work, None for this process. Raises InsituError when it
    cannot be computed, or not be stored.
    """
    filled = fill(project, report, store or ArrayCache(), cluster)
    report(Progress(WHAT, 0.0))
    filled.client.send(EstimateError(filled.scene, revision=filled.transport))
    return CacheContents(filled.n_bytes, _poll_until(filled.client, ErrorEstimated, report).estimate)


def fill(
    project: Project, report: Report, store: ArrayCache, cluster: ClusterProject | None = None, holds: bool = False
) -> FilledCache:
    """The same without an estimate of the error, as far as something can be stored. holds: keep in memory what an
    editor would."""
    settings = project.editor_settings
    store.require()
    document, seen = project.picture_document, project.scene
    scene = OpenScene(document.source)
    camera, bumps, n_edge_rays = seen.description.camera, document.new_bumps, settings.n_edge_rays
    view = SetCamera(
        0, camera, seen.resolution, document.poses, bumps, n_edge_rays, document.new_opacities, document.composition
    )
    executor = None if cluster is None else cluster.executor(scene, view, document)
    client = InProcessClient(RequestDispatcher(store, fills=not holds, executor=executor))
    curves = Curves()
    controller = TransportController(client.send, curves)
    number = client.send(scene)
    _poll_until(client, SceneOpened, report)
    client.send(replace(view, scene=number))
    _poll_until(client, ViewTraced, report)
    controller.scene_opened()
    controller.update(time.monotonic(), document, None, settings.of_light, False)
    while not (stage := _poll_until(client, StageDone, report)).exact:
        pass
    store.require_stored()
    return FilledCache(client, controller.revision, curves.scene_state(document), stage.transport_bytes)


def _poll_until(client: InProcessClient, kind: type[Answer], report: Report) -> Answer:
    """Work until there is such a response, and no further: other responses are dropped."""
    for response in _responses(client, report):
        if isinstance(response, kind):
            return response
    raise InsituError("the computation ended without a result")


def _responses(client: InProcessClient, report: Report) -> Iterator[Response]:
    """The responses to what was requested, until nothing is left to do."""
    while client.wait(0.0):
        for response in client.poll(budget_s=0.0):
            if isinstance(response, RequestFailed):
                raise InsituError(response.line)
            if isinstance(response, Progress):
                report(response)
            yield response


def held_bytes(project: Project, report: Report, store: ArrayCache) -> int:
    """Main memory that an editor holds of a project's transport and indirect light, with the curve selected for which
    most is frozen, and with all that a turning sky needs."""
    filled, most = fill(project, report, store, holds=True), 0
    editable = set(project.editable)
    for layer in filled.scene.visible:
        if layer.key in editable:
            filled.client.send(FreezeIndirect(filled.scene, layer.key, layer.bands.index(max(layer.bands))))
            frozen = [each for each in _responses(filled.client, report) if isinstance(each, IndirectFrozen)]
            most = max(most, *(each.light.n_bytes for each in frozen), 0)
    filled.client.send(PrepareRelighting(filled.scene))
    return most + _poll_until(filled.client, RelightingPrepared, report).transport_bytes


MIB = 2.0**20


@dataclass(frozen=True)
class ActualCost:
    """Seconds of the processors, the peak of main memory, what is stored on disk, and what an editor holds, MiB."""

    seconds: float
    memory_mib: float
    disk_mib: float
    editing_mib: float


def carry_out(words: ProjectSpec) -> ActualCost:
    """Fill an empty cache with what `words` open, and open that in an editor, in processes of their own. Raises
    InsituError."""
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        seconds, peak = _in_process("fill", words, folder)
        kept = sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file())
        held, _ = _in_process("hold", words, folder)
    return ActualCost(seconds, peak / MIB, kept / MIB, held / MIB)


def _in_process(what: str, words: ProjectSpec, folder: str) -> tuple[float, int]:
    """What a process with its cache in a folder found, and the peak of its memory in bytes."""
    import psutil

    environment = os.environ | {CACHE_VARIABLE: folder}
    command = [sys.executable, "-m", qualified("app.cli.precompute"), what, json.dumps(asdict(words))]
    with psutil.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment) as process:
        peak = 0
        while process.poll() is None:
            with contextlib.suppress(psutil.Error):
                peak = max(peak, process.memory_info().rss)
            time.sleep(0.02)
        said, complaint = process.communicate()
    if process.returncode:
        raise InsituError(complaint.strip().splitlines()[-1] if complaint.strip() else f"{words.name}: no result")
    return float(json.loads(said.splitlines()[-1])), peak


def main(what: str, said: str) -> None:
    """Print one number: how long it took the processors to "fill" the cache, or the bytes that an editor will "hold" of
    it; in a process of its own."""
    words = json.loads(said)
    words |= {name: tuple(map(tuple, words[name])) for name in ("values", "settings", "overrides")}
    words["resolution"] = words["resolution"] and tuple(words["resolution"])
    project = ProjectSpec(**words).open()
    if what == "hold":
        print(held_bytes(project, lambda progress: None, ArrayCache()))
        return
    started = time.process_time()
    fill(project, lambda progress: None, ArrayCache())
    print(time.process_time() - started)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except InsituError as error:
        sys.exit(str(error))
