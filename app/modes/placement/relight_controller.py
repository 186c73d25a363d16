"""Requests that the worker prepares a scene for another sky, once its picture is idle and nothing else is left to do.

The request is cancelled as soon as the picture changes: an edit has the processors to itself.
"""

from __future__ import annotations

from collections.abc import Callable

from app.document.document import Document
from app.messages.worker_messages import CancelRequests, Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import PrepareRelighting, RelightingPrepared
from app.modes.reconciler import Reconciler

# The error of the picture is requested before.
IDLE_SECONDS = 1.0

# A document and the revision of its transport.
_LitDocument = tuple[Document, int]


def _is_same(one: _LitDocument, two: _LitDocument) -> bool:
    return one[0] is two[0] and one[1] == two[1]


class RelightController:
    """Requests preparation for a rotating sky. ``send`` sends a request."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._reconciler = Reconciler[_LitDocument, RelightingPrepared](
            IDLE_SECONDS, cancels_at_once=True, covers=_is_same
        )

    @property
    def is_ready(self) -> bool:
        """Whether the scene is prepared for other light."""
        return self._reconciler.is_ready

    def forget(self) -> None:
        """Forget what is ready: another picture, or another worker."""
        self._reconciler.clear()

    def update(self, now: float, document: Document, revision: int, rests: bool) -> None:
        """Request preparation where it is time to. revision: of the transport that the picture is made with; rests:
        whether all of the picture is there, a sky lights it, and no drag is under way."""
        reconciler = self._reconciler
        reconciler.desire(now, (document, revision))
        match reconciler.action(now, rests):
            case "request":
                request = PrepareRelighting(self._curves.scene_state(document), revision=revision)
                reconciler.sent(now, self._send(request))
            case "cancel":
                self._send(CancelRequests(of=(PrepareRelighting,)))

    def receive(self, response: RelightingPrepared) -> None:
        """Take the response."""
        self._reconciler.receive(response.id, response)

    def interrupted(self) -> None:
        """The user or a fault stopped it: it is not requested again before the picture changes."""
        self._reconciler.stop()

    def receive_failure(self, id: int) -> None:
        self._reconciler.fail(id)
