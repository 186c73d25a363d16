"""Requests that the worker prepares a scene for other light, another sky or mix, once its picture is idle and nothing
else is left to do.

The request is cancelled as soon as the picture changes: an edit has the processors to itself.
"""

from __future__ import annotations

from collections.abc import Callable

from app.document.document import Document
from app.messages.worker_messages import CancelRequests, Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import LightsReady, PrepareRelighting, RelightingPrepared
from app.modes.reconciler import Reconciler
from engine.material.layer import Layer

# The error of the picture is requested before.
IDLE_SECONDS = 1.0

# A document and the revision of its transport.
_LitDocument = tuple[Document, int]


def _layers_of(document: Document) -> tuple[Layer, ...]:
    return tuple(layer for _, layer in document.layers())


def _is_same(one: _LitDocument, two: _LitDocument) -> bool:
    return one[0] is two[0] and one[1] == two[1]


class RelightController:
    """Requests preparation for other light. ``send`` sends a request. n_lights: those that can be mixed."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._reconciler = Reconciler[_LitDocument, RelightingPrepared](
            IDLE_SECONDS, cancels_at_once=True, covers=_is_same
        )
        self.forget()

    @property
    def is_ready(self) -> bool:
        """Whether the scene is prepared for other light."""
        return self._reconciler.is_ready

    def mixes(self, document: Document) -> bool:
        """Whether the lights of a document can be mixed: the worker has pictures of its layers under each alone."""
        return self.n_lights > 0 and self._layers == _layers_of(document)

    def forget(self) -> None:
        """Forget what is ready: another picture, or another worker."""
        self._reconciler.clear()
        self.n_lights = 0
        self._layers: tuple[Layer, ...] = ()

    def update(self, now: float, document: Document, revision: int, rests: bool) -> None:
        """Request preparation where it is time to. revision: of the transport that the picture is made with; rests:
        whether all of the picture is there, and no drag is under way."""
        reconciler = self._reconciler
        reconciler.desire(now, (document, revision))
        match reconciler.action(now, rests):
            case "request":
                request = PrepareRelighting(self._curves.scene_state(document), revision=revision)
                reconciler.sent(now, self._send(request))
            case "cancel":
                self._send(CancelRequests(of=(PrepareRelighting,)))

    def receive(self, response: LightsReady | RelightingPrepared) -> None:
        """Take a response. What is prepared coarsely is not ready, but its lights can be mixed."""
        requested = self._reconciler.requested
        if requested is not None and requested.id == response.id:
            self.n_lights, self._layers = response.n_lights, _layers_of(requested.desired[0])
        if isinstance(response, RelightingPrepared):
            self._reconciler.receive(response.id, response)

    def interrupted(self) -> None:
        """The user or a fault stopped it: it is not requested again before the picture changes."""
        self._reconciler.stop()

    def receive_failure(self, id: int) -> None:
        self._reconciler.fail(id)
