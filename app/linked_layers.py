"""Layers of one object that share their curves: the terms of a sum, edited once [BenArtzi07, 3.3.1].

A layer may follow another by its name. What makes the curves that both models have, operators and parameters alike, is
then the same in all layers of that group, whichever of them is edited; what scales a layer or stands in its quotient
stays its own. So a Fresnel term is a second layer that follows the highlight: the same model with reflectance 0, whose
scale says how much it adds towards grazing angles (eq. 3.12: the highlight itself has reflectance 1). Each layer has
its own transport, and pictures of layers are summed as ever.

Layers with several terms inside were rejected: every part of the program that knows a layer by its key would have had
to learn of terms, to no other effect.
"""

from __future__ import annotations

from collections.abc import Sequence

from engine.errors import LoadError
from engine.material.layer import Layer

Layers = tuple[Layer, ...]


def group_of(layers: Sequence[Layer], index: int) -> tuple[int, ...]:
    """Indices of the layers that share curves with this one, itself included; the one that leads stands first."""
    lead = layers[index].follows or layers[index].name
    followers = [i for i, layer in enumerate(layers) if layer.follows == lead]
    leaders = [i for i, layer in enumerate(layers) if layer.name == lead and not layer.follows]
    group = (*leaders[:1], *followers)
    return group if index in group else (index,)


def with_layer(layers: Layers, index: int, changed: Layer) -> Layers:
    """The layers with one replaced, and its curves in all that share them; who follows it follows its new name.

    One that is of another model now begins with the curves of the others.
    """
    found = [*layers]
    others = [i for i in group_of(layers, index) if i != index]
    if others and changed.model is not layers[index].model:
        changed = changed.sharing(layers[others[0]])
    found[index] = changed
    for i in others:
        found[i] = layers[i].sharing(changed)
        if layers[i].follows == layers[index].name != changed.name:
            found[i] = found[i].replace(follows=changed.name)
    return tuple(found)


def check_links(file: str, name: str, layers: Layers) -> Layers:
    """The layers of an object as a file has them, those that follow with the curves of the one they follow.

    Raises LoadError where a layer follows what is not there, or follows itself.
    """
    found = [*layers]
    for i, layer in enumerate(layers):
        if not layer.follows:
            continue
        leaders = [other for other in layers if not other.follows]
        leader = next((other for other in leaders if other.name == layer.follows), None)
        if leader is None:
            there = " or ".join(other.name for other in leaders) or "no layer"
            raise LoadError(file, f"{name}.{i}.follows", layer.follows, f"{there}, a layer that follows no other")
        found[i] = layer.sharing(leader)
    return tuple(found)
