"""Orbit's controller: pictures of its own while something moves, Placement's once the view is idle.

    document, view ─► PrepareOrbit ─► OrbitProgress ─► DrawOrbit ─► OrbitPictureDrawn ─► OrbitPicture    each frame
    the view is idle, its picture complete ─► PlacementController ─► Placement's events    fades in over that

As in Placement, states are compared, events are not followed: what document and view desire, what was requested, what
has come. One picture is under way at a time; the next one takes the camera, light and materials of its own moment, so
that nothing queues up behind the pointer. A picture of an idle view takes longer, and gives way to input at once. Where
the window draws moving pictures on a graphics card (`draw_in_window`), the worker exports the parts that they are drawn
of, and draws only those of an idle view.

Placement's controller is a part of this one. It is held back until Orbit's picture of an idle view is complete, and
again as soon as it could not keep up: neither mode's files depend on what the other requests. Rejected: to switch the
mode when idle, which would change the session with every pause of the user.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from app.document.commands import EditCommand
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.view_state import Viewpoint, ViewState
from app.messages.editor_status import PictureState, Status
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import CancelRequests, Request, RequestFailed, Response
from app.modes.error_controller import ErrorController
from app.modes.mode import EditorServices, ModeController, OpenedScene
from app.modes.orbit.desired_state import (
    WINDOW_SECONDS,
    WINDOW_STEPS,
    DesiredOrbit,
    PictureRequest,
    QualityPacer,
    ReadyState,
    ShownPicture,
)
from app.modes.orbit.orbit_events import OrbitPartArrived, OrbitPicture
from app.modes.orbit.orbit_messages import (
    DrawHeadlight,
    DrawnErrorEstimated,
    DrawOrbit,
    EstimateDrawn,
    EstimateOrbit,
    OrbitNotReady,
    OrbitPartExported,
    OrbitPictureDrawn,
    OrbitProgress,
    PrepareOrbit,
    PrioritizeView,
    Quality,
)
from app.modes.orbit.orbit_status import OrbitStatus
from app.modes.placement.accepted_light import AcceptedLight
from app.modes.placement.placement_controller import PlacementController
from app.modes.placement.placement_messages import ComputeTransport
from engine.material.layer import Layer
from engine.realtime.zonal_harmonics.pose import Poses
from engine.render.picture_error import ErrorEstimate
from engine.scene.description import Camera, CameraDescription

# The pointer is idle after so long without input.
IDLE_SECONDS = 0.2
# How long a picture is to be on screen, whole, before its error is estimated.
ERROR_IDLE_SECONDS = 0.3
# How often a window that draws itself checks whether it sees parts that are not ready.
PRIORITIZE_SECONDS = 0.25
# While pictures improve by themselves, the worker gets this many times the time that drawing one takes.
_WORK_SHARE = 4.0
_listeners = count(1)
PLACEMENT_FOLLOWS = "Placement computes this view and fades in when it is ready."
LACKS = (
    "Glossy surfaces reflect only lights here, blurred by about three degrees; other objects appear in them as an even "
    "glow."
)


class OrbitController(ModeController):
    """The controller of Orbit; `placement` is that of the idle view. Another mode whose pictures are drawn in the
    worker overrides what it is called, what it desires to be ready, and what it has drawn."""

    title, limitations = "Orbit", LACKS
    prepares: type[Request] = PrepareOrbit
    draws: type[Request] = DrawOrbit
    estimates: type[EstimateDrawn] = EstimateOrbit

    def __init__(self, services: EditorServices) -> None:
        self._services = services
        self.placement = PlacementController(services)
        self._error = ErrorController[ShownPicture, DrawnErrorEstimated](
            services.send, self.estimates, ERROR_IDLE_SECONDS
        )
        self._is_open = False
        self._listener = self._most_bytes = 0
        self._forget()

    def _forget(self) -> None:
        """Forget the scene."""
        self._own_camera: CameraDescription | None = None
        self.is_away = False
        self._desired: DesiredOrbit | None = None
        self._desired_inputs: tuple[object, ...] = ()
        self._moved_at = -math.inf
        self._viewpoint: Viewpoint | None = None
        self._poses: Poses = ()
        self._split: tuple[float, float] | None = None
        self._fit_error = False
        self._prepare_id = 0
        self._is_stopped = False
        self._accepted_light = AcceptedLight()
        self._pace = self._new_pace()
        self._hands_over_to_placement = self._placement_follows = self._shows_placement = False
        self._error.forget()
        self._forget_worker()

    def _forget_worker(self) -> None:
        """Forget the worker's state: it knows nothing, and will not answer earlier requests."""
        self._requested: DesiredOrbit | None = None
        self._ready = ReadyState()
        self._drawing: PictureRequest | None = None
        self._drawing_id = 0
        self._refused: PictureRequest | None = None
        self._shown: PictureRequest | None = None
        self._seconds = 0.0
        self._n_bytes = 0
        self._drawn_at = self._prioritized = -math.inf

    # --------------------------------------------------------------------------------------------- events of the editor

    def scene_closed(self) -> None:
        self._hold_placement_back()
        self._is_open = False

    def scene_open_failed(self) -> None:
        self._is_open = True
        self._requested = self._drawing = None

    def scene_opened(self, scene: OpenedScene) -> None:
        self._forget()
        self._is_open = True
        self._own_camera = scene.description.camera
        self._accepted_light.accept(scene.described.light)
        self.placement.scene_opened(scene)
        self.placement.view_moved()

    def view_moved(self) -> None:
        self.is_away = True
        self._hold_placement_back()

    def view_restored(self) -> None:
        self.is_away = False
        self._resume_preparation()

    def view_traced(self, scene: OpenedScene) -> None:
        self.is_away = False
        self._resume_preparation()
        self._error.forget()
        self._hands_over_to_placement = self._placement_follows = self._shows_placement = False
        self.placement.view_traced(scene)
        self.placement.view_moved()

    def _resume_preparation(self) -> None:
        """Resume the preparation that a newly traced view has cancelled."""
        if not self._is_ready_for_request:
            self._requested = None

    def deactivated(self) -> None:
        self._services.send(CancelRequests(of=(self.prepares, self.draws, self.estimates, DrawHeadlight)))
        self.placement.deactivated()

    def edited(self, command: EditCommand | None = None) -> None:
        self.placement.edited(command)

    def drag_ended(self) -> None:
        self._moved_at = -math.inf
        self.placement.drag_ended()

    def add_band_plans(self, planned: Iterable[tuple[Layer, Mapping[str, int]]]) -> None:
        self.placement.add_band_plans(planned)

    def reload_images(self, key: str) -> None:
        self._requested = None
        self.placement.reload_images(key)

    def cancelled(self) -> None:
        self._is_stopped = True
        self.placement.cancelled()

    def resume(self) -> None:
        self._is_stopped, self._requested = False, None
        self.placement.resume()

    def worker_restarted(self) -> None:
        self._reset_preparation()
        self.placement.worker_restarted()

    def _reset_preparation(self) -> None:
        """Forget what was ready; what is shown stays."""
        shown = self._shown
        self._error.forget()
        self._forget_worker()
        self._shown = shown and replace(shown, made_of=ReadyState())

    def draw_in_window(self, most_bytes: int) -> None:
        """From now on the window draws moving pictures itself, of arrays of at most so many bytes; 0: the worker
        does."""
        self._listener, self._most_bytes = next(_listeners) if most_bytes else 0, most_bytes
        self._pace = self._new_pace()
        self._requested = self._shown = None

    def _new_pace(self) -> QualityPacer:
        return QualityPacer(WINDOW_SECONDS, WINDOW_STEPS, 2) if self._listener else QualityPacer()

    def record_draw_seconds(self, seconds: float) -> None:
        """Note that a picture took the window this long."""
        self._seconds = seconds
        if self._shown is not None and self._shown.resolution == self._pace.resolution(self._full_resolution):
            self._pace.record_seconds(seconds)

    # --------------------------------------------------------------------------------------------- state for the window

    @property
    def drawn_in_window(self) -> tuple[Camera, tuple[int, int], int] | None:
        """The camera, resolution (width, height) and coefficients per point for the window to draw the exported parts;
        None where it is to show a picture of the worker's."""
        shown = self._shown
        if not self._listener or shown is None or shown.quality != "moving" or shown.is_headlight:
            return None
        return self._camera(shown.viewpoint), shown.resolution, self._pace.n_coefficients

    @property
    def shows_viewpoint(self) -> bool:
        """Whether the picture has the present camera and poses, and not those of a moment ago."""
        if self._shows_placement or self._shown is None:
            return self._shows_placement
        view = self._services.view
        poses = self._poses_of(self._services.history.document, view)
        return (self._shown.viewpoint, self._shown.poses) == (view.viewpoint, poses)

    @property
    def is_placement_active(self) -> bool:
        """Whether Placement computes the picture of the view, or has it."""
        return self._hands_over_to_placement

    @property
    def shows_placement(self) -> bool:
        """Whether Placement's picture is shown."""
        return self._shows_placement

    @property
    def awaits_response(self) -> bool:
        return self._drawing is not None or self._hands_over_to_placement and self.placement.awaits_response

    @property
    def is_running(self) -> bool:
        requested = self._requested is not None and not self._is_ready_for_request
        return requested or self._hands_over_to_placement and self.placement.is_running

    def status(self, status: Status) -> Status:
        if self._shows_placement:
            return replace(self.placement.status(status), shown_by="Placement")
        estimate, resolution = self._estimate, (0, 0) if self._shown is None else self._shown.resolution
        lacks = self.limitations if estimate is not None and estimate.is_large else ""
        note = "\n".join(filter(None, (lacks, PLACEMENT_FOLLOWS))) if self._picture == "refining" else ""
        said = {
            "picture": self._picture,
            "missing_note": note,
            "shown_by": self.title,
            "precomputed_mb": self._n_bytes / 1e6,
            "estimate": estimate,
            "error_colours": self._error_colours,
            "image_error": None if estimate is None else estimate.overall,
        }
        values = vars(status) | said
        return OrbitStatus(
            **values, drawn_resolution=resolution, drawn_seconds=self._seconds, is_headlight=self._is_headlight
        )

    @property
    def _estimate(self) -> ErrorEstimate | None:
        """The error of the shown picture: at rest that estimated for this view, else that of moving pictures, which
        holds from any camera until the scene is edited. A map does not change it."""
        seen, newest = self._shown_picture, self._error.newest
        if self._shown is None or self._is_headlight or seen is None or newest is None or not self._can_be_estimated:
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
        return (
            None
            if self._desired is None or self._viewpoint is None
            else ShownPicture(self._desired, self._viewpoint, self._poses, self._services.view.shows_error)
        )

    @property
    def _picture(self) -> PictureState:
        if self._shown is None or self._is_headlight:
            return "waiting"
        if self._is_whole:
            return "refining" if self._placement_can_show else "finished"
        return "preview"

    @property
    def _is_headlight(self) -> bool:
        """Whether nothing was ready for the picture, which shows objects lit from the camera."""
        return self._shown is not None and self._shown.is_headlight

    @property
    def _is_ready_for_request(self) -> bool:
        """Whether all is ready that the last request needs."""
        return self._ready.is_done and self._ready.prepared == self._prepare_id

    @property
    def _is_whole(self) -> bool:
        """Whether Orbit shows all it can of the document and the view."""
        shown = self._shown
        return (
            shown is not None and shown.quality == "rest"
            and (shown.viewpoint, shown.poses) == (self._viewpoint, self._poses)
            and shown.made_of == self._ready and self._is_ready_for_request and self._requested == self._desired
            and self._has_followed
        )  # fmt: skip

    @property
    def _has_followed(self) -> bool:
        """Whether document and view are as they were at the last update."""
        document = self._services.history.document
        view = effective_view(self._services.view, document)
        return self._desired_inputs_of(document, view) == self._desired_inputs and view.viewpoint == self._viewpoint

    # ---------------------------------------------------------------------------------------------- what modes override

    def _desired_inputs_of(self, document: Document, view: ViewState) -> tuple[object, ...]:
        """All that the desired state is made of."""
        return document, view.solo, view.n_bounces, view.n_points, view.n_coefficients, view.n_rays, view.n_lobes

    def _desired_state(self, document: Document, view: ViewState) -> DesiredOrbit:
        """The desired state: what pictures are to be drawn of."""
        return DesiredOrbit.of(document, view)

    def _poses_of(self, document: Document, view: ViewState) -> Poses:
        """The poses to draw; none where objects are as the worker has traced them."""
        return ()

    @property
    def _placement_can_show(self) -> bool:
        """Whether Placement can show what this mode does."""
        return True

    @property
    def _can_be_estimated(self) -> bool:
        """Whether path tracing covers all that this mode shows."""
        return True

    def _preparation(self, desired: DesiredOrbit) -> Request:
        return PrepareOrbit(
            desired.scene, desired.n_bounces, self._listener, self._most_bytes, desired.n_points, desired.n_coefficients
        )

    def _headlight_request(self, camera: Camera, wanted: PictureRequest) -> Request:
        assert self._desired is not None
        return DrawHeadlight(camera, wanted.resolution, self._desired.scene)

    def _draw_request(self, camera: Camera, wanted: PictureRequest) -> Request:
        if wanted.quality == "rest":
            return DrawOrbit(camera, wanted.resolution, "rest")
        return DrawOrbit(camera, wanted.resolution, wanted.quality, self._pace.n_coefficients)

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        if not self._is_open:
            return []
        self._update_desired(now, document, view)
        events = self._update_placement(now, document, view)
        if not self._placement_follows:
            self._prepare()
            self._draw(now)
            if (
                self._is_whole
                and self._placement_can_show
                and not (self._hands_over_to_placement or self.is_away or self._is_stopped)
            ):
                self._hands_over_to_placement = True
                self.placement.view_restored()
        elif not (self.placement.is_running or self._services.history.dragging):
            self._prepare()  # so that the view can move at once
        self._update_error(now)
        return events

    def _update_error(self, now: float) -> None:
        """Request an estimate of the shown picture's error, if the picture is this mode's."""
        if (seen := self._shown_picture) is not None:
            rests = self._is_whole and not (self.is_away or self._shows_placement or self._services.history.dragging)
            self._error.update(now, seen, rests and self._can_be_estimated, lambda: self._estimate_request(seen))

    def _estimate_request(self, seen: ShownPicture) -> EstimateDrawn:
        """The request for the error of the idle picture, and of one drawn while something moves."""
        at_rest = PictureRequest(seen.viewpoint, self._full_resolution, "rest", self._ready, seen.poses)
        moving = replace(at_rest, resolution=self._pace.resolution(self._full_resolution), quality="moving")
        first, other = (self._draw_request(self._camera(seen.viewpoint), each) for each in (at_rest, moving))
        return self.estimates(seen.desired.scene, seen.desired.n_bounces, first, other, seen.has_map)

    def _camera(self, look: Viewpoint) -> Camera:
        assert self._own_camera is not None
        return look.camera or self._own_camera

    def _update_desired(self, now: float, document: Document, view: ViewState) -> None:
        """Compute the desired state, and note since when it holds."""
        made_of = self._desired_inputs_of(document, view)
        desired = self._desired
        if desired is None or self._desired_inputs != made_of:
            desired, self._desired_inputs = self._desired_state(document, view), made_of
        poses = self._poses_of(document, view)
        if (desired, view.viewpoint, poses) != (self._desired, self._viewpoint, self._poses):
            self._moved_at = -math.inf if self._desired is None else now
            self._is_stopped = self._is_stopped and desired == self._desired
            self._desired, self._viewpoint, self._poses = desired, view.viewpoint, poses

    def _update_placement(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        """Update Placement's part, where it has one; it loses that as soon as its picture is not the document's. That
        picture stays on screen until Orbit has another."""
        if not self._hands_over_to_placement:
            return []
        events = self.placement.update(now, document, view)
        picture = self.placement.status(Status()).picture
        followed, is_finished = self._placement_follows, picture in ("finished", "exact")
        self._placement_follows = is_finished or followed and picture == "refining"
        self._shows_placement |= self._placement_follows
        if not self._placement_follows and (followed or not self._is_requested):
            self._hold_placement_back()
        return events

    @property
    def _is_requested(self) -> bool:
        """Whether Orbit has requested this scene; Placement may have planned the number of bounces since."""
        return (
            self._requested is not None and self._desired is not None and self._requested.scene == self._desired.scene
        )

    def _hold_placement_back(self) -> None:
        """Stop Placement's requests until Orbit's picture is complete again."""
        if self._hands_over_to_placement:
            self._hands_over_to_placement = self._placement_follows = False
            self.placement.view_moved()
            self._services.send(CancelRequests(of=(ComputeTransport,)))

    def _prepare(self) -> None:
        """Request what the document desires. During a drag it waits until the request before is in a picture: each
        takes a while to show, and would be given up for the next."""
        desired = self._desired
        if desired is None or desired == self._requested or self._is_stopped:
            return
        shown = self._shown
        if self._services.history.dragging and shown is not None and shown.made_of.prepared != self._prepare_id:
            return
        self._requested = desired
        self._prepare_id = self._services.send(self._preparation(desired))

    def _draw(self, now: float) -> None:
        """Request a picture, where the desired one is neither shown nor under way."""
        wanted = self._desired_picture(now) or self._desired_headlight_picture(now)
        if (
            wanted is None
            or wanted in (self._drawing, self._refused)
            or self._shown
            and self._shown.is_as_good_as(wanted)
        ):
            return
        if self._listener and wanted.quality == "moving" and not wanted.is_headlight:
            self._show_in_window(wanted, now)
            return
        if self._drawing is not None and self._drawing.quality == "moving":
            return
        if self._is_refinement(wanted) and now - self._drawn_at < _WORK_SHARE * self._seconds:
            return
        self._drawing, self._drawn_at = wanted, now
        draws = self._headlight_request if wanted.is_headlight else self._draw_request
        request = draws(self._camera(wanted.viewpoint), wanted)
        self._drawing_id = self._services.send(request)

    def _show_in_window(self, wanted: PictureRequest, now: float) -> None:
        """Request only that what is seen gets ready first; once all is ready that is seldom needed."""
        if self._drawing is not None:
            self._services.send(CancelRequests(of=(self.draws,)))
            self._drawing, self._drawing_id = None, 0
        looked, self._shown = self._shown and self._shown.viewpoint, wanted
        self._shows_placement = self._placement_follows
        if looked != wanted.viewpoint and (not self._ready.is_done or now - self._prioritized >= PRIORITIZE_SECONDS):
            self._prioritized = now
            self._services.send(PrioritizeView(self._camera(wanted.viewpoint)))

    def _desired_picture(self, now: float) -> PictureRequest | None:
        """The best picture possible now; None before there can be any."""
        if self._viewpoint is None or not self._ready.version:
            return None
        whole = self._full_resolution
        rests = now - self._moved_at >= IDLE_SECONDS
        quality: Quality = "rest" if rests and self._is_ready_for_request else "moving"
        resolution = whole if rests else self._pace.resolution(whole)
        return PictureRequest(
            self._viewpoint, resolution, quality, self._ready, self._poses, self._split, self._fit_error
        )

    def _desired_headlight_picture(self, now: float) -> PictureRequest | None:
        """The picture before there is any other: where camera or poses have moved on from the traced ones, the objects
        as they appear from there, lit from the camera."""
        if self._viewpoint is None or not (self._is_headlight or self._shown is None and self.is_away):
            return None
        rests, (width, height) = now - self._moved_at >= IDLE_SECONDS, self._full_resolution
        resolution = (width, height) if rests else (max(width // 2, 1), max(height // 2, 1))
        return PictureRequest(self._viewpoint, resolution, "moving", ReadyState(), self._poses, is_headlight=True)

    @property
    def _full_resolution(self) -> tuple[int, int]:
        """The resolution of an idle picture."""
        own = (1, 1) if self._own_camera is None else self._own_camera.resolution
        return (self._viewpoint and self._viewpoint.resolution) or own

    def _is_refinement(self, wanted: PictureRequest) -> bool:
        """Whether it shows the same as on screen, a little further computed."""
        shown = self._shown
        if (
            shown is None
            or (wanted.viewpoint, wanted.poses) != (shown.viewpoint, shown.poses)
            or wanted.made_of.is_done
        ):
            return False
        return shown.made_of.prepared == wanted.made_of.prepared

    # -------------------------------------------------------------------------------------------------------- responses

    def receive(self, response: Response) -> list[PictureEvent]:
        match response:
            case OrbitProgress():
                self._take_advance(response)
            case OrbitPartExported():
                return [OrbitPartArrived(response.part)] if self._listener else []
            case OrbitPictureDrawn():
                return self._take_picture(response)
            case OrbitNotReady() if response.id == self._drawing_id:
                if self._drawing is not None and self._drawing.is_headlight:
                    self._refused, self._drawing = self._drawing, None
                else:
                    self._reset_preparation()
            case DrawnErrorEstimated():
                self._error.receive(response)
            case RequestFailed():
                self._error.receive_failure(response.id)
                self._take_failure(response)
                return self.placement.receive(response)
            case _:
                return self.placement.receive(response)
        return []

    def _take_advance(self, response: OrbitProgress) -> None:
        if response.id != self._prepare_id:
            return
        self._note_ready(ReadyState(response.id, response.version, response.is_done))
        self._n_bytes = response.n_bytes
        if self._requested is not None:
            self._accepted_light.accept(self._requested.scene.light)
        if response.is_done and not self.is_running:
            self._services.metrics.progress = None

    def _take_picture(self, response: OrbitPictureDrawn) -> list[PictureEvent]:
        drawing = self._drawing
        if drawing is None or response.id != self._drawing_id:
            return []
        made_of = ReadyState(response.prepared, response.version, response.is_done)
        self._shown, self._drawing, self._refused = replace(drawing, made_of=made_of), None, None
        if made_of.version and made_of.prepared == self._prepare_id and made_of.version >= self._ready.version:
            self._note_ready(made_of)
        self._seconds = response.seconds
        self._shows_placement = self._placement_follows
        if (
            drawing.quality == "moving"
            and not drawing.is_headlight
            and drawing.resolution == self._pace.resolution(self._full_resolution)
        ):
            self._pace.record_seconds(response.seconds)
        return [OrbitPicture(response.radiance, drawing.fit_error)]

    def _note_ready(self, known: ReadyState) -> None:
        """Note how much the worker has ready."""
        if self._is_ready_for_request and not known.is_done:
            self._requested = None  # what no picture has used before is still to be prepared
        self._ready = known

    def _take_failure(self, response: RequestFailed) -> None:
        if response.id == self._drawing_id:
            self._refused, self._drawing = self._drawing, None
        if response.id == self._prepare_id and self._requested is not None:
            self._is_stopped = True
            if self._accepted_light.revert(self._services.history, self._requested.scene.light):
                self._services.document_changed()
