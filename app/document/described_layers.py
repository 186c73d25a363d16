"""Layers as scenes and sessions describe them: models with parameters, layers that follow others, Fresnel terms.

    { model = "phong", name = "coat", exponent = 80 }
    { model = "fresnel", follows = "coat", fresnel = [0.95, 0.64, 0.54] }

A layer of the "model" `fresnel` is the second term of the one it follows; it has R, which belongs to both.
"""

from __future__ import annotations

from collections.abc import Sequence

from app.document.linked_layers import FRESNEL_NAME, Layers, synchronize_layers
from engine.core.errors import LoadError
from engine.material import MODELS
from engine.material.layer import Layer
from engine.material.layer_maps import map_values
from engine.material.model import validate_parameters
from engine.material.parameters import FRESNEL, ParameterError
from engine.scene.description import LayerDescription


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
    return synchronize_layers(tuple(layer for layer in found if layer is not None))


def _plain(file: str, key: str, described: LayerDescription) -> Layer:
    if described.model not in MODELS:
        expected = " or ".join(sorted([*MODELS, FRESNEL_NAME]))
        raise LoadError(file, f"{key}.model", described.model, expected)
    model = MODELS[described.model]
    try:
        values = validate_parameters(model, described.parameters, file)
    except LoadError as error:
        raise LoadError(file, f"{key}: {error.what}", error.value, error.expected) from None
    return Layer(
        model, described.name or model.name, tuple(values.items()), follows=described.follows or "", maps=described.maps
    )


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
    given = described.parameters | map_values(described.maps)
    unknown = next((name for name in given if name != FRESNEL.name), None)
    if unknown is not None:
        raise LoadError(file, f"{key}: {unknown}", given[unknown], f"only {FRESNEL.name}")
    try:
        lead = lead.with_fresnel(described.parameters.get(FRESNEL.name, FRESNEL.default))
    except ParameterError as error:
        raise LoadError(file, f"{key}: {error.what}", error.value, error.expected) from None
    return lead, lead.replace(name=described.name or FRESNEL_NAME, follows=lead.name, rises=True)
