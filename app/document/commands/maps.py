"""Edits of a layer's texture and weight map (`engine.material.layer_maps`), strokes painted on it among them, of the
maps of its parameters (`engine.material.parameter_maps`), and of the surface below all layers: normal or bump map
(`engine.material.bumps`), opacity (`engine.material.opacity`), settings for Deform (`engine.scene.surface_kinds`).

Layers of one object with the same weight map, some of them with it inverted, are blended by it: they are painted
together, or the first stroke would separate them. A stroke's value is meant for the selected layer; where that has the
map inverted, one minus it is painted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.document.commands.layers import editable_layer
from app.document.document import Document, ObjectState, split_key
from app.document.linked_layers import Layers
from app.document.linked_objects import frozen_one
from app.document.targets import SURFACE
from engine.core.errors import InsituError, LoadError
from engine.material.bumps import set_bump_field
from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.material.map_tables import set_map_field
from engine.material.model import find_parameter
from engine.material.opacity import set_opacity_field
from engine.material.parameter_maps import parameter_map_from, parameter_map_table
from engine.material.strokes import MAX_DABS, MAX_STROKES, Stroke, Strokes
from engine.scene.surface_kinds import SURFACES, surface_with

NONE = "none"


@dataclass(frozen=True)
class SetMap:
    """Set a part of a layer's maps; an image's name of "" removes it."""

    key: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.key} {self.name.replace('_', ' ')}"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        return document.with_layer(self.key, layer.replace(maps=set_map_field(layer.maps, self.name, self.value)))


@dataclass(frozen=True)
class SetParameterMap:
    """Let a parameter vary over the surface, by an image: its file, or a table as in a scene's file
    (`engine.material.parameter_maps.parameter_map_from`), of which what is not given stays as it is; None, or a file's
    name of "": the parameter is the same everywhere again."""

    key: str
    parameter: str
    table: Any

    @property
    def label(self) -> str:
        return f"{self.key} {self.parameter} map"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        parameter = find_parameter(layer.model.name, layer.model.parameters, self.parameter)
        if self.table is None or self.table == "":
            return document.with_layer(self.key, layer.with_parameter_map(None, self.parameter))
        before = layer.parameter_map(self.parameter)
        kept = {} if before is None else parameter_map_table(before)
        table = {"map": self.table} if isinstance(self.table, str) else self.table
        if isinstance(table, Mapping):
            table = kept | dict(table)
        new = parameter_map_from(parameter, table)
        return document.with_layer(self.key, layer.with_parameter_map(new, self.parameter))


@dataclass(frozen=True)
class Paint:
    """Begin a stroke on a layer's weight map, or (`begins` False) continue the newest with the dabs of this one."""

    key: str
    stroke: Stroke
    begins: bool = True

    @property
    def label(self) -> str:
        return f"paint {self.key}"

    def apply(self, document: Document) -> Document:
        maps = editable_layer(document, self.key).maps
        strokes = maps.strokes
        if strokes.n_dabs + self.stroke.n_dabs > MAX_DABS or len(strokes.strokes) >= MAX_STROKES:
            raise InsituError(f"{self.key}: its map is full, it holds {MAX_DABS} dabs; undo some strokes or clear it")
        if self.begins or not strokes:
            value = 1.0 - self.stroke.value if maps.weight_invert else self.stroke.value
            strokes = strokes.with_stroke(replace(self.stroke, value=value))
        else:
            strokes = strokes.with_dabs(self.stroke)
        for key in blended_with(document, self.key):
            layer = document.layer(key)
            document = document.with_layer(key, layer.replace(maps=replace(layer.maps, strokes=strokes)))
        return document


@dataclass(frozen=True)
class BlendByMap:
    """Give the layer `other` the map of the layer `key`, inverted: where one is, the other is not."""

    key: str
    other: str

    @property
    def label(self) -> str:
        return f"blend {self.key} and {self.other} by a map"

    def apply(self, document: Document) -> Document:
        maps, layer = document.layer(self.key).maps, editable_layer(document, self.other)
        theirs = replace(
            layer.maps, weight=maps.weight, weight_channel=maps.weight_channel, weight_start=maps.weight_start,
            strokes=maps.strokes, weight_invert=not maps.weight_invert,
        )  # fmt: skip
        return document.with_layer(self.other, layer.replace(maps=theirs))


