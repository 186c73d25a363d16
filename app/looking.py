"""From where the scene is seen, and in how many pixels: what of that the worker was asked to trace, and has traced.

A view is another one as soon as a hand moves it; it is traced once it rests, till then the picture before it stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from app.messages import LookFrom, Request, Response
from app.view_state import Viewpoint
from engine.scene.picture_frame import PictureFrame

REST_SECONDS = 0.25


class LookTalk:
    """The talk with the worker about the view. ``send`` hands a request over and returns its id.

    ``seen`` is the look whose picture there is, of the scene that the request ``scene`` opened, by the request ``id``;
    ``has_resized``: it has other pixels than the one before. ``is_away``: the view is another one.
    """

    def __init__(self, send: Callable[[Request], int]) -> None:
        self.seen = Viewpoint()
        self.scene = self.id = 0
        self.is_away = self.has_resized = False
        self._send = send
        self._asked: Viewpoint | None = None
        self._asked_scene = self._asked_id = 0
        self._wish = Viewpoint()
        self._since = -math.inf
        self._released = False

    def ask(self, look: Viewpoint, scene: int) -> None:
        """Have the scene of that number traced from there."""
        self._asked, self._asked_scene = look, scene
        self._asked_id = self._send(LookFrom(scene, look.camera, look.resolution))

    def update(self, now: float, look: Viewpoint) -> bool:
        """Once a frame: ask for another look once it rests; whether what is seen came or went with that, see
        `is_away`. now: seconds of a steady clock."""
        if look != self._wish:
            self._wish, self._since = look, now
        rests, self._released = self._released or now - self._since >= REST_SECONDS, False
        if look != (self._asked or self.seen) and rests:
            self.ask(look, self.scene)
        was_away, self.is_away = self.is_away, look != self.seen or self._asked is not None
        return was_away != self.is_away

    def hand_released(self) -> None:
        """What waits for the view to rest need wait no longer."""
        self._released = True

    def took(self, response: Response) -> bool:
        """Note that a look was traced; whether it is the one that was asked for."""
        if self._asked is None or not self.awaits(response.id):
            return False
        self.has_resized = self._asked.resolution != self.seen.resolution
        self.seen, self.scene, self.id = self._asked, self._asked_scene, response.id
        self._asked, self.is_away = None, False
        return True

    def adopted(self, own: tuple[int, int]) -> Viewpoint:
        """The look that was traced, as one of a scene whose own resolution is known."""
        if self.seen.resolution == own:
            self.seen = self.seen._replace(resolution=None)
        return self.seen

    def awaits(self, id: int) -> bool:
        """Whether the request of that number is to be answered yet."""
        return self._asked is not None and id == self._asked_id

    def gave_up(self) -> Viewpoint | None:
        """What was asked for will not come; the look that it was, None where there was nothing."""
        asked, self._asked, self.is_away = self._asked, None, False
        return asked


def what_is_missing(frame: PictureFrame) -> str:
    """What is to be said of a picture in which there is nothing to edit; "" of any other."""
    if frame.n_pixels:
        return ""
    return f"the camera sees {'lamps alone' if (frame.object_image >= 0).any() else 'no surface, the background alone'}"
