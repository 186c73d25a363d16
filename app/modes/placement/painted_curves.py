"""What of a layer a painted highlight is solved for, and what of the document an answer changes."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from app.document.commands.curves import CurveEdit
from app.document.commands.layers import SetParameter, editable_layer
from app.document.document import Document, Selection
from app.modes.placement.edited_curves import edited_layers
from engine.core.errors import InsituError, list_names
from engine.curve.tables import Float64Array, TabulatedCurve
from engine.inverse.change_operator import change_operator
from engine.inverse.curve_fit import SCALE
from engine.inverse.photo_targets import SCALES
from engine.material.layer import Layer, object_of, place_of
from engine.material.parameters import Parameter

Solved = Literal["curve", "curves", "scale"]
SOLVED: tuple[Solved, ...] = get_args(Solved)
# A hand says less of a curve than a whole picture does: what it leaves open is decided by smoothness.
SMOOTHNESS = 1e-3
# How often a stroke is solved for again, and from which error on, relative to the wanted change.
MOST_COMPARED, LEAST_ERROR = 3, 0.02


def solved_curves(document: Document, selected: Selection | None, solved: Solved) -> tuple[str, tuple[str, ...]]:
    """The key of the layer that is painted, and the names of what is solved for. Raises InsituError."""
    if selected is None or document.object(selected.object).is_lamp:
        raise InsituError("select an object with a highlight to paint it")
    layer = editable_layer(document, selected.key)
    if solved == "scale":
        if scale_of(layer) is None:
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


def scale_of(layer: Layer) -> Parameter | None:
    """The parameter that a layer's strength is proportional to."""
    return next((each for each in layer.parameter_table if each.name in SCALES), None)


def set_scale(key: str, layer: Layer, factor: Float64Array) -> SetParameter:
    """Multiply a layer's scale by factors (3,), as far as the parameter permits."""
    parameter = scale_of(layer)
    assert parameter is not None
    value = np.clip(np.asarray(layer.values[parameter.name]) * factor, parameter.minimum, parameter.maximum)
    numbers = [float(each) for each in value]
    return SetParameter(key, parameter.name, tuple(numbers) if parameter.kind == "rgb" else float(np.mean(numbers)))


def painted_layers(document: Document, key: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """The keys of the layers of an object that follow these curves of one of them, which is first."""
    curve = next((name for name in names if name != SCALE), document.layer(key).model.factors[0].name)
    selected = Selection(object_of(key), place_of(key), curve)
    return tuple(each for each in edited_layers(document, selected) if object_of(each) == selected.object)
