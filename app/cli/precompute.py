"""Filling the cache: the worker's own computation in this process, for the transport that the editor will ask for.

The talk is the editor's (`app.placement.transport_talk`), so that what is computed is what the editor looks up.
Stopped half-way, it goes on from the last complete tile.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from app.jobs.cache import Store
from app.jobs.in_process import InProcessClient
from app.jobs.tasks import Tasks
from app.messages import Failed, LookFrom, OpenScene, Progress, Response, SceneOpened, SceneSeen
from app.placement.curves import Curves
from app.placement.messages import ErrorEstimated, EstimateError, StageDone
from app.placement.transport_talk import TransportTalk
from app.project import Project
from app.view_state import AS_PLANNED
from engine.errors import InsituError
from engine.plan import N_LIGHTS, N_PATCHES
from engine.render.error_estimate import WHAT
from engine.render.picture_error import ErrorEstimate

Report = Callable[[Progress], None]
Answer = TypeVar("Answer", bound=Response)


@dataclass(frozen=True)
class CacheContents:
    """What is in the cache: bytes of transport and indirect light, and how far off the picture is that they make."""

    n_bytes: int
    error: ErrorEstimate


def precompute(
    project: Project, report: Report, n_lights: int | None = None, store: Store | None = None
) -> CacheContents:
    """Compute all transport of a project into the cache, and its indirect light.

    n_lights: None for as many as the editor would take; store: None for the editor's. Raises InsituError when it cannot
    be computed, or not be kept.
    """
    store = store or Store()
    store.require()
    client = InProcessClient(Tasks(store, fills=True))
    curves = Curves()
    talk = TransportTalk(client.send, curves)
    scene = client.send(OpenScene(project.document.source))
    _until(client, SceneOpened, report)
    document, seen = project.document, project.scene
    camera = seen.description.camera
    client.send(LookFrom(scene, camera, seen.resolution, document.poses, document.new_bumps))
    _until(client, SceneSeen, report)
    talk.scene_opened()
    n_bounces = project.n_bounces or project.scene.description.bounces or AS_PLANNED
    n_lights = n_lights or project.n_lights or N_LIGHTS
    talk.update(
        time.monotonic(),
        project.document,
        None,
        n_lights,
        False,
        n_bounces=n_bounces,
        n_patches=project.n_patches or N_PATCHES,
    )
    while not (stage := _until(client, StageDone, report)).exact:
        pass
    store.require_kept()
    report(Progress(WHAT, 0.0))
    client.send(EstimateError(curves.scene_state(project.document), revision=talk.revision))
    return CacheContents(stage.transport_bytes, _until(client, ErrorEstimated, report).estimate)


def _until(client: InProcessClient, kind: type[Answer], report: Report) -> Answer:
    """Work until there is such an answer, and no further: answers that came with it are kept by nobody."""
    while client.wait(0.0):
        for response in client.poll(budget_s=0.0):
            if isinstance(response, Failed):
                raise InsituError(response.line)
            if isinstance(response, Progress):
                report(response)
            if isinstance(response, kind):
                return response
    raise InsituError("the computation ended without a result")
