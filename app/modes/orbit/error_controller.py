"""Estimates of the error of pictures that the worker draws, requested once the picture of an idle view is complete.

A request is given up as soon as the picture changes. The estimate for an idle picture belongs to that view alone; the
estimate for moving pictures holds for any camera, until the scene is edited.
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
    """The content of a shown picture."""

    desired: DesiredOrbit
    viewpoint: Viewpoint
    poses: Poses
    has_map: bool = False


class DrawnErrorController:
    """Requests estimates of the error of drawn pictures. send: sends a request; kind: that of the mode."""

    def __init__(self, send: Callable[[Request], int], kind: type[EstimateDrawn]) -> None:
        self._send, self._kind = send, kind
        self.forget()

    def forget(self) -> None:
        """Forget all estimates; the worker was given something else to do."""
        self._seen: ShownPicture | None = None
        self._estimate: DrawnErrorEstimated | None = None
        self._estimate_of: ShownPicture | None = None
        self._requested: int | None = None
        self._is_refused = False
        self._idle_since = math.inf

    def update(self, now: float, seen: ShownPicture, rests: bool, request: Callable[[], EstimateDrawn]) -> None:
        """Request an estimate where it is time to. rests: whether the picture of what is shown is there, and
        complete."""
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
        """Give up the request: its response is no longer needed."""
        if self._requested is not None:
            self._send(CancelRequests(of=(self._kind,)))
            self._requested = None

    def at_rest(self, seen: ShownPicture) -> ErrorEstimate | None:
        """The error of the idle picture; None while unknown. The map does not change it."""
        of = self._estimate_of
        is_of_it = of is not None and of._replace(has_map=seen.has_map) == seen
        return self._estimate.at_rest if self._estimate is not None and is_of_it else None

    def colours(self, seen: ShownPicture) -> NDArray[np.uint8] | None:
        """The error map of the idle picture; None while unknown."""
        return self._estimate.colours if self._estimate is not None and self._estimate_of == seen else None

    def moving(self, desired: DesiredOrbit) -> ErrorEstimate | None:
        """The error of moving pictures of this state, from any camera; None while unknown."""
        of = self._estimate_of
        return (
            self._estimate.moving if self._estimate is not None and of is not None and of.desired == desired else None
        )

    def receive(self, response: DrawnErrorEstimated) -> None:
        """Take the response."""
        if response.id == self._requested:
            self._estimate, self._estimate_of, self._requested = response, self._seen, None

    def receive_failure(self, response: RequestFailed) -> None:
        """The estimate failed, and is not requested again."""
        if response.id == self._requested:
            self._requested, self._is_refused = None, True
