"""Requests for one layer's transport or radiance at a time, of the transport that was requested last.

- The selected curve needs its layer's transport, the layer's other factor contracted with its present curve ("curve
  switching", [BenArtzi07, eq. 4.16]), in half or single floats; it is requested again when that other curve or the
  precision has changed. So are layers that share the curve (`edited_curves`).
- A layer that is not selected needs its radiance with its present curves: undo may have changed them, or it was
  selected before and is a sum in half floats since.

At most one contraction is under way, because a newer one cancels the older; the selected curve's goes first.

Rejected: a `Reconciler`, which knows one desired state and where its result comes from. Here what is desired is a state
for each layer, all of them share one place in the worker, and each may also come with a stage of the transport itself,
so that it is remembered by layer what was requested either way.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np

from app.document.document import Document, Selection
from app.messages.worker_messages import Request
from app.modes.placement.curves import Coefficients, Curves, Float64Array
from app.modes.placement.desired_state import (
    DesiredCurve,
    DesiredTransport,
    ReadyCurve,
    ReadyLayer,
    same_coefficients,
)
from app.modes.placement.edited_curves import EditedCurves, edited_layers
from app.modes.placement.placement_messages import ContractTransport, LayerPicture, LayerTransport
from app.modes.reconciler import SentRequest

CONTRACT_PATIENCE = 3.0


class ContractionController:
    """Requests contractions. ``send`` sends a request and returns its id.

    layers: the radiance that has come of each layer under the transport requested last. is_complete: whether all is
    there that document and selection desire.
    """

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._transport: DesiredTransport | None = None
        self._edited = EditedCurves()
        self.is_complete = False
        self._forget_answers({})

    def _forget_answers(self, staying: dict[str, ReadyLayer]) -> None:
        """Forget responses, except what is on screen of these layers."""
        self.layers = staying
        self._edited.forget_answers(staying)
        self._requested_pictures: dict[str, Coefficients] = {}
        self._under_way: SentRequest[DesiredCurve] | None = None

    def transport_requested(
        self, transport: DesiredTransport, curves: tuple[DesiredCurve, ...], staying: dict[str, ReadyLayer]
    ) -> tuple[str, ...]:
        """Other transport is being requested, and with it that of these curves; staying: the layers on screen that are
        a part of it. Returns the keys of the curves that need not come again."""
        self._transport, self._edited.desired = transport, curves
        self._forget_answers(staying)
        return tuple(curve.key for curve in curves if self._edited.has(curve, staying))

    def forget_requests(self) -> None:
        """Forget requests: they will not be answered."""
        self._under_way, self._requested_pictures = None, {}
        self._edited.forget_requested()

    def cancelled(self) -> None:
        """The user stopped the work."""
        self._under_way = None

    def edited(self) -> None:
        """The document or the selection changed: until the next update it is unknown whether anything is missing."""
        self.is_complete = False

    @property
    def is_under_way(self) -> bool:
        """Whether a response of the worker is due at any moment."""
        return self._under_way is not None

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(self, now: float, document: Document, curves: tuple[DesiredCurve, ...], revision: int) -> None:
        """Request what is missing of the transport of that revision."""
        edited = self._edited
        edited.desired = curves
        outdated = self._outdated_layers(document, [desired.key for desired in curves])
        self.is_complete = edited.has_all(self.layers) and not outdated and not self._waits(now)
        missing = [desired for desired in edited.missing(self.layers) if self._has_transport(document, desired)]
        under_way = None if self._under_way is None else self._under_way.desired
        if not missing:
            if not self._waits(now):
                self._request_picture(now, document, outdated, revision)
        elif not self._waits(now) or not any(desired.same_curve(under_way) for desired in curves):
            self._contract(missing[0], document, now, revision)

    def _has_transport(self, document: Document, desired: DesiredCurve) -> bool:
        """Whether the worker can hand out a curve's transport, as far as that was requested."""
        return self._can_contract(desired.key, self._curves.coefficients(document, desired.key))

    def _outdated_layers(self, document: Document, edited: Collection[str]) -> dict[str, Coefficients]:
        """The curves of those layers, except edited ones, whose radiance was made with other curves, or in half
        floats."""
        outdated: dict[str, Coefficients] = {}
        there = {key for key, _ in document.layers()}
        for key, shown in self.layers.items():
            if key not in there:  # a Fresnel term that was taken away: the requested transport is that of before
                continue
            wanted = self._curves.coefficients(document, key)
            is_same = same_coefficients(shown.coefficients, wanted)
            if is_same:
                shown.coefficients = wanted
            if key not in edited and (not is_same or shown.in_halves and self._can_contract(key, wanted)):
                outdated[key] = wanted
        return outdated

    def _request_picture(
        self, now: float, document: Document, outdated: Mapping[str, Coefficients], revision: int
    ) -> None:
        """Request the radiance of the first outdated layer that was not requested yet."""
        for key, wanted in outdated.items():
            requested = same_coefficients(self._requested_pictures.get(key, {}), wanted)
            if not requested and self._can_contract(key, wanted):
                self._requested_pictures[key] = wanted
                self._contract(DesiredCurve(key, None, {}), document, now, revision)
                return

    def _waits(self, now: float) -> bool:
        """Whether the response to a contraction is still worth waiting for."""
        return self._under_way is not None and now - self._under_way.sent_at < CONTRACT_PATIENCE

    def _contract(self, curve: DesiredCurve, document: Document, now: float, revision: int) -> None:
        if self._under_way is not None:  # it is replaced unanswered: request again what it was to bring
            self._requested_pictures.pop(self._under_way.desired.key, None)
            if self._under_way.desired.factor is not None:
                self._edited.withdraw(self._under_way.desired.key)
        wanted = self._curves.coefficients(document, curve.key)
        if curve.factor is not None:
            self._edited.note_request(curve)
        is_follower = curve.factor is not None and curve.key != self._edited.desired[0].key
        shown = self.layers.get(curve.key)
        new_picture = curve.factor is None or shown is None or not same_coefficients(shown.coefficients, wanted)
        state = self._curves.layer_state(document, curve.key)
        request = ContractTransport(state, curve.factor, curve.precision, new_picture, is_follower, revision=revision)
        self._under_way = SentRequest[DesiredCurve](self._send(request), curve, now)

    def _can_contract(self, key: str, wanted: Coefficients) -> bool:
        """Whether the requested transport is over the layer's present curves and bands."""
        shape = None if self._transport is None else self._transport.shape(key)
        return shape is not None and shape.takes(wanted)

    # -------------------------------------------------------------------------------------------------------- responses

    def receive_picture(self, response: LayerPicture) -> Coefficients:
        """Note a layer's radiance; returns the coefficients it was made with, by factor."""
        shape = None if self._transport is None else self._transport.shape(response.key)
        names = [] if shape is None else [name for name, _ in shape.bands]
        values = [np.asarray(made_with, dtype=np.float64) for made_with in response.coefficients]
        coefficients = dict(zip(names, values, strict=True))
        self.layers[response.key] = ReadyLayer(response.stage, coefficients)
        if same_coefficients(self._requested_pictures.get(response.key, {}), coefficients):
            del self._requested_pictures[response.key]
        under_way = self._under_way
        if under_way is not None and under_way.desired.factor is None and under_way.id == response.id:
            self._under_way = None
        return coefficients

    def receive_transport(self, response: LayerTransport, document: Document, selected: Selection | None) -> bool:
        """Note a curve's transport; returns whether it is that of a layer which follows the selected curve."""
        came = ReadyCurve(response.key, response.factor, response.stage, response.precision)
        under_way = None if self._under_way is None else self._under_way.desired
        if under_way is not None and under_way.same_curve(DesiredCurve(came.key, came.factor, {}, came.precision)):
            self._under_way = None
        is_selected = selected is not None and selected.factor == came.factor
        return self._edited.receive(came, edited_layers(document, selected) if is_selected else ())

    def finish_stage(self) -> None:
        """Note the end of a stage: what did not come with it, or came with older curves, is requested again."""
        self._edited.finish_stage(self.layers)
        self._requested_pictures = {}

    def receive_failure(self, id: int) -> None:
        """Note that a request failed: it is not repeated until it would be another one."""
        if self._under_way is not None and id == self._under_way.id:
            desired, self._under_way = self._under_way.desired, None
            if desired.factor is None and desired.key in self.layers:
                self.layers[desired.key].in_halves = False  # it stays as it is

    def rendered(self, key: str, factor: str, coefficients: Float64Array) -> None:
        """The renderer has updated a layer's picture to exactly these coefficients."""
        shown = self.layers.get(key)
        if shown is not None and self._edited.stage_of(key, factor) == shown.stage:
            shown.coefficients = {**shown.coefficients, factor: coefficients}
            shown.in_halves = self._edited.is_in_halves(key)
