"""Measured layers of a document: the files that they name, and the measurements read from them.

A layer that a scene, a session or a material describes has only a file's name. The worker reads the file and answers
with a `Measurement`, small enough to be the layer's parameter; its table stays there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from app.document.document import Document
from app.document.linked_layers import Layers
from app.system.paths import full_path
from engine.material.layer import Layer
from engine.measured.measurement import Measurement

FILE = "file"


def measurement_in(layer: Layer) -> Measurement | None:
    """The measurement of a layer, read or not; None for one that is not measured."""
    value = layer.values.get(FILE)
    return value if isinstance(value, Measurement) and value.file else None


def unread_files(layers: Iterable[Layer]) -> tuple[str, ...]:
    """The files that layers name and that have not been read for them, each once."""
    found = (measurement_in(layer) for layer in layers)
    return tuple(dict.fromkeys(each.file for each in found if each is not None and not each.is_read))


def layers_of_document(document: Document) -> list[Layer]:
    """All layers."""
    return [layer for _, layer in document.layers()]


def measured_files(layers: Iterable[Layer]) -> tuple[tuple[str, int], ...]:
    """(file, number) of all measurements that were read, each once."""
    found = (measurement_in(layer) for layer in layers)
    return tuple(dict.fromkeys((each.file, each.number) for each in found if each is not None and each.is_read))


def with_measurements(layers: Layers, found: Mapping[str, Measurement]) -> Layers:
    """The layers with the measurements read from their files."""
    return tuple(_with_measurement(layer, found) for layer in layers)


def document_with_measurements(document: Document, found: Mapping[str, Measurement]) -> Document:
    """The document with the measurements read from its layers' files."""
    if not found:
        return document
    return replace(
        document, objects=tuple(replace(o, layers=with_measurements(o.layers, found)) for o in document.objects)
    )


def with_full_paths(layers: Layers, folder: Path) -> Layers:
    """The layers with absolute names for files that are named from `folder`."""
    names = unread_files(layers)
    return with_measurements(layers, {name: Measurement(full_path(name, folder)) for name in names})


def _with_measurement(layer: Layer, found: Mapping[str, Measurement]) -> Layer:
    there = measurement_in(layer)
    if there is None or there.is_read or there.file not in found:
        return layer
    return layer.with_parameter(FILE, found[there.file])
