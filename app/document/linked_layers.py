"""Layers of one object that share their curves: the terms of a sum, edited once [BenArtzi07, 3.3.1].

A layer may follow another by its name. What makes the curves that both models have, operators and parameters alike, is
then the same in all layers of that group, whichever of them is edited; what scales a layer or is in its quotient stays
its own. A second Fresnel term (`Layer.rises`) shares everything with the layer it follows, R included. Each layer has
its own transport, and pictures of layers are summed as always.

Scenes and sessions describe the second term as a layer of the "model" `fresnel` that follows the first; it has R, which
belongs to both:

    { model = "phong", name = "coat", exponent = 80 }
    { model = "fresnel", follows = "coat", fresnel = [0.95, 0.64, 0.54] }

A layer may also lie `under` another, which takes its directional albedo from it (`Layer.covers`); that one may lie
under a further one. `with_covers` hands each layer the present value of those above it, so that a layer can be
evaluated by itself.

Layers with several terms inside were rejected: every part of the program that knows a layer by its key would have had
to handle terms, to no other effect.
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Sequence

import numpy as np

from engine.core.errors import InsituError, LoadError
from engine.material import MODELS
from engine.material.layer import Layer
from engine.material.map_tables import map_values
from engine.material.model import channels, validate_parameters
from engine.material.parameter_maps import parameter_maps_from
from engine.material.parameters import FRESNEL, Parameter, ParameterError
from engine.scene.description import LayerDescription

Layers = tuple[Layer, ...]
FRESNEL_NAME = "fresnel"


def linked_indices(layers: Sequence[Layer], index: int) -> tuple[int, ...]:
    """Indices of the layers that share curves with this one, itself included; the leader comes first."""
    lead = layers[index].follows or layers[index].name
    followers = [i for i, layer in enumerate(layers) if layer.follows == lead]
    leaders = [i for i, layer in enumerate(layers) if layer.name == lead and not layer.follows]
    group = (*leaders[:1], *followers)
    return group if index in group else (index,)


def with_covers(layers: Layers) -> Layers:
    """The layers, each with the present values of those that lie on it, the nearest first; unchanged ones are the same
    objects. What lay under a layer that is gone, or covers no more, lies under nothing."""
    by_name = {layer.name: layer for layer in reversed(layers) if layer.can_cover}
    found = []
    for layer in layers:
        covers: list[Layer] = []
        above = by_name.get(layer.under)
        while above is not None and above.name not in {layer.name, *(each.name for each in covers)}:
            covers.append(above.replace(covers=(), frozen=False, links=()))
            above = by_name.get(above.under)
        under = covers[0].name if covers else ""
        if (layer.under, layer.covers) != (under, tuple(covers)):
            layer = layer.replace(under=under, covers=tuple(covers))
        found.append(layer)
    return tuple(found)


def possible_covers(layers: Layers, layer: Layer) -> tuple[str, ...]:
    """The names of the layers that can lie on this one: covering ones that do not lie under it themselves."""
    return tuple(
        each.name for each in layers
        if each.can_cover and layer.name not in (each.name, *(cover.name for cover in each.covers))
    )  # fmt: skip


def with_layer(layers: Layers, index: int, changed: Layer) -> Layers:
    """The layers with one replaced, and its curves in all that share them; followers follow its new name.

    A follower that gets another model starts with the curves of the others.
    """
    found = [*layers]
    found[index] = changed
    group = linked_indices(layers, index)
    lead = group[0]
    if changed.rises:
        found[lead] = layers[lead].with_curves_of(changed)
    source = lead if changed.rises else index
    others = [i for i in group if i != source and not layers[i].rises]
    if others and found[source].model is not layers[source].model:
        found[source] = found[source].with_curves_of(layers[others[0]])
    for i in others:
        found[i] = layers[i].with_curves_of(found[source])
    for i in (i for i in group if layers[i].rises):
        found[i] = found[i].with_curves_of(found[lead])
    for i in group:
        if layers[i].follows == layers[lead].name != found[lead].name:
            found[i] = found[i].replace(follows=found[lead].name)
    if changed.name != layers[index].name:
        found = [each.replace(under=changed.name) if each.under == layers[index].name else each for each in found]
    return with_covers(tuple(found))


def synchronize_layers(layers: Layers) -> Layers:
    """The layers, those that follow with the curves of the one they follow, and those under others with these."""
    leads = [layers[linked_indices(layers, index)[0]] for index in range(len(layers))]
    return with_covers(
        tuple(each if each is lead else each.with_curves_of(lead) for each, lead in zip(layers, leads, strict=True))
    )


def with_fresnel(layers: Layers, index: int) -> Layers:
    """The layers with a Fresnel term for one of them, at the end; at normal incidence it reflects as before: its colour
    becomes R."""
    layer = layers[index]
    if layer.fresnel is not None:
        return layers
    if layer.follows:
        raise InsituError(
            f"{layer.title} follows {layers[linked_indices(layers, index)[0]].title}; give that layer the Fresnel term"
        )
    strength = _strength(layer)
    fresnel: object = FRESNEL.default
    if strength is not None:
        now = channels(layer.values, strength.name)
        fresnel = np.minimum(now, 1.0)
        layer = layer.with_parameter(strength.name, _fitting(strength, np.maximum(now, 1.0)))
    lead = layer.with_fresnel(fresnel)
    term = lead.replace(
        name=unused_name(FRESNEL_NAME, [each.name for each in layers]),
        follows=lead.name,
        visible=True,
        frozen=False,
        rises=True,
    )
    return (*layers[:index], lead, *layers[index + 1 :], term)


def without_fresnel(layers: Layers, index: int) -> Layers:
    """The layers without the Fresnel term of one of them (or that is the one): R becomes its colour again."""
    lead = linked_indices(layers, index)[0]
    layer = layers[lead]
    if layer.fresnel is None:
        return layers
    strength = _strength(layer)
    if strength is not None:
        layer = layer.with_parameter(
            strength.name, _fitting(strength, channels(layer.values, strength.name) * layer.fresnel)
        )
    kept = (*layers[:lead], layer.with_fresnel(None), *layers[lead + 1 :])
    return tuple(each for each in kept if not (each.rises and each.follows == layer.name))


def _strength(layer: Layer) -> Parameter | None:
    """The parameter that is only the layer's strength or colour."""
    return next((p for p in layer.model.parameters if p.drives == ("scale",) and p.kind != "choice"), None)


