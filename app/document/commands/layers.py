"""The edits of objects and layers: model and parameters, and the switches that both have."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from app.document.document import Document, all_factors, resolve, split_key
from app.document.linked_layers import linked_indices, with_fresnel, without_fresnel
from engine.core.errors import InsituError
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.measured.measurement import Measurement


@dataclass(frozen=True)
class SetParameter:
    """Set a layer's parameter: a number, three numbers or a choice."""

    key: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.key} {self.name}"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        if isinstance(layer.values.get(self.name), Measurement):
            raise InsituError(f"{self.key}.{self.name} is what was imported; give {self.key} another material instead")
        return document.with_layer(self.key, layer.with_parameter(self.name, self.value))


@dataclass(frozen=True)
class SetModel:
    """Make a layer of another model, or of a preset's parameters; edits of curves that both models have stay."""

    key: str
    model: str
    parameters: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        return f"{self.key} material"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        if self.model not in MODELS:
            raise InsituError(f"there is no model {self.model!r}; available: {', '.join(sorted(MODELS))}")
        model = MODELS[self.model]
        key, layer = _leading(document, self.key) if layer.rises else (self.key, layer)
        values = make_layer(model, dict(self.parameters)).with_fresnel(layer.fresnel).parameters
        names = {factor.name for factor in all_factors(model)}
        edits = tuple((factor, operators) for factor, operators in layer.edits if factor in names)
        name = model.name if layer.name == layer.model.name else layer.name
        return document.with_layer(key, layer.replace(model=model, name=name, parameters=values, edits=edits))


@dataclass(frozen=True)
class SetVisible:
    """Show or hide an object (``"teapot"``) or a layer (``"teapot.1"``) in the picture; its shadow stays."""

    path: str
    visible: bool

    @property
    def label(self) -> str:
        return f"{'show' if self.visible else 'hide'} {self.path}"

    def apply(self, document: Document) -> Document:
        return _with_switch(document, self.path, {"visible": self.visible})


@dataclass(frozen=True)
class SetFrozen:
    """Freeze an object or a layer, so that it refuses edits, or unfreeze it."""

    path: str
    frozen: bool

    @property
    def label(self) -> str:
        return f"{'freeze' if self.frozen else 'thaw'} {self.path}"

    def apply(self, document: Document) -> Document:
        return _with_switch(document, self.path, {"frozen": self.frozen})


@dataclass(frozen=True)
class SetFresnelTerm:
    """Add a second term to a layer that rises towards grazing angles (`app.document.linked_layers`), or remove it."""

    key: str
    present: bool

    @property
    def label(self) -> str:
        return f"{'give' if self.present else 'take'} {self.key} its Fresnel term"

    def apply(self, document: Document) -> Document:
        editable_layer(document, self.key)
        name, index = split_key(document, self.key)
        state = document.object(name)
        change = with_fresnel if self.present else without_fresnel
        return document.with_object(replace(state, layers=change(state.layers, index)))


@dataclass(frozen=True)
class SetEditable:
    """Declare an object editable, or fixed."""

    object: str
    editable: bool

    @property
    def label(self) -> str:
        return f"make {self.object} {'editable' if self.editable else 'fixed'}"

    def apply(self, document: Document) -> Document:
        return document.with_object(replace(document.object(self.object), editable=self.editable))


def editable_layer(document: Document, key: str) -> Layer:
    """A layer to edit. Raises InsituError where it is frozen."""
    layer = document.layer(key)
    if document.is_frozen(key):
        raise InsituError(f"{key} is frozen; thaw it to edit it")
    return layer


def _leading(document: Document, key: str) -> tuple[str, Layer]:
    """Key and value of the layer that a layer follows."""
    name, index = split_key(document, key)
    layers = document.object(name).layers
    lead = linked_indices(layers, index)[0]
    return f"{name}.{lead}", layers[lead]


def _with_switch(document: Document, path: str, changes: dict[str, Any]) -> Document:
    target = resolve(document, path)
    if target.kind == "object":
        return document.with_object(replace(document.object(target.object), **changes))
    if target.kind == "layer" and target.key is not None:
        return document.with_layer(target.key, document.layer(target.key).replace(**changes))
    raise InsituError(f"{path!r} is a {target.kind}, not an object or a layer")
