"""Edits of objects and layers: the whole material of an object, a layer's model and parameters, and the switches that
objects and layers have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.document.document import Document, ObjectState, Variant, all_factors, split_key
from app.document.linked_layers import (
    Layers,
    linked_indices,
    possible_covers,
    unused_name,
    with_fresnel,
    without_fresnel,
)
from app.document.linked_objects import frozen_one
from app.document.looks import carried_out_in_all_looks
from app.document.named_files import variant_with_scene_names, with_scene_names
from app.document.targets import resolve
from engine.core.errors import InsituError
from engine.curve.operators import Edit, collapse
from engine.material import MODELS
from engine.material.bumps import Bumps
from engine.material.layer import FRAMES, Frame, Layer, make_layer
from engine.material.opacity import Opacity
from engine.material.parameter_maps import maps_that_fit
from engine.measured.measurement import Measurement

MAX_LAYERS = 64


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
    """Make a layer of another model, or of a preset's parameters; edits of curves that both models have stay, and from
    one part of a measurement to another the file and what else both have."""

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
        kept = layer.values if model.needs_file and layer.model.needs_file else {}
        values = make_layer(model, {**kept, **dict(self.parameters)}).with_fresnel(layer.fresnel).parameters
        names = {factor.name for factor in all_factors(model)}
        edits = tuple((factor, operators) for factor, operators in layer.edits if factor in names)
        others = [each.name for each in document.object(split_key(document, key)[0]).layers if each is not layer]
        name = unused_name(model.name, others) if layer.name == layer.model.name else layer.name
        maps = maps_that_fit(layer.parameter_maps, model.parameters)
        changed = layer.replace(model=model, name=name, parameters=values, edits=edits, parameter_maps=maps)
        return document.with_layer(key, changed)


@dataclass(frozen=True)
class SetVisible:
    """Show or hide an object (``"teapot"``), which then shades and lights nothing, or a layer (``"teapot.1"``)."""

    path: str
    visible: bool

    @property
    def label(self) -> str:
        return f"{'show' if self.visible else 'hide'} {self.path}"

    def apply(self, document: Document) -> Document:
        return _with_switch(document, self.path, {"visible": self.visible})


@dataclass(frozen=True)
class SetShadowCatcher:
    """Make an object a shadow catcher, or an object like others again."""

    object: str
    is_catcher: bool

    @property
    def label(self) -> str:
        return f"{self.object} {'a' if self.is_catcher else 'no'} shadow catcher"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        if state.emits and self.is_catcher:
            raise InsituError(f"{self.object} emits light: it catches no shadows")
        return document.with_object(replace(state, shadow_catcher=self.is_catcher))


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
class SetUnder:
    """Put a layer under another one of its object, which dims it by what it reflects itself; "": under none."""

    key: str
    cover: str

    @property
    def label(self) -> str:
        return f"{self.key} under {self.cover or 'nothing'}"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        choices = possible_covers(document.object(split_key(document, self.key)[0]).layers, layer)
        if self.cover and self.cover not in choices:
            there = ", ".join(choices) or "none; add a clear coat or a sheen"
            raise InsituError(f"{self.key} cannot lie under {self.cover!r}; layers that can: {there}")
        return document.with_layer(self.key, layer.replace(under=self.cover))


@dataclass(frozen=True)
class SetFrame:
    """Let a layer reflect in the frame of the object's bumps, "base", or in the coat's, "coat"
    (`engine.material.bumps.Bumps`)."""

    key: str
    frame: Frame

    @property
    def label(self) -> str:
        return f"{self.key} normals of the {self.frame}"

    def apply(self, document: Document) -> Document:
        layer = editable_layer(document, self.key)
        if self.frame not in FRAMES:
            raise InsituError(f"{self.key} cannot have the frame {self.frame!r}; frames: {', '.join(FRAMES)}")
        return document.with_layer(self.key, layer.replace(frame=self.frame))


@dataclass(frozen=True)
class SetEditable:
    """Declare an object editable, or fixed."""

    object: str
    editable: bool

    @property
    def label(self) -> str:
        return f"make {self.object} {'editable' if self.editable else 'fixed'}"

    @carried_out_in_all_looks
    def apply(self, document: Document) -> Document:
        return document.with_object(replace(document.object(self.object), editable=self.editable))


@dataclass(frozen=True)
class SetMaterial:
    """Give an object another material, all at once; `name` is the material's.

    bumps, opacity: those that it brings, None where the object keeps its own. choices: materials of the same file,
    which become variants of the object where it has none of that name. file: a file of materials that is to be read
    first; there are no layers before, and `name` is the material's in it, "" for the first.
    """

    object: str
    layers: Layers
    name: str = "material"
    bumps: Bumps | None = None
    opacity: Opacity | None = None
    choices: tuple[Variant, ...] = ()
    file: str = ""

    @property
    def label(self) -> str:
        return f"{self.name or self.file} on {self.object}"

    def apply(self, document: Document) -> Document:
        state = self.check(document)
        if not self.layers:
            raise InsituError(f"{self.name or self.file} has no layers; an object has one at least")
        layers = tuple(layer.replace(frozen=False, links=()) for layer in self.layers)
        material = Variant(self.name, layers, self.bumps, self.opacity)
        there = {variant.name for variant in state.variants}
        added = tuple(
            variant_with_scene_names(each, document.source) for each in self.choices if each.name not in there
        )
        state = replace(state, variants=(*state.variants, *added))
        return document.with_object(variant_with_scene_names(material, document.source).of(state))

    def check(self, document: Document) -> ObjectState:
        """The object. Raises InsituError where it cannot have another material."""
        return _editable_object(document, self.object)


@dataclass(frozen=True)
class SetVariant:
    """Give all objects the materials of one of the scene's variants, by its name."""

    name: str

    @property
    def label(self) -> str:
        return f"variant {self.name}"

    def objects(self, document: Document) -> tuple[str, ...]:
        """The objects that get other materials."""
        return tuple(state.name for state in document.objects if self.name in [each.name for each in state.variants])

    def apply(self, document: Document) -> Document:
        if self.name not in document.variants:
            there = ", ".join(document.variants) or "none; its files have no variants"
            raise InsituError(f"there is no variant {self.name!r}; available: {there}")
        for state in document.objects:
            if state.in_variant(self.name) != state:
                document = document.with_object(_editable_object(document, state.name).in_variant(self.name))
        return document


