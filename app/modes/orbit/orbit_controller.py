"""Orbit's controller: pictures of its own while something moves, Placement's once the view is idle.

    document, view ─► PrepareOrbit ─► OrbitProgress ─► DrawOrbit ─► OrbitPictureDrawn ─► OrbitPicture    each frame
    the view is idle, its picture complete ─► PlacementController ─► Placement's events    fades in over that

It joins four parts. `orbit_drawing` says what is desired and how it is requested, `preparation` requests what pictures
are drawn of, `picture_controller` the pictures, `placement_handover` Placement's picture of an idle view. Another mode
whose pictures the worker draws has this controller with another drawing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.document.commands import EditCommand
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.view_state import ViewState
from app.messages.editor_status import PictureState, Status
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import CancelRequests, RequestFailed, Response
from app.modes.error_controller import ErrorController
from app.modes.mode import EditorServices, ModeController, OpenedScene, StillMode
from app.modes.orbit.desired_state import DesiredDrawing, ReadyState, ShownPicture
from app.modes.orbit.orbit_drawing import OrbitDrawing
from app.modes.orbit.orbit_events import OrbitPartArrived
from app.modes.orbit.orbit_messages import (
    DrawHeadlight,
    DrawnErrorEstimated,
    EstimateDrawn,
    OrbitNotReady,
    OrbitPartExported,
    OrbitPictureDrawn,
    OrbitProgress,
)
from app.modes.orbit.orbit_status import OrbitStatus
from app.modes.orbit.picture_controller import PictureController, WindowPicture
from app.modes.orbit.placement_handover import PlacementHandover
from app.modes.orbit.preparation import Preparation
from app.modes.placement.placement_controller import PlacementController
from engine.material.layer import Layer
from engine.render.picture_error import ErrorEstimate

# How long a picture is to be on screen, whole, before its error is estimated.
ERROR_IDLE_SECONDS = 0.3
# While objects are moved.
MOVE_NOTE = "indirect light as before the move"
MOVE_HINT = "Direct light and shadows follow the objects, coarsely; all else when they rest."
PLACEMENT_FOLLOWS = "Placement computes this view and fades in when it is ready."


class OrbitController(ModeController):
    """The controller of Orbit. drawing: what is drawn, and by which requests. is_away: whether the view is not the
    traced one."""

    def __init__(self, services: EditorServices, drawing: OrbitDrawing | None = None) -> None:
        self._services = services
        self._drawing = drawing = drawing or OrbitDrawing()
        self._state = DesiredDrawing(drawing)
        self._preparation = Preparation(services.send, drawing)
        self._pictures = PictureController(services.send, drawing, self._state)
        self._handover = PlacementHandover(services)
        self._error = ErrorController[ShownPicture, DrawnErrorEstimated](
            services.send, drawing.estimates, ERROR_IDLE_SECONDS
        )
        self._is_open = self.is_away = self._is_stopped = False

    @property
    def title(self) -> str:
        """The mode's name for users."""
        return self._drawing.title

    @property
    def placement(self) -> PlacementController:
        """The controller of the idle view's picture."""
        return self._handover.placement

    # --------------------------------------------------------------------------------------------- events of the editor

    def scene_closed(self) -> None:
        self._handover.hold_back()
        self._is_open = False

    def scene_open_failed(self) -> None:
        self._is_open = True
        self._preparation.restart()
        self._pictures.cancel()

    def scene_opened(self, scene: OpenedScene) -> None:
        self._is_open, self.is_away, self._is_stopped = True, False, False
        self._state.scene_opened(scene.description.camera)
        self._drawing.scene_opened()
        self._drawing.accept_light(scene.described.light)
        self._preparation.forget()
        self._pictures.scene_opened()
        self._error.forget()
        self._handover.forget()
        self.placement.scene_opened(scene)
        self.placement.scene_closed()

    def view_moved(self) -> None:
        self.is_away = True
        self._handover.hold_back()

    def view_restored(self) -> None:
        self.is_away = False
        self._preparation.resume()

    def view_traced(self, scene: OpenedScene) -> None:
        self.is_away = False
        self._preparation.resume()
        self._error.forget()
        self._handover.forget()
        self.placement.view_traced(scene)
        self.placement.scene_closed()

    def deactivated(self) -> None:
        drawing = self._drawing
        self._services.send(CancelRequests(of=(drawing.prepares, drawing.draws, drawing.estimates, DrawHeadlight)))
        self.placement.deactivated()

    def edited(self, command: EditCommand | None = None) -> None:
        self.placement.edited(command)

    def drag_ended(self) -> None:
        self._state.skip_idle()
        self.placement.drag_ended()

    def add_band_plans(self, planned: Iterable[tuple[Layer, Mapping[str, int]]]) -> None:
        self.placement.add_band_plans(planned)

    def reload_images(self, key: str) -> None:
        self._preparation.restart()
        self.placement.reload_images(key)

    def cancelled(self) -> None:
        self._is_stopped = True
        self._preparation.stop()
        self.placement.cancelled()

    def resume(self) -> None:
        self._is_stopped = False
        self._preparation.restart()
        self.placement.resume()

    def worker_restarted(self) -> None:
        self._worker_lost()
        self.placement.worker_restarted()

    def _worker_lost(self) -> None:
        """Forget what was ready; what is shown stays."""
        self._error.forget()
        self._preparation.forget()
        self._pictures.worker_lost()

    def draw_in_window(self, most_bytes: int) -> None:
        """From now on the window draws moving pictures itself, of arrays of at most so many bytes; 0: the worker
        does."""
        self._drawing.draw_in_window(most_bytes)
        self._pictures.restart_pace()
        self._preparation.restart()

    def draw_again(self) -> None:
        """Request the picture on screen again: the window could not draw it."""
        self._pictures.draw_again()

    def record_draw_seconds(self, seconds: float) -> None:
        """Note that a picture took the window this long."""
        self._pictures.record_seconds(seconds)

    # --------------------------------------------------------------------------------------------- state for the window

    @property
    def still_mode(self) -> StillMode:
        return "placement" if self._handover.follows else self._drawing.still_mode

    @property
    def is_whole(self) -> bool:
        return self.placement.is_whole if self._handover.follows else self._is_whole

    def await_catchers(self, awaits: bool) -> None:
        self._handover.is_held_back = awaits

    @property
    def drawn_in_window(self) -> WindowPicture | None:
        """What the window is to draw of the exported parts; None where it is to show a picture of the worker's."""
        return self._pictures.drawn_in_window

    @property
    def shows_viewpoint(self) -> bool:
        """Whether the picture has the present camera and poses, and not those of a moment ago."""
        shown = self._pictures.shown
        if self._handover.is_shown or shown is None:
            return self._handover.is_shown
        content = self._drawing.content(self._services.pictured, self._services.view)
        return (shown.viewpoint, shown.poses) == (content.viewpoint, content.poses)

    @property
    def is_placement_active(self) -> bool:
        """Whether Placement computes the picture of the view, or has it."""
        return self._handover.is_active

    @property
    def shows_placement(self) -> bool:
        """Whether Placement's picture is shown."""
        return self._handover.is_shown

    @property
    def awaits_response(self) -> bool:
        return self._pictures.is_under_way or self._handover.is_active and self.placement.awaits_response

    @property
    def is_running(self) -> bool:
        is_preparing = self._preparation.is_running or self._awaits_more and not self._is_stopped
        return is_preparing or self._handover.is_active and self.placement.is_running

    @property
    def follows_objects(self) -> bool:
        return self._drawing.follows_objects and self._preparation.ready.version > 0

    def status(self, status: Status) -> Status:
        if self._handover.is_shown:
            return replace(self.placement.status(status), shown_by="Placement")
        drawing, shown, picture, estimate = self._drawing, self._pictures.shown, self._picture, self._estimate
        lacks = drawing.limitations if estimate is not None and estimate.is_large else ""
        note = "\n".join(filter(None, (lacks, PLACEMENT_FOLLOWS))) if picture == "refining" else ""
        shown_move = shown is not None and shown.made_of.follows_move
        follows_move = picture == "preview" and shown_move
        said = {
            "picture": picture,
            "missing_note": MOVE_NOTE if follows_move else note,
            "missing_hint": MOVE_HINT if follows_move else "",
            "shown_by": drawing.title,
            "precomputed_mb": self._preparation.n_bytes / 1e6,
            "estimate": estimate,
            "error_colours": self._error_colours,
            "image_error": None if estimate is None else estimate.overall,
        }
        own = OrbitStatus(
            **(vars(status) | said),
            drawn_resolution=(0, 0) if shown is None else shown.resolution,
            drawn_seconds=self._pictures.seconds,
            is_headlight=self._pictures.is_headlight,
        )
        return drawing.complete_status(own, self._preparation.id)

    @property
    def _estimate(self) -> ErrorEstimate | None:
        """The error of the shown picture: at rest that estimated for this view, else that of moving pictures, which
        holds from any camera until the scene is edited. A map does not change it."""
        seen, newest = self._shown_picture, self._error.newest
        if self._picture == "waiting" or seen is None or newest is None or not self._drawing.can_be_estimated:
            return None
        picture, estimated = newest
        if self._is_whole:
            return estimated.at_rest if picture._replace(has_map=seen.has_map) == seen else None
        return estimated.moving if picture.desired == seen.desired else None

    @property
    def _error_colours(self) -> NDArray[np.uint8] | None:
        estimated = None if self._shown_picture is None else self._error.estimated(self._shown_picture)
        return estimated.colours if estimated is not None and self._is_whole else None

    @property
    def _shown_picture(self) -> ShownPicture | None:
        desired, content = self._state.desired, self._state.content
        if desired is None or content is None:
            return None
        return ShownPicture(desired, content.viewpoint, content.poses, self._services.view.shows_error)

    @property
    def _picture(self) -> PictureState:
        if self._pictures.shown is None or self._pictures.is_headlight:
            return "waiting"
        if not self._is_whole:
            return "preview"
        return "refining" if self._drawing.placement_can_show or self._awaits_more else "finished"

    @property
    def _awaits_more(self) -> bool:
        return self._drawing.awaits_more(self._state.desired, self._preparation.id)

    @property
    def _is_whole(self) -> bool:
        """Whether this mode shows all it can of the document and the view."""
        shown, state, preparation = self._pictures.shown, self._state, self._preparation
        if shown is None or state.content is None or shown.quality != "rest":
            return False
        is_of_view = (shown.viewpoint, shown.poses) == (state.content.viewpoint, state.content.poses)
        is_ready = preparation.is_ready and preparation.requested == state.desired
        document = self._services.pictured
        has_followed = state.has_followed(document, effective_view(self._services.view, document))
        return is_of_view and is_ready and shown.made_of == preparation.ready and has_followed

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        if not self._is_open:
            return []
        handover = self._handover
        if self._state.update(now, document, view):
            self._is_stopped = False
        desired, requested = self._state.desired, self._preparation.requested
        is_requested = requested is not None and desired is not None and requested.scene == desired.scene
        events = handover.update(now, document, view, is_requested)
        if not handover.follows or handover.is_held_back:
            self._prepare(now)
            if self._pictures.update(now, self._preparation.ready, self._preparation.is_ready, self.is_away):
                handover.picture_shown()
            can_begin = self._is_whole and self._drawing.placement_can_show
            if can_begin and not (handover.is_active or self.is_away or self._is_stopped):
                handover.begin()
        elif not (self.placement.is_running or self._services.history.dragging):
            self._prepare(now)  # so that the view can move at once
        self._update_error(now)
        return events

    def _prepare(self, now: float) -> None:
        """Request what the document desires. During a drag it waits until the request before is in a picture: each
        takes a while to show, and would be given up for the next."""
        shown, desired, preparation = self._pictures.shown, self._state.desired, self._preparation
        is_due = shown is None or preparation.requested is None or shown.made_of.prepared == preparation.id
        if desired is not None:
            may_request = not self._is_stopped and (is_due or not self._services.history.dragging)
            preparation.update(now, desired, may_request)

    def _update_error(self, now: float) -> None:
        """Request an estimate of the shown picture's error, if the picture is this mode's."""
        if (seen := self._shown_picture) is not None:
            is_moving = self.is_away or self._handover.is_shown or self._services.history.dragging
            rests = self._is_whole and not is_moving and self._drawing.can_be_estimated

            def request() -> EstimateDrawn:
                at_rest, moving = self._pictures.estimated_requests(self._preparation.ready)
                desired = seen.desired
                return self._drawing.estimates(desired.scene, desired.n_bounces, at_rest, moving, seen.has_map)

            self._error.update(now, seen, rests, request)

    # -------------------------------------------------------------------------------------------------------- responses

    def receive(self, response: Response) -> list[PictureEvent]:
        if self._drawing.receive(response):
            return []
        match response:
            case OrbitProgress():
                self._take_progress(response)
            case OrbitPartExported():
                return [OrbitPartArrived(response.part)] if self._drawing.needs_no_request else []
            case OrbitPictureDrawn():
                return self._take_picture(response)
            case OrbitNotReady():
                if self._pictures.receive_not_ready(response.id):
                    self._worker_lost()
            case DrawnErrorEstimated():
                self._error.receive(response)
            case RequestFailed():
                self._error.receive_failure(response.id)
                self._pictures.receive_failure(response.id)
                self._take_failure(response)
                return self.placement.receive(response)
            case _:
                return self.placement.receive(response)
        return []

    def _take_progress(self, response: OrbitProgress) -> None:
        if not self._preparation.receive(response):
            return
        if self._preparation.requested is not None:
            self._drawing.accept(self._preparation.requested)
        if response.is_done and not self.is_running:
            self._services.metrics.progress = None

    def _take_picture(self, response: OrbitPictureDrawn) -> list[PictureEvent]:
        drawn = self._pictures.receive(response)
        if drawn is None:
            return []
        ready = ReadyState(response.prepared, response.version, response.is_done, response.follows_move)
        if (
            ready.version
            and ready.prepared == self._preparation.id
            and ready.version >= self._preparation.ready.version
        ):
            self._preparation.note_ready(ready)
        self._handover.picture_shown()
        return self._drawing.picture_events(response, drawn, self._state.camera(drawn.viewpoint))

    def _take_failure(self, response: RequestFailed) -> None:
        """What is to be drawn cannot be prepared: it is not requested again, and leaves the document."""
        refused = self._preparation.receive_failure(response.id)
        if refused is not None:
            self._is_stopped = True
            if self._drawing.revert(self._services.history, refused):
                self._services.document_changed()
