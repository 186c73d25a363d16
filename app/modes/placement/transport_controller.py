"""Requests for transport once the user is idle, and for one curve's transport after each change of the selection.

Once a frame ``update`` compares what the document and the selection desire with what the worker has delivered and was
last asked for, and requests the difference. Because it compares states instead of following events, it is also right
after an undo, a crash, or a selection that changed during a computation.

- Where emitters are the only light, and all become brighter by one factor, the picture is multiplied (`light_gain`). -
Light, quotient parameters, bands and the number of lights determine the transport; of fixed objects the curves do as
  well. When they change, transport is requested anew once the user is idle: at the end of a drag, or when nothing has
  changed for a quarter of a second; the worker computes what it does not have. While an environment is being rotated,
  or an emitter dimmed, drag-quality transport is requested at once, one request at a time.
- The selected curve needs its layer's transport, the layer's other factor contracted with its present curve ("curve
  switching", [BenArtzi07, eq. 4.16]), in half or single floats; it is requested again when that other curve or the
  precision has changed. So are layers that share the curve (`edited_curves`).
- A layer that is not selected needs its radiance with its present curves: undo may have changed them.

At most one contraction is under way, because a newer one cancels the older; the selected curve's goes first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from app.document.commands.light import emission_of
from app.document.document import SCENE_ENVIRONMENT, Document, LightState, Selection
from app.messages.worker_messages import Request, RequestFailed
from app.modes.placement.curves import Coefficients, Curves, Float64Array, picture_identity
from app.modes.placement.desired_state import (
    DesiredCurve,
    DesiredTransport,
    PendingContraction,
    ReadyCurve,
    ReadyLayer,
    TransportShape,
    brightening_factors,
    desired_transport,
    same_coefficients,
)
from app.modes.placement.edited_curves import EditedCurves, desired_curves, edited_layers
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    LayerPicture,
    LayerTransport,
    StageDone,
)
from engine.planner import Precision, RenderSettings

IDLE_SECONDS = 0.25
CONTRACT_PATIENCE = 3.0
N_LIGHTS_PREVIEW = 400
FINAL_STAGE = "final"


class TransportController:
    """Requests transport for one scene. ``send`` sends a request and returns its id."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self.revision = 0
        self._send = send
        self._curves = curves
        self.is_open = False
        self._has_sky = True
        self._precision: Precision = "half"
        self._forget()

    def _forget(self) -> None:
        self._desired: DesiredTransport | None = None
        self._desired_since = -math.inf
        self._desired_inputs: tuple[Document, RenderSettings] | None = None
        self._requested: DesiredTransport | None = None
        self._requested_document: Document | None = None
        self._becoming_editable: tuple[str, ...] = ()
        self._drag_quality = False
        self._transport_id: int | None = None
        self._running = False
        self._exact = False
        self.has_stage = False  # of the transport requested last
        self._complete = False
        self._released = self._stopped = False
        self._made_for: tuple[Document, RenderSettings] | None = None
        self._light_gain = np.ones(3)
        self.emitters_are_all = False
        self._is_fine = False
        self._edited = EditedCurves()
        self._forget_answers({})

    def _forget_answers(self, staying: dict[str, ReadyLayer]) -> None:
        """Forget responses, except what is on screen of these layers."""
        self._layers = staying
        self._edited.forget_answers(staying)
        self._requested_pictures: dict[str, Coefficients] = {}
        self._contraction: PendingContraction | None = None

    # --------------------------------------------------------------------------------------------- events of the editor

    def scene_closed(self) -> None:
        """Another scene is being opened: request nothing meanwhile."""
        self.is_open = False

    def scene_opened(self, is_new: bool = True, has_sky: bool = True) -> None:
        """The worker has a scene open, a new one (``has_sky``: its own environment lights it) or (``is_new`` False)
        still the one before.

        Requests for the one before were given up for the scene that could not be opened.
        """
        self.is_open = True
        if is_new:
            self._has_sky = has_sky
            self._forget()
        elif self._running:
            self.resume()
        else:
            self._forget_requests()

    def edited(self) -> None:
        """The document or the selection changed: until the next update it is unknown whether anything is missing."""
        self._complete = False

    def hand_released(self) -> None:
        """A drag ended: what waits for the idle time need wait no longer."""
        self._released = True

    def cancelled(self) -> None:
        """The user stopped the work; what has come stays, the next change of the light or a quotient requests anew."""
        self._stopped = True
        self._running = False
        self._contraction = None

    def worker_restarted(self) -> None:
        """A new worker starts the request over; its first stages are no longer the final picture."""
        self._running, self._exact = self._requested is not None, False
        self._forget_requests()

    def _forget_requests(self) -> None:
        """Forget other requests: they will not be answered."""
        self._contraction, self._requested_pictures = None, {}
        self._edited.forget_requested()

    def resume(self) -> None:
        """Request again what was cancelled or failed; responses to the old request are void."""
        self._requested, self._stopped = None, False
        self.revision += 1

    def rendered(self, key: str, factor: str, coefficients: Float64Array) -> None:
        """The renderer has updated a layer's picture to exactly these coefficients."""
        shown = self._layers.get(key)
        if shown is not None and self._edited.stage_of(key, factor) == shown.stage:
            shown.coefficients = {**shown.coefficients, factor: coefficients}

    # ------------------------------------------------------------------------------------------------------ state shown

    @property
    def transport_is_current(self) -> bool:
        """Whether the requested transport is that of the document as it is."""
        return self._requested is not None and self._requested == self._desired and not self._drag_quality

    @property
    def light_is_current(self) -> bool:
        """Whether the light of the requested transport is the document's."""
        return self._requested is not None and self._desired is not None and self._desired.lights_like(self._requested)

    @property
    def light_gain(self) -> Float64Array:
        """How much brighter (3,) the light is than in the requested transport: it is linear in the only emitters."""
        return self._light_gain

    @property
    def drag_quality(self) -> bool:
        """Whether the last request was for a quick picture of a dragged light."""
        return self._drag_quality

    @property
    def requested_light(self) -> LightState | None:
        """The light of the transport requested last, at intensity 1."""
        return None if self._requested is None else self._requested.light

    @property
    def requested(self) -> tuple[DesiredTransport, Document] | None:
        """The transport requested last, and its document."""
        return (
            None
            if self._requested is None or self._requested_document is None
            else (self._requested, self._requested_document)
        )

    @property
    def received(self) -> Collection[str]:
        """Keys of the layers whose radiance is that of the transport requested last."""
        return self._layers.keys()

    def serves(self, document: Document, like: Document, settings: RenderSettings) -> bool:
        """Whether the transport requested last would draw another document of the same models as ``like``."""
        models = [(key, layer.model) for key, layer in document.layers()]
        if self._requested is None or models != [(key, layer.model) for key, layer in like.layers()]:
            return False
        desired = desired_transport(document, settings, self._curves)
        lit_alike = desired.emission == emission_of(like)
        return lit_alike and replace(desired, emission=self._requested.emission) == self._requested

    def requested_bands(self, key: str) -> dict[str, int] | None:
        """J of each factor of a layer in the transport requested last; None where there is none of it."""
        shape = self._requested_shape(key)
        return None if shape is None else dict(shape.bands)

    def picture_identity(self, key: str) -> tuple[object, ...]:
        """The identity of a layer's f_q and curves in the transport requested last."""
        shape = self._requested_shape(key)
        return () if shape is None else picture_identity(shape.model, shape.quotient_parameters)

    def is_transport(self, id: int) -> bool:
        """Whether this is the number of the transport requested last."""
        return id == self._transport_id

    @property
    def requested_rotation(self) -> float | None:
        """The rotation (degrees) in the transport requested last; None where no environment lights the scene."""
        if self._requested is None or self._requested.light.environment == SCENE_ENVIRONMENT and not self._has_sky:
            return None
        return self._requested.light.rotation

    @property
    def has_sky(self) -> bool:
        """Whether an environment lights the scene in the transport requested last."""
        return self.requested_rotation is not None

    @property
    def running(self) -> bool:
        """Whether the worker is computing requested transport."""
        return self._running

    @property
    def awaits_contraction(self) -> bool:
        """Whether a response of the worker is due at any moment."""
        return self._contraction is not None

    @property
    def delivered_final(self) -> bool:
        """Whether the transport requested last has come in its final quality."""
        return self._exact

    @property
    def finished(self) -> bool:
        """Whether all that the document and the selection desire has been delivered in its final quality."""
        return self.transport_is_current and self._exact and self._complete

    @property
    def quotient_is_current(self) -> bool:
        """Whether the quotients in the requested transport are those of the document's parameters."""
        if self._requested is None or self._desired is None:
            return False
        return all(shape.has_quotient_of(self._requested.shape(shape.key)) for shape in self._desired.layers)

    @property
    def fixed_is_current(self) -> bool:
        """Whether the requested transport has the curves of the fixed objects as they are."""
        if self._requested is None or self._desired is None:
            return False
        return all(shape.looks_like(self._requested.shape(shape.key)) for shape in self._desired.layers)

    @property
    def shows_final(self) -> bool:
        """Whether what is on screen is the document's picture in final quality, though bands of it may be missing."""
        if self._requested is None or self._desired is None or self._drag_quality:
            return False
        shown = [self._layers.get(key) for key in self._desired.alike(self._requested)]
        finals = [layer for layer in shown if layer is not None and layer.stage == FINAL_STAGE]
        return bool(finals) and len(finals) == len(self._desired.layers)

    @property
    def requested_layers(self) -> tuple[TransportShape, ...]:
        """The layers in the transport requested last."""
        return () if self._requested is None else self._requested.layers

    @property
    def becoming_editable(self) -> tuple[str, ...]:
        """Keys of the layers whose picture stays while their bands are computed."""
        return self._becoming_editable if self._running else ()

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(
        self, now: float, document: Document, selected: Selection | None, settings: RenderSettings, dragging: bool,
        precision: Precision = "half", planned: bool = True, is_fine: bool = False,
    ) -> None:  # fmt: skip
        """Request what is missing; ``now`` in seconds of any steady clock. planned: whether the bands of all layers are
        known; until they are, nothing is requested. is_fine: whether all that is on screen is of the last stage."""
        if not self.is_open:
            return
        self._is_fine = is_fine
        self._precision = precision
        made_for = (document, settings)
        self._stopped = self._stopped and made_for == self._made_for
        self._made_for = made_for
        desired = self._desired_transport(document, settings)
        if desired != self._desired:
            self._desired_since = -math.inf if self._desired is None else now
            self._desired = desired
        if not planned:
            self._desired_inputs = None
            return
        self._request_transport(desired, now, document, selected, dragging)
        self._released = False
        if not self._drag_quality:
            self._edited.desired = desired_curves(document, selected, self._curves, self._precision)
            self._request_contraction(now, document)

    def _request_transport(
        self, desired: DesiredTransport, now: float, document: Document, selected: Selection | None, dragging: bool
    ) -> None:
        if self.transport_is_current or self._stopped:
            return
        requested = self._requested
        if requested is None or self._released or now - self._desired_since >= IDLE_SECONDS:
            self._compute(desired, document, selected)
        elif dragging and desired.moved_from(requested) and not (self._drag_quality and self._running):
            self._compute(desired, document, selected, is_drag=True)

    def _compute(
        self, desired: DesiredTransport, document: Document, selected: Selection | None, is_drag: bool = False
    ) -> None:
        self._edited.desired = curves = desired_curves(document, selected, self._curves, self._precision)
        staying = self._staying(desired, is_drag)
        was_fixed = [shape.key for shape in self.requested_layers if shape.is_fixed and shape.key in staying]
        is_fine = (
            self._is_fine and self._requested is not None and desired.can_mix_with(self._requested) and not is_drag
        )
        self.revision += 1
        self._requested, self._drag_quality, self._running, self._exact = desired, is_drag, True, False
        self._requested_document, self.has_stage = document, False
        self._forget_answers(staying)
        self._becoming_editable = tuple(s.key for s in desired.layers if s.key in was_fixed and not s.is_fixed)
        request = ComputeTransport(
            replace(self._curves.scene_state(document), emission=desired.emission),
            curves[0].key if curves else None,
            curves[0].factor if curves else None,
            min(N_LIGHTS_PREVIEW, desired.settings.n_lights),
            desired.settings,
            self._precision,
            tuple(curve.key for curve in curves[1:]),
            is_drag,
            tuple(staying),
            tuple(curve.key for curve in curves if self._edited.has(curve, staying)),
            is_fine,
            revision=self.revision,
        )
        self._transport_id = self._send(request)

    def _staying(self, desired: DesiredTransport, is_drag: bool) -> dict[str, ReadyLayer]:
        """What is on screen and is the picture of what is desired: the worker goes on from there."""
        if self._requested is None or self._drag_quality or is_drag:
            return {}
        alike = desired.alike(self._requested)
        return {key: shown for key, shown in self._layers.items() if key in alike}

    def _request_contraction(self, now: float, document: Document) -> None:
        edited = self._edited
        outdated = self._outdated_layers(document, [desired.key for desired in edited.desired])
        self._complete = edited.has_all(self._layers) and not outdated and not self._waits(now)
        missing = [desired for desired in edited.missing(self._layers) if self._has_transport(document, desired)]
        if not missing:
            if not self._waits(now):
                self._request_picture(now, document, outdated)
            return
        under_way = None if self._contraction is None else self._contraction.desired
        if not self._waits(now) or not any(desired.same_curve(under_way) for desired in edited.desired):
            self._contract(missing[0], document, now)

    def _has_transport(self, document: Document, desired: DesiredCurve) -> bool:
        """Whether the worker can hand out a curve's transport, as far as that was requested."""
        return self._can_contract(desired.key, self._curves.coefficients(document, desired.key))

    def _outdated_layers(self, document: Document, edited: Collection[str]) -> dict[str, Coefficients]:
        """The curves of those layers, except edited ones, whose radiance was made with other curves."""
        outdated: dict[str, Coefficients] = {}
        there = {key for key, _ in document.layers()}
        for key, shown in self._layers.items():
            if key not in there:  # a Fresnel term that was taken away: the requested transport is that of before
                continue
            wanted = self._curves.coefficients(document, key)
            if same_coefficients(shown.coefficients, wanted):
                shown.coefficients = wanted
            elif key not in edited:
                outdated[key] = wanted
        return outdated

    def _request_picture(self, now: float, document: Document, outdated: Mapping[str, Coefficients]) -> None:
        """Request the radiance of the first outdated layer that was not requested yet."""
        for key, wanted in outdated.items():
            requested = same_coefficients(self._requested_pictures.get(key, {}), wanted)
            if not requested and self._can_contract(key, wanted):
                self._requested_pictures[key] = wanted
                self._contract(DesiredCurve(key, None, {}), document, now)
                return

    def _waits(self, now: float) -> bool:
        """Whether the response to a contraction is still worth waiting for."""
        return self._contraction is not None and now - self._contraction.sent_at < CONTRACT_PATIENCE

    def _contract(self, curve: DesiredCurve, document: Document, now: float) -> None:
        if self._contraction is not None:  # it is replaced unanswered: request again what it was to bring
            self._requested_pictures.pop(self._contraction.desired.key, None)
            if self._contraction.desired.factor is not None:
                self._edited.withdraw(self._contraction.desired.key)
        wanted = self._curves.coefficients(document, curve.key)
        if curve.factor is not None:
            self._edited.note_request(curve)
        is_follower = curve.factor is not None and curve.key != self._edited.desired[0].key
        shown = self._layers.get(curve.key)
        new_picture = curve.factor is None or shown is None or not same_coefficients(shown.coefficients, wanted)
        state = self._curves.layer_state(document, curve.key)
        request = ContractTransport(
            state, curve.factor, curve.precision, new_picture, is_follower, revision=self.revision
        )
        self._contraction = PendingContraction(self._send(request), curve, now)

    def _requested_shape(self, key: str) -> TransportShape | None:
        """The requested shape of a layer's transport: its model may have changed since."""
        return None if self._requested is None else self._requested.shape(key)

    def _can_contract(self, key: str, wanted: Coefficients) -> bool:
        """Whether the requested transport is over the layer's present curves and bands."""
        shape = self._requested_shape(key)
        return shape is not None and shape.takes(wanted)

    def _desired_transport(self, document: Document, settings: RenderSettings) -> DesiredTransport:
        made_of = (document, settings)
        if self._desired is not None and self._desired_inputs == made_of:
            return self._desired
        self._desired_inputs = made_of
        return self._with_requested_emission(desired_transport(*made_of, self._curves))

    def _with_requested_emission(self, desired: DesiredTransport) -> DesiredTransport:
        """The same with the requested emission, where all the light has only become brighter."""
        self.emitters_are_all = not self._has_sky and desired.light.environment == SCENE_ENVIRONMENT
        known = self._requested.emission if self.emitters_are_all and self._requested is not None else ()
        factors = brightening_factors(desired.emission, known)
        self._light_gain = np.ones(3) if factors is None else factors
        return desired if factors is None else replace(desired, emission=known)

    # -------------------------------------------------------------------------------------------------------- responses

    def receive_bounces(self, n_bounces: int) -> None:
        """Note that the worker goes on with as many bounces as it found that the scene requires."""
        if self._requested is not None:
            self._requested = replace(self._requested, settings=replace(self._requested.settings, n_bounces=n_bounces))
        if self._made_for is not None:
            document, settings = self._made_for  # not chosen by the user: what was stopped stays so
            self._made_for = document, replace(settings, n_bounces=n_bounces)

    def receive_picture(self, response: LayerPicture) -> Coefficients:
        """Note a layer's radiance; returns the coefficients it was made with, by factor."""
        shape = self._requested_shape(response.key)
        names = [] if shape is None else [name for name, _ in shape.bands]
        values = [np.asarray(made_with, dtype=np.float64) for made_with in response.coefficients]
        coefficients = dict(zip(names, values, strict=True))
        self._layers[response.key] = ReadyLayer(response.stage, coefficients)
        under_way = self._contraction
        if under_way is not None and under_way.desired.factor is None and under_way.id == response.id:
            self._contraction = None
        return coefficients

    def receive_transport(self, response: LayerTransport, document: Document, selected: Selection | None) -> bool:
        """Note a curve's transport; returns whether it is that of a layer which follows the selected curve."""
        came = ReadyCurve(response.key, response.factor, response.stage, response.precision)
        under_way = None if self._contraction is None else self._contraction.desired
        if under_way is not None and under_way.same_curve(DesiredCurve(came.key, came.factor, {}, came.precision)):
            self._contraction = None
        is_selected = selected is not None and selected.factor == came.factor
        return self._edited.receive(came, edited_layers(document, selected) if is_selected else ())

    def receive_stage(self, response: StageDone) -> None:
        """Note the end of a stage: what did not come with it, or came with older curves, is requested again."""
        self._edited.finish_stage(self._layers)
        self._requested_pictures, self.has_stage = {}, True
        if response.id == self._transport_id and response.exact:
            self._running, self._exact = False, not self._drag_quality

    def receive_failure(self, response: RequestFailed) -> None:
        """Note that a request failed: it is not repeated until it would be another one."""
        if response.id == self._transport_id:
            self._running = False
        if self._contraction is not None and response.id == self._contraction.id:
            self._contraction = None
