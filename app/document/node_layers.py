"""The document that pictures are made of: each layer with parameter maps as its nodes
(`engine.material.parameter_nodes`).

The user's document has one layer for each row in the window, with its maps; files, undo and paths know no other. What
computes pictures gets this one, in which the first node has the layer's place, and its other nodes follow it at the end
of the object's layers: keys of layers that the user sees are the same in both, and a curve that is edited is edited in
all nodes, as in all layers that follow one. A document without such maps is itself.

A map whose image has not been read yet, or cannot be, leaves its parameter at its own value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from app.document.document import Document, layer_key
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage
from engine.material.parameter_maps import ChannelStatistics
from engine.material.parameter_nodes import MOST_NODES, find_nodes, plan_nodes
from engine.settings import LineValue

Statistics = Mapping[ChannelImage, ChannelStatistics]


def channel_images(document: Document) -> tuple[ChannelImage, ...]:
    """The channels that parameter maps read, each once."""
    return tuple(dict.fromkeys(each.image for _, layer in document.layers() for each in layer.parameter_maps))


def with_node_layers(document: Document, statistics: Statistics, n_nodes: int | None = None) -> Document:
    """The document with nodes in place of layers with parameter maps. n_nodes: of each map, None for as many as are
    planned."""
    if not any(layer.parameter_maps for _, layer in document.layers()):
        return document
    objects, added = [], dict[str, str]()
    for state in document.objects:
        layers = list(state.layers)
        for i, layer in enumerate(state.layers):
            layers[i], *others = _nodes(layer, statistics, n_nodes)
            for number, other in enumerate(others, 2):
                added[layer_key(state.name, len(layers))] = layer_key(state.name, i)
                follows = layer.follows or layer.name
                layers.append(other.replace(name=f"{layer.name} node {number}", follows=follows))
        objects.append(replace(state, layers=tuple(layers)))
    return replace(document, objects=tuple(objects), overrides=_with_lines_of(document.overrides, added))


class NodeCount(NamedTuple):
    """The nodes of the map of one parameter, by the path of that; error: see `ParameterNodes`."""

    path: str
    n_nodes: int
    error: float


def node_counts(document: Document, statistics: Statistics, n_nodes: int | None = None) -> tuple[NodeCount, ...]:
    """The nodes of all parameter maps of a document; arguments as for `with_node_layers`."""
    found = []
    for key, layer in document.layers():
        for each in layer.parameter_maps if not layer.rises else ():
            if each.image in statistics:
                nodes = find_nodes(layer, each, statistics[each.image], n_nodes)
                found.append(NodeCount(f"{key}.{each.parameter}", len(nodes.values), nodes.error))
    return tuple(found)


def nodes_reason(counts: Sequence[NodeCount]) -> str:
    """The reason for the numbers of nodes, with the error of each."""
    errors = (f"{each.path} {each.error:.1%}" if each.error else f"{each.path} exact" for each in counts)
    return f"as few as a pilot under lamps allows for 1 %, at most {MOST_NODES}; errors: {', '.join(errors)}"


def _nodes(layer: Layer, statistics: Statistics, n_nodes: int | None) -> list[Layer]:
    known = tuple(each for each in layer.parameter_maps if each.image in statistics)
    if not known:
        return [layer.replace(parameter_maps=())]
    return plan_nodes(layer.replace(parameter_maps=known), [statistics[each.image] for each in known], n_nodes)


def _with_lines_of(
    overrides: tuple[tuple[str, LineValue], ...], added: Mapping[str, str]
) -> tuple[tuple[str, LineValue], ...]:
    """The plan's overrides, those of a layer's curves for its nodes as well. added: each node's key and its layer's."""
    lines = dict(overrides)
    for node, key in added.items():
        lines |= {node + line[len(key) :]: value for line, value in overrides if line.startswith(f"{key}.")}
    return tuple(sorted(lines.items()))
