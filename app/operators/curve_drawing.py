"""Operators that draw the selected curve: freehand, and by control points; as tools of the mouse and in scripts."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from app.document.commands.curves import AddOperator
from app.document.selection import layer_shown
from app.document.view_state import Channel, channels_of
from app.editor.editor import Editor
from app.operators.operator import CURVE, Gesture, Operator, ScriptKey, ValueRecord
from engine.curve.drawing import (
    FALLOFF,
    LEAST_GAP,
    MOST_SAMPLES,
    SMOOTHING,
    coloured,
    follow_pointer,
    smooth,
    stroke,
    through_points,
)
from engine.curve.operators import apply_operators
from engine.curve.tables import HALF_PI, VALUE_LIMIT, Float64Array, TabulatedCurve
from engine.scene.description import Number

Degrees = Annotated[Number, Field(ge=0.0, le=90.0)]
Height = Annotated[Number, Field(ge=-VALUE_LIMIT, le=VALUE_LIMIT)]


class CurveStroke(ValueRecord):
    points: Annotated[
        tuple[tuple[Degrees, Height], ...],
        Field(min_length=2, max_length=1000, description="Angles in degrees, and values, that the pointer passes."),
    ]
    channel: Annotated[Channel, Field(description="Which of red, green and blue it changes.")] = "rgb"

    @model_validator(mode="after")
    def _has_width(self) -> CurveStroke:
        if len({degrees for degrees, _ in self.points}) < 2:
            raise ValueError("points at two angles or more")
        return self


class CurvePoints(ValueRecord):
    points: Annotated[
        tuple[tuple[Degrees, Height], ...],
        Field(min_length=1, max_length=256, description="Increasing angles in degrees, and the curve's values there."),
    ]
    channel: Annotated[Channel, Field(description="Which of red, green and blue they change.")] = "rgb"

    @model_validator(mode="after")
    def _increases(self) -> CurvePoints:
        if (np.diff([degrees for degrees, _ in self.points]) < math.degrees(LEAST_GAP)).any():
            raise ValueError(f"points whose angles increase, by {math.degrees(LEAST_GAP):.2g} degrees at least")
        return self


def _draw_stroke(editor: Editor, drawn: CurveStroke) -> str | None:
    degrees, heights = follow_pointer(drawn.points, MOST_SAMPLES)
    heights = smooth(heights, SMOOTHING * 90.0 / (degrees[1] - degrees[0]))
    gammas = np.minimum(np.radians(degrees), HALF_PI)
    below = _values_of_selected(editor, gammas)
    return _add(editor, stroke(gammas, heights, below, FALLOFF * HALF_PI, channels_of(drawn.channel)))


def _set_points(editor: Editor, drawn: CurvePoints) -> str | None:
    gammas = np.minimum(np.radians([degrees for degrees, _ in drawn.points]), HALF_PI)
    heights, channels = np.array([height for _, height in drawn.points], float), channels_of(drawn.channel)
    values = coloured(heights, _values_of_selected(editor, gammas), channels)
    triples = tuple((r, g, b) for r, g, b in values.tolist())
    return _add(editor, through_points(tuple(gammas.tolist()), triples, FALLOFF * HALF_PI, channels))


def _values_of_selected(editor: Editor, gammas: Float64Array) -> Float64Array:
    """The selected curve as it is, at angles (S,): (S, 3)."""
    selected = layer_shown(editor.document, editor.view.selected)
    assert selected is not None and selected.factor is not None
    layer = editor.document.layer(selected.key)
    return apply_operators(layer.operators(selected.factor), layer.generated_curve(selected.factor))(gammas)


def _add(editor: Editor, table: TabulatedCurve) -> str | None:
    selected = layer_shown(editor.document, editor.view.selected)
    assert selected is not None and selected.factor is not None
    return editor.do(AddOperator(selected.key, selected.factor, table))


DRAWING = (
    Operator("draw_tool", keys=("W",), help="Draw the curve freehand, set control points", listed_keys="W   P"),
    Operator("points_tool", keys=("P",)),
    Operator(
        "highlight_tool", keys=("Shift P",), help="Paint the highlight in the picture: the curve follows",
        entry="Paint highlight", needs=CURVE,
    ),
    Gesture("Right click", "Remove the control point"),
    Operator(
        "draw_curve", _draw_stroke, needs=CURVE,
        script=ScriptKey(CurveStroke, "Draws the selected curve freehand: see below."),
    ),
    Operator(
        "set_points", _set_points, needs=CURVE,
        script=ScriptKey(CurvePoints, "Puts control points on the selected curve: see below."),
    ),
)  # fmt: skip
