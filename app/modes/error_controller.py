"""Estimates of the error of the picture on screen, requested from the worker when nothing else is left to do.

An estimate is requested once the picture has all that is desired and the user has been idle for a while. The request is
cancelled as soon as the picture changes: an edit has the processors to itself. Estimates are remembered for undo.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import CancelRequests, Request
from app.modes.reconciler import Reconciler


class EstimateResponse(Protocol):
    """What a worker answers; colours: the error map, None where it was not requested."""

    @property
    def id(self) -> int: ...

    @property
    def colours(self) -> NDArray[np.uint8] | None: ...


Picture = TypeVar("Picture")
Estimated = TypeVar("Estimated", bound=EstimateResponse)


class ErrorController(Generic[Picture, Estimated]):
    """Requests estimates of the error of pictures, which compare by what they show.

    send: sends a request; kind: that of the requests; idle_seconds: how long a picture is to be on screen before;
    max_remembered: estimates of earlier pictures that are kept, without error maps, which are large.
    """

    def __init__(
        self, send: Callable[[Request], int], kind: type[Request], idle_seconds: float, max_remembered: int = 0
    ) -> None:
        self._send, self._kind = send, kind
        self._reconciler = Reconciler[tuple[Picture, int], Estimated](idle_seconds, cancels_at_once=True)
        self._remembered: deque[tuple[Picture, Estimated]] = deque(maxlen=max_remembered)

    def update(
        self, now: float, picture: Picture, rests: bool, request: Callable[[], Request], made_by: int = 0
    ) -> None:
        """Request an estimate where it is time to. rests: whether nothing of the picture is left to come, and no drag
        is under way; request: makes the request; made_by: the number of what the picture was computed by, if it may be
        computed again."""
        reconciler, desired = self._reconciler, (picture, made_by)
        if desired != reconciler.desired:
            for known, estimated in self._remembered:
                if known == picture:
                    reconciler.accept(estimated, desired)
        reconciler.desire(now, desired)
        match reconciler.action(now, rests):
            case "request":
                reconciler.sent(now, self._send(request()))
            case "cancel":
                self._send(CancelRequests(of=(self._kind,)))

    def estimated(self, picture: Picture) -> Estimated | None:
        """The response for this picture, if it is the one of the last update; None while unknown."""
        reconciler = self._reconciler
        is_of_it = reconciler.is_ready and reconciler.desired is not None and reconciler.desired[0] == picture
        return reconciler.ready if is_of_it else None

    @property
    def newest(self) -> tuple[Picture, Estimated] | None:
        """The newest response, and the picture that it is for, which may be an earlier one."""
        ready, ready_for = self._reconciler.ready, self._reconciler.ready_for
        return None if ready is None or ready_for is None else (ready_for[0], ready)

    def forget(self) -> None:
        """Forget all estimates: all pictures have changed, or are no longer known."""
        if self._reconciler.is_under_way:
            self._send(CancelRequests(of=(self._kind,)))
        self._reconciler.clear()
        self._remembered.clear()

    def worker_interrupted(self) -> None:
        """The request will not be answered: the worker was given something else to do."""
        self._reconciler.lose()

    def user_stopped(self) -> None:
        """The user stopped the work: the error of this picture is not requested again."""
        self._reconciler.stop()

    def receive(self, response: Estimated) -> None:
        """Take the response."""
        if self._reconciler.receive(response.id, response) and response.colours is None:
            assert self._reconciler.ready_for is not None
            self._remembered.append((self._reconciler.ready_for[0], response))

    def receive_failure(self, id: int) -> None:
        """The estimate failed, and is not requested again."""
        self._reconciler.fail(id)
