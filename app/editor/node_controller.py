"""The statistics of the images of parameter maps on the window's side, and the document that pictures are made of with
them (`app.document.node_layers`).

The worker reads images, so a map that the user has just chosen is shown by its parameter's own value for a moment.
Statistics belong to a scene's files, not to the document: undo needs none again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

from app.document.document import Document
from app.document.history import History
from app.document.node_layers import NodeCount, channel_images, node_counts, with_node_layers
from app.messages.worker_messages import ChannelsRead, ReadChannels, Request
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage
from engine.material.parameter_maps import ChannelStatistics

# The present document, the one that is drawn, and that of side A.
_MOST_CACHED = 4


class NodeHost(Protocol):
    """What the controller needs of the editor."""

    history: History[Document]

    def send(self, request: Request) -> int: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...

    def document_changed(self) -> None: ...


class NodeController:
    """The nodes of one editor's documents."""

    def __init__(self, host: NodeHost) -> None:
        self._host = host
        self.scene_opened({})

    def scene_opened(self, statistics: Mapping[ChannelImage, ChannelStatistics]) -> None:
        """Another scene is open; statistics: of the images that it and its session name."""
        self._statistics, self._refused = dict(statistics), dict[ChannelImage, str]()
        self._requested: tuple[int, frozenset[ChannelImage]] | None = None
        self._forget_documents()

    def _forget_documents(self) -> None:
        self._cached: list[tuple[Document, Document]] = []
        self._counted: tuple[Document, tuple[NodeCount, ...]] | None = None

    def with_nodes(self, document: Document) -> Document:
        """The document that pictures are made of; the same one for the same document."""
        found = next((pair for pair in self._cached if pair[0] is document), None)
        if found is None:
            found = document, with_node_layers(document, self._statistics, _n_nodes(document))
        others = [pair for pair in self._cached if pair is not found]
        self._cached = [*others[1 - _MOST_CACHED :], found]
        return found[1]

    def counts(self, document: Document) -> tuple[NodeCount, ...]:
        """The nodes of all parameter maps of a document; those of the last one are remembered, for every frame."""
        if self._counted is None or self._counted[0] is not document:
            self._counted = document, node_counts(document, self._statistics, _n_nodes(document))
        return self._counted[1]

    def refusal(self, layer: Layer) -> str:
        """Why images of a layer's parameter maps cannot be used, in one line; "" where they can, or nothing is known
        yet."""
        found = (self._refused.get(each.image, "") for each in layer.parameter_maps)
        return "; ".join(dict.fromkeys(filter(None, found)))

    def request_missing(self, *documents: Document) -> None:
        """Request the statistics that documents need and that are neither known nor requested."""
        missing = frozenset[ChannelImage]().union(*map(self._missing, documents))
        if missing and (self._requested is None or not missing <= self._requested[1]):
            self._requested = self._host.send(ReadChannels(tuple(missing))), missing

    def is_complete(self, document: Document) -> bool:
        """Whether all that a document's nodes depend on is known."""
        return not self._missing(document)

    def _missing(self, document: Document) -> frozenset[ChannelImage]:
        known = self._statistics.keys() | self._refused.keys()
        return frozenset(image for image in channel_images(document) if image not in known)

    def receive(self, response: ChannelsRead) -> None:
        """Take statistics. If choosing an image that cannot be read was the last step, that step disappears from the
        history."""
        self._statistics |= response.statistics
        self._refused |= response.refused
        self._forget_documents()
        self.lose_request(response.id)
        if not response.refused:
            return
        history, refused = self._host.history, response.refused.keys()
        present = _without_maps(history.document)
        if not refused.isdisjoint(channel_images(history.document)) and history.retract(
            lambda before: refused.isdisjoint(channel_images(before)) and _without_maps(before) == present
        ):
            self._host.document_changed()
        self._host.notify("; ".join(response.refused.values()), True)

    def receive_failure(self, request: int, line: str) -> None:
        """A request failed: its images are refused, or they would be requested again in each frame."""
        if self._requested is not None and self._requested[0] == request:
            self._refused |= dict.fromkeys(self._requested[1], line)
            self._requested = None

    def lose_request(self, request: int | None = None) -> None:
        """What is under way will not come, or (with its number) has come."""
        if self._requested is not None and request in (None, self._requested[0]):
            self._requested = None

    def reload(self, document: Document, key: str) -> None:
        """Read the images of a layer's parameter maps again: their files were written meanwhile."""
        for each in document.layer(key).parameter_maps:
            self._statistics.pop(each.image, None)
            self._refused.pop(each.image, None)
        self._forget_documents()


def _n_nodes(document: Document) -> int | None:
    value = dict(document.overrides).get("nodes")
    return value if isinstance(value, int) else None


def _without_maps(document: Document) -> Document:
    objects = tuple(
        replace(state, layers=tuple(layer.replace(parameter_maps=()) for layer in state.layers))
        for state in document.objects
    )
    return replace(document, objects=objects)
