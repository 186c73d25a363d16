"""Layers whose strengths and roughnesses are fields, one upon the other: the stack that a surface shader describes.

All that multiplies a layer, point by point, becomes its colours and one texture: a reflectance, the share of its part
of a mixture, what a coat's colour takes. So no layer needs two images of shares. Where the share of a cover varies,
each layer beneath is two, with shared curves: one under the cover, and one where it is not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from engine.material import MODELS
from engine.material.layer_maps import LayerMaps
from engine.material.model import find_parameter
from engine.scene.description import LayerDescription
from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.graph_fields import Field, constant
from engine.scene.loaders.pbr_layers import LEAST_SHEEN, SMOOTHEST
from engine.scene.loaders.surface_inputs import fitting, mean_of, one_minus, plain, product, rgb_of

ONE = constant(1.0)
# Roughness r to the width of the model: alpha = r^2.
RoughnessRule = Callable[[float], float]


@dataclass(frozen=True)
class StackedLayer:
    """A layer of a stack. strength: its albedo or scale, which is also what a cover takes from beneath; share: what
    multiplies it besides; roughness: the root of its width, for models that have one."""

    name: str
    model: str
    strength: Field = ONE
    share: Field = ONE
    roughness: Field | None = None
    parameters: dict[str, Any] = field(default_factory=dict)
    under: str = ""
    follows: str = ""

    @property
    def is_cover(self) -> bool:
        return MODELS[self.model].is_cover


def covered(layers: list[StackedLayer], cover: StackedLayer, share: Field) -> list[StackedLayer]:
    """The layers beneath a cover that is there by a share, and the cover."""
    if share.is_constant:
        cover = replace(cover, strength=product(cover.strength, share))
        return [*(_under(layer, cover.name) for layer in layers), cover]
    rest, found = one_minus(share), list[StackedLayer]()
    for layer in layers:
        beneath = _under(layer, cover.name)
        found.append(replace(beneath, share=product(layer.share, share)))
        bare = replace(
            layer, name=_bare_name(layer.name, cover.name), follows=layer.follows or layer.name,
            under=layer.under and _bare_name(layer.under, cover.name), share=product(layer.share, rest),
        )  # fmt: skip
        found.append(bare)
    return [*found, replace(cover, share=product(cover.share, share))]


def _under(layer: StackedLayer, cover: str) -> StackedLayer:
    return layer if layer.under else replace(layer, under=cover)


def _bare_name(name: str, cover: str) -> str:
    return f"{name} without {cover}"


def layer_descriptions(layers: list[StackedLayer], maps: MapMaker) -> tuple[LayerDescription, ...]:
    """The layers as in a scene; those that reflect nothing are left out, unless they are all."""
    found = [each for layer in layers if (each := _description(layer, maps)) is not None]
    names = {each.name for each in found}
    return tuple(
        each.model_copy(update={
            "under": each.under if each.under in names else None,
            "follows": each.follows if each.follows in names else None,
        })
        for each in found
    ) or (LayerDescription(model="lambert", name="base", parameters={"albedo": (0.0, 0.0, 0.0)}),)  # fmt: skip


def _description(layer: StackedLayer, maps: MapMaker) -> LayerDescription | None:
    model = MODELS[layer.model]
    name = "albedo" if any(each.name == "albedo" for each in model.parameters) else "scale"
    parameter = find_parameter(model.name, model.parameters, name)
    factor = product(layer.strength, layer.share)
    own, strength = LayerMaps(), np.ones(3)
    number, varying = factor.parts
    if layer.is_cover and layer.strength.is_constant and layer.share.is_constant:
        # What multiplies a cover and is no part of its strength must not change what it takes from beneath.
        share = rgb_of(layer.share.value.astype(float))
        largest = float(share.max())
        strength = rgb_of(layer.strength.value.astype(float)) * (share / largest if largest > 0.0 else 0.0)
        own = replace(own, weight_start=plain(min(largest, 1.0))) if largest < 1.0 else own
    elif layer.is_cover and layer.strength.is_constant:
        strength, own = rgb_of(layer.strength.value.astype(float)), maps.colours(layer.share)
    elif varying is None:
        strength = rgb_of(number)
    elif layer.is_cover or (number > parameter.maximum).any():
        own = maps.colours(factor)
    else:
        strength, own = rgb_of(number), maps.colours(varying)
    if not np.any(strength) or own.weight_start == 0.0:
        return None
    scale = [plain(fitting(parameter, value)) for value in strength.tolist()]
    parameters = {name: tuple(scale) if parameter.kind == "rgb" else scale[0], **layer.parameters}
    parameter_maps = {}
    if layer.roughness is not None:
        least = LEAST_SHEEN if layer.model == "sheen" else SMOOTHEST
        parameters["alpha"] = plain(min(max(float(mean_of(layer.roughness)[0]) ** 2, least), 1.0))
        if not layer.roughness.is_constant:
            widths = maps.numbers(layer.roughness).table(0.0, 1.0, response="square", least=least)
            parameter_maps["alpha"] = widths
    return LayerDescription(
        model=model.name, name=layer.name, under=layer.under or None, follows=layer.follows or None, maps=own,
        parameters=parameters, parameter_maps=parameter_maps,
    )  # fmt: skip
