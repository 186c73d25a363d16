"""The edits: small frozen values that make a new document. Panels return them; they are the only writers.

A command names what it changes by key or path (see ``app.document``) and raises InsituError, with nothing changed,
when that is not there, is frozen, or the value is outside its range. Operator lists stand in the order in which they
apply: the first works on the generated curve, each next one on what the ones before it made [BenArtzi07, ch. 9].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from app.document import Document, all_factors, resolve, split_key
from app.light_commands import SetEmission, SetEnvironment, SetIntensity, SetMapping, SetRotation
from app.linked_layers import group_of, with_fresnel, without_fresnel
from app.map_commands import SetMap
from app.material_commands import AddLayers, RemoveLayer, SetMaterial
from app.paint_commands import BlendByMap, ClearMap, Paint
from app.series_commands import SetFirstBands
from engine.curve.operators import Edit, Tabulated, collapse
from engine.curve.pairs import edit_at, moved
from engine.errors import InsituError
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.measured.measurement import Measurement

CurveEdit = Edit
MAX_OPERATORS = 256


@dataclass(frozen=True)
class SetParameter:
    """Give a layer's parameter a value: a number, three numbers or a choice."""

    key: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.key} {self.name}"

    def apply(self, document: Document) -> Document:
        layer = _editable_layer(document, self.key)
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
        layer = _editable_layer(document, self.key)
        if self.model not in MODELS:
            raise InsituError(f"there is no model {self.model!r}; there is: {', '.join(sorted(MODELS))}")
        model = MODELS[self.model]
        key, layer = _leading(document, self.key) if layer.rises else (self.key, layer)
        values = make_layer(model, dict(self.parameters)).with_fresnel(layer.fresnel).parameters
        names = {factor.name for factor in all_factors(model)}
        edits = tuple((factor, operators) for factor, operators in layer.edits if factor in names)
        name = model.name if layer.name == layer.model.name else layer.name
        return document.with_layer(key, layer.replace(model=model, name=name, parameters=values, edits=edits))


@dataclass(frozen=True)
class SetOperators:
    """Replace all operators of one curve (a drag does this each frame)."""

    key: str
    factor: str
    operators: tuple[CurveEdit, ...]

    @property
    def label(self) -> str:
        return f"{self.key} {self.factor} curve"

    def apply(self, document: Document) -> Document:
        layer = _editable_layer(document, self.key)
        if len(self.operators) > MAX_OPERATORS:
            raise InsituError(f"{self.key}.{self.factor} has {MAX_OPERATORS} operators; collapse them to add more")
        return document.with_layer(self.key, layer.with_operators(self.factor, self.operators))


@dataclass(frozen=True)
class AddOperator:
    """Put an operator on a curve: on top, or at ``index`` of the list."""

    key: str
    factor: str
    operator: CurveEdit
    index: int | None = None

    @property
    def label(self) -> str:
        return f"{self.key} {self.factor} {operator_title(self.operator)}"

    def apply(self, document: Document) -> Document:
        operators = list(document.layer(self.key).operators(self.factor))
        operators.insert(len(operators) if self.index is None else self.index, self.operator)
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class ReplaceOperator:
    """Change one operator (its regions, magnitude, baseline or channels)."""

    key: str
    factor: str
    index: int
    operator: CurveEdit

    @property
    def label(self) -> str:
        return f"{self.key} {self.factor} {operator_title(self.operator)}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        operators[self.index] = self.operator
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class RemoveOperator:
    """Delete one operator, of a diagonal edit both."""

    key: str
    factor: str
    index: int

    @property
    def label(self) -> str:
        return f"delete an operator of {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        there = edit_at(operators, self.index)
        del operators[there.start : there.stop]
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class MoveOperator:
    """Move one operator, of a diagonal edit both, to the place of another."""

    key: str
    factor: str
    index: int
    to: int

    @property
    def label(self) -> str:
        return f"reorder the operators of {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        to = min(max(self.to, 0), len(operators) - 1)
        return _with_operators(document, self, list(moved(operators, self.index, to)))


