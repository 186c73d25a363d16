"""Orbit's talk with the worker: pictures while something moves, Placement's once nothing does.

    document, view ─► PrepareOrbit ─► OrbitAdvanced ─► DrawOrbit ─► OrbitDrawn ─► OrbitPicture     a new one each frame
    the view rests, its picture is whole ─► PlacementTalk ─► Placement's events                    fades in over that

As in Placement, states are compared and not events followed: what the document and the view want, what was asked for,
what has come. One picture is under way at a time; the next has the camera, light and materials of then, so that nothing
piles up behind a hand. One that is drawn at rest, which takes longer, gives way to a hand at once. Where the window has
a graphics card that draws moving pictures itself (`draw_in_window`), the worker tells it what they are drawn of, and
draws those at rest alone.

Placement's talk is a part of this one, held back until Orbit's picture of a resting view is whole, and again as soon as
it could not follow: so either mode's files know nothing of what the other asks. Rejected: to change the mode at rest,
which would change the session with every pause of a hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from app.commands import EditCommand
from app.effective_settings import effective_view
from app.document import Document
from app.messages import CancelRequests, RequestFailed, Request, Response
from app.mode import EditorServices, ModeController, OpenedScene
from app.orbit.error_talk import DrawnErrorTalk, Seen
from app.orbit.events import OrbitPartCame, OrbitPicture
from app.orbit.messages import (
    DrawnEstimated,
    DrawOrbit,
    DrawPlainly,
    EstimateDrawn,
    EstimateOrbit,
    LookOrbit,
    OrbitAdvanced,
    OrbitDrawn,
    OrbitTold,
    OrbitUnknown,
    PrepareOrbit,
    Quality,
)
from app.orbit.status import OrbitStatus
from app.orbit.wishes import WINDOW_SECONDS, WINDOW_STEPS, Drawing, Known, OrbitWish, Pace
from app.picture_events import PictureEvent
from app.placement.known_light import KnownLight
from app.placement.messages import ComputeTransport
from app.placement.talk import PlacementTalk
from app.editor_status import PictureState, Status
from app.view_state import Viewpoint, ViewState
from engine.deform.pose import Poses
from engine.material.layer import Layer
from engine.render.picture_error import ErrorEstimate
from engine.scene.description import Camera, CameraDescription

# A hand that was still for so long rests.
REST_SECONDS = 0.2
# How often a window that draws itself asks whether it sees what nothing was made ready for.
LOOK_SECONDS = 0.25
# While pictures become better by themselves, how much longer than drawing one the worker has for that.
_WORK_SHARE = 4.0
_listeners = count(1)
PLACEMENT_FOLLOWS = "Placement computes this view, and fades in when it is there."
LACKS = (
    "Gloss mirrors lights alone here, sharp ones blurred by some three degrees; of the objects around it shows an even "
    "glow."
)


class OrbitTalk(ModeController):
    """The talk of Orbit; `placement` is that of the view at rest. Another mode whose pictures are drawn in the worker
    says what it is called, what it wants made ready, and what it has drawn."""

    title, lacks = "Orbit", LACKS
    prepares: type[Request] = PrepareOrbit
    draws: type[Request] = DrawOrbit
    estimates: type[EstimateDrawn] = EstimateOrbit

    def __init__(self, desk: EditorServices) -> None:
        self._desk = desk
        self.placement = PlacementTalk(desk)
        self._error = DrawnErrorTalk(desk.send, self.estimates)
        self._is_open = False
        self._listener = self._most_bytes = 0
        self._forget()

    def _forget(self) -> None:
        """Nothing is known of the scene."""
        self._own_camera: CameraDescription | None = None
        self.is_away = False
        self._wish: OrbitWish | None = None
        self._wish_made_of: tuple[object, ...] = ()
        self._moved_at = -math.inf
        self._look: Viewpoint | None = None
        self._poses: Poses = ()
        self._split: tuple[float, float] | None = None
        self._fit_error = False
        self._prepare_id = 0
        self._is_stopped = False
        self._known_light = KnownLight()
        self._pace = self._new_pace()
        self._hands_over = self._placement_follows = self._shows_placement = False
        self._error.forget()
        self._forget_worker()

    def _forget_worker(self) -> None:
        """The worker knows nothing, and what it was asked will not be answered."""
        self._asked: OrbitWish | None = None
        self._known = Known()
        self._drawing: Drawing | None = None
        self._drawing_id = 0
        self._refused: Drawing | None = None
        self._shown: Drawing | None = None
        self._seconds = 0.0
        self._n_bytes = 0
        self._drawn_at = self._looked_at = -math.inf

    # ----------------------------------------------------------------------------------------- what the editor tells

    def scene_closed(self) -> None:
        self._hold_placement_back()
        self._is_open = False

    def scene_open_failed(self) -> None:
        self._is_open = True
        self._asked = self._drawing = None

    def scene_opened(self, scene: OpenedScene) -> None:
        self._forget()
        self._is_open = True
        self._own_camera = scene.description.camera
        self._known_light.worked(scene.described.light)
        self.placement.scene_opened(scene)
        self.placement.view_moved()

    def view_moved(self) -> None:
        self.is_away = True
        self._hold_placement_back()

    def view_restored(self) -> None:
        self.is_away = False
        self._go_on()

    def view_traced(self, scene: OpenedScene) -> None:
        self.is_away = False
        self._go_on()
        self._error.forget()
        self._hands_over = self._placement_follows = self._shows_placement = False
        self.placement.view_traced(scene)
        self.placement.view_moved()

    def _go_on(self) -> None:
        """A look has cancelled what was being made ready."""
        if not self._is_known_to_be_done:
            self._asked = None

    def deactivated(self) -> None:
        self._desk.send(CancelRequests(of=(self.prepares, self.draws, self.estimates, DrawPlainly)))
        self.placement.deactivated()

    def edited(self, command: EditCommand | None = None) -> None:
        self.placement.edited(command)

    def drag_ended(self) -> None:
        self._moved_at = -math.inf
        self.placement.drag_ended()

    def add_band_plans(self, planned: Iterable[tuple[Layer, Mapping[str, int]]]) -> None:
        self.placement.add_band_plans(planned)

    def reload_images(self, key: str) -> None:
        self._asked = None
        self.placement.reload_images(key)

    def cancelled(self) -> None:
        self._is_stopped = True
        self.placement.cancelled()

    def resume(self) -> None:
        self._is_stopped, self._asked = False, None
        self.placement.resume()

    def worker_restarted(self) -> None:
        self._begin_anew()
        self.placement.worker_restarted()

    def _begin_anew(self) -> None:
        """Nothing is ready any more; what is shown stays."""
        shown = self._shown
        self._error.forget()
        self._forget_worker()
        self._shown = shown and replace(shown, made_of=Known())

    def draw_in_window(self, most_bytes: int) -> None:
        """The window draws moving pictures itself from now on, of arrays of so many bytes; 0: the worker does."""
        self._listener, self._most_bytes = next(_listeners) if most_bytes else 0, most_bytes
        self._pace = self._new_pace()
        self._asked = self._shown = None

    def _new_pace(self) -> Pace:
        return Pace(WINDOW_SECONDS, WINDOW_STEPS, 2) if self._listener else Pace()

    def drew(self, seconds: float) -> None:
        """A picture took the window so long."""
        self._seconds = seconds
        if self._shown is not None and self._shown.resolution == self._pace.resolution(self._whole):
            self._pace.took(seconds)

    # --------------------------------------------------------------------------------------------- what is to be told

    @property
    def drawn_in_window(self) -> tuple[Camera, tuple[int, int], int] | None:
        """From which camera, in how many pixels (width, height) and by how many coefficients a point the window is to
        draw what it was told; None where it is to show a picture of the worker's."""
        shown = self._shown
        if not self._listener or shown is None or shown.quality != "moving" or shown.is_plain:
            return None
        return self._camera(shown.look), shown.resolution, self._pace.n_coefficients

    @property
    def shows_look(self) -> bool:
        """Whether the picture is from where the view looks now, and in its poses, and not as it was a moment ago."""
        if self._shows_placement or self._shown is None:
            return self._shows_placement
        view = self._desk.view
        poses = self._poses_of(self._desk.history.document, view)
        return (self._shown.look, self._shown.poses) == (view.viewpoint, poses)

    @property
    def hands_over(self) -> bool:
        """Whether Placement is at work on the view, or has it."""
        return self._hands_over

    @property
    def shows_placement(self) -> bool:
        """Whether Placement's picture is the one to be seen."""
        return self._shows_placement

    @property
    def awaits_response(self) -> bool:
        return self._drawing is not None or self._hands_over and self.placement.awaits_response

    @property
    def is_running(self) -> bool:
        asked = self._asked is not None and not self._is_known_to_be_done
        return asked or self._hands_over and self.placement.is_running

    def status(self, status: Status) -> Status:
        if self._shows_placement:
            return replace(self.placement.status(status), shown_by="Placement")
        estimate, resolution = self._estimate, (0, 0) if self._shown is None else self._shown.resolution
        lacks = self.lacks if estimate is not None and estimate.is_large else ""
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
        told = vars(status) | said
        return OrbitStatus(**told, drawn_resolution=resolution, drawn_seconds=self._seconds, is_plain=self._is_plain)

    @property
    def _estimate(self) -> ErrorEstimate | None:
        """How far off the picture is that is shown: at rest by itself, else as those are that are drawn like it."""
        if self._shown is None or self._is_plain or self._seen is None or not self._can_be_judged:
            return None
        return self._error.at_rest(self._seen) if self._is_whole else self._error.moving(self._seen.wish)

    @property
    def _error_colours(self) -> NDArray[np.uint8] | None:
        return self._error.colours(self._seen) if self._seen is not None and self._is_whole else None

    @property
    def _seen(self) -> Seen | None:
        return (
            None
            if self._wish is None or self._look is None
            else Seen(self._wish, self._look, self._poses, self._desk.view.shows_error)
        )

    @property
    def _picture(self) -> PictureState:
        if self._shown is None or self._is_plain:
            return "waiting"
        if self._is_whole:
            return "refining" if self._may_hand_over else "finished"
        return "preview"

    @property
    def _is_plain(self) -> bool:
        """Whether nothing was ready for the picture, which shows objects in light from the eye."""
        return self._shown is not None and self._shown.is_plain

    @property
    def _is_known_to_be_done(self) -> bool:
        """Whether all is ready that the wish asked last needs."""
        return self._known.is_done and self._known.prepared == self._prepare_id

    @property
    def _is_whole(self) -> bool:
        """Whether Orbit shows all it can of the document and the view."""
        shown = self._shown
        return (
            shown is not None and shown.quality == "rest" and (shown.look, shown.poses) == (self._look, self._poses)
            and shown.made_of == self._known and self._is_known_to_be_done and self._asked == self._wish
            and self._has_followed
        )  # fmt: skip

    @property
    def _has_followed(self) -> bool:
        """Whether document and view are as they were at the last update."""
        document = self._desk.history.document
        view = effective_view(self._desk.view, document)
        return self._inputs(document, view) == self._wish_made_of and view.viewpoint == self._look

    # ------------------------------------------------------------------------------------------- what modes differ in

    def _inputs(self, document: Document, view: ViewState) -> tuple[object, ...]:
        """All that a wish is made of."""
        return document, view.solo, view.n_bounces, view.n_points, view.n_coefficients, view.n_rays, view.n_lobes

    def _wish_of(self, document: Document, view: ViewState) -> OrbitWish:
        """What pictures are to be drawn of."""
        return OrbitWish.of(document, view)

    def _poses_of(self, document: Document, view: ViewState) -> Poses:
        """The poses that are drawn; none where objects stand as the worker has traced them."""
        return ()

    @property
    def _may_hand_over(self) -> bool:
        """Whether Placement can show what this mode does."""
        return True

    @property
    def _can_be_judged(self) -> bool:
        """Whether paths know all that this mode shows."""
        return True

    def _preparation(self, wish: OrbitWish) -> Request:
        return PrepareOrbit(
            wish.scene, wish.n_bounces, self._listener, self._most_bytes, wish.n_points, wish.n_coefficients
        )

    def _plain_request(self, camera: Camera, wanted: Drawing) -> Request:
        assert self._wish is not None
        return DrawPlainly(camera, wanted.resolution, self._wish.scene)

    def _draw_request(self, camera: Camera, wanted: Drawing) -> Request:
        if wanted.quality == "rest":
            return DrawOrbit(camera, wanted.resolution, "rest")
        return DrawOrbit(camera, wanted.resolution, wanted.quality, self._pace.n_coefficients)

    # --------------------------------------------------------------------------------------------------------- asking

    def update(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        if not self._is_open:
            return []
        self._follow(now, document, view)
        events = self._update_placement(now, document, view)
        if not self._placement_follows:
            self._prepare()
            self._draw(now)
            if self._is_whole and self._may_hand_over and not (self._hands_over or self.is_away or self._is_stopped):
                self._hands_over = True
                self.placement.view_restored()
        elif not (self.placement.is_running or self._desk.history.dragging):
            self._prepare()  # so that the view can move at once
        self._judge(now)
        return events

    def _judge(self, now: float) -> None:
        """Ask how far off the picture is that is shown, if it is this mode's."""
        if (seen := self._seen) is not None:
            rests = self._is_whole and not (self.is_away or self._shows_placement or self._desk.history.dragging)
            self._error.update(now, seen, rests and self._can_be_judged, lambda: self._estimate_request(seen))

    def _estimate_request(self, seen: Seen) -> EstimateDrawn:
        """Of the picture at rest, and of one as it is drawn while something moves."""
        at_rest = Drawing(seen.look, self._whole, "rest", self._known, seen.poses)
        moving = replace(at_rest, resolution=self._pace.resolution(self._whole), quality="moving")
        first, other = (self._draw_request(self._camera(seen.look), each) for each in (at_rest, moving))
        return self.estimates(seen.wish.scene, seen.wish.n_bounces, first, other, seen.has_map)

    def _camera(self, look: Viewpoint) -> Camera:
        assert self._own_camera is not None
        return look.camera or self._own_camera

    def _follow(self, now: float, document: Document, view: ViewState) -> None:
        """What is wanted now, and since when."""
        made_of = self._inputs(document, view)
        wish = self._wish
        if wish is None or self._wish_made_of != made_of:
            wish, self._wish_made_of = self._wish_of(document, view), made_of
        poses = self._poses_of(document, view)
        if (wish, view.viewpoint, poses) != (self._wish, self._look, self._poses):
            self._moved_at = -math.inf if self._wish is None else now
            self._is_stopped = self._is_stopped and wish == self._wish
            self._wish, self._look, self._poses = wish, view.viewpoint, poses

    def _update_placement(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        """Placement's part, where it has one; it loses that as soon as its picture is not the document's. That stays on
        screen until Orbit has another."""
        if not self._hands_over:
            return []
        events = self.placement.update(now, document, view)
        picture = self.placement.status(Status()).picture
        followed, is_finished = self._placement_follows, picture in ("finished", "exact")
        self._placement_follows = is_finished or followed and picture == "refining"
        self._shows_placement |= self._placement_follows
        if not self._placement_follows and (followed or not self._is_asked_for):
            self._hold_placement_back()
        return events

    @property
    def _is_asked_for(self) -> bool:
        """Whether Orbit was asked for this scene; how often light bounces Placement itself may have found out since."""
        return self._asked is not None and self._wish is not None and self._asked.scene == self._wish.scene

    def _hold_placement_back(self) -> None:
        """Placement asks for nothing until Orbit's picture is whole again."""
        if self._hands_over:
            self._hands_over = self._placement_follows = False
            self.placement.view_moved()
            self._desk.send(CancelRequests(of=(ComputeTransport,)))

    def _prepare(self) -> None:
        """Ask for what the document wants. In mid-drag only once the wish before is in a picture: each takes a while
        until it shows, and would be given up for the next."""
        wish = self._wish
        if wish is None or wish == self._asked or self._is_stopped:
            return
        shown = self._shown
        if self._desk.history.dragging and shown is not None and shown.made_of.prepared != self._prepare_id:
            return
        self._asked = wish
        self._prepare_id = self._desk.send(self._preparation(wish))

    def _draw(self, now: float) -> None:
        """Ask for a picture, where there is another one than is shown or under way."""
        wanted = self._wanted(now) or self._wanted_plainly(now)
        if (
            wanted is None
            or wanted in (self._drawing, self._refused)
            or self._shown
            and self._shown.is_as_good_as(wanted)
        ):
            return
        if self._listener and wanted.quality == "moving" and not wanted.is_plain:
            self._show_in_window(wanted, now)
            return
        if self._drawing is not None and self._drawing.quality == "moving":
            return
        if self._only_better(wanted) and now - self._drawn_at < _WORK_SHARE * self._seconds:
            return
        self._drawing, self._drawn_at = wanted, now
        draws = self._plain_request if wanted.is_plain else self._draw_request
        request = draws(self._camera(wanted.look), wanted)
        self._drawing_id = self._desk.send(request)

    def _show_in_window(self, wanted: Drawing, now: float) -> None:
        """Nothing is asked for but that what is seen be made ready first; once all is ready that is seldom anything."""
        if self._drawing is not None:
            self._desk.send(CancelRequests(of=(self.draws,)))
            self._drawing, self._drawing_id = None, 0
        looked, self._shown = self._shown and self._shown.look, wanted
        self._shows_placement = self._placement_follows
        if looked != wanted.look and (not self._known.is_done or now - self._looked_at >= LOOK_SECONDS):
            self._looked_at = now
            self._desk.send(LookOrbit(self._camera(wanted.look)))

    def _wanted(self, now: float) -> Drawing | None:
        """The best picture that there could be now; None before there could be any."""
        if self._look is None or not self._known.version:
            return None
        whole = self._whole
        rests = now - self._moved_at >= REST_SECONDS
        quality: Quality = "rest" if rests and self._is_known_to_be_done else "moving"
        resolution = whole if rests else self._pace.resolution(whole)
        return Drawing(self._look, resolution, quality, self._known, self._poses, self._split, self._fit_error)

    def _wanted_plainly(self, now: float) -> Drawing | None:
        """Before there was any: where view or poses have moved on from those of the objects that are seen, how these
        look from there."""
        if self._look is None or not (self._is_plain or self._shown is None and self.is_away):
            return None
        rests, (width, height) = now - self._moved_at >= REST_SECONDS, self._whole
        resolution = (width, height) if rests else (max(width // 2, 1), max(height // 2, 1))
        return Drawing(self._look, resolution, "moving", Known(), self._poses, is_plain=True)

    @property
    def _whole(self) -> tuple[int, int]:
        """The resolution of a picture at rest."""
        own = (1, 1) if self._own_camera is None else self._own_camera.resolution
        return (self._look and self._look.resolution) or own

    def _only_better(self, wanted: Drawing) -> bool:
        """Whether it shows the same as is seen, a little further computed."""
        shown = self._shown
        if shown is None or (wanted.look, wanted.poses) != (shown.look, shown.poses) or wanted.made_of.is_done:
            return False
        return shown.made_of.prepared == wanted.made_of.prepared

    # -------------------------------------------------------------------------------------------------------- answers

    def receive(self, response: Response) -> list[PictureEvent]:
        match response:
            case OrbitAdvanced():
                self._take_advance(response)
            case OrbitTold():
                return [OrbitPartCame(response.part)] if self._listener else []
            case OrbitDrawn():
                return self._take_picture(response)
            case OrbitUnknown() if response.id == self._drawing_id:
                if self._drawing is not None and self._drawing.is_plain:
                    self._refused, self._drawing = self._drawing, None
                else:
                    self._begin_anew()
            case DrawnEstimated():
                self._error.took(response)
            case RequestFailed():
                self._error.took_failure(response)
                self._take_failure(response)
                return self.placement.receive(response)
            case _:
                return self.placement.receive(response)
        return []

    def _take_advance(self, response: OrbitAdvanced) -> None:
        if response.id != self._prepare_id:
            return
        self._learn(Known(response.id, response.version, response.is_done))
        self._n_bytes = response.n_bytes
        if self._asked is not None:
            self._known_light.worked(self._asked.scene.light)
        if response.is_done and not self.is_running:
            self._desk.metrics.progress = None

    def _take_picture(self, response: OrbitDrawn) -> list[PictureEvent]:
        drawing = self._drawing
        if drawing is None or response.id != self._drawing_id:
            return []
        made_of = Known(response.prepared, response.version, response.is_done)
        self._shown, self._drawing, self._refused = replace(drawing, made_of=made_of), None, None
        if made_of.version and made_of.prepared == self._prepare_id and made_of.version >= self._known.version:
            self._learn(made_of)
        self._seconds = response.seconds
        self._shows_placement = self._placement_follows
        if (
            drawing.quality == "moving"
            and not drawing.is_plain
            and drawing.resolution == self._pace.resolution(self._whole)
        ):
            self._pace.took(response.seconds)
        return [OrbitPicture(response.radiance, drawing.fit_error)]

    def _learn(self, known: Known) -> None:
        """How far the worker is."""
        if self._is_known_to_be_done and not known.is_done:
            self._asked = None  # to be made ready yet: what no picture has seen before
        self._known = known

    def _take_failure(self, response: RequestFailed) -> None:
        if response.id == self._drawing_id:
            self._refused, self._drawing = self._drawing, None
        if response.id == self._prepare_id and self._asked is not None:
            self._is_stopped = True
            if self._known_light.go_back(self._desk.history, self._asked.scene.light):
                self._desk.document_changed()
