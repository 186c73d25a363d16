"""The document that pictures are made of: each layer with parameter maps as its nodes
(`engine.material.parameter_nodes`).

The user's document has one layer for each row in the window, with its maps; files, undo and paths know no other. What
computes pictures gets this one, in which the first node has the layer's place, and its other nodes follow it at the end
of the object's layers: keys of layers that the user sees are the same in both, and a curve that is edited is edited in
all nodes, as in all layers that follow one. A document without such maps is itself.

What lies under a layer whose directional albedo varies over the surface, as a sheen's does with its roughness, is one
layer for each of a few nodes of that one, with its weight: 1 - E is a sum over nodes as well.

A map whose image has not been read yet, or cannot be, leaves its parameter at its own value.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from app.document.document import Document, ObjectState, layer_key, split_key
from app.document.linked_layers import linked_indices
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage
from engine.material.parameter_maps import ChannelStatistics
from engine.material.parameter_nodes import FEWEST_NODES, MOST_NODES, nodes_of_maps, plan_nodes
from engine.material.parameters import Value
from engine.settings import LineValue

Statistics = Mapping[ChannelImage, ChannelStatistics]
# A metal with images of colour and of roughness, over a dielectric, would have nineteen.
MOST_LAYERS_OF_OBJECT = 16
# Nodes of a cover for what lies under it: its directional albedo is smoother than its lobe.
MOST_NODES_OF_COVER = 3
_ANGLES = np.radians([0.0, 45.0, 75.0, 85.0])


def channel_images(document: Document) -> tuple[ChannelImage, ...]:
    """The channels that parameter maps read, each once."""
    layers = chain.from_iterable(state.layers for state in document.objects)
    return tuple(dict.fromkeys(each.image for layer in layers for each in layer.parameter_maps))


def n_nodes_of(document: Document) -> int | None:
    """The number of nodes of each map that the user has set, None for as many as are planned."""
    value = dict(document.overrides).get("nodes")
    return value if isinstance(value, int) else None


def plan_layers(layers: Iterable[Layer], statistics: Statistics) -> None:
    """Find the nodes of layers, of a document whose objects are not known, so that they are known."""
    for layer in layers:
        nodes_of_maps(*_with_known_maps(layer, statistics))


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
    return _nodes_of_layers(state, statistics, n_nodes, _most_nodes(state, statistics, n_nodes))


def _nodes_of_layers(state: ObjectState, statistics: Statistics, n_nodes: int | None, most: int) -> list[list[Layer]]:
    found = []
    for layer in state.layers:
        plain, of_maps = _with_known_maps(layer, statistics)
        nodes = plan_nodes(plain, of_maps, n_nodes, most) if of_maps else [plain]
        found.append([each for node in nodes for each in _under_nodes(node, statistics, most)])
    return found


def _under_nodes(layer: Layer, statistics: Statistics, most: int) -> list[Layer]:
    """A layer under each node of those of its covers whose directional albedo varies."""
    found = [layer]
    for k, cover in enumerate(layer.covers):
        plain, of_maps = _with_known_maps(cover, statistics)
        nodes = plan_nodes(plain, of_maps, None, min(most, MOST_NODES_OF_COVER)) if of_maps else [plain]
        if len(nodes) > 1 and np.ptp([node.coverage(_ANGLES) for node in nodes], axis=0).max() > 0.0:
            found = [_under(each, k, node) for each in found for node in nodes]
        elif cover.parameter_maps:
            found = [_under(each, k, cover.replace(parameter_maps=())) for each in found]
    return found


def _under(layer: Layer, k: int, node: Layer) -> Layer:
    """A layer with a node as its cover k, as much of it as there is of the node."""
    maps = layer.maps
    for weight in node.maps.node_weights:
        maps = maps.with_node_weight(weight)
    covers = (*layer.covers[:k], node, *layer.covers[k + 1 :])
    return layer.replace(covers=covers, maps=maps, node_of=layer.node_of or layer.name)


def _most_nodes(state: ObjectState, statistics: Statistics, n_nodes: int | None) -> int:
    """The most nodes of a map of an object, so that it has no more than so many layers as can be edited quickly."""
    for most in range(MOST_NODES, FEWEST_NODES, -1):
        n_layers = sum(map(len, _nodes_of_layers(state, statistics, n_nodes, most)))
        if n_nodes is not None or n_layers <= MOST_LAYERS_OF_OBJECT:
            return most
    return FEWEST_NODES


def _with_known_maps(layer: Layer, statistics: Statistics) -> tuple[Layer, list[ChannelStatistics]]:
    """The layer with those of its parameter maps whose images are known, and their statistics."""
    if not layer.parameter_maps:
        return layer, []
    known = tuple(each for each in layer.parameter_maps if each.image in statistics)
    return layer.replace(parameter_maps=known), [statistics[each.image] for each in known]


class NodeCount(NamedTuple):
    """The nodes of the map of one parameter, by the path of that, and its values there; error: see
    `ParameterNodes`."""

    path: str
    n_nodes: int
    error: float
    values: tuple[Value, ...] = ()


def node_counts(document: Document, statistics: Statistics, n_nodes: int | None = None) -> tuple[NodeCount, ...]:
    """The nodes of all parameter maps of a document; arguments as for `with_node_layers`."""
    found = []
    for state in filter(_varies, document.objects):
        most = _most_nodes(state, statistics, n_nodes)
        for i, layer in enumerate(state.layers):
            for nodes in () if layer.rises else nodes_of_maps(*_with_known_maps(layer, statistics), n_nodes, most):
                path = f"{layer_key(state.name, i)}.{nodes.parameter}"
                found.append(NodeCount(path, len(nodes.values), nodes.error, nodes.values))
    return tuple(found)


def layers_at_nodes(document: Document, key: str, counts: Sequence[NodeCount], factor: str) -> tuple[Layer, ...]:
    """A layer with the values of its parameters at each node: of those that its curve `factor` does not depend on the
    middle one. Itself alone where none varies. counts: of the document."""
    layer = document.layer(key)
    name, index = split_key(document, key)
    lead = layer_key(name, linked_indices(document.object(name).layers, index)[0]) if layer.rises else key
    found = [layer]
    for each in counts:
        owner, _, parameter = each.path.rpartition(".")
        if owner == lead:
            at_nodes = [[one.with_parameter(parameter, value) for value in each.values] for one in found]
            first, last = (at_nodes[0][i].generated_curve(factor)(_ANGLES) for i in (0, -1))
            middle, drives = len(each.values) // 2, not np.array_equal(first, last)
            found = [node for nodes in at_nodes for node in (nodes if drives else nodes[middle : middle + 1])]
    return tuple(found)


def picked_node(nodes: Sequence[Layer], node: int | None) -> int:
    """The index of the node with that index; None: of the middle one."""
    return len(nodes) // 2 if node is None else min(node, len(nodes) - 1)


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
