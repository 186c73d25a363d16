"""Deform's controller: Orbit's, for a scene whose objects deform.

As in Orbit, the worker draws a picture for each frame in which something moves, and Placement takes over once the view
is idle: the worker traces the scene in its new pose, as it traces a new view.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.document.document import Document
from app.document.timeline import visible_poses
from app.document.view_state import ViewState
from app.messages.editor_status import PictureState, Status
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import Request, RequestFailed, Response
from app.modes.deform.accepted_surfaces import AcceptedSurfaces
from app.modes.deform.deform_events import PoseArrived
from app.modes.deform.deform_messages import (
    DeformLoss,
    DrawDeform,
    EstimateDeform,
    PathPreview,
    PathsTraced,
    PoseExported,
    PrepareDeform,
)
from app.modes.deform.deform_status import DeformStatus
from app.modes.mode import EditorServices
from app.modes.orbit.desired_state import DesiredOrbit, PictureRequest
from app.modes.orbit.orbit_controller import IDLE_SECONDS, OrbitController
from app.modes.orbit.orbit_messages import AnimationOffsets, DrawHeadlight, OrbitPictureDrawn, OrbitProgress
from engine.realtime.zonal_harmonics.gpu_parts import NO_PARTS, Numbers
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.description import Camera
from engine.scene.surface_kinds import SurfacesByObject


@dataclass(frozen=True)
class DesiredDeform(DesiredOrbit):
    """All that pictures are drawn of, except camera and amounts; posed: the objects that deform; surfaces: what the
    document sets of surfaces; traced: what path tracing is to show beside them."""

    posed: tuple[str, ...] = ()
    surfaces: SurfacesByObject = ()
    traced: PathPreview | None = None
    n_rays: int = 1000
    n_lobes: int = 4


class DeformController(OrbitController):
    """The controller of Deform."""

    title, limitations = "Deform", "Sharp highlights are softer here; the Accuracy panel shows by how much."
    prepares = PrepareDeform
    draws = DrawDeform
    estimates = EstimateDeform

    def __init__(self, services: EditorServices) -> None:
        self._lost: tuple[tuple[str, float], ...] = ()
        self._deform_only: tuple[str, ...] = ()
        self._carried: AnimationOffsets = ()
        self._traced = PathsTraced(0, 1)
        self._in_window = False
        self._sent_parts = NO_PARTS  # those that the window has, see `DrawDeform.sent_parts`
        super().__init__(services)

    def draw_in_window(self, most_bytes: int) -> None:
        """From now on the window draws moving pictures itself; 0: the worker does."""
        self._in_window, self._sent_parts = most_bytes > 0, NO_PARTS

    def resend_parts(self, known: Numbers) -> None:
        """Send parts again: the window could not draw its last picture from these alone."""
        self._sent_parts, self._shown = known, None

    def _forget(self) -> None:
        super()._forget()
        self._known_surfaces = AcceptedSurfaces()

    def receive(self, response: Response) -> list[PictureEvent]:
        match response:
            case DeformLoss():
                self._lost = response.lost
                return []
            case PathsTraced():
                self._traced = response
                return []
            case OrbitPictureDrawn() if response.id == self._drawing_id:
                self._carried = response.animation_offsets
        drawing, own = self._drawing, self._own_camera
        events = super().receive(response)
        if isinstance(response, PoseExported) and events and drawing is not None and own is not None:
            self._sent_parts = response.export.numbers
            return [PoseArrived(response.export, drawing.viewpoint.camera or own, drawing.resolution)]
        return events

    def _take_advance(self, response: OrbitProgress) -> None:
        super()._take_advance(response)
        if response.id == self._prepare_id and isinstance(self._requested, DesiredDeform):
            self._known_surfaces.accept(self._requested.surfaces)

    def _take_failure(self, response: RequestFailed) -> None:
        requested = self._requested
        super()._take_failure(response)
        if response.id == self._prepare_id and isinstance(requested, DesiredDeform):
            if self._known_surfaces.revert(self._services.history, requested.surfaces):
                self._services.document_changed()

    def status(self, status: Status) -> Status:
        orbit_status = super().status(status)
        if orbit_status.shown_by != self.title:
            return orbit_status
        own: dict[str, object] = {"lost": self._lost, "deform_only": self._deform_only, "carried": self._carried}
        own["no_estimate_reason"] = self._no_estimate_reason
        if self._picture == "refining" and self._split is not None:
            n, of = (self._traced.n_passes, self._traced.of) if self._traced.id == self._prepare_id else (0, 1)
            own["missing_note"] = f"The path-traced part is being refined: {n / of:.0%} done."
        return DeformStatus(**(vars(orbit_status) | own))

    @property
    def _picture(self) -> PictureState:
        """The state of the picture; a split picture has a path-traced part."""
        found = super()._picture
        return "refining" if found == "finished" and self._awaits_paths else found

    @property
    def _awaits_paths(self) -> bool:
        done = self._traced.id == self._prepare_id and self._traced.n_passes >= self._traced.of
        return self._split is not None and not (
            done and isinstance(self._desired, DesiredDeform) and self._desired.traced
        )

    @property
    def is_running(self) -> bool:
        return super().is_running or self._awaits_paths and not self._is_stopped

    def _desired_inputs_of(self, document: Document, view: ViewState) -> tuple[object, ...]:
        return *super()._desired_inputs_of(document, view), view.playing is None

    def _desired_state(self, document: Document, view: ViewState) -> DesiredOrbit:
        desired, plays = DesiredOrbit.of(document, view), view.playing is not None
        posed = tuple(
            state.name for state in document.objects
            if state.deformations or state.moment is not None or plays and state.animations
        )  # fmt: skip
        return DesiredDeform(
            desired.scene, desired.n_bounces, posed=posed, surfaces=document.new_surfaces, n_rays=view.n_rays,
            n_lobes=view.n_lobes,
        )  # fmt: skip

    def _poses_of(self, document: Document, view: ViewState) -> Poses:
        return visible_poses(document, view)

    @property
    def _placement_can_show(self) -> bool:
        """Only Deform draws membranes, transmitted light, patches and wrinkles; Placement shows light alone."""
        return not self._deform_only and self._split is None and not self._fit_error

    @property
    def _can_be_estimated(self) -> bool:
        return not self._no_estimate_reason

    @property
    def _no_estimate_reason(self) -> str:
        """Why the error of the picture is not estimated; empty where it is."""
        if self._deform_only:
            return f"No error estimate: path tracing does not support the surface of {', '.join(self._deform_only)}"
        if self._split is not None:
            return "No error estimate beside path-traced parts"
        return "No error estimate while the fit error is shown" if self._fit_error else ""

    def _update_desired(self, now: float, document: Document, view: ViewState) -> None:
        """Where the picture is split and idle, the desired state includes what path tracing is to show."""
        super()._update_desired(now, document, view)
        self._deform_only = tuple(state.name for state in document.objects if state.surface.kind)
        self._fit_error, desired = view.fit_error, self._desired
        self._split = None if view.fit_error else view.split
        assert isinstance(desired, DesiredDeform) and self._own_camera is not None and self._viewpoint is not None
        if self._split is None:
            self._desired = replace(desired, traced=None)
        elif now - self._moved_at >= IDLE_SECONDS:
            traced = PathPreview(self._viewpoint.camera or self._own_camera, self._full_resolution, self._poses)
            self._desired = replace(desired, traced=traced)

    def _preparation(self, desired: DesiredOrbit) -> Request:
        assert isinstance(desired, DesiredDeform)
        effort = desired.n_rays, desired.n_lobes
        return PrepareDeform(desired.scene, desired.n_bounces, desired.posed, desired.surfaces, desired.traced, *effort)

    def _headlight_request(self, camera: Camera, wanted: PictureRequest) -> Request:
        assert self._desired is not None
        return DrawHeadlight(camera, wanted.resolution, self._desired.scene, wanted.poses)

    def _draw_request(self, camera: Camera, wanted: PictureRequest) -> Request:
        shows_light = wanted.split is None and not wanted.fit_error
        known = self._sent_parts if self._in_window and shows_light and wanted.quality == "moving" else None
        return DrawDeform(
            camera, wanted.resolution, wanted.quality, wanted.poses, wanted.split, wanted.fit_error, known
        )
