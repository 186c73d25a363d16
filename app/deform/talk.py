"""Deform's talk with the worker: Orbit's, of a scene whose objects bend.

As in Orbit a picture is drawn in the worker for each frame in which something moves, and Placement takes over what
rests: the worker traces the scene in its new pose, as it traces a new view.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.deform.events import PoseCame
from app.deform.known_surfaces import KnownSurfaces
from app.deform.messages import (
    DeformKnown,
    DrawDeform,
    EstimateDeform,
    PathsTraced,
    PoseTold,
    PrepareDeform,
    Traced,
)
from app.deform.status import DeformStatus
from app.document import Document
from app.messages import RequestFailed, Request, Response
from app.mode import EditorServices
from app.orbit.messages import Carried, DrawPlainly, OrbitAdvanced, OrbitDrawn
from app.orbit.talk import REST_SECONDS, OrbitTalk
from app.orbit.wishes import Drawing, OrbitWish
from app.picture_events import PictureEvent
from app.editor_status import PictureState, Status
from app.timeline import visible_poses
from app.view_state import ViewState
from engine.deform.gpu_parts import NO_PARTS, Numbers
from engine.deform.pose import Poses
from engine.scene.description import Camera
from engine.scene.surface_kinds import SurfacesByObject


@dataclass(frozen=True)
class DeformWish(OrbitWish):
    """All that pictures are drawn of, but for camera and amounts; posed: the objects that bend; surfaces: what the
    document says of surfaces; traced: what paths are to show beside them."""

    posed: tuple[str, ...] = ()
    surfaces: SurfacesByObject = ()
    traced: Traced | None = None
    n_rays: int = 1000
    n_lobes: int = 4


class DeformTalk(OrbitTalk):
    """The talk of Deform."""

    title, lacks = "Deform", "How much of sharp highlights is lost here the Accuracy panel says."
    prepares = PrepareDeform
    draws = DrawDeform
    estimates = EstimateDeform

    def __init__(self, desk: EditorServices) -> None:
        self._lost: tuple[tuple[str, float], ...] = ()
        self._alone: tuple[str, ...] = ()
        self._carried: Carried = ()
        self._traced = PathsTraced(0, 1)
        self._in_window = False
        self._parts_told = NO_PARTS  # to the window of what it draws, see `DrawDeform.known`
        super().__init__(desk)

    def draw_in_window(self, most_bytes: int) -> None:
        """The window draws moving pictures itself from now on; 0: the worker does."""
        self._in_window, self._parts_told = most_bytes > 0, NO_PARTS

    def tell_again(self, known: Numbers) -> None:
        """The window could not draw its last picture, of these parts alone."""
        self._parts_told, self._shown = known, None

    def _forget(self) -> None:
        super()._forget()
        self._known_surfaces = KnownSurfaces()

    def receive(self, response: Response) -> list[PictureEvent]:
        match response:
            case DeformKnown():
                self._lost = response.lost
                return []
            case PathsTraced():
                self._traced = response
                return []
            case OrbitDrawn() if response.id == self._drawing_id:
                self._carried = response.carried
        drawing, own = self._drawing, self._own_camera
        events = super().receive(response)
        if isinstance(response, PoseTold) and events and drawing is not None and own is not None:
            self._parts_told = response.told.numbers
            return [PoseCame(response.told, drawing.look.camera or own, drawing.resolution)]
        return events

    def _take_advance(self, response: OrbitAdvanced) -> None:
        super()._take_advance(response)
        if response.id == self._prepare_id and isinstance(self._asked, DeformWish):
            self._known_surfaces.worked(self._asked.surfaces)

    def _take_failure(self, response: RequestFailed) -> None:
        asked = self._asked
        super()._take_failure(response)
        if response.id == self._prepare_id and isinstance(asked, DeformWish):
            if self._known_surfaces.go_back(self._desk.history, asked.surfaces):
                self._desk.document_changed()

    def status(self, status: Status) -> Status:
        told = super().status(status)
        if told.shown_by != self.title:
            return told
        own: dict[str, object] = {"lost": self._lost, "alone": self._alone, "carried": self._carried}
        own["unjudged"] = self._unjudged
        if self._picture == "refining" and self._split is not None:
            n, of = (self._traced.n_passes, self._traced.of) if self._traced.id == self._prepare_id else (0, 1)
            own["missing_note"] = f"The part by paths becomes smoother: {n / of:.0%} of them are in it."
        return DeformStatus(**(vars(told) | own))

    @property
    def _picture(self) -> PictureState:
        """Of a split one paths are a part."""
        found = super()._picture
        return "refining" if found == "finished" and self._awaits_paths else found

    @property
    def _awaits_paths(self) -> bool:
        done = self._traced.id == self._prepare_id and self._traced.n_passes >= self._traced.of
        return self._split is not None and not (done and isinstance(self._wish, DeformWish) and self._wish.traced)

    @property
    def is_running(self) -> bool:
        return super().is_running or self._awaits_paths and not self._is_stopped

    def _inputs(self, document: Document, view: ViewState) -> tuple[object, ...]:
        return *super()._inputs(document, view), view.playing is None

    def _wish_of(self, document: Document, view: ViewState) -> OrbitWish:
        wish, plays = OrbitWish.of(document, view), view.playing is not None
        posed = tuple(
            state.name for state in document.objects
            if state.deformations or state.moment is not None or plays and state.animations
        )  # fmt: skip
        return DeformWish(
            wish.scene, wish.n_bounces, posed=posed, surfaces=document.new_surfaces, n_rays=view.n_rays,
            n_lobes=view.n_lobes,
        )  # fmt: skip

    def _poses_of(self, document: Document, view: ViewState) -> Poses:
        return visible_poses(document, view)

    @property
    def _may_hand_over(self) -> bool:
        """Only Deform knows membranes, what light goes through, patches and wrinkles; Placement shows light alone."""
        return not self._alone and self._split is None and not self._fit_error

    @property
    def _can_be_judged(self) -> bool:
        return not self._unjudged

    @property
    def _unjudged(self) -> str:
        """Why nobody asks how far off the picture is; empty where that is asked."""
        if self._alone:
            return f"Where it is off is not known: paths do not know the surface of {', '.join(self._alone)}"
        if self._split is not None:
            return "Beside paths the picture is not judged"
        return "The colours of the fit's error are not judged" if self._fit_error else ""

    def _follow(self, now: float, document: Document, view: ViewState) -> None:
        """Where the picture is split and rests, what paths are to show is a part of the wish."""
        super()._follow(now, document, view)
        self._alone = tuple(state.name for state in document.objects if state.surface.kind)
        self._fit_error, wish = view.fit_error, self._wish
        self._split = None if view.fit_error else view.split
        assert isinstance(wish, DeformWish) and self._own_camera is not None and self._look is not None
        if self._split is None:
            self._wish = replace(wish, traced=None)
        elif now - self._moved_at >= REST_SECONDS:
            traced = Traced(self._look.camera or self._own_camera, self._whole, self._poses)
            self._wish = replace(wish, traced=traced)

    def _preparation(self, wish: OrbitWish) -> Request:
        assert isinstance(wish, DeformWish)
        effort = wish.n_rays, wish.n_lobes
        return PrepareDeform(wish.scene, wish.n_bounces, wish.posed, wish.surfaces, wish.traced, *effort)

    def _plain_request(self, camera: Camera, wanted: Drawing) -> Request:
        assert self._wish is not None
        return DrawPlainly(camera, wanted.resolution, self._wish.scene, wanted.poses)

    def _draw_request(self, camera: Camera, wanted: Drawing) -> Request:
        shows_light = wanted.split is None and not wanted.fit_error
        known = self._parts_told if self._in_window and shows_light and wanted.quality == "moving" else None
        return DrawDeform(
            camera, wanted.resolution, wanted.quality, wanted.poses, wanted.split, wanted.fit_error, known
        )
