"""Painting a highlight: a stroke over the picture becomes a change of the selected object's curves.

While the brush is held, few pixels are solved for and the answer follows it; once it is released, more of them. One
request is under way at a time, for the newest form of the stroke. A stroke changes the picture as it was at the press,
however often it is solved for: the answers replace each other. All of it is one step of the history, an answer that
comes after the release, too. A stroke waits until the picture shows all that there was before: another may begin before
the last answer to the one before it has come, or while the picture is still refined.

A stroke adds one operator to each curve that it changes. The next one on the same curve goes on with that operator,
until another edit comes in between: what is painted in one sitting is muted and moved together, and undone stroke by
stroke. A released stroke whose answer is still to come survives an edit that leaves its object, the light and all
shapes as they were: the answer is a step of its own, on the document as it is then. After any other edit it is dropped,
and one line says so.

Light that is reflected more than once does not change in proportion to a curve. So the finished picture is compared
with what was wanted, and where they differ the curve is solved for again, from where it is now.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.document.commands import EditCommand
from app.document.document import Document, ObjectState
from app.modes.mode import EditorServices
from app.modes.placement.curves import Curves
from app.modes.placement.highlight_stroke import HighlightStroke, PaintedOutcome
from app.modes.placement.inverse_messages import CurvesFitted, FitCurves
from app.modes.placement.painted_curves import (
    LEAST_ERROR,
    MOST_COMPARED,
    SMOOTHNESS,
    Solved,
    edit_of_changes,
    painted_layers,
    solved_curves,
    whole_change,
)
from engine.core.errors import InsituError
from engine.curve.tables import TabulatedCurve
from engine.inverse.highlight_brush import HighlightBrush, Place
from engine.material.layer import object_of
from engine.scene.picture_frame import PictureFrame

# The radiance (p, 3) of the points of an object, by its number, in the picture: linear, at intensity 1.
ReadPicture = Callable[[int], NDArray[np.floating]]


class _Sent(NamedTuple):
    """A request under way: its number, the transport that it is built on, the form of the stroke that it is of, and the
    points that decide."""

    id: int
    revision: int
    form: tuple[int, int]
    points: NDArray[np.integer]


@dataclass
class _WaitingStroke:
    """A stroke that waits for its picture: key and names as in `HighlightStroke`, the object's number, and where it
    went meanwhile."""

    brush: HighlightBrush
    key: str
    names: tuple[str, ...]
    i_object: int
    places: list[Place]
    is_held: bool = True


class HighlightController:
    """The strokes on highlights under one mode controller. curves: of the document's layers; outcome: of the last
    stroke, None before there is one, and after another edit."""

    def __init__(self, services: EditorServices, curves: Curves) -> None:
        self._services, self._curves = services, curves
        self._stroke: HighlightStroke | None = None
        self._waiting: list[_WaitingStroke] = []
        self._sent: _Sent | None = None
        self._known: Document | None = None  # as the last stroke began, or left it
        self._is_editing = False
        self._revision = 0  # of the transport requested last
        # The operators that strokes left, by layer and curve.
        self._left: dict[tuple[str, str], TabulatedCurve] = {}
        self.outcome: PaintedOutcome | None = None

    @property
    def is_busy(self) -> bool:
        """Whether the brush is held, or an answer is awaited."""
        return bool(self._waiting) or self._stroke is not None and not self.wants_picture

    @property
    def wants_picture(self) -> bool:
        """Whether the picture, once it is at rest, is to be compared with what was wanted."""
        stroke = self._stroke
        is_answered = stroke is not None and not stroke.is_held and self._sent is None and stroke.is_answered
        return is_answered and not self._waiting

    @property
    def can_go_on(self) -> bool:
        """Whether the next stroke is waiting for the picture of the document as it is now, see `go_on`."""
        return bool(self._waiting) and not self._is_finishing

    @property
    def _is_finishing(self) -> bool:
        """Whether the stroke was released, and its last form is still to be solved for."""
        stroke = self._stroke
        return stroke is not None and not stroke.is_held and not stroke.is_answered

    def forget(self) -> None:
        """Forget all strokes: another view is traced, the worker died, or another edit came in between."""
        self._stroke = self._sent = self.outcome = None
        self._waiting.clear()

    def edited(self, command: EditCommand | None = None) -> None:
        """The document or the selection has changed: by anyone else, the sitting is over. command: the user's edit,
        None for an undo and all that is none."""
        if self._is_editing:
            return
        self._left.clear()
        document, known = self._services.history.document, self._known
        if document is not known:
            awaited = self._stroke if self._is_finishing else None
            if command is not None and awaited is not None and known is not None and not awaited.n_compared:
                if _leaves(known, document, awaited.key):
                    # Its answer is no longer part of the last step.
                    self._known, awaited.is_recorded = document, False
                    self._waiting.clear()
                    return
                name = object_of(awaited.key)
                self._services.notify(
                    f"the stroke on {name} was dropped: an edit changed what it was painted on before it was solved for"
                )
            self.forget()
        elif not self._services.history.dragging:  # only the selection has changed, or a drag was taken back
            self._waiting = [each for each in self._waiting if not each.is_held]
            if self._stroke is None or self._stroke.is_held:
                self.forget()

    # ------------------------------------------------------------------------------------------------------- the stroke

    def begin(self, brush: HighlightBrush, solved: Solved, place: Place) -> None:
        """Press the brush at a place of the picture. Raises InsituError where the selection cannot be painted."""
        document = self._services.history.document
        key, names = solved_curves(document, self._services.view.selected, solved)
        names_seen = [each.name for each in self._services.pictured.objects]
        if object_of(key) not in names_seen or not document.is_visible(key):
            raise InsituError(f"{key} is not in the picture")
        if not self._waiting and not self._is_finishing:
            self.forget()
            self._known = self._services.history.document
        self._waiting.append(_WaitingStroke(brush, key, names, names_seen.index(object_of(key)), [place]))

    def go_on(self, read: ReadPicture, frame: PictureFrame) -> None:
        """Begin the stroke that waited in the picture of this frame, see `can_go_on`."""
        of, document = self._waiting.pop(0), self._services.history.document
        self._known = document
        seen, continued = read(of.i_object), dict(self._left)
        self._stroke = stroke = HighlightStroke(
            of.key, of.names, of.brush, document, frame, of.i_object, seen, of.places[0], document, continued
        )
        if len(of.places) > 1:
            stroke.extend(of.places[1:])
        stroke.is_held, self._sent = of.is_held, None

    def extend(self, places: Sequence[Place]) -> None:
        """Go on through places of the picture, from the last one on."""
        if self._waiting:
            if self._waiting[-1].is_held:
                self._waiting[-1].places += places
        elif self._stroke is not None and self._stroke.is_held and places:
            self._stroke.extend(places)

    def end(self) -> None:
        """Release the brush: the stroke is solved for as far as it is to be."""
        held = self._waiting[-1] if self._waiting else self._stroke
        if held is not None:
            held.is_held = False

    def update(self, revision: int) -> None:
        """Request what is missing; once a frame. revision: of the transport requested last, which makes requests that
        are built on the one before void."""
        stroke, sent, self._revision = self._stroke, self._sent, revision
        if stroke is None:
            return
        if sent is not None and sent.revision != revision:
            self._sent = sent = None
            if stroke.n_compared:  # the picture that was compared is void as well
                self._stroke = None
                return
        if sent is not None or stroke.is_answered or stroke.n_compared:
            return
        if stroke.touched().size:
            self._request(stroke, stroke.seen)
        elif not stroke.is_held:
            self._stroke = None  # it touched nothing

    def compare(self, read: ReadPicture) -> None:
        """Compare the picture at rest with what was wanted, see `wants_picture`."""
        stroke, outcome = self._stroke, self.outcome
        assert stroke is not None and outcome is not None
        now, decided = read(stroke.i_object), stroke.decided
        wanted = stroke.wanted(decided)
        left = np.nan_to_num(wanted - now[decided], posinf=0.0, neginf=0.0)  # what is not finite decides nothing
        off = left - outcome.missing
        if stroke.n_compared >= MOST_COMPARED or _norm(off) <= LEAST_ERROR * _norm(wanted - stroke.seen[decided]):
            self.outcome, self._stroke = stroke.outcome(left), None
            return
        stroke.n_compared += 1
        stroke.base, stroke.base_change = self._services.history.document, stroke.change
        self._request(stroke, now)

    def _request(self, stroke: HighlightStroke, picture: NDArray[np.floating]) -> None:
        """Ask the worker for a change of the curves of the stroke's base, where its object's points show `picture`
        (p, 3)."""
        touched = stroke.touched()
        points = stroke.points(touched)
        pictured = self._services.with_nodes(stroke.base)
        keys = painted_layers(pictured, stroke.key, stroke.names)
        layers = tuple(self._curves.layer_state(pictured, key) for key in keys)
        request = FitCurves(
            layers, stroke.names, points, picture[points], stroke.wanted(points), touched, SMOOTHNESS,
            stroke.brush.hold, stroke.brush.keeps_hues,
        )  # fmt: skip
        self._sent = _Sent(self._services.send(request), self._revision, stroke.form, points)

    # -------------------------------------------------------------------------------------------------------- responses

    def receive(self, response: CurvesFitted) -> None:
        """Put an answer in place of the one before."""
        stroke, sent = self._stroke, self._sent
        if stroke is None or sent is None or response.id != sent.id:
            return
        self._sent = None
        stroke.note_answer(sent.form, sent.points)
        base = stroke.base_change
        stroke.change = {name: whole_change(name, base.get(name), fit.change) for name, fit in response.fits.items()}
        self.outcome = stroke.outcome(response.left)
        self._edit(stroke)

    def receive_failure(self, id: int) -> None:
        """A request failed: the stroke that waited for it ends."""
        if self._sent is not None and id == self._sent.id:
            self._stroke = self._sent = self.outcome = None

    def _edit(self, stroke: HighlightStroke) -> None:
        """Give the document the curves of the last answer: in the step of the stroke's drag, or in that step after its
        end, and before the drag of a stroke that waits."""
        history = self._services.history
        continued = {name: operator for (key, name), operator in stroke.continued.items() if key == stroke.key}
        command, left = edit_of_changes(stroke.key, stroke.before.layer(stroke.key), stroke.change, continued)
        self._is_editing = True
        try:
            with contextlib.nullcontext() if stroke.is_held else history.before_drag():
                if stroke.is_recorded and not history.dragging:
                    history.apply_unrecorded(command)
                else:
                    stroke.is_recorded |= history.do(command)
            self._services.document_changed()
        finally:
            self._is_editing = False
        self._left = {(stroke.key, name): operator for name, operator in left.items()}
        self._known = history.document


def _leaves(before: Document, now: Document, key: str) -> bool:
    """Whether an edit leaves what a stroke on a layer was painted on: its object, the light, and all shapes."""
    name = object_of(key)

    def seen(document: Document) -> list[ObjectState]:
        return [each if each.name == name else replace(each, layers=()) for each in document.objects]

    return before.light == now.light and seen(before) == seen(now)


def _norm(radiance: NDArray[np.floating]) -> float:
    return float(np.linalg.norm(radiance))
