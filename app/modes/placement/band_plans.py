"""The number of bands of each layer of a document, planned by the worker: that takes longer than the window may block.

A layer is planned when it is first seen, and keeps its bands while it is edited, so that transport outlives edits; a
layer of another model is planned anew. Plans are stored by what the layer was made of, so that undo finds them.

An edit that brings another layer (a material of the library, a pasted one, another model) is carried out at once. Until
its plan is there, a few hundredths of a second, the layer has the usual bands, which need no plan: the picture shows
what it shows, and nothing is requested that depends on bands. Rejected: the usual bands for good, which are too few for
a clear coat; and edits that wait for their plan, because undo, scripts and panels would then find a document without
the edit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from app.document.document import Document
from app.messages.worker_messages import Request, RequestFailed
from app.modes.placement.placement_messages import BandsPlanned, PlanBands
from app.modes.reconciler import Reconciler
from engine.material.layer import Layer
from engine.material.model import Model
from engine.planner import MOST_BANDS, band_counts, usual_bands

Counts = dict[str, int]


class BandPlans:
    """J of each transport factor by layer key. most: their upper limit; planned here until `leave_to_worker`."""

    def __init__(self, most: int = MOST_BANDS) -> None:
        self._most = most
        self._scene: object = None
        self._by_worker = False
        self._planned: dict[str, tuple[Model, Counts]] = {}
        self._first_seen: dict[str, Layer] = {}
        self._added: dict[object, Counts] = {}

    def leave_to_worker(self) -> None:
        """Plan nothing here any more; the worker knows no upper limit, so plans with one stay here."""
        self._by_worker = self._most == MOST_BANDS

    def scene_opened(self, scene: object) -> None:
        """Take over an open scene, or the same one newly traced: plans are dropped only for another scene."""
        if scene is not self._scene:
            self._planned, self._first_seen, self._added = {}, {}, {}
        self._scene = scene

    def add_plan(self, layer: Layer, counts: Mapping[str, int]) -> None:
        """Note how many bands a layer needs that the document has or may get."""
        if self._most == MOST_BANDS:
            self._added[_made_of(layer)] = dict(counts)

    def replan(self, keys: Iterable[str]) -> None:
        """Plan these layers anew: they have changed."""
        for key in keys:
            self._planned.pop(key, None)
            self._first_seen.pop(key, None)

    def of(self, key: str, layer: Layer) -> Counts:
        """J of each of the layer's factors; the usual ones until the worker has planned it."""
        known = self._cached_plan(key, layer)
        if known is None and self._by_worker:
            return usual_bands(layer.model)
        if known is None:
            known = self._store_plan(key, layer, band_counts(layer, self._most))
        return known

    def missing(self, layers: Iterable[tuple[str, Layer]]) -> tuple[Layer, ...]:
        """The layers, by key, that the worker is to plan, each as it was first seen; none where it plans none."""
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
        """The layer as it was when it got this model: a drag may change it until the response comes."""
        seen = self._first_seen.get(key)
        if seen is None or seen.model is not layer.model:
            seen = self._first_seen[key] = layer
        return seen


class BandController:
    """Requests band plans. ``send`` sends a request and returns its number."""

    def __init__(self, send: Callable[[Request], int], plans: BandPlans) -> None:
        self._send, self._plans = send, plans
        plans.leave_to_worker()
        self._reconciler = Reconciler[tuple[Layer, ...], None](covers=_includes)
        self._planned: Document | None = None

    def update(self, document: Document) -> bool:
        """Request what is missing; returns whether every layer of the document is planned."""
        if document is self._planned:
            return True
        missing = self._plans.missing(document.layers())
        self._reconciler.desire(0.0, missing or None)
        if not missing:
            self._planned = document
        elif self._reconciler.action(0.0) == "request":
            self._reconciler.sent(0.0, self._send(PlanBands(missing)))
        return not missing

    def receive(self, response: BandsPlanned) -> None:
        """Take the plan that was requested last."""
        if self._reconciler.receive(response.id, None):
            self._learn(response.bands)

    def receive_failure(self, response: RequestFailed) -> None:
        """Give layers that cannot be planned the usual bands, so that they can be edited."""
        requested = self._reconciler.requested
        if requested is not None and self._reconciler.fail(response.id):
            self._learn(usual_bands(layer.model) for layer in requested.desired)

    def _learn(self, bands: Iterable[Counts]) -> None:
        assert self._reconciler.requested is not None
        for layer, counts in zip(self._reconciler.requested.desired, bands, strict=True):
            self._plans.add_plan(layer, counts)
        self._reconciler.clear()  # what is planned is remembered by `BandPlans`


def _includes(requested: tuple[Layer, ...], desired: tuple[Layer, ...]) -> bool:
    return all(layer in requested for layer in desired)


def _made_of(layer: Layer) -> object:
    """The inputs of a layer's curves."""
    return layer.model, layer.parameters, layer.edits
