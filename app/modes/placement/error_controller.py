"""Estimates of the picture's error, requested from the worker when nothing else is left to do.

An estimate is requested once the picture has all that was requested and the user has been idle for a while. The request
is given up as soon as the picture changes: an edit has the processors to itself. Estimates are remembered for undo.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.document.view_state import ViewState
from app.messages.worker_messages import CancelRequests, Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import ErrorEstimated, EstimateError
from engine.render.picture_error import ErrorEstimate

IDLE_SECONDS = 0.5
MAX_ESTIMATES = 32


@dataclass(frozen=True, eq=False)
class _RestingPicture:
    """An idle picture: its document, and what of the view it depends on."""

    document: Document
    made_with: tuple[int | None, ...]

    def is_same(self, other: _RestingPicture | None) -> bool:
        """Whether it is of the identical document: undo comes back to those."""
        return other is not None and self.document is other.document and self.made_with == other.made_with


class ErrorController:
    """Requests estimates of the error of the shown picture. ``send`` sends a request."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._picture: _RestingPicture | None = None
        self._revision = 0
        self._estimates: deque[tuple[_RestingPicture, ErrorEstimate]] = deque(maxlen=MAX_ESTIMATES)
        self._idle_since = math.inf
        self._estimate: ErrorEstimate | None = None
        self._colours: NDArray[np.uint8] | None = None
        self._requested: int | None = None
        self._stopped = False

    def estimate_of(self, document: Document) -> ErrorEstimate | None:
        """The error of the picture of this document; None while unknown."""
        return self._estimate if self._picture is not None and document is self._picture.document else None

    def colours_of(self, document: Document) -> NDArray[np.uint8] | None:
        """The error map of that picture, see `ErrorEstimated`; None while unknown."""
        return None if self.estimate_of(document) is None else self._colours

    def update(self, now: float, document: Document, view: ViewState, revision: int, rests: bool) -> None:
        """Request an estimate where it is time to. revision: of the transport that the picture is made with; rests:
        whether nothing of the picture is left to come, and no drag is under way."""
        knobs = view.n_lights, view.n_patches, view.n_bounces, view.second_bands
        picture = _RestingPicture(document, (*knobs, view.shows_error))
        if not picture.is_same(self._picture) or revision != self._revision:
            self._give_up()
            self._picture, self._revision = picture, revision
            self._estimate = next((estimate for known, estimate in self._estimates if picture.is_same(known)), None)
        if not rests or self._estimate is not None or self._requested is not None or self._stopped:
            self._idle_since = math.inf
            return
        self._idle_since = min(self._idle_since, now)
        if now - self._idle_since >= IDLE_SECONDS:
            wanted = EstimateError(
                self._curves.scene_state(document), view.second_bands, view.shows_error, revision=revision
            )
            self._requested = self._send(wanted)

    def forget(self) -> None:
        """Forget all estimates: all pictures have changed, or are no longer known."""
        self._give_up()
        self._estimates.clear()

    def _give_up(self) -> None:
        """Give up the response that is still to come: the picture has changed."""
        if self._requested is not None:
            self._send(CancelRequests(of=(EstimateError,)))
        self._estimate = self._requested = self._colours = None
        self._stopped = False
        self._idle_since = math.inf

    def worker_interrupted(self) -> None:
        """The request will not be answered: the worker was given something else to do."""
        self._requested = None

    def user_stopped(self) -> None:
        """The user stopped the work: the error of this picture is not requested again."""
        self._stopped, self._requested = self._estimate is None, None

    def receive(self, response: ErrorEstimated) -> None:
        """Take the response."""
        if response.id == self._requested and self._picture is not None:
            self._estimate, self._requested = response.estimate, None
            self._colours = response.colours
            if response.colours is None:  # maps are large, and are computed again
                self._estimates.append((self._picture, response.estimate))

    def receive_failure(self, id: int) -> None:
        """The estimate failed, and is not requested again."""
        if id == self._requested:
            self.user_stopped()
