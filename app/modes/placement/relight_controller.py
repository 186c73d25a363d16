"""When the worker is to make a scene ready for another sky: once its picture rests, and nothing else is left to do.

What was asked for is given up as soon as the picture is to be another: an edit has the processors to itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from app.document.document import Document
from app.messages.worker_messages import CancelRequests, Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import PrepareRelighting, RelightingPrepared

# The error of the picture is asked for before.
IDLE_SECONDS = 1.0


class RelightController:
    """The talk with the worker about turning the sky. ``send`` hands a request over."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self.forget()

    def forget(self) -> None:
        """Another picture, or another worker: nothing is ready."""
        self._picture: tuple[Document, int] | None = None
        self._requested: int | None = None
        self._is_done = False
        self._idle_since = math.inf

    def update(self, now: float, document: Document, revision: int, rests: bool) -> None:
        """Ask where it is time to. revision: of the transport that the picture is made with; rests: whether all of the
        picture is there, a sky lights it, and no hand has hold of anything."""
        if self._picture is None or self._picture[0] is not document or self._picture[1] != revision:
            if self._requested is not None:
                self._send(CancelRequests(of=(PrepareRelighting,)))
            self.forget()
            self._picture = document, revision
        if not rests or self._requested is not None or self._is_done:
            self._idle_since = math.inf
            return
        self._idle_since = min(self._idle_since, now)
        if now - self._idle_since >= IDLE_SECONDS:
            self._requested = self._send(PrepareRelighting(self._curves.scene_state(document), revision=revision))

    def receive(self, response: RelightingPrepared) -> None:
        """The answer."""
        if response.id == self._requested:
            self._requested, self._is_done = None, True

    def interrupted(self) -> None:
        """It was given up, by a person or by a fault: it is not asked for again before the picture changes."""
        self._requested, self._is_done = None, True

    def receive_failure(self, id: int) -> None:
        if id == self._requested:
            self.interrupted()
