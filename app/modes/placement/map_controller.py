"""Textures and weight maps on the window's side: which images are to be sampled, and what is known of them.

The worker samples a layer's images once for each pixel of its object. Strength and inversion are numbers that the
renderer multiplies by; repeats or another file require new samples. Until those are here the old ones stay on screen.
Samples are cached for a while, so that undo shows them at once. The desired images are compared whenever the document
has changed, one request at a time. A request is answered surface by surface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.document.history import History
from app.messages.worker_messages import Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_events import LayerMapsChanged
from app.modes.placement.placement_messages import MapsRefused, MapsSampled, SampleMaps
from app.modes.reconciler import Reconciler
from engine.material.layer import object_of
from engine.material.layer_maps import Images, LayerMaps
from engine.material.strokes import Strokes

MAX_CACHED = 24

Surface = tuple[str, Images]
# Layers, by key, with images that are to be sampled, one for each surface.
Missing = tuple[tuple[str, Images], ...]


class MapController:
    """Requests samples of images. ``send`` sends a request and returns its id; ``curves`` get the means."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._reconciler = Reconciler[Missing, None](covers=_includes)
        self.scene_opened()

    def scene_opened(self) -> None:
        """Another scene is open: its images are unknown."""
        self._cached: dict[Surface, MapsSampled] = {}
        self._refused: dict[Surface, str] = {}
        self._shown: dict[str, MapsSampled] = {}
        self._newest: dict[Surface, MapsSampled] = {}
        self._reconciler.clear()
        self._awaited: set[Surface] = set()
        self._document: Document | None = None
        self._followed: Document | None = None
        self._wanted: dict[str, LayerMaps] = {}
        self._found: dict[str, MapsSampled | None] = {}
        self._curves.map_means.clear()

    @property
    def is_complete(self) -> bool:
        """Whether the images of all layers are in the picture, as far as they can be used."""
        return self._reconciler.desired is None

    def is_wanted(self, document: Document) -> bool:
        """Whether a document has images."""
        return bool(_wanted(document))

    def refusal(self, key: str, maps: LayerMaps) -> str | None:
        """Why a layer's images cannot be used, in one line."""
        return self._refused.get((object_of(key), maps.images))

    def cached_maps(self, key: str, maps: LayerMaps) -> MapsSampled | None:
        """The cached samples, means and thumbnails of a layer's images."""
        return self._cached.get((object_of(key), maps.images))

    def edited(self) -> None:
        """The document changed: until the next update it is unknown whether anything is missing."""
        self._document = None

    def reload(self, key: str, maps: LayerMaps) -> None:
        """Sample a layer's images again: their files were written meanwhile. The old ones are shown until then."""
        surface = (object_of(key), maps.images)
        self._cached.pop(surface, None)
        self._refused.pop(surface, None)
        self._reconciler.restart()
        self.edited()

    def receive(self, response: MapsSampled) -> None:
        """Take the samples of images."""
        surface = (object_of(response.key), response.images)
        # The request shares its strokes with the document; what crossed between processes is a copy of them all.
        surface = next((requested for requested in self._awaited if requested == surface), surface)
        response = replace(response, images=surface[1])
        self._forget_awaited(surface)
        self._cached.pop(surface, None)
        self._forget_begun(surface)
        self._cached[surface] = response
        self._newest[surface[0], response.images.without_strokes] = response
        self._curves.map_means[surface] = response.means
        shown = {id(each) for each in self._shown.values()}
        spare = [key for key, each in self._cached.items() if id(each) not in shown and each is not response]
        for key in spare[: max(0, len(self._cached) - MAX_CACHED)]:
            del self._cached[key]
        self.edited()

    def receive_failure(self, request: int) -> None:
        """A request was given up: nothing more comes of it."""
        if self._reconciler.fail(request):
            self._awaited.clear()
            self.edited()

    def lose_request(self) -> None:
        """What is under way will not come: the worker gave it up for a scene or a view that it could not show."""
        self._reconciler.lose()
        self._awaited.clear()
        self.edited()

    def _forget_awaited(self, surface: Surface) -> None:
        """Note a response for a surface, and after the last one that the request is answered."""
        self._awaited.discard(surface)
        if not self._awaited and self._reconciler.requested is not None:
            self._reconciler.receive(self._reconciler.requested.id, None)

    def _forget_begun(self, surface: Surface) -> None:
        """Forget a stroke's samples of earlier frames: they are of no further use."""
        for place, images in list(self._cached):
            if place == surface[0] and surface[1].strokes.extends_last_stroke(images.strokes):
                del self._cached[place, images]
        for place, images in list(self._curves.map_means):
            if place == surface[0] and surface[1].strokes.extends_last_stroke(images.strokes):
                del self._curves.map_means[place, images]

    def refuse(self, response: MapsRefused, history: History[Document]) -> bool:
        """Drop images that cannot be used. If choosing them was the last step, that step disappears from the history;
        returns whether it did. Else they stay in the document, and the layer is shown without them."""
        self._refused[object_of(response.key), response.images] = response.line
        self._forget_awaited((object_of(response.key), response.images))
        self.edited()
        document = history.document
        if all(key != response.key for key, _ in document.layers()):
            return False
        layer = document.layer(response.key)
        if layer.maps.images != response.images:
            return False
        return history.retract(lambda before: _only_chose(response.key, response.images, before, document))

    def request_missing(self, document: Document, may_request: bool = True) -> None:
        """Request what is missing. may_request: whether the worker has the scene and the view open; once it has again,
        `lose_request` or `scene_opened` notes it."""
        if document is self._document:
            return
        self._document, self._followed = document, None
        self._wanted = _wanted(document)
        missing: dict[Surface, str] = {}
        self._found = {}
        for key, maps in self._wanted.items():
            surface = (object_of(key), maps.images)
            found = self._cached.get(surface)
            if found is None and surface not in self._refused:
                missing.setdefault(surface, key)
                found = self._painted_so_far(surface)
                if found is None:
                    continue
            self._found[key] = found
        desired = tuple((key, images) for (_, images), key in missing.items())
        self._reconciler.desire(0.0, desired or None)
        if self._reconciler.action(0.0, may_request and not self._drag_is_ahead(missing)) == "request":
            self._reconciler.sent(0.0, self._send(SampleMaps(desired)))
            self._awaited = set(missing)

    def follow(self, document: Document) -> list[LayerMapsChanged]:
        """The layers whose samples differ from those shown, of the document at the last request."""
        if document is self._followed or document is not self._document:
            return []
        self._followed = document
        wanted, found = self._wanted, self._found
        events = [self._drop(key) for key in list(self._shown) if key not in wanted]
        waits = _out_of_step(wanted, found)
        changed = [key for key in found if key not in waits and found[key] is not self._shown.get(key)]
        for key, following in zip_longest(changed, changed[1:]):
            samples = found[key]
            if samples is None:
                events.append(self._drop(key))
                continue
            self._shown[key] = samples
            with_next = following is not None and _painted_as(wanted, key) == _painted_as(wanted, following)
            events.append(
                LayerMapsChanged(
                    key, samples.samples, samples.images.has_weight, samples.thumbnails,
                    with_next=with_next and bool(wanted[key].strokes),
                )
            )  # fmt: skip
        return events

    def _drag_is_ahead(self, missing: Iterable[Surface]) -> bool:
        """Whether the worker is still at an earlier part of a stroke: another request would cancel that, and nothing
        would show before the user is idle."""
        return any(
            wanted[0] == awaited[0] and wanted[1].without_strokes == awaited[1].without_strokes
            and wanted[1].strokes.extends_last_stroke(awaited[1].strokes)
            for awaited in self._awaited for wanted in missing
        )  # fmt: skip

    def _painted_so_far(self, surface: Surface) -> MapsSampled | None:
        """During a stroke: the newest samples of it, whose mean stands in for that to come."""
        newest = self._newest.get((surface[0], surface[1].without_strokes))
        if newest is None or not surface[1].strokes.extends(newest.images.strokes):
            return None
        self._curves.map_means.setdefault(surface, newest.means)
        return newest

    def _drop(self, key: str) -> LayerMapsChanged:
        del self._shown[key]
        return LayerMapsChanged(key, None)

    def samples(self, key: str, maps: LayerMaps) -> NDArray[np.float16] | None:
        """The samples of a layer's images, where they are known."""
        found = self.cached_maps(key, maps)
        return None if found is None else found.samples