@dataclass(frozen=True)
class MuteOperator:
    """Switch one operator, of a diagonal edit both, off or on again, where it stands."""

    key: str
    factor: str
    index: int
    muted: bool = True

    @property
    def label(self) -> str:
        return f"{'mute' if self.muted else 'unmute'} an operator of {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        operators = _operators_with(document, self)
        for index in edit_at(operators, self.index):
            operators[index] = replace(operators[index], muted=self.muted)
        return _with_operators(document, self, operators)


@dataclass(frozen=True)
class CollapseOperators:
    """Evaluate the edited curve into a table that takes the place of its operators [BenArtzi07, sect. 9.2].

    The table no longer follows the layer's parameters: what was generated below it is replaced.
    """

    key: str
    factor: str

    @property
    def label(self) -> str:
        return f"collapse {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        layer = document.layer(self.key)
        operators = layer.operators(self.factor)
        if not operators:
            return document
        return _with_operators(document, self, [collapse(operators, layer.generated(self.factor))])


@dataclass(frozen=True)
class ResetCurve:
    """Remove all operators of one curve: it becomes the generated one again."""

    key: str
    factor: str

    @property
    def label(self) -> str:
        return f"reset {self.key} {self.factor}"

    def apply(self, document: Document) -> Document:
        return _with_operators(document, self, [])


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
    """Freeze an object or a layer, so that it refuses edits, or thaw it."""

    path: str
    frozen: bool

    @property
    def label(self) -> str:
        return f"{'freeze' if self.frozen else 'thaw'} {self.path}"

    def apply(self, document: Document) -> Document:
        return _with_switch(document, self.path, {"frozen": self.frozen})


@dataclass(frozen=True)
class SetFresnelTerm:
    """Give a layer a second term that rises towards grazing angles (`app.linked_layers`), or take it away."""

    key: str
    present: bool

    @property
    def label(self) -> str:
        return f"{'give' if self.present else 'take'} {self.key} its Fresnel term"

    def apply(self, document: Document) -> Document:
        _editable_layer(document, self.key)
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


EditCommand = (
    SetParameter | SetModel | SetOperators | AddOperator | ReplaceOperator | RemoveOperator | MoveOperator
    | MuteOperator | CollapseOperators | ResetCurve | SetVisible | SetFrozen | SetFresnelTerm | SetEditable
    | SetMap | Paint | BlendByMap | ClearMap | SetMaterial | AddLayers | RemoveLayer | SetRotation | SetIntensity
    | SetEnvironment | SetMapping | SetEmission | SetFirstBands
)  # fmt: skip


def operator_title(*edit: CurveEdit) -> str:
    """What an edit is called in lists and in the undo menu: ``Translate Y``, ``Amplify XY``, ``Table``."""
    first = edit[0]
    if isinstance(first, Tabulated):
        return "Table"
    return f"{first.kind.capitalize()} {'XY' if len(edit) > 1 else first.axis.upper()}"


def _editable_layer(document: Document, key: str) -> Layer:
    layer = document.layer(key)
    if document.is_frozen(key):
        raise InsituError(f"{key} is frozen; thaw it to edit it")
    return layer


def _leading(document: Document, key: str) -> tuple[str, Layer]:
    """Key and value of the layer that a layer follows."""
    name, index = split_key(document, key)
    layers = document.object(name).layers
    lead = group_of(layers, index)[0]
    return f"{name}.{lead}", layers[lead]


def _operators_with(
    document: Document, command: ReplaceOperator | RemoveOperator | MoveOperator | MuteOperator
) -> list[CurveEdit]:
    """The command's curve's operators as a list, when there is one at its index."""
    operators = document.layer(command.key).operators(command.factor)
    if not 0 <= command.index < len(operators):
        there = f"{len(operators)} operators" if operators else "no operators"
        raise InsituError(f"{command.key} {command.factor} has {there}, none at {command.index}")
    return list(operators)


def _with_operators(document: Document, command: Any, operators: list[CurveEdit]) -> Document:
    return SetOperators(command.key, command.factor, tuple(operators)).apply(document)


def _with_switch(document: Document, path: str, changes: dict[str, Any]) -> Document:
    target = resolve(document, path)
    if target.kind == "object":
        return document.with_object(replace(document.object(target.object), **changes))
    if target.kind == "layer" and target.key is not None:
        return document.with_layer(target.key, document.layer(target.key).replace(**changes))
    raise InsituError(f"{path!r} is a {target.kind}, not an object or a layer")
