"""The document that pictures are made of: each layer with parameter maps as its nodes
(`engine.material.parameter_nodes`).

The user's document has one layer for each row in the window, with its maps; files, undo and paths know no other. What
computes pictures gets this one, in which the first node has the layer's place, and its other nodes follow it at the end
of the object's layers: keys of layers that the user sees are the same in both, and a curve that is edited is edited in
all nodes, as in all layers that follow one. A document without such maps is itself.

A map whose image has not been read yet, or cannot be, leaves its parameter at its own value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

from app.document.document import Document, ObjectState, layer_key
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage
from engine.material.parameter_maps import ChannelStatistics, ParameterMaps
from engine.material.parameter_nodes import FEWEST_NODES, MOST_NODES, ParameterNodes, nodes_of_maps, plan_nodes
from engine.settings import LineValue

Statistics = Mapping[ChannelImage, ChannelStatistics]
# A metal with images of colour and of roughness, over a dielectric, would have nineteen.
MOST_LAYERS_OF_OBJECT = 16


def channel_images(document: Document) -> tuple[ChannelImage, ...]:
    """The channels that parameter maps read, each once."""
    layers = chain.from_iterable(state.layers for state in document.objects)
    return tuple(dict.fromkeys(each.image for layer in layers for each in layer.parameter_maps))


def with_node_layers(document: Document, statistics: Statistics, n_nodes: int | None = None) -> Document:
    """The document with nodes in place of layers with parameter maps. n_nodes: of each map, None for as many as are
    planned."""
    if not any(map(_varies, document.objects)):
        return document
    objects, added = [], dict[str, str]()
    for state in document.objects:
        if not _varies(state):
            objects.append(state)
            continue
        layers = list(state.layers)
        for i, (first, *others) in enumerate(_nodes_of_object(state, statistics, n_nodes)):
            layers[i] = first
            for number, other in enumerate(others, 2):
                added[layer_key(state.name, len(layers))] = layer_key(state.name, i)
                follows = first.follows or first.name
                layers.append(other.replace(name=f"{first.name} node {number}", follows=follows))
        objects.append(replace(state, layers=tuple(layers)))
    return replace(document, objects=tuple(objects), overrides=_with_lines_of(document.overrides, added))


def _varies(state: ObjectState) -> bool:
    """Whether an object has parameter maps."""
    return any(layer.parameter_maps for layer in state.layers)


def _nodes_of_object(state: ObjectState, statistics: Statistics, n_nodes: int | None) -> list[list[Layer]]:
    """The nodes of each layer of an object: as many as are planned for each map, fewer where that makes too many."""
    most = _most_nodes(state, statistics, n_nodes)
    found = []
    for layer in state.layers:
        known = _known_maps(layer, statistics)
        plain = layer.replace(parameter_maps=known) if layer.parameter_maps else layer
        of_maps = [statistics[each.image] for each in known]
        found.append(plan_nodes(plain, of_maps, n_nodes, most) if known else [plain])
    return found


def _most_nodes(state: ObjectState, statistics: Statistics, n_nodes: int | None) -> int:
    """The most nodes of a map of an object, so that it has no more than so many layers as can be edited quickly."""
    for most in range(MOST_NODES, FEWEST_NODES, -1):
        n_layers = sum(
            math.prod(len(each.values) for each in _nodes_of_maps(layer, statistics, n_nodes, most))
            for layer in state.layers
        )
        if n_nodes is not None or n_layers <= MOST_LAYERS_OF_OBJECT:
            return most
    return FEWEST_NODES


def _known_maps(layer: Layer, statistics: Statistics) -> ParameterMaps:
    return tuple(each for each in layer.parameter_maps if each.image in statistics)


def _nodes_of_maps(layer: Layer, statistics: Statistics, n_nodes: int | None, most: int) -> list[ParameterNodes]:
    known = _known_maps(layer, statistics)
    plain = layer.replace(parameter_maps=known)
    return nodes_of_maps(plain, [statistics[each.image] for each in known], n_nodes, most)


class NodeCount(NamedTuple):
    """The nodes of the map of one parameter, by the path of that; error: see `ParameterNodes`."""

    path: str
    n_nodes: int
    error: float


def node_counts(document: Document, statistics: Statistics, n_nodes: int | None = None) -> tuple[NodeCount, ...]:
    """The nodes of all parameter maps of a document; arguments as for `with_node_layers`."""
    found = []
    for state in filter(_varies, document.objects):
        most = _most_nodes(state, statistics, n_nodes)
        for i, layer in enumerate(state.layers):
            for nodes in () if layer.rises else _nodes_of_maps(layer, statistics, n_nodes, most):
                path = f"{layer_key(state.name, i)}.{nodes.parameter}"
                found.append(NodeCount(path, len(nodes.values), nodes.error))
    return tuple(found)


def nodes_reason(counts: Sequence[NodeCount]) -> str:
    """The reason for the numbers of nodes, with the error of each."""
    errors = (f"{each.path} {each.error:.1%}" if each.error else f"{each.path} exact" for each in counts)
    return f"as few as a pilot under lamps allows for 1 %, at most {MOST_NODES}; errors: {', '.join(errors)}"


def _with_lines_of(
    overrides: tuple[tuple[str, LineValue], ...], added: Mapping[str, str]
) -> tuple[tuple[str, LineValue], ...]:
    """The plan's overrides, those of a layer's curves for its nodes as well. added: each node's key and its layer's."""
    lines = dict(overrides)
    for node, key in added.items():
        lines |= {node + line[len(key) :]: value for line, value in overrides if line.startswith(f"{key}.")}
    return tuple(sorted(lines.items()))
