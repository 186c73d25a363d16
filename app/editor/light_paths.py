"""Says what keeps a light that was placed in the picture from doing what it was placed for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from app.document.document import Document
from app.messages.light_path_messages import LightPathTraced, TraceLightPath
from app.messages.worker_messages import Request, RequestFailed
from engine.scene.light_paths import LightPath


class LightPathHost(Protocol):
    """What light paths need of the editor."""

    @property
    def document(self) -> Document: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...


class LightPaths:
    """Requests the way of the light that was placed last. ``send`` sends a request and returns its id."""

    def __init__(self, host: LightPathHost, send: Callable[[Request], int]) -> None:
        self._host, self._send = host, send
        self._path: LightPath | None = None
        self._document: Document | None = None
        self._requested: int | None = None
        self._said = ""

    @property
    def is_tracing(self) -> bool:
        """Whether a response is still to come."""
        return self._requested is not None

    def trace(self, path: LightPath, again: bool = True) -> None:
        """Trace the way of a placed light; again: also where it is the one that was traced last."""
        if again or path != self._path:
            self._path, self._document = path, self._host.document
            self._requested = self._send(TraceLightPath(path))

    def receive(self, response: LightPathTraced) -> None:
        """Show a line where the light does not do what it was placed for, and where it does so again."""
        if self._path is None or response.id != self._requested:
            return
        self._requested = None
        if response.line != self._said:
            self._host.notify(response.line or f"{self._path.light} is placed, and nothing hides it there")
        self._said = response.line

    def view_traced(self) -> None:
        """A view was traced, which takes lines away: what is said of the last edit is said again."""
        if self._said and self._host.document is self._document:
            self._host.notify(self._said)

    def receive_failure(self, response: RequestFailed) -> bool:
        """A request failed; returns whether it was for the way of a light."""
        if self._requested is None or response.id != self._requested:
            return False
        self._requested = None
        self._host.notify(response.line, True)
        return True

    def worker_restarted(self) -> None:
        """No response comes any more."""
        self._requested = None