def _fitting(parameter: Parameter, value: np.ndarray) -> object:
    """A strength (3,) as a value of the parameter."""
    inside = np.clip(value, parameter.minimum, parameter.maximum)
    return tuple(inside.tolist()) if parameter.kind == "rgb" else float(inside.mean())


def unused_name(name: str, taken: Container[str]) -> str:
    """The name, with a number where another layer of the object has it: covers and leaders are found by their names."""
    numbered = (f"{name} {number}" for number in itertools.count(2))
    return next(each for each in itertools.chain((name,), numbered) if each not in taken)


def layers_from_descriptions(file: str, name: str, described: Sequence[LayerDescription]) -> Layers:
    """The layers of an object, unedited. LoadError names the file, the layer and the error."""
    keys = [f"{name}.{index}" for index in range(len(described))]
    found: list[Layer | None] = [
        None if each.model == FRESNEL_NAME else _plain(file, key, each)
        for key, each in zip(keys, described, strict=True)
    ]
    for i, (key, each) in enumerate(zip(keys, described, strict=True)):
        if each.follows or found[i] is None:
            lead = _leader(file, key, each.follows, found)
            if found[i] is None:
                found[lead], found[i] = _two_terms(file, key, each, found[lead])
    for key, layer in zip(keys, found, strict=True):
        _check_cover(file, key, layer, found)
    return synchronize_layers(tuple(layer for layer in found if layer is not None))


def _plain(file: str, key: str, described: LayerDescription) -> Layer:
    if described.model not in MODELS:
        expected = " or ".join(sorted([*MODELS, FRESNEL_NAME]))
        raise LoadError(file, f"{key}.model", described.model, expected)
    model = MODELS[described.model]
    try:
        values = validate_parameters(model, described.parameters, file)
        parameter_maps = parameter_maps_from(model.parameters, described.parameter_maps)
    except (LoadError, ParameterError) as error:
        raise LoadError(file, f"{key}: {error.what}", error.value, error.expected) from None
    return Layer(
        model, described.name or model.name, tuple(values.items()), follows=described.follows or "",
        maps=described.maps, parameter_maps=parameter_maps, under=described.under or "",
        frame=described.frame,
    )  # fmt: skip


def _check_cover(file: str, key: str, layer: Layer | None, layers: Sequence[Layer | None]) -> None:
    """Raise LoadError unless what lies on a layer, if anything, is a layer that can, and not the layer itself."""
    above, seen = layer, set[str]()
    while above is not None and above.under:
        covers = {each.name: each for each in layers if each is not None and each.can_cover}
        seen.add(above.name)
        if above.under not in covers or above.under in seen:
            there = " or ".join(name for name in covers if name not in seen) or "no layer"
            models = " or ".join(name for name, model in MODELS.items() if model.is_cover)
            raise LoadError(file, f"{key}.under", above.under, f"{there}: another layer of the model {models}")
        above = covers[above.under]


def _leader(file: str, key: str, follows: str | None, layers: Sequence[Layer | None]) -> int:
    """The index of the layer that is followed: one that follows no other."""
    leaders = {layer.name: i for i, layer in reversed([*enumerate(layers)]) if layer is not None and not layer.follows}
    if follows not in leaders:
        there = " or ".join(reversed(leaders)) or "no layer"
        raise LoadError(file, f"{key}.follows", follows or "nothing", f"{there}, a layer that follows no other")
    return leaders[follows]


def _two_terms(file: str, key: str, described: LayerDescription, lead: Layer | None) -> tuple[Layer, Layer]:
    """A layer and its second term."""
    assert lead is not None
    if lead.fresnel is not None:
        raise LoadError(file, f"{key}.follows", lead.name, "a layer that has no Fresnel term yet")
    given = described.parameters | map_values(described.maps) | described.parameter_maps
    given |= {"under": described.under} if described.under else {}
    given |= {"frame": described.frame} if described.frame != "base" else {}
    unknown = next((name for name in given if name != FRESNEL.name), None)
    if unknown is not None:
        raise LoadError(file, f"{key}: {unknown}", given[unknown], f"only {FRESNEL.name}")
    try:
        lead = lead.with_fresnel(described.parameters.get(FRESNEL.name, FRESNEL.default))
    except ParameterError as error:
        raise LoadError(file, f"{key}: {error.what}", error.value, error.expected) from None
    return lead, lead.replace(name=described.name or FRESNEL_NAME, follows=lead.name, rises=True)