@dataclass(frozen=True)
class AddLayers:
    """Add layers on top of an object's; those whose name is taken get another. Layers that lie under nothing lie under
    the last one added that can cover them."""

    object: str
    layers: Layers

    @property
    def label(self) -> str:
        return f"add {', '.join(layer.title for layer in self.layers)} to {self.object}"

    def apply(self, document: Document) -> Document:
        state = _editable_object(document, self.object)
        if len(state.layers) + len(self.layers) > MAX_LAYERS:
            raise InsituError(f"{self.object} has {len(state.layers)} layers; it can have {MAX_LAYERS}")
        added = with_scene_names(_renamed(self.layers, state.layers), document.source)
        cover = next((layer.name for layer in reversed(added) if layer.can_cover), "")
        beneath = tuple(layer if layer.under else layer.replace(under=cover) for layer in state.layers)
        return document.with_object(replace(state, layers=(*beneath, *added)))


@dataclass(frozen=True)
class RemoveLayer:
    """Remove a layer, with its Fresnel term; layers that followed it keep its curves as their own."""

    key: str

    @property
    def label(self) -> str:
        return f"delete {self.key}"

    def apply(self, document: Document) -> Document:
        name, index = split_key(document, self.key)
        state = _editable_object(document, name)
        layers = state.layers
        if document.is_frozen(self.key):
            raise InsituError(f"{self.key} is frozen; thaw it to delete it")
        if layers[index].rises:
            return document.with_object(replace(state, layers=without_fresnel(layers, index)))
        followers = [layers[i] for i in linked_indices(layers, index) if layers[i].follows == layers[index].name]
        kept = tuple(each for each in layers if each is not layers[index] and not (each.rises and each in followers))
        if not kept:
            raise InsituError(f"{self.key} is the only layer of {name}; give the object another material instead")
        uncovered = tuple(
            each.replace(under=layers[index].under) if each.under == layers[index].name else each for each in kept
        )
        return document.with_object(replace(state, layers=_with_new_leader(uncovered, layers[index].name, followers)))


def new_layer(model: str) -> Layer:
    """A layer of a model with default parameters. InsituError for an unknown model."""
    if model not in MODELS:
        raise InsituError(f"there is no model {model!r}; available: {', '.join(sorted(MODELS))}")
    return make_layer(MODELS[model])


def operators_of_copy(source: Layer, factor: str, onto: Layer, onto_factor: str) -> tuple[Edit, ...]:
    """The operators that make a curve of one layer equal to that of another.

    Where both generated curves are the same they are the source's own, and stay editable; else a table of the edited
    curve, which replaces what is generated below it.
    """
    gamma = np.linspace(0.0, np.pi / 2, 91)
    there, here = source.generated_curve(factor)(gamma), onto.generated_curve(onto_factor)(gamma)
    if np.allclose(there, here, rtol=1e-9, atol=0.0):
        return source.operators(factor)
    return (collapse(source.operators(factor), source.generated_curve(factor)),)


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


def _editable_object(document: Document, name: str) -> ObjectState:
    state = document.object(name)
    if state.is_lamp:
        raise InsituError(f"{name} is an emitter; it has an emission and no material")
    if not state.editable:
        raise InsituError(f"{name} is fixed; make it editable to change its material")
    if frozen := frozen_one(document, name):
        raise InsituError(f"{frozen} is frozen; thaw it to change its material")
    return state


def _with_new_leader(layers: Layers, gone: str, followers: Sequence[Layer]) -> Layers:
    """The remaining layers; of those that followed the removed one, the first leads the others from now on."""
    heirs = [layer.name for layer in followers if not layer.rises]
    follows = {name: "" if name == heirs[0] else heirs[0] for name in heirs}
    return tuple(each.replace(follows=follows[each.name]) if each.follows == gone else each for each in layers)


def _renamed(layers: Layers, there: Sequence[Layer]) -> Layers:
    """The layers under names that none of those `there` has; followers follow the new name."""
    taken = {layer.name for layer in there}
    names: dict[str, str] = {}
    for layer in layers:
        names[layer.name] = unused_name(layer.name, taken)
        taken.add(names[layer.name])
    return tuple(
        layer.replace(
            name=names[layer.name],
            follows=names.get(layer.follows, ""),
            under=names.get(layer.under, ""),
            frozen=False,
            links=(),
        )  # fmt: skip
        for layer in layers
    )
