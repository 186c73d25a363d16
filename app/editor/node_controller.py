"""The statistics of the images of parameter maps on the window's side, and the document that pictures are made of with
them (`app.document.node_layers`).

The worker reads images and finds nodes, which takes longer than a frame. So a map that the user has just chosen or
changed is shown as it was before for a moment, or by its parameter's own value where there was none; while one is
dragged, nothing is asked for. Statistics and nodes belong to a scene's files, not to the document: undo needs none
again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

from app.document.document import Document
from app.document.history import History
from app.document.linked_layers import with_covers
from app.document.node_layers import NodeCount, channel_images, n_nodes_of, node_counts, with_node_layers
from app.messages.file_messages import ChannelsRead, ReadChannels
from app.messages.worker_messages import Request
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage
from engine.material.model import Model
from engine.material.parameter_maps import ChannelStatistics, ParameterMap
from engine.material.parameter_nodes import KnownNodes, are_nodes_known, remember_nodes

# The present document, the one that is drawn, and that of side A.
_MOST_CACHED = 4
_Place = tuple[str, str, str]  # object, layer, parameter
_Needed = tuple[Model, ParameterMap]


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

    def scene_opened(
        self, statistics: Mapping[ChannelImage, ChannelStatistics], nodes: KnownNodes | None = None
    ) -> None:
        """Another scene is open; statistics, nodes: of the images and the maps that it and its session name."""
        remember_nodes(nodes or {})
        self._statistics, self._refused = dict(statistics), dict[ChannelImage, str]()
        self._requested: tuple[int, frozenset[_Needed]] | None = None
        self._shown: dict[_Place, ParameterMap] = {}
        self._forget_documents()

    def _forget_documents(self) -> None:
        self._cached: list[tuple[Document, Document]] = []
        self._counted: tuple[Document, tuple[NodeCount, ...]] | None = None

    def with_nodes(self, document: Document) -> Document:
        """The document that pictures are made of; the same one for the same document."""
        found = next((pair for pair in self._cached if pair[0] is document), None)
        if found is None:
            ready = self._with_ready_maps(document)
            found = document, with_node_layers(ready, self._statistics, n_nodes_of(document))
        others = [pair for pair in self._cached if pair is not found]
        self._cached = [*others[1 - _MOST_CACHED :], found]
        return found[1]

    def counts(self, document: Document) -> tuple[NodeCount, ...]:
        """The nodes of all parameter maps of a document; those of the last one are remembered, for every frame."""
        if self._counted is None or self._counted[0] is not document:
            ready = self._with_ready_maps(document)
            self._counted = document, node_counts(ready, self._statistics, n_nodes_of(document))
        return self._counted[1]

    def refusal(self, layer: Layer) -> str:
        """Why images of a layer's parameter maps cannot be used, in one line; "" where they can, or nothing is known
        yet."""
        found = (self._refused.get(each.image, "") for each in layer.parameter_maps)
        return "; ".join(dict.fromkeys(filter(None, found)))

    def request_missing(self, *documents: Document) -> None:
        """Request what documents need and what is neither known nor requested; not during a drag."""
        missing = frozenset[_Needed]().union(*map(self._missing, documents))
        if not missing or self._host.history.dragging:
            return
        if self._requested is None or not missing <= self._requested[1]:
            unread = dict.fromkeys(own.image for _, own in missing if own.image not in self._statistics)
            self._requested = self._host.send(ReadChannels(tuple(unread), documents)), missing

    def is_complete(self, document: Document) -> bool:
        """Whether all that a document's nodes depend on is known."""
        return not self._missing(document)

    def _missing(self, document: Document) -> frozenset[_Needed]:
        """The maps whose image is unread, or whose nodes are not known, with the model of their layer."""
        return frozenset(
            (layer.model, own)
            for state in document.objects for layer in state.layers for own in layer.parameter_maps
            if own.image not in self._refused and not self._is_ready(layer, own)
        )  # fmt: skip

    def _is_ready(self, layer: Layer, own: ParameterMap) -> bool:
        statistics = self._statistics.get(own.image)
        return statistics is not None and are_nodes_known(layer, own, statistics)

    def _with_ready_maps(self, document: Document) -> Document:
        """The document with those maps whose nodes are known, in place of others those that were shown before."""
        if not any(layer.parameter_maps for state in document.objects for layer in state.layers):
            return document
        objects = []
        for state in document.objects:
            layers = tuple(self._with_own_ready_maps(state.name, layer) for layer in state.layers)
            changed = any(new is not old for new, old in zip(layers, state.layers, strict=True))
            objects.append(replace(state, layers=with_covers(layers)) if changed else state)
        return replace(document, objects=tuple(objects))

    def _with_own_ready_maps(self, name: str, layer: Layer) -> Layer:
        maps = []
        for own in layer.parameter_maps:
            place = name, layer.name, own.parameter
            if self._is_ready(layer, own):
                self._shown[place] = own
                maps.append(own)
            elif own.image not in self._refused and place in self._shown and self._is_ready(layer, self._shown[place]):
                maps.append(self._shown[place])
        return layer if tuple(maps) == layer.parameter_maps else layer.replace(parameter_maps=tuple(maps))

    def receive(self, response: ChannelsRead) -> None:
        """Take statistics. If choosing an image that cannot be read was the last step, that step disappears from the
        history."""
        remember_nodes(response.nodes)
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
            self._refused |= dict.fromkeys((own.image for _, own in self._requested[1]), line)
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


def _without_maps(document: Document) -> Document:
    objects = tuple(
        replace(state, layers=tuple(layer.replace(parameter_maps=()) for layer in state.layers))
        for state in document.objects
    )
    return replace(document, objects=objects)