@dataclass(frozen=True)
class ClearMap:
    """Remove a layer's weight map, image and strokes."""

    key: str

    @property
    def label(self) -> str:
        return f"{self.key} without weight map"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        return document.with_layer(self.key, layer.replace(maps=_without_weight(layer.maps)))


def blended_with(document: Document, key: str) -> tuple[str, ...]:
    """Keys of the layers that are painted with this one, itself among them."""
    name, index = split_key(document, key)
    layers = document.object(name).layers
    same = [i for i, layer in enumerate(layers) if _map_of(layer) == _map_of(layers[index])]
    blended = layers[index].maps.has_weight and len({layers[i].maps.weight_invert for i in same}) == 2
    return tuple(f"{name}.{i}" for i in same) if blended else (f"{name}.{index}",)


def without_strokes(layers: Layers) -> Layers:
    """The layers for another object: strokes belong to the place where they were painted, and are removed, with the
    maps that have no image."""
    return tuple(
        layer.replace(maps=replace(layer.maps, strokes=Strokes()) if layer.maps.weight else _without_weight(layer.maps))
        if layer.maps.strokes else layer
        for layer in layers
    )  # fmt: skip


def _map_of(layer: Layer) -> tuple[str, str, float, Strokes]:
    return layer.maps.weight, layer.maps.weight_channel, layer.maps.weight_start, layer.maps.strokes


def _without_weight(maps: LayerMaps) -> LayerMaps:
    return replace(maps, weight="", weight_channel="grey", weight_start=1.0, weight_invert=False, strokes=Strokes())


@dataclass(frozen=True)
class _SetPart:
    """Set a part of what all layers of an object have in common; an image's name of "" removes it."""

    object: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.object} {self.name.replace('_', ' ')}"


@dataclass(frozen=True)
class SetBumps(_SetPart):
    """Set a part of an object's bumps."""

    def apply(self, document: Document) -> Document:
        state = _reflecting(document, self.object, "bumps")
        bumps = set_bump_field(state.bumps, self.name, self.value)
        return document.with_object(replace(state, new_bumps=None if bumps == state.own_bumps else bumps))


@dataclass(frozen=True)
class SetOpacity(_SetPart):
    """Set a part of an object's opacity."""

    def apply(self, document: Document) -> Document:
        state = _reflecting(document, self.object, "opacity")
        opacity = set_opacity_field(state.opacity, self.name, self.value)
        return document.with_object(replace(state, new_opacity=None if opacity == state.own_opacity else opacity))


@dataclass(frozen=True)
class SetSurface:
    """Make an object's surface one of a kind ("": of none), with these values of that kind's parameters."""

    object: str
    kind: str
    values: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        what = self.values[0][0] if self.values else self.kind or SURFACE
        return f"{self.object} {what}"

    def apply(self, document: Document) -> Document:
        state = _reflecting(document, self.object, "a surface for Deform")
        new = surface_with(state.surface, self.kind, dict(self.values), self.object)
        return document.with_object(replace(state, new_surface=None if new == state.own_surface else new))


def surface_named(object_name: str, path: str, value: Any) -> SetSurface:
    """The command for "surface" = "membrane", or "none"; or "membrane.translucency" = 0.5. Raises LoadError."""
    kind, _, name = path.partition(".")
    if kind == SURFACE and not name:
        if value not in (NONE, *SURFACES):
            raise LoadError(object_name, SURFACE, value, f"one of {', '.join((NONE, *SURFACES))}")
        return SetSurface(object_name, "" if value == NONE else value)
    if kind == SURFACE or not name:
        raise LoadError(object_name, path, value, f"{SURFACE}, or one of its values such as membrane.translucency")
    return SetSurface(object_name, kind, ((name, value),))


def _reflecting(document: Document, name: str, what: str) -> ObjectState:
    """An object to edit. Raises InsituError where it is frozen or cannot have `what`."""
    state = document.object(name)
    if frozen := frozen_one(document, name):
        raise InsituError(f"{frozen} is frozen; thaw it to edit it")
    if state.is_lamp:
        raise InsituError(f"{name} is an emitter; only objects that reflect have {what}")
    return state
