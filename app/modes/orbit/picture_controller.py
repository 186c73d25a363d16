"""Requests pictures: the best that is possible now, one at a time, each of the camera and poses of its own moment.

While something moves, a picture has as many pixels as can be drawn in time (`QualityPacer`), and nothing queues up
behind the pointer. A picture of an idle view takes longer, and gives way to input at once. Before anything is ready,
objects are lit from the camera. Where the window draws moving pictures itself, the worker draws only those of an idle
view, and makes ready first what is seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from app.messages.worker_messages import CancelRequests, Request
from app.modes.orbit.desired_state import (
    WINDOW_SECONDS,
    WINDOW_STEPS,
    DesiredDrawing,
    PictureRequest,
    QualityPacer,
    ReadyState,
)
from app.modes.orbit.orbit_drawing import OrbitDrawing
from app.modes.orbit.orbit_messages import OrbitPictureDrawn, PrioritizeView, Quality
from app.modes.reconciler import Reconciler
from engine.scene.description import Camera

# How often a window that draws itself checks whether it sees parts that are not ready.
PRIORITIZE_SECONDS = 0.25
# While pictures improve by themselves, the worker gets this many times the time that drawing one takes.
_WORK_SHARE = 4.0


class WindowPicture(NamedTuple):
    """A picture that the window draws: camera, resolution (width, height), coefficients per point, and whether it has
    alpha, without the environment."""

    camera: Camera
    resolution: tuple[int, int]
    n_coefficients: int
    transparent: bool


class PictureController:
    """Requests pictures of a state. send: sends a request; drawing: makes it; state: what document and view desire.

    seconds: that the newest picture took to be drawn.
    """

    def __init__(self, send: Callable[[Request], int], drawing: OrbitDrawing, state: DesiredDrawing) -> None:
        self._send, self._drawing, self._state = send, drawing, state
        self._reconciler = Reconciler[PictureRequest, PictureRequest]()
        self.scene_opened()

    def scene_opened(self) -> None:
        """Another scene is open: there is no picture of it."""
        self._pace, self._is_paced_in_window = self._new_pace(), self._in_window
        self._forget()

    def _forget(self) -> None:
        self._reconciler.clear()
        self.seconds = 0.0
        self._drawn_at = self._prioritized = -math.inf

    def _new_pace(self) -> QualityPacer:
        return QualityPacer(WINDOW_SECONDS, WINDOW_STEPS, 2) if self._in_window else QualityPacer()

    @property
    def _in_window(self) -> bool:
        """Whether the window draws moving pictures; those with shadow catchers it does not."""
        desired = self._state.desired
        return self._drawing.needs_no_request and (desired is None or desired.catchers is None)

    # ------------------------------------------------------------------------------------------------------ state shown

    @property
    def shown(self) -> PictureRequest | None:
        """The picture on screen; None before there is one."""
        return self._reconciler.ready

    @property
    def is_under_way(self) -> bool:
        """Whether a picture is being drawn."""
        return self._reconciler.is_under_way

    @property
    def is_headlight(self) -> bool:
        """Whether nothing was ready for the picture, which shows objects lit from the camera."""
        return self.shown is not None and self.shown.is_headlight

    @property
    def drawn_in_window(self) -> WindowPicture | None:
        """What the window is to draw of what was exported; None where it is to show a picture of the worker's."""
        shown = self.shown
        if shown is None or not self._can_window_draw(shown):
            return None
        camera, n_coefficients = self._state.camera(shown.viewpoint), self._pace.n_coefficients
        return WindowPicture(camera, shown.resolution, n_coefficients, shown.transparent)

    def _can_window_draw(self, picture: PictureRequest) -> bool:
        """Whether the window draws a picture of what was exported. Objects that have moved since are not: their points
        and the triangles between are most of what there is, and would be sent anew for each step of the movement."""
        is_exported = not (picture.is_headlight or picture.made_of.follows_move)
        return self._in_window and picture.quality == "moving" and is_exported

    # ----------------------------------------------------------------------------------------------------------- events

    def worker_lost(self) -> None:
        """What the worker had ready is lost, and requests will not be answered; what is shown stays."""
        shown = self.shown
        self._forget()
        if shown is not None:
            self._show(replace(shown, made_of=ReadyState()))

    def restart_pace(self) -> None:
        """Moving pictures are drawn by another processor from now on."""
        self._pace, self._is_paced_in_window = self._new_pace(), self._in_window
        self.draw_again()

    def draw_again(self) -> None:
        """Request a picture of what is shown, and do not count on the one that is."""
        self._reconciler.forget_ready()

    def cancel(self) -> None:
        """No longer count on a response to the request under way."""
        self._reconciler.lose()

    def record_seconds(self, seconds: float) -> None:
        """Note that the picture on screen took the window this long."""
        self.seconds = seconds
        if self.shown is not None and self.shown.resolution == self._pace.resolution(self._state.full_resolution):
            self._pace.record_seconds(seconds)

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(self, now: float, ready: ReadyState, is_ready: bool, is_away: bool) -> bool:
        """Request a picture, where the desired one is neither shown nor under way; returns whether the window shows
        another that it draws itself. ready: what pictures are drawn of, all that was requested if is_ready; is_away:
        whether the view is not the traced one."""
        if self._is_paced_in_window != self._in_window:
            self.restart_pace()
        wanted = self._desired_picture(now, ready, is_ready) or self._desired_headlight_picture(now, is_away)
        reconciler, shown = self._reconciler, self.shown
        if wanted is None or shown is not None and shown.is_as_good_as(wanted):
            return False
        reconciler.desire(now, wanted)
        if reconciler.is_met or reconciler.is_refused:
            return False
        if self._can_window_draw(wanted):
            self._show_in_window(now, wanted)
            return True
        requested = reconciler.requested
        is_moving = reconciler.is_under_way and requested is not None and requested.desired.quality == "moving"
        waits = self._is_refinement(wanted) and now - self._drawn_at < _WORK_SHARE * self.seconds
        if reconciler.action(now, not (is_moving or waits)) == "request":
            self._drawn_at = now
            reconciler.sent(now, self._send(self._request(wanted)))
        return False

    def _request(self, wanted: PictureRequest) -> Request:
        camera, desired = self._state.camera(wanted.viewpoint), self._state.desired
        if wanted.is_headlight:
            assert desired is not None
            return self._drawing.headlight_request(camera, wanted, desired)
        return self._drawing.draw_request(camera, wanted, self._pace.n_coefficients)

    def estimated_requests(self, ready: ReadyState) -> tuple[Request, Request]:
        """The requests for the idle picture and for one while something moves, whose error is to be estimated."""
        content, resolution = self._state.content, self._state.full_resolution
        assert content is not None
        at_rest = PictureRequest(content.viewpoint, resolution, "rest", ready, content.poses)
        moving = replace(at_rest, resolution=self._pace.resolution(resolution), quality="moving")
        return self._request(at_rest), self._request(moving)

    def _show_in_window(self, now: float, wanted: PictureRequest) -> None:
        """Request only that what is seen gets ready first; once all is ready that is seldom needed."""
        if self._reconciler.is_under_way:
            self._send(CancelRequests(of=(self._drawing.draws,)))
            self._reconciler.lose()
        looked = self.shown and self.shown.viewpoint
        self._show(wanted)
        is_due = not wanted.made_of.is_done or now - self._prioritized >= PRIORITIZE_SECONDS
        if looked != wanted.viewpoint and is_due:
            self._prioritized = now
            self._send(PrioritizeView(self._state.camera(wanted.viewpoint)))

    def _show(self, picture: PictureRequest) -> None:
        self._reconciler.accept(picture, picture)

    def _desired_picture(self, now: float, ready: ReadyState, is_ready: bool) -> PictureRequest | None:
        """The best picture possible now; None before there can be any."""
        content = self._state.content
        if content is None or not ready.version:
            return None
        whole, rests = self._state.full_resolution, self._state.rests(now)
        quality: Quality = "rest" if rests and is_ready else "moving"
        resolution = whole if rests else self._pace.resolution(whole)
        return PictureRequest(
            content.viewpoint, resolution, quality, ready, content.poses, content.split, content.fit_error,
            content.transparent,
        )  # fmt: skip

    def _desired_headlight_picture(self, now: float, is_away: bool) -> PictureRequest | None:
        """The picture before there is any other: where camera or poses have moved on from the traced ones, the objects
        as they appear from there, lit from the camera."""
        content = self._state.content
        if content is None or not (self.is_headlight or self.shown is None and is_away):
            return None
        width, height = self._state.full_resolution
        resolution = (width, height) if self._state.rests(now) else (max(width // 2, 1), max(height // 2, 1))
        made_of, transparent = ReadyState(), content.transparent
        return PictureRequest(
            content.viewpoint, resolution, "moving", made_of, content.poses, transparent=transparent, is_headlight=True
        )

    def _is_refinement(self, wanted: PictureRequest) -> bool:
        """Whether it shows the same as on screen, a little further computed."""
        shown = self.shown
        if shown is None or wanted.made_of.is_done:
            return False
        is_same_view = (wanted.viewpoint, wanted.poses) == (shown.viewpoint, shown.poses)
        return is_same_view and shown.made_of.prepared == wanted.made_of.prepared

    # -------------------------------------------------------------------------------------------------------- responses

    def receive(self, response: OrbitPictureDrawn) -> PictureRequest | None:
        """Take a picture; returns the one that it was requested as, None where it is not the one under way."""
        requested = self._reconciler.requested
        if requested is None or response.id != requested.id or not self._reconciler.is_under_way:
            return None
        drawing = requested.desired
        made_of = ReadyState(response.prepared, response.version, response.is_done, response.follows_move)
        picture = replace(drawing, made_of=made_of)
        self._reconciler.receive(response.id, picture)
        self._show(picture)
        self.seconds = response.seconds
        is_paced = drawing.resolution == self._pace.resolution(self._state.full_resolution)
        if drawing.quality == "moving" and not drawing.is_headlight and is_paced:
            self._pace.record_seconds(response.seconds)
        return drawing

    def receive_failure(self, id: int) -> None:
        """A picture cannot be drawn, and is not requested again."""
        self._reconciler.fail(id)

    def receive_not_ready(self, id: int) -> bool:
        """The worker has nothing to draw of; returns whether what was ready is lost."""
        requested = self._reconciler.requested
        if requested is None or requested.id != id:
            return False
        if requested.desired.is_headlight:
            self._reconciler.fail(id)
        return not requested.desired.is_headlight
