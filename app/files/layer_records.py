"""Layers in TOML, as sessions and materials have them: records, checked by pydantic models and by the parameter tables.

Layers are written whole: model, parameters, and the operators on each curve. Numbers are written in the shortest form
that reads back the same, so layers written and read are equal to the last bit; angles of operators are radians as
inside, likewise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.document.commands.curves import MAX_OPERATORS, CurveEdit
from app.document.document import all_factors, layer_key
from app.document.linked_layers import FRESNEL_NAME, Layers, layers_from_descriptions, synchronize_layers
from app.system.paths import written_path
from engine.core.errors import LoadError
from engine.curve.operators import Operator
from engine.curve.tables import ALL_CHANNELS, EVERYWHERE, TabulatedCurve
from engine.material.layer import Frame, Layer
from engine.material.layer_maps import LayerMaps
from engine.material.map_tables import map_values
from engine.material.parameter_maps import parameter_map_table
from engine.material.parameters import FRESNEL, Value
from engine.measured.measurement import Measurement
from engine.scene.description import LayerDescription, Maps, Name, Number, Parameter, Text
from engine.scene.toml_text import toml_lines, toml_value

MAX_TABLE = 8192
MAX_LAYERS = 64

Flag = Annotated[bool, Field(strict=True)]
Triple = tuple[Number, Number, Number]


class StrictModel(BaseModel):
    """Frozen, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class OperatorRecord(StrictModel):
    """An operator: one with an axis, or a table of one of the `TABLE_KINDS`, with gammas and values."""

    kind: Literal["translate", "amplify", "curve", "stroke", "points", "change", "ratio"]
    axis: Literal["x", "y"] | None = None
    regions: tuple[Number, Number, Number, Number] | None = None
    magnitude: Number | None = None
    baseline: Number = 0.0
    channels: tuple[Flag, Flag, Flag] = (True, True, True)
    muted: Flag = False
    joined: Flag = False
    gammas: Annotated[tuple[Number, ...], Field(max_length=MAX_TABLE)] = ()
    values: Annotated[tuple[Triple, ...], Field(max_length=MAX_TABLE)] = ()

    @model_validator(mode="after")
    def _is_an_edit(self) -> OperatorRecord:
        try:
            self.edit()
        except (ValueError, TypeError) as error:
            raise ValueError(f"kind: a complete operator ({error})") from None
        return self

    def edit(self) -> CurveEdit:
        """The operator."""
        if self.kind == "translate" or self.kind == "amplify":
            if self.axis is None or self.regions is None or self.magnitude is None:
                raise ValueError("with axis, regions and magnitude")
            return Operator(
                self.kind, self.axis, *self.regions, self.magnitude, self.baseline, self.channels, self.muted,
                self.joined,
            )  # fmt: skip
        return TabulatedCurve(
            self.gammas, self.values, self.muted, self.kind, EVERYWHERE if self.regions is None else self.regions,
            1.0 if self.magnitude is None else self.magnitude, self.channels,
        )  # fmt: skip


class CurveRecord(StrictModel):
    """The operators on one curve, in the order in which they apply."""

    factor: Text
    operators: Annotated[tuple[OperatorRecord, ...], Field(alias="operator", max_length=MAX_OPERATORS)]


class LayerRecord(StrictModel):
    model: Text
    name: Name
    follows: Name | None = None
    under: Name | None = None
    frame: Frame = "base"
    visible: Flag = True
    frozen: Flag = False
    links: dict[Text, Name] = Field(default_factory=dict)
    maps: Maps = LayerMaps()
    parameter_maps: dict[str, dict[str, Any]] = Field(default_factory=dict)
    values: dict[str, Parameter] = Field(default_factory=dict)
    curves: tuple[CurveRecord, ...] = Field(default=(), alias="curve", max_length=8)


def layers_of(file: str, name: str, records: Sequence[LayerRecord]) -> Layers:
    """The layers of the object or material called `name`, with all edits. Raises LoadError for `file`."""
    described = [
        LayerDescription(
            model=each.model,
            name=each.name,
            follows=each.follows,
            under=each.under,
            frame=each.frame,
            maps=each.maps,
            parameter_maps=each.parameter_maps,
            parameters=each.values,
        )
        for each in records
    ]
    plain = layers_from_descriptions(file, name, described)
    return synchronize_layers(
        tuple(
            with_curves(file, layer_key(name, i), layer, record.curves).replace(
                visible=record.visible, frozen=record.frozen, links=tuple(sorted(record.links.items()))
            )
            for i, (layer, record) in enumerate(zip(plain, records, strict=True))
        )
    )


