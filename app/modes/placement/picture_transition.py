"""From one picture to the next: responses for the next picture wait until they can replace the one on screen.

The worker answers layer by layer and stage by stage. Shown as it comes, that would mix parts of two documents in one
picture, and show coarse samples where fine ones were. So the picture is always one document's (`drawn`), and a document
is drawn from the frame in which all that it changes is there:

- A layer's radiance replaces another of the same light that is no finer. Layers that change together appear together.
- Under other light all layers and the sky behind them change in one frame, once every pixel has samples of its own,
  those at edges included; what 400 lights then still lack follows soon.
- A light that is dragged is followed by quick, complete pictures; a drag of something that the picture has not shown
  yet is followed by coarse ones.
- The first picture of a view replaces objects lit from the camera, and is as coarse as it comes.
- The last stage is always shown, whatever was there: nothing finer will come.

It requests nothing, and so has no `Reconciler`: it compares what has come with what is on screen.

Rejected: to show coarse samples of a new material at once, which is a second earlier and looks like a fault; to fade
from one picture into the other, which is a mixture of both.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from app.document.document import Document, layer_key
from app.document.light_mix import emission_of, mixed_light
from app.messages.picture_events import PictureEvent, SkyChanged
from app.modes.placement.curves import Coefficients, Curves, Float64Array, picture_identity
from app.modes.placement.desired_state import DesiredTransport, brightening_factors, same_coefficients
from app.modes.placement.placement_events import LayerRadiance, TransportReady
from engine.material.layer import object_of

# Coarse to fine. A relit picture is as fine as a preview in its pixels, and has the exact picture's details beside.
_RANK = {"drag": 0, "coarse": 1, "preview": 2, "relit": 3, "final": 4}
_FULL_RESOLUTION = _RANK["preview"]
_ANY = -1


@dataclass(frozen=True)
class RequestedTransport:
    """The transport requested last: its desired state, the document then, and how complete it and the document's other
    needs are.

    is_drag: for a light that is dragged. is_last: whether its last stage has come. has_other_parts: whether images and
    indirect light of the document as it is now are there, of a light that is dragged the indirect light as far as it
    follows; is_finished: whether all of the picture is.
    """

    desired: DesiredTransport
    document: Document
    is_drag: bool
    is_last: bool
    has_other_parts: bool
    is_finished: bool


@dataclass
class _ShownLayer:
    """The state that a layer's picture was made of. curve: the one whose transport came with it, None for none."""

    rank: int
    drawn_as: tuple[object, ...]
    coefficients: Coefficients
    curve: str | None = None


