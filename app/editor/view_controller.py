"""From where the scene is seen, in how many pixels and in which pose, and how finely at edges: what of that the worker
was asked to trace, and has traced.

A view is another one as soon as a hand moves it, or an object in it, or turns an object's normals; it is traced once
all of them rest, till then the picture before it stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from app.document.view_state import Viewpoint
from app.messages.worker_messages import Request, Response, SetCamera
from engine.material.bumps import BumpsByObject
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.picture_frame import PictureFrame

REST_SECONDS = 0.25


class TracedView(NamedTuple):
    """What is seen: from where, the poses and bumps of objects in it, and the rays through a pixel at an edge."""

    viewpoint: Viewpoint = Viewpoint()
    poses: Poses = ()
    bumps: BumpsByObject = ()
    n_edge_rays: int | None = None


class ViewController:
    """The talk with the worker about the view. ``send`` hands a request over and returns its id.

    ``traced`` is the look whose picture there is, of the scene that the request ``scene`` opened, by the request
    ``id``; ``has_resized``: it has other pixels than the one before. ``is_away``: the view is another one.
    """

    def __init__(self, send: Callable[[Request], int]) -> None:
        self._traced = TracedView()
        self.scene = self.id = 0
        self.is_away = self.has_resized = False
        self._send = send
        self._requested: TracedView | None = None
        self._failed: TracedView | None = None
        self._requested_scene = self._requested_id = 0
        self._desired = TracedView()
        self._since = -math.inf
        self._drag_ended = False

    @property
    def traced(self) -> Viewpoint:
        return self._traced.viewpoint

    def request_view(
        self, look: Viewpoint, scene: int, poses: Poses = (), bumps: BumpsByObject = (), n_edge_rays: int | None = None
    ) -> None:
        """Have the scene of that number traced from there, in these poses and under these bumps; n_edge_rays: None for
        as many as it requires."""
        self._requested, self._requested_scene = TracedView(look, poses, bumps, n_edge_rays), scene
        self._requested_id = self._send(SetCamera(scene, *look, poses, bumps, n_edge_rays))

    def update(
        self, now: float, look: Viewpoint, poses: Poses = (), bumps: BumpsByObject = (), n_edge_rays: int | None = None
    ) -> bool:
        """Once a frame: ask for another look once it rests; whether what is seen came or went with that, see
        `is_away`. now: seconds of a steady clock."""
        sight, seen = TracedView(look, poses, bumps, n_edge_rays), self._traced
        if sight != self._desired:
            self._desired, self._since = sight, now
        rests, self._drag_ended = self._drag_ended or now - self._since >= REST_SECONDS, False
        if sight not in (self._requested or seen, self._failed) and rests:
            self.request_view(look, self.scene, poses, bumps, n_edge_rays)
        was_away, self.is_away = self.is_away, sight != seen or self._requested is not None
        return was_away != self.is_away

    def hand_released(self) -> None:
        """What waits for the view to rest need wait no longer."""
        self._drag_ended = True

    def note_traced(self, response: Response) -> bool:
        """Note that a look was traced; whether it is the one that was asked for."""
        if self._requested is None or not self.is_pending(response.id):
            return False
        self.has_resized = self._requested.viewpoint.resolution != self.traced.resolution
        self._traced = self._requested
        self.scene, self.id = self._requested_scene, response.id
        self._requested, self._failed, self.is_away = None, None, False
        return True

    def adopt_resolution(self, own: tuple[int, int]) -> Viewpoint:
        """The look that was traced, as one of a scene whose own resolution is known."""
        if self.traced.resolution == own:
            self._traced = self._traced._replace(viewpoint=self.traced._replace(resolution=None))
        return self.traced

    def is_pending(self, id: int) -> bool:
        """Whether the request of that number is to be answered yet."""
        return self._requested is not None and id == self._requested_id

    def give_up(self) -> Viewpoint | None:
        """What was asked for will not come; the look that it was, None where there was nothing."""
        self._failed, self._requested, self.is_away = self._requested, None, False
        return self._failed and self._failed.viewpoint


def describe_empty_frame(frame: PictureFrame) -> str:
    """What is to be said of a picture in which there is nothing to edit; "" of any other."""
    if frame.n_points:
        return ""
    return f"the camera sees {'lamps alone' if (frame.object_image >= 0).any() else 'no surface, the background alone'}"
