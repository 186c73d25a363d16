"""How far off the picture is, asked of the worker when nothing else is left to do.

It is asked once the picture has all that was asked for and the hand has rested for a while, and what was asked for is
given up as soon as the picture is to be another: an edit has the processors to itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from app.document import Document
from app.jobs.messages import Cancel, Request
from app.placement.curves import Curves
from app.placement.messages import ErrorEstimated, EstimateError
from app.view_state import ViewState
from engine.render.picture_error import ErrorEstimate

REST_SECONDS = 0.5


class ErrorTalk:
    """The talk with the worker about the error of the picture that is shown. ``send`` hands a request over."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._document: Document | None = None
        self._made_with: tuple[int | None, int] = None, 0
        self._rests_since = math.inf
        self._estimate: ErrorEstimate | None = None
        self._asked: int | None = None
        self._stopped = False

    def estimate_of(self, document: Document) -> ErrorEstimate | None:
        """What was told of the picture of this document; None while that is not known."""
        return self._estimate if document is self._document else None

    def update(self, now: float, document: Document, view: ViewState, revision: int, rests: bool) -> None:
        """Ask where it is time to. revision: of the transport that the picture is made with; rests: whether nothing of
        the picture is left to come, and no hand has hold of anything."""
        made_with = view.second_bands, revision
        if document is not self._document or made_with != self._made_with:
            self.forget()
            self._document, self._made_with = document, made_with
        if not rests or self._estimate is not None or self._asked is not None or self._stopped:
            self._rests_since = math.inf
            return
        self._rests_since = min(self._rests_since, now)
        if now - self._rests_since >= REST_SECONDS:
            wanted = EstimateError(self._curves.scene_state(document), view.second_bands, revision=revision)
            self._asked = self._send(wanted)

    def forget(self) -> None:
        """The picture is another one, or no longer known: an answer that is still to come is given up."""
        if self._asked is not None:
            self._send(Cancel(of=(EstimateError,)))
        self._estimate = self._asked = None
        self._stopped = False
        self._rests_since = math.inf

    def lost(self) -> None:
        """What was asked will not be answered: the worker was given something else to do."""
        self._asked = None

    def stopped(self) -> None:
        """A person stopped the work: the error of this picture is asked for no more."""
        self._stopped, self._asked = self._estimate is None, None

    def took(self, response: ErrorEstimated) -> None:
        """The answer."""
        if response.id == self._asked:
            self._estimate, self._asked = response.estimate, None

    def took_failure(self, id: int) -> None:
        """It could not be found out, and is not asked for again."""
        if id == self._asked:
            self.stopped()
