"""The requested and the traced view: camera, resolution, poses, bumps, edge rays.

A view changes as soon as the user moves the camera, poses an object, or perturbs an object's normals; it is traced once
all of these are idle. Until then the previous picture stays.
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
    """A view: camera and resolution, the poses and bumps of objects in it, and the rays through a pixel at an edge."""

    viewpoint: Viewpoint = Viewpoint()
    poses: Poses = ()
    bumps: BumpsByObject = ()
    n_edge_rays: int | None = None


class ViewController:
    """Requests traced views. ``send`` sends a request and returns its id.

    ``traced`` is the view that the picture shows, of the scene that the request ``scene`` opened, by the request
    ``id``; ``has_resized``: its resolution is not that of the view before. ``is_away``: the present view is another
    one.
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
        """Request a view of the scene of that number, with these poses and bumps; n_edge_rays: None for as many as it
        requires."""
        self._requested, self._requested_scene = TracedView(look, poses, bumps, n_edge_rays), scene
        self._requested_id = self._send(SetCamera(scene, *look, poses, bumps, n_edge_rays))

    def update(
        self, now: float, look: Viewpoint, poses: Poses = (), bumps: BumpsByObject = (), n_edge_rays: int | None = None
    ) -> bool:
        """Request another view once it is idle; once a frame. Returns whether `is_away` changed. now: seconds of a
        steady clock."""
        sight, seen = TracedView(look, poses, bumps, n_edge_rays), self._traced
        if sight != self._desired:
            self._desired, self._since = sight, now
        rests, self._drag_ended = self._drag_ended or now - self._since >= REST_SECONDS, False
        if sight not in (self._requested or seen, self._failed) and rests:
            self.request_view(look, self.scene, poses, bumps, n_edge_rays)
        was_away, self.is_away = self.is_away, sight != seen or self._requested is not None
        return was_away != self.is_away

    def hand_released(self) -> None:
        """A drag ended: the view is requested without waiting for the idle time."""
        self._drag_ended = True

    def note_traced(self, response: Response) -> bool:
        """Note that a view was traced; returns whether it is the one that was requested."""
        if self._requested is None or not self.is_pending(response.id):
            return False
        self.has_resized = self._requested.viewpoint.resolution != self.traced.resolution
        self._traced = self._requested
        self.scene, self.id = self._requested_scene, response.id
        self._requested, self._failed, self.is_away = None, None, False
        return True

    def adopt_resolution(self, own: tuple[int, int]) -> Viewpoint:
        """The traced view, for a scene whose own resolution is known."""
        if self.traced.resolution == own:
            self._traced = self._traced._replace(viewpoint=self.traced._replace(resolution=None))
        return self.traced

    def is_pending(self, id: int) -> bool:
        """Whether the response to the request of that number is still to come."""
        return self._requested is not None and id == self._requested_id

    def give_up(self) -> Viewpoint | None:
        """Note that the requested view will not come; returns it, None where there was none."""
        self._failed, self._requested, self.is_away = self._requested, None, False
        return self._failed and self._failed.viewpoint


def describe_empty_frame(frame: PictureFrame) -> str:
    """The line to show for a picture in which there is nothing to edit; "" for any other."""
    if frame.n_points:
        return ""
    return f"the camera sees {'lamps alone' if (frame.object_image >= 0).any() else 'no surface, the background alone'}"
