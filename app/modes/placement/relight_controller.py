"""Requests that the worker prepares a scene for another sky, once its picture is idle and nothing else is left to do.

The request is given up as soon as the picture changes: an edit has the processors to itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from app.document.document import Document
from app.messages.worker_messages import CancelRequests, Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import PrepareRelighting, RelightingPrepared

# The error of the picture is requested before.
IDLE_SECONDS = 1.0


class RelightController:
    """Requests preparation for a rotating sky. ``send`` sends a request."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self.forget()

    def forget(self) -> None:
        """Forget what is ready: another picture, or another worker."""
        self._picture: tuple[Document, int] | None = None
        self._requested: int | None = None
        self._is_done = False
        self._idle_since = math.inf

    def update(self, now: float, document: Document, revision: int, rests: bool) -> None:
        """Request preparation where it is time to. revision: of the transport that the picture is made with; rests:
        whether all of the picture is there, a sky lights it, and no drag is under way."""
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
        """Take the response."""
        if response.id == self._requested:
            self._requested, self._is_done = None, True

    def interrupted(self) -> None:
        """The user or a fault stopped it: it is not requested again before the picture changes."""
        self._requested, self._is_done = None, True

    def receive_failure(self, id: int) -> None:
        if id == self._requested:
            self.interrupted()
