"""How far off the picture is, asked of the worker when nothing else is left to do.

It is asked once the picture has all that was asked for and the hand has rested for a while, and what was asked for is
given up as soon as the picture is to be another: an edit has the processors to itself. What was told is remembered for
undo.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.document import Document
from app.messages import CancelRequests, Request
from app.placement.curves import Curves
from app.placement.messages import ErrorEstimated, EstimateError
from app.view_state import ViewState
from engine.render.picture_error import ErrorEstimate

REST_SECONDS = 0.5
MOST_KNOWN = 32


@dataclass(frozen=True, eq=False)
class _Picture:
    """A picture at rest: of a document, and how much of what the view has it made with."""

    document: Document
    made_with: tuple[int | None, ...]

    def is_same(self, other: _Picture | None) -> bool:
        """Whether it is of the very same document: those that undo comes back to are."""
        return other is not None and self.document is other.document and self.made_with == other.made_with


class ErrorTalk:
    """The talk with the worker about the error of the picture that is shown. ``send`` hands a request over."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._picture: _Picture | None = None
        self._revision = 0
        self._known: deque[tuple[_Picture, ErrorEstimate]] = deque(maxlen=MOST_KNOWN)
        self._rests_since = math.inf
        self._estimate: ErrorEstimate | None = None
        self._colours: NDArray[np.uint8] | None = None
        self._asked: int | None = None
        self._stopped = False

    def estimate_of(self, document: Document) -> ErrorEstimate | None:
        """What was told of the picture of this document; None while that is not known."""
        return self._estimate if self._picture is not None and document is self._picture.document else None

    def colours_of(self, document: Document) -> NDArray[np.uint8] | None:
        """Where it is off, see `ErrorEstimated`; None while that is not known."""
        return None if self.estimate_of(document) is None else self._colours

    def update(self, now: float, document: Document, view: ViewState, revision: int, rests: bool) -> None:
        """Ask where it is time to. revision: of the transport that the picture is made with; rests: whether nothing of
        the picture is left to come, and no hand has hold of anything."""
        knobs = view.n_lights, view.n_patches, view.n_bounces, view.second_bands
        picture = _Picture(document, (*knobs, view.shows_error))
        if not picture.is_same(self._picture) or revision != self._revision:
            self._give_up()
            self._picture, self._revision = picture, revision
            self._estimate = next((estimate for known, estimate in self._known if picture.is_same(known)), None)
        if not rests or self._estimate is not None or self._asked is not None or self._stopped:
            self._rests_since = math.inf
            return
        self._rests_since = min(self._rests_since, now)
        if now - self._rests_since >= REST_SECONDS:
            wanted = EstimateError(
                self._curves.scene_state(document), view.second_bands, view.shows_error, revision=revision
            )
            self._asked = self._send(wanted)

    def forget(self) -> None:
        """All pictures are others, or no longer known."""
        self._give_up()
        self._known.clear()

    def _give_up(self) -> None:
        """The picture is another one: an answer that is still to come is given up."""
        if self._asked is not None:
            self._send(CancelRequests(of=(EstimateError,)))
        self._estimate = self._asked = self._colours = None
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
        if response.id == self._asked and self._picture is not None:
            self._estimate, self._asked = response.estimate, None
            self._colours = response.colours
            if response.colours is None:  # maps are large, and are found again
                self._known.append((self._picture, response.estimate))

    def took_failure(self, id: int) -> None:
        """It could not be found out, and is not asked for again."""
        if id == self._asked:
            self.stopped()
