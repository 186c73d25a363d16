"""Requests what shadow catchers show where nothing stands on them, which the window needs to show only their shadows.

Once Placement's picture is complete, the worker draws catchers and what emits alone (`app.worker.catcher_tasks`). That
stays until it would be another: an edit of other objects does not concern it. Until it is there, and where the window
shows something else than the scene in its light, catchers are shown as objects. Orbit and Deform draw them alone with
each picture (`app.worker.catcher_engines`); Placement's waits behind these until its catchers are known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.history import History
from app.document.shadow_catchers import catchers_alone, why_as_objects
from app.document.view_state import Viewpoint, ViewState
from app.messages.catcher_messages import CatcherLightFound, CatcherProgress, FindCatcherLight
from app.messages.editor_status import Status
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import CancelRequests, Request
from app.modes.mode import ModeController
from app.modes.reconciler import Reconciler
from engine.settings import RenderSettings

Light = NDArray[np.float32]
IDLE_SECONDS = 0.1
STAGE = "shadow catchers"


class CatcherLightArrived(PictureEvent):
    """What catchers show alone is there: the picture shows their shadows from now on."""


class TracedScene(Protocol):
    """The view that the worker has traced, and the number of the request that opened its scene."""

    is_away: bool

    @property
    def traced(self) -> Viewpoint: ...

    @property
    def scene(self) -> int: ...


class CatcherHost(Protocol):
    """What it needs of the editor."""

    view: ViewState
    history: History[Document]
    controller: ModeController

    def send(self, request: Request) -> int: ...


@dataclass(frozen=True)
class CatchersSeen:
    """What is drawn: a document of catchers and emitters alone, how, and from where; scene: see `TracedScene`."""

    alone: Document
    settings: RenderSettings
    viewpoint: Viewpoint
    scene: int


class CatcherController:
    """The shadow catchers of one editor."""

    def __init__(self, host: CatcherHost, tracing: TracedScene) -> None:
        self._host, self._tracing = host, tracing
        self._reconciler = Reconciler[CatchersSeen, Light](IDLE_SECONDS, cancels_at_once=True)
        self._found: tuple[CatchersSeen, Light] | None = None
        self._alone: tuple[Document, Document | None] | None = None
        self._fraction = 0.0
        self._are_caught = self._failed = False

    def update(self, now: float, document: Document, view: ViewState) -> None:
        """Request the light of the document's catchers where it is time to; once a frame."""
        reconciler, controller = self._reconciler, self._host.controller
        if self._tracing.is_away:
            reconciler.lose()  # another view cancels it in the worker
            return
        if why_as_objects(document, view):
            controller.await_catchers(False)
            return
        desired = self._seen(document, view) if controller.still_mode == "placement" else None
        self._failed &= reconciler.desired == desired
        reconciler.desire(now, desired)
        if desired is not None and self._found is not None and self._found[0] == desired and not reconciler.is_ready:
            reconciler.accept(self._found[1], desired)
        is_answered = desired is not None and (reconciler.is_ready or reconciler.is_refused)
        controller.await_catchers(bool(document.shadow_catchers) and not is_answered)
        may_request = desired is not None and not self._host.history.dragging and controller.is_whole
        match reconciler.action(now, may_request):
            case "request":
                assert desired is not None
                request = FindCatcherLight(desired.alone, desired.settings)
                reconciler.sent(now, self._host.send(request))
                self._fraction, self._failed = 0.0, False
            case "cancel":
                self._host.send(CancelRequests(of=(FindCatcherLight,)))

    def light(self, document: Document) -> Light | None:
        """What the catchers of a document show alone in Placement's picture (H, W, 3); None while unknown, where there
        is none, and where catchers are to be shown as objects."""
        view, found = self._host.view, self._found
        if found is None or not found[1].size or why_as_objects(document, view):
            return None
        return found[1] if found[0] == self._seen(document, effective_view(view, document)) else None

    def status(self, status: Status, document: Document, view: ViewState) -> Status:
        """The status of a picture with catchers, which is not finished before their light is there."""
        if not document.shadow_catchers:
            return status
        if note := why_as_objects(document, view):
            return replace(status, catcher_note=note)
        reconciler = self._reconciler
        if not self._are_caught:
            status = replace(status, catcher_note="until their shadows are known")
        if reconciler.is_under_way and not status.stage:
            status = replace(status, stage=STAGE, fraction=self._fraction, text="drawing shadow catchers alone")
        is_placement = self._host.controller.still_mode == "placement"
        if status.is_finished and is_placement and not (reconciler.is_ready or self._failed):
            return replace(status, picture="refining", missing_note="Shadow catchers are still shown as objects.")
        return status

    def drawn(self, are_caught: bool) -> None:
        """Note whether the picture on screen shows shadows in place of the catchers."""
        self._are_caught = are_caught

    # -------------------------------------------------------------------------------------------------------- responses

    def receive(self, response: CatcherLightFound | CatcherProgress) -> list[PictureEvent]:
        """Take a response; returns what the picture needs of it."""
        reconciler = self._reconciler
        if isinstance(response, CatcherProgress):
            self._fraction = response.fraction
            return []
        if not reconciler.receive(response.id, response.light) or reconciler.ready_for is None:
            return []
        self._found = reconciler.ready_for, response.light
        return [CatcherLightArrived()]

    def receive_failure(self, id: int) -> None:
        self._failed = self._reconciler.fail(id) or self._failed

    def cancelled(self) -> None:
        """The user stopped the work."""
        self._reconciler.stop()

    def resume(self) -> None:
        """Go on with what was stopped or has failed."""
        self._reconciler.retry()

    # ------------------------------------------------------------------------------------------------------------ parts

    def _seen(self, document: Document, view: ViewState) -> CatchersSeen | None:
        """What is to be drawn; None without catchers."""
        if self._alone is None or self._alone[0] is not document:
            self._alone = document, catchers_alone(document)
        alone, tracing = self._alone[1], self._tracing
        if alone is None:
            return None
        settings = RenderSettings(
            n_bounces=view.settings.n_bounces, n_edge_rays=view.settings.n_edge_rays,
            n_hemisphere_rays=view.settings.n_hemisphere_rays, n_map_nodes=view.settings.n_map_nodes,
        )  # fmt: skip
        return CatchersSeen(alone, settings, tracing.traced, tracing.scene)
