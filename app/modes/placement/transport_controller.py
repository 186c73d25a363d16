"""Requests for transport once the user is idle. Once a frame ``update`` says what the document desires, and requests it
where the `Reconciler` finds it missing.

- Where emitters are the only light, and all become brighter by one factor, the picture is multiplied (`light_gain`).
- Light, quotient parameters, bands and the number of lights determine the transport; of fixed objects the curves do as
  well. When they change, transport is requested anew once the user is idle: at the end of a drag, or when nothing has
  changed for a quarter of a second; the worker computes what it does not have. While an environment is being rotated,
  or an emitter dimmed, drag-quality transport is requested at once, one request at a time.

What is left to request of one layer or curve under this transport is `contraction_controller`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from app.document.document import Document, Selection
from app.document.light_mix import emission_of
from app.document.light_state import LightState
from app.messages.worker_messages import Request, RequestFailed
from app.modes.placement.contraction_controller import ContractionController
from app.modes.placement.curves import Curves, Float64Array, picture_identity
from app.modes.placement.desired_state import (
    DesiredCurve,
    DesiredTransport,
    ReadyLayer,
    TransportShape,
    brightening_factors,
    desired_transport,
)
from app.modes.placement.edited_curves import desired_curves
from app.modes.placement.placement_messages import ComputeTransport, StageDone
from app.modes.reconciler import Reconciler
from engine.realtime.zonal_harmonics.pose import Poses
from engine.settings import Precision, RenderSettings

IDLE_SECONDS = 0.25
# Seconds for which a quick picture of a light that has stopped moving is worth waiting for.
QUICK_PATIENCE = 0.5
N_LIGHTS_PREVIEW = 400
FINAL_STAGE = "final"
WHOLE_STAGES = ("relit", "preview", FINAL_STAGE)


class TransportController:
    """Requests transport for one scene. ``send`` sends a request and returns its id.

    revision: counts requests; `contractions` requests what is left under the newest. has_stage: whether a stage of that
    has come; emitters_are_all: whether emitters are the only light.
    """

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self.revision = 0
        self._send, self._curves = send, curves
        self.is_open, self._has_sky = False, True
        # What is ready is the transport in its last stage; the stages before are in `contractions.layers`.
        self._reconciler = Reconciler[DesiredTransport, StageDone](IDLE_SECONDS, replaces=True)
        self._forget()

    def _forget(self) -> None:
        self._reconciler.clear()
        self.contractions = ContractionController(self._send, self._curves)
        self._desired_inputs: tuple[Document, RenderSettings] | None = None
        self._requested_document: Document | None = None
        self._becoming_editable: tuple[str, ...] = ()
        self.has_stage = False
        self._light_gain = np.ones(3)
        self.emitters_are_all = False

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
        elif self.running:
            self.resume()
        else:
            self.contractions.forget_requests()

    def edited(self) -> None:
        """The document or the selection changed: until the next update it is unknown whether anything is missing."""
        self.contractions.edited()

    def hand_released(self) -> None:
        """A drag ended: what waits for the idle time need wait no longer."""
        self._reconciler.skip_idle()

    def cancelled(self) -> None:
        """The user stopped the work; what has come stays, the next change of the light or a quotient requests anew."""
        self._reconciler.stop()
        self.contractions.cancelled()

    def worker_restarted(self) -> None:
        """A new worker starts the request over; its first stages are no longer the final picture."""
        self._reconciler.resent()
        self.contractions.forget_requests()

    def resume(self) -> None:
        """Request again what was cancelled or failed; responses to the old request are void."""
        self._reconciler.restart()
        self.revision += 1

    # ------------------------------------------------------------------------------------------------------ state shown

    @property
    def _desired(self) -> DesiredTransport | None:
        return self._reconciler.desired

    @property
    def _requested(self) -> DesiredTransport | None:
        return None if self._reconciler.requested is None else self._reconciler.requested.desired

    @property
    def requested(self) -> tuple[DesiredTransport, Document] | None:
        """The transport requested last, and its document."""
        if self._requested is None or self._requested_document is None:
            return None
        return self._requested, self._requested_document

    @property
    def drag_quality(self) -> bool:
        """Whether the last request was for a quick picture of a dragged light."""
        return self._requested is not None and self._requested.is_drag

    @property
    def running(self) -> bool:
        """Whether the worker is computing requested transport."""
        return self._reconciler.is_under_way

    @property
    def transport_is_current(self) -> bool:
        """Whether the requested transport is that of the document as it is."""
        return self._requested is not None and self._requested == self._desired

    @property
    def light_is_current(self) -> bool:
        """Whether the light of the requested transport is the document's."""
        return self._requested is not None and self._desired is not None and self._desired.lights_like(self._requested)

    @property
    def light_gain(self) -> Float64Array:
        """How much brighter (3,) the light is than in the requested transport: it is linear in the only emitters."""
        return self._light_gain

    @property
    def requested_light(self) -> LightState | None:
        """The light of the transport requested last, at intensity 1."""
        return None if self._requested is None else self._requested.light

    @property
    def received(self) -> Collection[str]:
        """Keys of the layers whose radiance is that of the transport requested last."""
        return self.contractions.layers.keys()

    def serves(self, document: Document, like: Document, settings: RenderSettings) -> bool:
        """Whether the transport requested last would draw another document of the same models as ``like``."""
        models = [(key, layer.model) for key, layer in document.layers()]
        if self._requested is None or models != [(key, layer.model) for key, layer in like.layers()]:
            return False
        requested, desired = self._requested, desired_transport(document, settings, self._curves)
        lit_alike = desired.emission == emission_of(like)
        return lit_alike and replace(desired, emission=requested.emission, is_drag=requested.is_drag) == requested

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
        return self._reconciler.requested is not None and id == self._reconciler.requested.id

    @property
    def requested_rotation(self) -> float | None:
        """The rotation (degrees) in the transport requested last; None where no environment lights the scene."""
        if self._requested is None or not self._requested.light.has_sky(self._has_sky):
            return None
        return self._requested.light.rotation

    @property
    def has_sky(self) -> bool:
        """Whether an environment lights the scene in the transport requested last."""
        return self.requested_rotation is not None

    @property
    def delivered_final(self) -> bool:
        """Whether the transport requested last has come in its final quality."""
        return self._reconciler.ready_for is not None and not self._reconciler.ready_for.is_drag

    @property
    def finished(self) -> bool:
        """Whether all that the document and the selection desire has been delivered in its final quality."""
        return self.transport_is_current and self.delivered_final and self.contractions.is_complete

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
        if self._requested is None or self._desired is None or self.drag_quality:
            return False
        shown = [self.contractions.layers.get(key) for key in self._desired.alike(self._requested)]
        finals = [layer for layer in shown if layer is not None and layer.stage == FINAL_STAGE]
        return bool(finals) and len(finals) == len(self._desired.layers)

    @property
    def requested_layers(self) -> tuple[TransportShape, ...]:
        """The layers in the transport requested last."""
        return () if self._requested is None else self._requested.layers

    @property
    def becoming_editable(self) -> tuple[str, ...]:
        """Keys of the layers whose picture stays while their bands are computed."""
        return self._becoming_editable if self.running else ()

    def _requested_shape(self, key: str) -> TransportShape | None:
        """The requested shape of a layer's transport: its model may have changed since."""
        return None if self._requested is None else self._requested.shape(key)

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(
        self, now: float, document: Document, selected: Selection | None, settings: RenderSettings, dragging: bool,
        precision: Precision = "half", planned: bool = True, is_fine: bool = False, lamps: Poses = (),
    ) -> None:  # fmt: skip
        """Request what is missing; ``now`` in seconds of any steady clock. planned: whether the bands of all layers are
        known; until they are, nothing is requested. is_fine: whether all that is on screen is of the last stage. lamps:
        where a hand has emitters, as far as the view has them elsewhere: of that view nothing else is requested."""
        if not self.is_open:
            return
        reconciler, desired = self._reconciler, self._desired_transport(document, settings)
        reconciler.desire(now, desired)
        if not planned:
            self._desired_inputs = None
            return
        curves = desired_curves(document, selected, self._curves, precision)
        if self._requested is None:
            reconciler.skip_idle()
        is_due = reconciler.action(now) == "request"
        dragged = replace(desired, is_drag=True, lamps=lamps)
        if dragging and self._is_drag_due(dragged):
            self._compute(now, dragged, document, curves, precision, is_fine=False)
        elif is_due and not lamps and not (dragging and self._awaits_quick_picture(now)):
            self._compute(now, desired, document, curves, precision, is_fine)
        if not self.drag_quality:
            self.contractions.update(now, document, curves, self.revision)

    def _is_drag_due(self, desired: DesiredTransport) -> bool:
        """Whether a dragged light is to have another quick picture: one at a time."""
        if self._requested is None or self._reconciler.is_refused or self.drag_quality and self.running:
            return False
        if self._requested.lamps and not desired.lamps:  # back where they were: that picture is there
            return False
        if desired.lamps and not (self.drag_quality or self._has_whole_pictures):
            return False
        return desired.moved_from(self._requested)

    @property
    def _has_whole_pictures(self) -> bool:
        """Whether each layer has a picture at every pixel, to which a lamp that moves adds its light."""
        shown = [self.contractions.layers.get(shape.key) for shape in self.requested_layers]
        return all(layer is not None and layer.stage in WHOLE_STAGES for layer in shown)

    def _awaits_quick_picture(self, now: float) -> bool:
        """Whether a quick picture is about to come: the stages of other transport, which take longer, would void it."""
        sent = self._reconciler.requested
        return self.drag_quality and self.running and sent is not None and now - sent.sent_at < QUICK_PATIENCE

    def _compute(
        self, now: float, desired: DesiredTransport, document: Document, curves: tuple[DesiredCurve, ...],
        precision: Precision, is_fine: bool,
    ) -> None:  # fmt: skip
        staying = self._staying(desired)
        was_fixed = [shape.key for shape in self.requested_layers if shape.is_fixed and shape.key in staying]
        is_fine = is_fine and self._requested is not None and desired.can_mix_with(self._requested)
        self._becoming_editable = tuple(s.key for s in desired.layers if s.key in was_fixed and not s.is_fixed)
        self._requested_document, self.has_stage = document, False
        self.revision += 1
        request = ComputeTransport(
            replace(self._curves.scene_state(document), emission=desired.emission, lamps=desired.lamps),
            curves[0].key if curves else None,
            curves[0].factor if curves else None,
            min(N_LIGHTS_PREVIEW, desired.settings.n_lights),
            desired.settings,
            precision,
            tuple(curve.key for curve in curves[1:]),
            desired.is_drag,
            tuple(staying),
            self.contractions.transport_requested(desired, curves, staying),
            is_fine,
            revision=self.revision,
        )
        self._reconciler.sent(now, self._send(request), desired)

    def _staying(self, desired: DesiredTransport) -> dict[str, ReadyLayer]:
        """What is on screen and is the picture of what is desired: the worker goes on from there."""
        if self._requested is None or self.drag_quality or desired.is_drag:
            return {}
        alike = desired.alike(self._requested)
        return {key: shown for key, shown in self.contractions.layers.items() if key in alike}

    def _desired_transport(self, document: Document, settings: RenderSettings) -> DesiredTransport:
        made_of = (document, settings)
        if self._desired is not None and self._desired_inputs == made_of:
            return self._desired
        self._desired_inputs = made_of
        return self._with_requested_emission(desired_transport(*made_of, self._curves))

    def _with_requested_emission(self, desired: DesiredTransport) -> DesiredTransport:
        """The same with the requested emission, where all the light has only become brighter."""
        self.emitters_are_all = not desired.light.has_sky(self._has_sky)
        known = self._requested.emission if self.emitters_are_all and self._requested is not None else ()
        factors = brightening_factors(desired.emission, known)
        self._light_gain = np.ones(3) if factors is None else factors
        return desired if factors is None else replace(desired, emission=known)

    # -------------------------------------------------------------------------------------------------------- responses

    def receive_bounces(self, n_bounces: int) -> None:
        """Note that the worker goes on with as many bounces as it found that the scene requires. That was not chosen by
        the user: what was stopped stays so."""
        self._reconciler.revise(lambda each: replace(each, settings=replace(each.settings, n_bounces=n_bounces)))

    def receive_stage(self, response: StageDone) -> None:
        """Note the end of a stage."""
        self.contractions.finish_stage()
        self.has_stage = True
        if response.exact:
            self._reconciler.receive(response.id, response)

    def receive_failure(self, response: RequestFailed) -> None:
        """Note that a request failed: it is not repeated until it would be another one."""
        self._reconciler.fail(response.id)
        self.contractions.receive_failure(response.id)