def _wanted(document: Document) -> dict[str, LayerMaps]:
    """The layers that have images."""
    return {key: layer.maps for key, layer in document.layers() if not layer.maps.is_plain}


def _includes(requested: Missing, desired: Missing) -> bool:
    return set(desired) <= set(requested)


def _out_of_step(wanted: dict[str, LayerMaps], found: dict[str, MapsSampled | None]) -> set[str]:
    """Layers of an object that the same strokes paint, as long as one has newer samples than another: shown apart, one
    would already make way for what the other does not show yet, and both would be black."""
    reached: dict[tuple[str, Strokes], set[Strokes | None]] = {}
    for key, maps in wanted.items():
        here = found.get(key)
        if maps.strokes and (key not in found or here is not None):
            step = None if here is None else here.images.strokes
            reached.setdefault(_painted_as(wanted, key), set()).add(step)
    return {key for key in wanted if len(reached.get(_painted_as(wanted, key), ())) > 1}


def _painted_as(wanted: dict[str, LayerMaps], key: str) -> tuple[str, Strokes]:
    """Equal for layers that one brush paints."""
    return object_of(key), wanted[key].strokes


def _only_chose(key: str, images: Images, before: Document, after: Document) -> bool:
    """Whether two documents differ only in that a layer got these images."""
    if all(each != key for each, _ in before.layers()) or before.layer(key).maps.images == images:
        return False
    return before.with_layer(key, before.layer(key).replace(maps=after.layer(key).maps)) == after
