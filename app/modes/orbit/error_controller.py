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

from app.document.view_state import Viewpoint
from app.messages.worker_messages import CancelRequests, Request, RequestFailed
from app.modes.orbit.desired_state import DesiredOrbit
from app.modes.orbit.orbit_messages import DrawnErrorEstimated, EstimateDrawn
from engine.realtime.zonal_harmonics.pose import Poses
from engine.render.picture_error import ErrorEstimate

IDLE_SECONDS = 0.3


class ShownPicture(NamedTuple):
    """What a picture shows."""

    desired: DesiredOrbit
    viewpoint: Viewpoint
    poses: Poses
    has_map: bool = False


class DrawnErrorController:
    """The talk with the worker about the error of what it draws. send: hands a request over; kind: that of the mode."""

    def __init__(self, send: Callable[[Request], int], kind: type[EstimateDrawn]) -> None:
        self._send, self._kind = send, kind
        self.forget()

    def forget(self) -> None:
        """Nothing is known of any picture; the worker was given something else to do."""
        self._seen: ShownPicture | None = None
        self._estimate: DrawnErrorEstimated | None = None
        self._estimate_of: ShownPicture | None = None
        self._requested: int | None = None
        self._is_refused = False
        self._idle_since = math.inf

    def update(self, now: float, seen: ShownPicture, rests: bool, request: Callable[[], EstimateDrawn]) -> None:
        """Ask where it is time to. rests: whether the picture of what is seen is there, and whole."""
        if seen != self._seen:
            self.give_up()
            self._seen, self._is_refused = seen, False
        if not rests or self._requested is not None or self._is_refused or self._estimate_of == seen:
            self._idle_since = math.inf
            return
        self._idle_since = min(self._idle_since, now)
        if now - self._idle_since >= IDLE_SECONDS:
            self._requested = self._send(request())

    def give_up(self) -> None:
        """Nobody waits for the answer any more."""
        if self._requested is not None:
            self._send(CancelRequests(of=(self._kind,)))
            self._requested = None

    def at_rest(self, seen: ShownPicture) -> ErrorEstimate | None:
        """Of the picture at rest; None while that is not known. With or without a map it is the same picture."""
        of = self._estimate_of
        is_of_it = of is not None and of._replace(has_map=seen.has_map) == seen
        return self._estimate.at_rest if self._estimate is not None and is_of_it else None

    def colours(self, seen: ShownPicture) -> NDArray[np.uint8] | None:
        """Where the picture at rest is off; None while that is not known."""
        return self._estimate.colours if self._estimate is not None and self._estimate_of == seen else None

    def moving(self, desired: DesiredOrbit) -> ErrorEstimate | None:
        """Of pictures of this from anywhere while something moves; None while that is not known."""
        of = self._estimate_of
        return (
            self._estimate.moving if self._estimate is not None and of is not None and of.desired == desired else None
        )

    def receive(self, response: DrawnErrorEstimated) -> None:
        """The answer."""
        if response.id == self._requested:
            self._estimate, self._estimate_of, self._requested = response, self._seen, None

    def receive_failure(self, response: RequestFailed) -> None:
        """It could not be found out, and is not asked for again."""
        if response.id == self._requested:
            self._requested, self._is_refused = None, True