class PictureTransition:
    """The document that is drawn, and what has come for the next."""

    def __init__(self, curves: Curves) -> None:
        self._curves = curves
        self.scene_opened(Document(""), has_sky=True)

    def scene_opened(self, document: Document, has_sky: bool) -> None:
        """Start with only objects lit from the camera on screen. has_sky: whether the scene's own light has one."""
        self._has_sky = has_sky
        self.drawn = document
        self._desired: DesiredTransport | None = None
        self._layers: dict[str, _ShownLayer] = {}
        self._coming: dict[str, LayerRadiance] = {}
        self._transports: dict[str, TransportReady] = {}
        self._sky: SkyChanged | None = None

    @property
    def has_picture(self) -> bool:
        """Whether anything computed is on screen."""
        return self._desired is not None

    @property
    def waits(self) -> bool:
        """Whether something has come that is not on screen."""
        return bool(self._coming or self._transports or self._sky)

    @property
    def is_fine(self) -> bool:
        """Whether all that is on screen is of the last stage."""
        return self.has_picture and self._rank == _RANK["final"]

    def is_fine_of(self, objects: Collection[str]) -> bool:
        """Whether what is on screen of these objects, by name, has the detail of the last stage."""
        ranks = [layer.rank for key, layer in self._layers.items() if object_of(key) in objects]
        return self.has_picture and min(ranks, default=_ANY) >= _RANK["relit"]

    @property
    def light_gain(self) -> Float64Array:
        """How much brighter (3,) the emitters of the drawn document are than in its pictures, where they are the only
        light."""
        factors = (
            None if self._desired is None else brightening_factors(emission_of(self.drawn), self._desired.emission)
        )
        return np.ones(3) if factors is None else factors

    # -------------------------------------------------------------------------------------------------------- responses

    def transport_requested(self, staying: Collection[str]) -> None:
        """Other transport was requested: what has come of these layers is a part of it, all else is void."""
        self._coming = {key: event for key, event in self._coming.items() if key in staying}
        self._transports = {key: event for key, event in self._transports.items() if key in self._coming}

    def receive_radiance(self, event: LayerRadiance) -> None:
        self._coming[event.key] = event
        self._transports.pop(event.key, None)

    def receive_transport(self, event: TransportReady) -> None:
        self._transports[event.key] = event

    def receive_sky(self, event: SkyChanged) -> None:
        self._sky = event

    def rendered(self, key: str, factor: str, coefficients: Float64Array) -> None:
        """The renderer has updated a layer's picture to exactly these coefficients."""
        layer = self._layers.get(key)
        if layer is not None and key not in self._coming:
            layer.coefficients = {**layer.coefficients, factor: coefficients}

    # ---------------------------------------------------------------------------------------------------- what is shown

    def update(
        self,
        document: Document,
        requested: RequestedTransport | None,
        dragging: bool,
        edited: Iterable[str],
        factor: str | None,
    ) -> list[PictureEvent]:
        """Replace what can be replaced on screen now, in one frame; `drawn` is then the document of the picture.

        edited: keys of the layers that follow the selected curve, `factor`, in every frame.
        """
        if not self.has_picture:  # objects lit from the camera need nothing
            self.drawn = document
        if requested is None:
            return []
        follows = dict.fromkeys(edited, factor)
        if self._desired is not None and requested.desired.can_mix_with(self._desired):
            return self._refined(document, requested, dragging, follows)
        return self._replaced(document, requested, dragging, follows)

    def draw_now(self, document: Document, edited: Iterable[str], factor: str | None) -> None:
        """Draw an edit in this very frame, where it needs no response."""
        if self._can_draw(document, self._layers, dict.fromkeys(edited, factor), False):
            self.drawn = document

    def follow_drag(self, document: Document) -> None:
        """Draw a drag in this very frame, as far as possible while another edit is waited for."""
        if document is self.drawn or not self.has_picture:
            self.drawn = document
        elif self._can_draw(document, self._layers, {}, True):
            self.drawn = document
        elif self._has_same_light(document, self._desired) and self._has_same_light(self.drawn, self._desired):
            for before, now in zip(self.drawn.objects, document.objects, strict=True):
                if now != before and self._can_draw_object(now.name, document, self._layers, {}, True):
                    objects = (now if each.name == now.name else each for each in self.drawn.objects)
                    self.drawn = replace(self.drawn, objects=tuple(objects))  # without those that share its material

    def _refined(
        self, document: Document, requested: RequestedTransport, dragging: bool, follows: Mapping[str, str | None]
    ) -> list[PictureEvent]:
        """Replace, under the light that is on screen, the layers that are no coarser than theirs, if the document can
        then be drawn; returns the events."""
        good = {
            key: event for key, event in self._coming.items()
            if requested.is_last or _RANK[event.stage] >= self._least_rank(document, key, dragging)
        }  # fmt: skip
        can_draw = self._can_draw(document, self._after(good), follows, dragging)
        if requested.is_finished or can_draw and (dragging or requested.has_other_parts):
            self.drawn, self._desired = document, requested.desired
            return self._released(good)
        return self._released({})

    def _replaced(
        self, document: Document, requested: RequestedTransport, dragging: bool, follows: Mapping[str, str | None]
    ) -> list[PictureEvent]:
        """Replace, under other light, all of the picture, once all of it is there; returns the events."""
        least = _ANY
        if self._desired is not None and not (requested.is_drag or requested.is_last):
            same_light = requested.desired.lights_like(self._desired)
            least = self._rank if same_light else min(self._rank, _FULL_RESOLUTION)
        keys = [shape.key for shape in requested.desired.layers]
        is_whole = all(key in self._coming and _RANK[self._coming[key].stage] >= least for key in keys)
        if not is_whole or not (requested.has_other_parts or requested.is_finished):
            return []
        if self._can_draw(document, self._after(self._coming, {}), follows, dragging, requested.desired):
            next_drawn = document
        elif _models(requested.document) == _models(document):
            next_drawn = requested.document
        else:
            return []
        self.drawn, self._desired, self._layers = next_drawn, requested.desired, {}
        return self._released(self._coming)

    def _released(self, radiances: Mapping[str, LayerRadiance]) -> list[PictureEvent]:
        """These layers, the sky of their light, and the transport of layers that are on screen."""
        events: list[PictureEvent] = [] if self._sky is None else [self._sky]
        self._sky = None
        for key, event in radiances.items():
            events.append(replace(event, is_outdated=self._is_outdated(event)))
            self._layers[key] = _shown_layer(event)
        self._coming = {key: event for key, event in self._coming.items() if key not in radiances}
        for key in [key for key in self._transports if key in self._layers and key not in self._coming]:
            transport = self._transports.pop(key)
            for other, layer in self._layers.items():
                layer.curve = transport.factor if other == key else layer.curve if other in transport.beside else None
            events.append(transport)
        return events

    def _is_outdated(self, event: LayerRadiance) -> bool:
        """Whether a radiance lacks the edits of a curve whose transport comes with it, and the layer's picture on
        screen is of the same material: that has them, and stays until they can be added."""
        shown = self._layers.get(event.key)
        if event.key not in self._transports or shown is None or shown.drawn_as != event.drawn_as:
            return False
        return not same_coefficients(event.coefficients, self._curves.coefficients(self.drawn, event.key))

    # ------------------------------------------------------------------------------------------------ what can be drawn

    @property
    def _rank(self) -> int:
        return min((layer.rank for layer in self._layers.values()), default=_ANY)

    def _least_rank(self, document: Document, key: str, dragging: bool) -> int:
        """How fine a layer's picture has to be: as the one on screen, unless a drag changes what that does not show."""
        shown = self._layers.get(key)
        if dragging and (shown is None or shown.drawn_as != _drawn_as(document, key)):
            return _ANY
        return self._rank if shown is None else shown.rank

    def _after(
        self, radiances: Mapping[str, LayerRadiance], before: Mapping[str, _ShownLayer] | None = None
    ) -> dict[str, _ShownLayer]:
        """The layers with these put on screen, and the transport that has come."""
        after = dict(self._layers if before is None else before)
        after.update((key, _shown_layer(event)) for key, event in radiances.items())
        for key, transport in self._transports.items():
            if key in radiances or key not in self._coming and key in after:
                after[key] = replace(after[key], curve=transport.factor)
        return after

    def _has_same_light(self, document: Document, desired: DesiredTransport | None) -> bool:
        """Whether a document's light is that of the transport, apart from what multiplies its pictures."""
        if desired is None or replace(mixed_light(document), intensity=1.0) != desired.light:
            return False
        emission = emission_of(document)
        if emission == desired.emission:
            return True
        emitters_are_all = not desired.light.has_sky(self._has_sky)
        return emitters_are_all and brightening_factors(emission, desired.emission) is not None

    def _can_draw(
        self, document: Document, layers: Mapping[str, _ShownLayer], follows: Mapping[str, str | None], roughly: bool,
        desired: DesiredTransport | None = None,
    ) -> bool:  # fmt: skip
        """Whether these layers, lit as on screen or by this transport, are all that a document shows. roughly: with
        curves that are on their way."""
        return self._has_same_light(document, desired or self._desired) and all(
            self._can_draw_object(state.name, document, layers, follows, roughly)
            for state in document.objects
        )  # fmt: skip

    def _can_draw_object(
        self, name: str, document: Document, layers: Mapping[str, _ShownLayer], follows: Mapping[str, str | None],
        roughly: bool,
    ) -> bool:  # fmt: skip
        state = document.object(name)
        for index in range(len(state.layers)):
            key = layer_key(name, index)
            if not document.is_visible(key):
                continue
            look = layers.get(key)
            if look is None or look.drawn_as != _drawn_as(document, key):
                return False
            if not (roughly or self._shows_curves(document, key, look, follows.get(key))):
                return False
        return True

    def _shows_curves(self, document: Document, key: str, look: _ShownLayer, followed: str | None) -> bool:
        """Whether a layer's picture has the document's curves, or follows the one in which it does not."""
        wanted = self._curves.coefficients(document, key)
        if same_coefficients(look.coefficients, wanted):
            look.coefficients = wanted
            return True
        if followed is None or followed != look.curve:
            return False
        shown, others = (
            {name: values for name, values in each.items() if name != followed} for each in (look.coefficients, wanted)
        )
        bands = followed in wanted and len(look.coefficients.get(followed, ())) == len(wanted[followed])
        return bands and same_coefficients(shown, others)


def _shown_layer(event: LayerRadiance) -> _ShownLayer:
    return _ShownLayer(_RANK[event.stage], event.drawn_as, event.coefficients)


def _drawn_as(document: Document, key: str) -> tuple[object, ...]:
    """The drawn properties of the layer that a document has by this key; empty where it has none."""
    if all(key != each for each, _ in document.layers()):
        return ()
    layer = document.layer(key)
    return picture_identity(layer.model.name, layer.quotient_parameters().tolist())


def _models(document: Document) -> list[tuple[str, str]]:
    return [(key, layer.model.name) for key, layer in document.layers()]
