"""Edits of an object's whole material: another one, a layer more or less, a curve that was copied elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.document.commands.maps import with_scene_names
from app.document.document import Document, ObjectState, split_key
from app.document.linked_layers import Layers, linked_indices, without_fresnel
from engine.core.errors import InsituError
from engine.curve.operators import Edit, collapse
from engine.material import MODELS
from engine.material.layer import Layer, make_layer

MAX_LAYERS = 64


@dataclass(frozen=True)
class SetMaterial:
    """Give an object other layers, all at once; `name` is the material's name."""

    object: str
    layers: Layers
    name: str = "material"

    @property
    def label(self) -> str:
        return f"{self.name} on {self.object}"

    def apply(self, document: Document) -> Document:
        state = _editable_object(document, self.object)
        if not self.layers:
            raise InsituError(f"{self.name} has no layers; an object has one at least")
        layers = tuple(layer.replace(frozen=False) for layer in self.layers)
        return document.with_object(replace(state, layers=with_scene_names(layers, document.source)))


@dataclass(frozen=True)
class AddLayers:
    """Add layers on top of an object's; those whose name is taken get another."""

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
        return document.with_object(replace(state, layers=(*state.layers, *added)))


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
        return document.with_object(replace(state, layers=_with_new_leader(kept, layers[index].name, followers)))


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


def _editable_object(document: Document, name: str) -> ObjectState:
    state = document.object(name)
    if state.is_lamp:
        raise InsituError(f"{name} is an emitter; it has an emission and no material")
    if not state.editable:
        raise InsituError(f"{name} is fixed; make it editable to change its material")
    if state.frozen:
        raise InsituError(f"{name} is frozen; thaw it to change its material")
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
        options = (layer.name, *(f"{layer.name} {n}" for n in range(2, len(there) + len(layers) + 2)))
        names[layer.name] = next(name for name in options if name not in taken)
        taken.add(names[layer.name])
    return tuple(
        layer.replace(name=names[layer.name], follows=names.get(layer.follows, ""), frozen=False) for layer in layers
    )
