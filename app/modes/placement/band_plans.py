"""How many bands each layer of a document has: planned by the worker, for that takes longer than the window may block.

A layer is planned when it is first seen, and keeps its bands while it is edited, so that transport outlives edits; one
of another model is planned anew. What was planned is remembered by what the layer was made of, so that undo finds it.

An edit that brings another layer (a material of the library, a pasted one, another model) is carried out at once. Until
its plan is there, a few hundredths of a second, the layer has the usual bands, which need no plan: the picture shows
what it shows, and nothing is asked for that depends on bands. Rejected: the usual bands for good, which are too few for
a clear coat; and edits that wait for their plan, for then undo, scripts and panels would find a document that is not
what was asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from app.document.document import Document
from app.messages.worker_messages import Request, RequestFailed
from app.modes.placement.placement_messages import BandsPlanned, PlanBands
from engine.material.layer import Layer
from engine.material.model import Model
from engine.planner import MOST_BANDS, band_counts, usual_bands

Counts = dict[str, int]


class BandPlans:
    """J of each transport factor by layer key. most: what caps them; planned here until `leave_to_worker`."""

    def __init__(self, most: int = MOST_BANDS) -> None:
        self._most = most
        self._scene: object = None
        self._by_worker = False
        self._planned: dict[str, tuple[Model, Counts]] = {}
        self._first_seen: dict[str, Layer] = {}
        self._added: dict[object, Counts] = {}

    def leave_to_worker(self) -> None:
        """Plan nothing here any more; the worker caps nothing, so that capped plans stay here."""
        self._by_worker = self._most == MOST_BANDS

    def scene_opened(self, scene: object) -> None:
        """This scene is open, or seen in another way: of another than before nothing is planned."""
        if scene is not self._scene:
            self._planned, self._first_seen, self._added = {}, {}, {}
        self._scene = scene

    def add_plan(self, layer: Layer, counts: Mapping[str, int]) -> None:
        """How many bands a layer needs that the document has or may come to have."""
        if self._most == MOST_BANDS:
            self._added[_made_of(layer)] = dict(counts)

    def replan(self, keys: Iterable[str]) -> None:
        """These layers have become others: they are planned anew."""
        for key in keys:
            self._planned.pop(key, None)
            self._first_seen.pop(key, None)

    def of(self, key: str, layer: Layer) -> Counts:
        """J of each of the layer's factors; the usual ones as long as the worker has not planned it."""
        known = self._cached_plan(key, layer)
        if known is None and self._by_worker:
            return usual_bands(layer.model)
        if known is None:
            known = self._store_plan(key, layer, band_counts(layer, self._most))
        return known

    def missing(self, layers: Iterable[tuple[str, Layer]]) -> tuple[Layer, ...]:
        """What the worker is to plan for these layers by key, each as it was first seen; none where it plans none."""
        if not self._by_worker:
            return ()
        return tuple(self._first_version(key, layer) for key, layer in layers if self._cached_plan(key, layer) is None)

    def _cached_plan(self, key: str, layer: Layer) -> Counts | None:
        model, counts = self._planned.get(key, (None, None))
        if model is layer.model:
            return counts
        for each in (layer, self._first_version(key, layer)):
            if (learnt := self._added.get(_made_of(each))) is not None:
                return self._store_plan(key, layer, learnt)
        return None

    def _store_plan(self, key: str, layer: Layer, counts: Counts) -> Counts:
        self._planned[key] = layer.model, counts
        self._first_seen.pop(key, None)
        return counts

    def _first_version(self, key: str, layer: Layer) -> Layer:
        """The layer as it was when it came to have this model: a hand may move it until the answer comes."""
        seen = self._first_seen.get(key)
        if seen is None or seen.model is not layer.model:
            seen = self._first_seen[key] = layer
        return seen


class BandController:
    """The talk with the worker about bands. ``send`` hands a request over and returns its number."""

    def __init__(self, send: Callable[[Request], int], plans: BandPlans) -> None:
        self._send, self._plans = send, plans
        plans.leave_to_worker()
        self._requested: tuple[int, tuple[Layer, ...]] = 0, ()
        self._planned: Document | None = None

    def update(self, document: Document) -> bool:
        """Ask for what is missing; whether every layer of the document is planned."""
        if document is self._planned:
            return True
        missing = self._plans.missing(document.layers())
        if not missing:
            self._planned = document
        elif any(layer not in self._requested[1] for layer in missing):
            self._requested = self._send(PlanBands(missing)), missing
        return not missing

    def receive(self, response: BandsPlanned) -> None:
        """What was asked for last has been planned."""
        if response.id == self._requested[0]:
            self._learn(response.bands)

    def receive_failure(self, response: RequestFailed) -> None:
        """Layers that cannot be planned get the usual bands, so that they can be edited on."""
        if response.id == self._requested[0]:
            self._learn(usual_bands(layer.model) for layer in self._requested[1])

    def _learn(self, bands: Iterable[Counts]) -> None:
        for layer, counts in zip(self._requested[1], bands, strict=True):
            self._plans.add_plan(layer, counts)
        self._requested = 0, ()


def _made_of(layer: Layer) -> object:
    """What a layer's curves come from."""
    return layer.model, layer.parameters, layer.edits
