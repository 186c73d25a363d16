"""What of an object's material a photograph is to determine: curves, scales, and parameters that no curve has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from engine.core.errors import InsituError, list_names
from engine.inverse.curve_fit import SCALE
from engine.material.layer import Layer
from engine.material.parameters import Parameter

# The parameters that are a layer's scale.
SCALES = ("scale", "albedo")


class Target(NamedTuple):
    """Of the layer of this number: a curve, `SCALE`, or a scalar parameter to search for."""

    layer: int
    name: str


def default_targets(layers: Sequence[Layer]) -> tuple[Target, ...]:
    """Of each visible layer that is not another's second term: its scale; unless it is diffuse its first curve, and the
    parameters that drive this as well as the quotient, such as a roughness."""
    found = list[Target]()
    for i, layer in enumerate(layers):
        if not layer.visible or layer.follows or layer.rises:
            continue
        found += [Target(i, SCALE)] if scale_parameter(layer) else []
        if _is_scaled_only(layer):
            continue
        found.append(Target(i, layer.model.factors[0].name))
        shaping = (p for p in layer.model.parameters if p.kind == "scalar" and {"A", "quotient"} <= set(p.drives))
        found += [Target(i, p.name) for p in shaping]
    return tuple(found)


def target_of(layers: Sequence[Layer], index: int, name: str) -> Target:
    """The target of this name; its scale by the name of the parameter, too. Raises InsituError."""
    layer = layers[index]
    if not layer.visible:
        raise InsituError(f"{layer.title} is hidden, expected a layer in the picture")
    if layer.rises:
        raise InsituError(f"{layer.title} is all of the layer that it follows; name that one")
    curves = [factor.name for factor in layer.model.factors if layer.model.leader(factor.name) == factor.name]
    scalars = [p.name for p in layer.model.parameters if p.kind == "scalar" and p.name not in SCALES]
    scales = [p.name for p in layer.parameter_table if p.name in SCALES]
    if scales and name in (SCALE, *scales):
        return Target(index, SCALE)
    if name in curves and layer.model.shared:
        raise InsituError(f"{layer.model.label} has one curve for two angles and cannot be matched")
    if name not in (*curves, *scalars):
        raise InsituError(f"{layer.title}: {name!r}, expected {list_names([*curves, *scales, *scalars])}")
    return Target(index, name)


def scale_parameter(layer: Layer) -> Parameter | None:
    """The parameter that a layer's strength is proportional to."""
    return next((p for p in layer.parameter_table if p.name in SCALES), None)


def _is_scaled_only(layer: Layer) -> bool:
    """Whether its shape is hardly to be seen in a picture, or not to be solved for."""
    return layer.model.is_diffuse or bool(layer.model.shared)
