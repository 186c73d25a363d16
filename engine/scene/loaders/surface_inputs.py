"""The inputs of a surface shader, as fields; what of them nothing asks for is listed as not shown.

Inputs come in groups with a weight, such as transmission: where that is 0, the others of the group have no effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.material.parameters import Parameter
from engine.scene.loaders.graph_fields import Array, Field, Samples, combine
from engine.scene.loaders.graph_nodes import NodeFields
from engine.scene.loaders.model import UnshownProperty
from engine.scene.loaders.shader_graph import ShaderInput, ShaderNode

Float64Array = NDArray[np.float64]
RGB = tuple[float, float, float]
_PROBE_SIDE = 64  # of the grid on which means are taken
MISSING = "not known to Insitu: the picture is as if it were not there"


class Group(NamedTuple):
    """Inputs that a weight makes effective, by patterns of their names; effect: what the picture lacks of them."""

    weight: str
    patterns: tuple[str, ...]
    effect: str = ""


class SurfaceInputs:
    """The inputs of one surface shader. groups: see `Group`; effects: of other inputs that are not shown, by
    patterns."""

    def __init__(
        self,
        node: ShaderNode,
        fields: NodeFields,
        groups: Sequence[Group] = (),
        effects: Mapping[str, str] | None = None,
    ) -> None:
        self._node, self._fields, self._groups, self._effects = node, fields, groups, effects or {}
        self._read: set[str] = set()
        self._listed: dict[str, str] = {}

    def field(self, name: str) -> Field:
        """An input's field; counts as shown."""
        self._read.add(name)
        return self._fields.of_input(self._input(name))

    def number(self, name: str, low: float = 0.0, high: float = 1.0) -> float:
        """One number, clipped to a range: of a field that varies its mean, which is listed."""
        found = self.field(name)
        if not found.is_constant:
            self.list(name, "the surface has its mean everywhere")
        return plain(float(np.clip(mean_of(found)[0], low, high)))

    def numbers(self, name: str, high: float = 1.0) -> RGB:
        """The same of three."""
        found = self.field(name)
        if not found.is_constant:
            self.list(name, "the surface has its mean everywhere")
        red, green, blue = np.clip(rgb_of(mean_of(found)), 0.0, high).tolist()
        return plain(red), plain(green), plain(blue)

    def node_of(self, name: str) -> ShaderNode | None:
        """The node that an input comes from; counts as shown."""
        self._read.add(name)
        found = self._input(name).node
        while found is not None and found.category == "dot" and "in" in found.inputs:
            found = found.inputs["in"].node
        return found

    def of_input(self, given: ShaderInput, kind: str) -> Field:
        """The field of an input of a node that is read on its own, as of this type."""
        return self._fields.of_input(given, kind)

    def list(self, name: str, effect: str) -> None:
        """List an input as not shown, or in part."""
        self._listed[name] = effect

    def is_set(self, name: str) -> bool:
        """Whether the file sets an input."""
        return self._input(name).is_set

    def unshown(self) -> tuple[UnshownProperty, ...]:
        """Inputs that the file sets and nothing asked for, and those that were listed."""
        listed = dict(self._listed)
        without_effect: set[str] = set()
        for group in self._groups:
            names = [name for name in self._node.inputs if any(fnmatchcase(name, each) for each in group.patterns)]
            weight = self._node.inputs.get(group.weight)
            is_there = weight is not None and not _is_zero(self._fields.of_input(weight))
            for name in (*names, group.weight):
                if not is_there:
                    without_effect.add(name)
                elif group.effect and name not in listed and name not in self._read and name in self._node.inputs:
                    listed[name] = group.effect
        for name, given in self._node.inputs.items():
            if name in self._read or name in without_effect or name in listed or not given.is_set:
                continue
            listed[name] = next((text for each, text in self._effects.items() if fnmatchcase(name, each)), MISSING)
        own = tuple(
            UnshownProperty(f"materials.{self._node.category}.{name}", 1, effect) for name, effect in listed.items()
            if name not in without_effect and self._node.inputs.get(name, ShaderInput("")).is_set
        )  # fmt: skip
        return (*own, *self._fields.unshown)

    def _input(self, name: str) -> ShaderInput:
        return self._node.inputs.get(name, ShaderInput("float", (0.0,)))


def mean_of(values: Field) -> Float64Array:
    """The mean (C,) of a field over the unit square."""
    return probes_of(values).mean(axis=0)


def probes_of(values: Field) -> Float64Array:
    """Values (N, C) of a field on a grid over the unit square; one of a constant field."""
    if values.is_constant:
        return values.value.astype(np.float64)[None]
    middles = (np.arange(_PROBE_SIDE, dtype=np.float32) + 0.5) / _PROBE_SIDE
    grid = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    return np.asarray(values.at(Samples(grid.astype(np.float32))), np.float64)


def rgb_of(values: Float64Array) -> Float64Array:
    """Three numbers of one or more."""
    return np.repeat(values, 3) if len(values) == 1 else values[:3]


def _is_zero(values: Field) -> bool:
    return values.is_constant and not values.value.any()


def product(*factors: Field) -> Field:
    """The product of fields: `Field.parts` has the constant ones apart from those that vary."""
    fixed = [each for each in factors if each.is_constant]
    varying = [each for each in factors if not each.is_constant]
    number = combine(_product, *fixed) if fixed else None
    if not varying:
        return combine(_product, *factors)
    whole = varying[0] if len(varying) == 1 else combine(_product, *varying)
    if number is None or (number.value == 1.0).all():
        return whole
    if not number.value.any():
        return number
    factor, inner = whole.parts
    assert inner is not None
    return replace(combine(_product, number, whole), scaled=((number.value * factor).astype(np.float32), inner))


def _product(*values: Array) -> Array:
    found = values[0]
    for each in values[1:]:
        found = found * each
    return found


def one_minus(values: Field) -> Field:
    """1 − a field."""
    return combine(lambda each: 1.0 - each, values)


def mixed(background: Field, foreground: Field, share: Field) -> Field:
    """A share of one field, and the rest of another."""
    if share.is_constant and share.value[0] in (0.0, 1.0):
        return foreground if share.value[0] else background
    return combine(lambda bg, fg, mix: bg * (1.0 - mix) + fg * mix, background, foreground, share)


def plain(value: float) -> float:
    """A number of single precision as it is written."""
    return float(f"{value:.7g}")


def fitting(parameter: Parameter, value: float) -> float:
    """A number within the range of a parameter."""
    return float(np.clip(value, parameter.minimum, parameter.maximum))
