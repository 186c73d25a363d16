"""Curves that layers of several objects share, edited once.

A curve has a link, by name, and all layers that have a link of that name for the curve follow each other: in its
operators, and in the parameters that drive it in the tables of both models, as layers of one object do
(`app.document.linked_layers`). The link is the layer's own, so that it goes with it through renames, duplicates, looks
and sessions, and nothing is left to tidy where an object is deleted. A link that one layer alone has is none.

Rejected: a list of links beside the objects, which each edit of these would have to keep.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from app.document.linked_layers import with_layer

if TYPE_CHECKING:
    from app.document.document import Document
    from engine.material.layer import Layer

CurveLinks = Mapping[tuple[str, str], tuple[str, ...]]


def curve_links(document: Document) -> CurveLinks:
    """The keys of the layers that have each link, by the curve's name and the link's."""
    found = dict[tuple[str, str], list[str]]()
    for key, layer in document.layers():
        for link in layer.links:
            if link[0] in layer.model.curve_names:
                found.setdefault(link, []).append(key)
    return {link: tuple(keys) for link, keys in found.items() if len(keys) > 1}


def linked_keys(document: Document, key: str, factor: str) -> tuple[str, ...]:
    """The keys of the other layers that share a curve by its link."""
    name = document.layer(key).link(factor)
    return tuple(other for other in document.curve_links.get((factor, name), ()) if other != key) if name else ()


def linked_layers_of(document: Document, key: str) -> tuple[str, ...]:
    """The keys of all layers that share any curve of a layer by a link."""
    layer = document.layer(key)
    return tuple(dict.fromkeys(other for factor, _ in layer.links for other in linked_keys(document, key, factor)))


def with_links_followed(document: Document, changed: tuple[str, ...]) -> Document:
    """The document after the layers of these keys have changed: what shares curves with them follows, and what shares
    others with that. A layer follows once; all that follow come from one edit."""
    waiting, done = [*changed], set(changed)
    while waiting:
        key = waiting.pop(0)
        layer = document.layer(key)
        for factor, _ in layer.links:
            for other in linked_keys(document, key, factor):
                followed = document.layer(other).with_curve_of(layer, factor)
                if other in done or followed is document.layer(other):
                    continue
                before = document
                document = _with_layer(document, other, followed)
                own = [k for k, _ in document.layers() if document.layer(k) is not before.layer(k)]
                waiting += [k for k in own if k not in done]
                done.update(own)
    return document


def with_linked_curves(document: Document, key: str, layer: Layer) -> Layer:
    """A layer of another model in the place of one, with the curves of those that this one shares curves with."""
    for factor, _ in layer.links:
        others = linked_keys(document, key, factor)
        if others and factor in layer.model.curve_names:
            layer = layer.with_curve_of(document.layer(others[0]), factor)
    return layer


def _with_layer(document: Document, key: str, changed: Layer) -> Document:
    name, _, index = key.rpartition(".")
    state = document.object(name)
    return document.with_object(replace(state, layers=with_layer(state.layers, int(index), changed)))


def free_link_name(document: Document, factor: str) -> str:
    """A name for a new link of a curve."""
    taken = {link for _, layer in document.layers() for _, link in layer.links}
    number = 1
    while f"{factor} {number}" in taken:
        number += 1
    return f"{factor} {number}"