def with_curves(file: str, key: str, layer: Layer, curves: Sequence[CurveRecord]) -> Layer:
    """The layer with the operators of its curves; LoadError for `file` and the layer called `key`."""
    known = [factor.name for factor in all_factors(layer.model)]
    names = [curve.factor for curve in curves]
    for curve in curves:
        if curve.factor not in known or names.count(curve.factor) > 1:
            raise LoadError(file, f"{key}: curve", curve.factor, f"each of {', '.join(known)} once at most")
        layer = layer.with_operators(curve.factor, [operator.edit() for operator in curve.operators])
    return layer


def description_of(layer: Layer, folder: Path | None = None) -> dict[str, Any]:
    """A layer without its edits as a scene file in that folder has it: an inline table's keys and values."""
    parameter_maps = _parameter_maps(layer)
    return (
        _named(layer) | _written(layer, folder) | _maps(layer)
        | ({"parameter_maps": parameter_maps} if parameter_maps else {})
    )  # fmt: skip


def layer_lines(layers: Layers, table: str, folder: Path | None = None) -> Iterator[str]:
    """The TOML lines of layers, an array of tables called `table`: "object.layer". Files are named from `folder`."""
    for layer in layers:
        yield f"[[{table}]]"
        yield from toml_lines({**_named(layer), "visible": layer.visible, "frozen": layer.frozen})
        if layer.links and not layer.rises:
            yield f"links = {toml_value(dict(layer.links))}"
        if maps := _maps(layer):
            yield f"maps = {toml_value(maps)}"
        if parameter_maps := _parameter_maps(layer):
            yield f"parameter_maps = {toml_value(parameter_maps)}"
        yield f"[{table}.values]"
        yield from toml_lines(_written(layer, folder))
        for factor, operators in () if layer.rises else layer.edits:
            yield f"[[{table}.curve]]"
            yield from toml_lines({"factor": factor})
            yield from operator_lines(operators)


def operator_lines(operators: Sequence[CurveEdit]) -> Iterator[str]:
    """The TOML lines of a curve's operators."""
    yield "operator = ["
    yield from (f"  {toml_value(operator_values(operator))}," for operator in operators)
    yield "]"


def _named(layer: Layer) -> dict[str, str | None]:
    model = FRESNEL_NAME if layer.rises else layer.model.name
    under = None if layer.rises else layer.under or None
    frame = None if layer.rises or layer.frame == "base" else layer.frame
    return {"model": model, "name": layer.name, "follows": layer.follows or None, "under": under, "frame": frame}


def _maps(layer: Layer) -> dict[str, Any]:
    """The records of its images; empty for a Fresnel term, which has those of its layer."""
    return {} if layer.rises else map_values(layer.maps)


def _parameter_maps(layer: Layer) -> dict[str, Any]:
    """The tables of the maps of its parameters; empty for a Fresnel term, as above."""
    return {} if layer.rises else {each.parameter: parameter_map_table(each) for each in layer.parameter_maps}


def _written(layer: Layer, folder: Path | None) -> dict[str, Any]:
    """The parameters that are written with a layer; a measurement by its file's name."""
    # Of a layer and its Fresnel term, R is written with the term, all else with the layer.
    own = [(name, value) for name, value in layer.values.items() if (name == FRESNEL.name) == layer.rises]
    return {name: _plain(value, folder) for name, value in own}


def _plain(value: Value, folder: Path | None) -> float | str | tuple[float, ...] | None:
    if not isinstance(value, Measurement):
        return value
    return written_path(value.file, folder) if value.file else None


def operator_values(operator: CurveEdit) -> dict[str, Any]:
    if isinstance(operator, TabulatedCurve):
        return {
            "kind": operator.kind,
            "muted": operator.muted,
            "regions": None if operator.regions == EVERYWHERE else operator.regions,
            "magnitude": None if operator.magnitude == 1.0 else operator.magnitude,
            "channels": None if operator.channels == ALL_CHANNELS else operator.channels,
            "gammas": operator.gammas,
            "values": operator.values,
        }
    return {
        "kind": operator.kind,
        "axis": operator.axis,
        "regions": operator.regions,
        "magnitude": operator.magnitude,
        "baseline": operator.baseline,
        "channels": operator.channels,
        "muted": operator.muted,
        "joined": operator.joined or None,
    }
