"""Side A of the A/B picture: a remembered document, brought to the quality of side B.

The renderer stores A as a picture. Stored while the first stages come in, that picture is coarse, and would stay so
beside a B that is refined. Transport belongs to light and quotients, not to curves, so as long as A has those of B it
can be drawn exactly from what is there:

- while A and B have the same layers, by storing the picture again after each stage, and when it is exact;
- when curves were edited meanwhile, by requesting from the idle worker the radiance of the layers that differ, with
  A's curves. That is one contraction a layer, and none when A was stored exact.

Indirect light depends on every layer: an edited layer changes it for all of them, so an A with other curves that was
stored coarse stays as it is until B equals it.

An A under another light than B's stays as it is until B comes back to that light: its transport is gone, and keeping a
second one for a picture that is seldom shown costs as much memory as the first. The divider's label says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.document.light_mix import emission_of
from app.document.scene_state import layer_state
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import Request
from app.modes.placement.contraction_controller import CONTRACT_PATIENCE
from app.modes.placement.curves import Coefficients, Curves, Float64Array, view_curves_of
from app.modes.placement.desired_state import same_coefficients
from app.modes.placement.placement_events import ComparisonRefined, LayerAppearance
from app.modes.placement.placement_messages import ContractTransport, LayerPicture
from app.modes.placement.transport_controller import TransportController
from app.modes.reconciler import Reconciler
from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.settings import RenderSettings

Samples = Callable[[str, LayerMaps], NDArray[np.float16] | None]


class Comparison:
    """Refines side A. ``send`` sends a request to the worker; ``curves`` are those of side B."""

    def __init__(self, send: Callable[[Request], int], curves: Curves, samples: Samples) -> None:
        """samples: those of a layer's images, None where they are unknown."""
        self._send, self._curves, self._samples = send, curves, samples
        self._reconciler = Reconciler[str, LayerPicture](patience=CONTRACT_PATIENCE)  # by layer key
        self._document: Document | None = None
        self._ids: set[int] = set()
        self._forget_revision()

    def _forget_revision(self, revision: int = -1) -> None:
        self._revision = revision
        self._serves = False
        self._coefficients: dict[str, Coefficients] = {}
        self._pictures: dict[str, NDArray[np.floating]] = {}
        self._reconciler.clear()
        self._stage_finished = False

    def begin(self, document: Document | None, is_exact: bool) -> None:
        """Begin or end the comparison with A; ``is_exact``: whether the picture that the renderer stored of it is."""
        self._document, self._exact = document, is_exact
        self._forget_revision()

    @property
    def document(self) -> Document | None:
        """The document of A; None while nothing is compared."""
        return self._document

    @property
    def exact(self) -> bool:
        """Whether A's picture is exact; True also while nothing is compared."""
        return self._document is None or self._exact

    def stage_finished(self) -> None:
        """A stage of the picture on screen is complete."""
        self._stage_finished = True

    def receive(self, response: LayerPicture) -> bool:
        """Take a layer's radiance; returns whether it was requested for A and is no part of side B."""
        if self._reconciler.receive(response.id, response):
            self._pictures[response.key] = response.radiance
        return response.id in self._ids

    def worker_restarted(self) -> None:
        """Request again later what was requested: a new worker would answer with its first, coarse stage."""
        self._reconciler.lose()

    def receive_failure(self, id: int) -> None:
        """Leave A as it is when the worker cannot draw it."""
        self._reconciler.fail(id)

    def update(
        self,
        now: float,
        document: Document,
        controller: TransportController,
        settings: RenderSettings,
        exact: bool,
        has_indirect: bool = False,
    ) -> list[PictureEvent]:
        """Show what is ready of A, and request what is missing.

        ``now`` in seconds; ``document`` is B's; ``exact``: whether B's picture on screen is, ``has_indirect``: whether
        there is light of further bounces in it.
        """
        compared = self._document
        if compared is None or self._exact:
            return []
        if controller.revision != self._revision:
            self._forget_revision(controller.revision)
            self._serves = controller.serves(compared, document, settings)
        if not self._serves:
            return []
        light = replace(compared.light, intensity=document.light.intensity)
        if (compared.objects, light) == (document.objects, document.light):
            return self._follow(exact)
        lit_alike = emission_of(compared) == emission_of(document)
        if has_indirect or not lit_alike or not (controller.finished and exact):
            return []
        return self._draw_apart(now, compared, document, controller)

    def _follow(self, exact: bool) -> list[PictureEvent]:
        """B has A's layers: the picture on screen is A's as well."""
        if not exact and not self._stage_finished:
            return []
        self._stage_finished, self._exact = False, exact
        return [ComparisonRefined({})]

    def _draw_apart(
        self, now: float, compared: Document, document: Document, controller: TransportController
    ) -> list[PictureEvent]:
        """B has other curves by now: request the layers that differ, one after the other, then draw A with them."""
        differing = self._differing(compared, document, controller)
        missing = [key for key in differing if key not in self._pictures]
        if missing:
            self._request_radiance(now, missing[0], compared, controller)
            return []
        if any(self._lacks_images(key, layer) for key, layer in compared.layers()):
            return []
        self._exact = True
        return [ComparisonRefined(self._layer_appearances(compared, differing, controller.light_gain))]

    def _lacks_images(self, key: str, layer: Layer) -> bool:
        """Whether A has images in this layer whose samples are missing or out of date."""
        return not layer.maps.is_plain and self._samples(key, layer.maps) is None

    def _differing(self, compared: Document, document: Document, controller: TransportController) -> list[str]:
        """Keys of the layers whose curves are not those on screen."""
        found = []
        for key, layer in compared.layers():
            bands = controller.requested_bands(key)
            if bands is None:
                continue
            if key not in self._coefficients:
                self._coefficients[key] = {name: layer.coefficients(name, n) for name, n in bands.items()}
            if not same_coefficients(self._coefficients[key], self._curves.coefficients(document, key)):
                found.append(key)
        return found

    def _request_radiance(self, now: float, key: str, compared: Document, controller: TransportController) -> None:
        """Request a layer's radiance; once more where a contraction of B has taken its place."""
        reconciler = self._reconciler
        if reconciler.requested is not None and now - reconciler.requested.sent_at > CONTRACT_PATIENCE:
            reconciler.lose()
        reconciler.desire(now, key)
        if reconciler.action(now) == "request":
            layer = layer_state(compared, key, tuple((controller.requested_bands(key) or {}).values()))
            id = self._send(ContractTransport(layer, None, revision=controller.revision))
            reconciler.sent(now, id)
            self._ids.add(id)

    def _layer_appearances(
        self, compared: Document, differing: list[str], light_gain: Float64Array
    ) -> Mapping[str, LayerAppearance]:
        return {
            key: LayerAppearance(
                layer.scale() * light_gain,
                view_curves_of(layer),
                compared.is_visible(key),
                self._pictures[key] if key in differing else None,
                (self._samples(key, layer.maps), layer.maps.sampled_strength, layer.maps.inverts),
            )
            for key, layer in compared.layers()
        }
