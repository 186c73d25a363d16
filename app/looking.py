"""From where the scene is seen, in how many pixels and in which pose, and how finely at edges: what of that the worker
was asked to trace, and has traced.

A view is another one as soon as a hand moves it, or an object in it, or turns an object's normals; it is traced once
all of them rest, till then the picture before it stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from app.messages import LookFrom, Request, Response
from app.view_state import Viewpoint
from engine.deform.pose import Poses
from engine.material.bumps import BumpsByObject
from engine.scene.picture_frame import PictureFrame

REST_SECONDS = 0.25


class Sight(NamedTuple):
    """What is seen: from where, the poses and bumps of objects in it, and the rays through a pixel at an edge."""

    look: Viewpoint = Viewpoint()
    poses: Poses = ()
    bumps: BumpsByObject = ()
    n_edge_rays: int | None = None


class LookTalk:
    """The talk with the worker about the view. ``send`` hands a request over and returns its id.

    ``seen`` is the look whose picture there is, of the scene that the request ``scene`` opened, by the request ``id``;
    ``has_resized``: it has other pixels than the one before. ``is_away``: the view is another one.
    """

    def __init__(self, send: Callable[[Request], int]) -> None:
        self._sight = Sight()
        self.scene = self.id = 0
        self.is_away = self.has_resized = False
        self._send = send
        self._asked: Sight | None = None
        self._refused: Sight | None = None
        self._asked_scene = self._asked_id = 0
        self._wish = Sight()
        self._since = -math.inf
        self._released = False

    @property
    def seen(self) -> Viewpoint:
        return self._sight.look

    def ask(
        self, look: Viewpoint, scene: int, poses: Poses = (), bumps: BumpsByObject = (), n_edge_rays: int | None = None
    ) -> None:
        """Have the scene of that number traced from there, in these poses and under these bumps; n_edge_rays: None for
        as many as it requires."""
        self._asked, self._asked_scene = Sight(look, poses, bumps, n_edge_rays), scene
        self._asked_id = self._send(LookFrom(scene, *look, poses, bumps, n_edge_rays))

    def update(
        self, now: float, look: Viewpoint, poses: Poses = (), bumps: BumpsByObject = (), n_edge_rays: int | None = None
    ) -> bool:
        """Once a frame: ask for another look once it rests; whether what is seen came or went with that, see
        `is_away`. now: seconds of a steady clock."""
        sight, seen = Sight(look, poses, bumps, n_edge_rays), self._sight
        if sight != self._wish:
            self._wish, self._since = sight, now
        rests, self._released = self._released or now - self._since >= REST_SECONDS, False
        if sight not in (self._asked or seen, self._refused) and rests:
            self.ask(look, self.scene, poses, bumps, n_edge_rays)
        was_away, self.is_away = self.is_away, sight != seen or self._asked is not None
        return was_away != self.is_away

    def hand_released(self) -> None:
        """What waits for the view to rest need wait no longer."""
        self._released = True

    def took(self, response: Response) -> bool:
        """Note that a look was traced; whether it is the one that was asked for."""
        if self._asked is None or not self.awaits(response.id):
            return False
        self.has_resized = self._asked.look.resolution != self.seen.resolution
        self._sight = self._asked
        self.scene, self.id = self._asked_scene, response.id
        self._asked, self._refused, self.is_away = None, None, False
        return True

    def adopted(self, own: tuple[int, int]) -> Viewpoint:
        """The look that was traced, as one of a scene whose own resolution is known."""
        if self.seen.resolution == own:
            self._sight = self._sight._replace(look=self.seen._replace(resolution=None))
        return self.seen

    def awaits(self, id: int) -> bool:
        """Whether the request of that number is to be answered yet."""
        return self._asked is not None and id == self._asked_id

    def gave_up(self) -> Viewpoint | None:
        """What was asked for will not come; the look that it was, None where there was nothing."""
        self._refused, self._asked, self.is_away = self._asked, None, False
        return self._refused and self._refused.look


def what_is_missing(frame: PictureFrame) -> str:
    """What is to be said of a picture in which there is nothing to edit; "" of any other."""
    if frame.n_points:
        return ""
    return f"the camera sees {'lamps alone' if (frame.object_image >= 0).any() else 'no surface, the background alone'}"
