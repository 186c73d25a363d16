"""How far off the pictures are that the worker draws, asked of it once one at rest is whole.

It is asked for what is seen, and given up as soon as that is another. What it says of the picture at rest belongs to
that view alone; what it says of pictures while something moves stands for those from anywhere, until the scene is
edited.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.messages import CancelRequests, RequestFailed, Request
from app.orbit.messages import DrawnEstimated, EstimateDrawn
from app.orbit.wishes import OrbitWish
from app.view_state import Viewpoint
from engine.deform.pose import Poses
from engine.render.picture_error import ErrorEstimate

REST_SECONDS = 0.3


class Seen(NamedTuple):
    """What a picture shows."""

    wish: OrbitWish
    look: Viewpoint
    poses: Poses
    has_map: bool = False


class DrawnErrorTalk:
    """The talk with the worker about the error of what it draws. send: hands a request over; kind: that of the mode."""

    def __init__(self, send: Callable[[Request], int], kind: type[EstimateDrawn]) -> None:
        self._send, self._kind = send, kind
        self.forget()

    def forget(self) -> None:
        """Nothing is known of any picture; the worker was given something else to do."""
        self._seen: Seen | None = None
        self._known: DrawnEstimated | None = None
        self._known_of: Seen | None = None
        self._asked: int | None = None
        self._is_refused = False
        self._rests_since = math.inf

    def update(self, now: float, seen: Seen, rests: bool, request: Callable[[], EstimateDrawn]) -> None:
        """Ask where it is time to. rests: whether the picture of what is seen is there, and whole."""
        if seen != self._seen:
            self.give_up()
            self._seen, self._is_refused = seen, False
        if not rests or self._asked is not None or self._is_refused or self._known_of == seen:
            self._rests_since = math.inf
            return
        self._rests_since = min(self._rests_since, now)
        if now - self._rests_since >= REST_SECONDS:
            self._asked = self._send(request())

    def give_up(self) -> None:
        """Nobody waits for the answer any more."""
        if self._asked is not None:
            self._send(CancelRequests(of=(self._kind,)))
            self._asked = None

    def at_rest(self, seen: Seen) -> ErrorEstimate | None:
        """Of the picture at rest; None while that is not known. With or without a map it is the same picture."""
        of = self._known_of
        is_of_it = of is not None and of._replace(has_map=seen.has_map) == seen
        return self._known.at_rest if self._known is not None and is_of_it else None

    def colours(self, seen: Seen) -> NDArray[np.uint8] | None:
        """Where the picture at rest is off; None while that is not known."""
        return self._known.colours if self._known is not None and self._known_of == seen else None

    def moving(self, wish: OrbitWish) -> ErrorEstimate | None:
        """Of pictures of this from anywhere while something moves; None while that is not known."""
        of = self._known_of
        return self._known.moving if self._known is not None and of is not None and of.wish == wish else None

    def took(self, response: DrawnEstimated) -> None:
        """The answer."""
        if response.id == self._asked:
            self._known, self._known_of, self._asked = response, self._seen, None

    def took_failure(self, response: RequestFailed) -> None:
        """It could not be found out, and is not asked for again."""
        if response.id == self._asked:
            self._asked, self._is_refused = None, True
