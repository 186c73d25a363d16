"""What of a layer a painted highlight is solved for, and what of the document an answer changes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np

from app.document.commands.curves import CurveEdit, SetOperators
from app.document.commands.layers import SetParameter, editable_layer
from app.document.commands.several import Several
from app.document.document import Document, Selection
from app.modes.placement.edited_curves import edited_layers
from engine.core.errors import InsituError, list_names
from engine.curve.tables import Float64Array, TabulatedCurve
from engine.inverse.change_operator import change_operator
from engine.inverse.curve_fit import SCALE
from engine.inverse.photo_targets import scale_parameter
from engine.material.layer import Layer, object_of, place_of

Solved = Literal["curve", "curves", "scale"]
SOLVED: tuple[Solved, ...] = get_args(Solved)
# A layer with its key.
KeyedLayer = tuple[str, Layer]
# A hand says less of a curve than a whole picture does: what it leaves open is decided by smoothness.
SMOOTHNESS = 1e-3
# Pixels of a stroke that decide, and of the rest of the object that are held. With eight times as many of the stroke
# the picture is the same within 0.2 %, and an answer takes half as long again (docs/inverse.md).
MOST_PIXELS, MOST_HELD = 1024, 1024
# How often a stroke is solved for again, and from which error on, relative to the wanted change.
MOST_COMPARED, LEAST_ERROR = 3, 0.02


def solved_curves(document: Document, selected: Selection | None, solved: Solved) -> tuple[str, tuple[str, ...]]:
    """The key of the layer that is painted, and the names of what is solved for. Raises InsituError."""
    if solved not in SOLVED:
        raise InsituError(f"solve = {solved!r}, expected {', '.join(SOLVED)}")
    if selected is None or document.object(selected.object).is_lamp:
        raise InsituError("select an object with a highlight to paint it")
    layer = editable_layer(document, selected.key)
    if solved == "scale":
        if scale_parameter(layer) is None:
            raise InsituError(f"{selected.key}: {layer.model.label} has no scale; solve for a curve")
        return selected.key, (SCALE,)
    curves = [factor.name for factor in layer.model.factors]
    first = curves[0] if selected.factor is None else layer.model.leader(selected.factor)
    if first not in curves:
        raise InsituError(f"{selected.path} is no curve of the light; select one of {list_names(curves)}")
    others = [name for name in curves if layer.model.leader(name) == name and name != first]
    return selected.key, (first, *(others if solved == "curves" else ()))


def with_change(
    layer: Layer, name: str, change: Float64Array, continued: TabulatedCurve | None
) -> tuple[tuple[CurveEdit, ...], TabulatedCurve | None]:
    """The operators of a curve without the one that is continued, where that is still on top, and the one for this
    change (J, 3) and what it continues; None where nothing changes."""
    operators = layer.operators(name)
    if continued is not None and operators and operators[-1] == continued and len(continued.values) == len(change):
        operators, change = operators[:-1], change + np.array(continued.values)
    return operators, change_operator(change, layer.with_operators(name, operators).coefficients(name, len(change)))


def set_scale(key: str, layer: Layer, factor: Float64Array) -> SetParameter:
    """Multiply a layer's scale by factors (3,), as far as the parameter permits."""
    parameter = scale_parameter(layer)
    assert parameter is not None
    value = np.clip(np.asarray(layer.values[parameter.name]) * factor, parameter.minimum, parameter.maximum)
    numbers = [float(each) for each in value]
    return SetParameter(key, parameter.name, tuple(numbers) if parameter.kind == "rgb" else float(np.mean(numbers)))


def edit_of_changes(
    key: str, layer: Layer, changes: Mapping[str, Float64Array], continued: Mapping[str, TabulatedCurve]
) -> tuple[Several, dict[str, TabulatedCurve]]:
    """The edit that changes the curves of a layer by these (J, 3), as it was before the stroke, and the operators that
    it leaves on top of them. continued: operators of strokes before that it goes on with, by curve."""
    commands, left = list[SetOperators | SetParameter](), dict[str, TabulatedCurve]()
    for name, change in changes.items():
        if name == SCALE:
            commands.append(set_scale(key, layer, 1.0 + change[0]))
            continue
        below, added = with_change(layer, name, change, continued.get(name))
        commands.append(SetOperators(key, name, below if added is None else (*below, added)))
        if added is not None:
            left[name] = added
    return Several(tuple(commands), f"paint highlight of {object_of(key)}"), left


def whole_change(name: str, before: Float64Array | None, change: Float64Array) -> Float64Array:
    """What a curve is more than at the start, where this is what it is more than after the change before."""
    if before is None:
        return change
    return (1.0 + before) * (1.0 + change) - 1.0 if name == SCALE else before + change


def shares_scale(one: KeyedLayer, selected: KeyedLayer) -> bool:
    """Whether the parameter that scales the selected layer scales this one: it is itself, its Fresnel term, or another
    node of it."""
    (key, layer), (selected_key, chosen) = one, selected
    if key == selected_key:
        return True
    own = object_of(key) == object_of(selected_key) and layer.model is chosen.model
    return own and (layer.rises != chosen.rises or bool(layer.node_of) and layer.node_of == chosen.node_of)


def painted_layers(document: Document, key: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """The keys of the layers of an object that follow these curves of one of them, which is first."""
    curve = next((name for name in names if name != SCALE), document.layer(key).model.factors[0].name)
    selected = Selection(object_of(key), place_of(key), curve)
    return tuple(each for each in edited_layers(document, selected) if object_of(each) == selected.object)
