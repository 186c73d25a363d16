"""What dragging a handle of the curve does to its operators [BenArtzi07, ch. 9]. Pure functions: nothing here draws.

The knob is direct: it stands where the edited feature stands, and the magnitude is whatever puts the feature under
the mouse. A diagonal tool keeps two operators, Y below X, that share regions and move together (`diagonal` order).
Every function measures against the `CurveGrip`, the gesture's beginning, so a drag that returns to its start undoes
itself exactly (rejected: summing mouse steps, which drifts at clamps).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from app.commands import CurveEdit
from app.view_state import Tool, ViewState
from engine.curve.operators import HALF_PI, Curve, Operator, apply_operators
from ui.panels.state import CurveGrip

Regions = tuple[float, float, float, float]
END_NAMES = ("a", "b", "c", "d")
LARGEST_AMPLIFICATION = 1e6
# Amplify-x about a baseline closer than this to the knob (radians) uses the exponential of the distance instead.
NEAR_BASELINE = 0.02
EXPONENTIAL_REACH = 0.3


@dataclass(frozen=True)
class Hand:
    """The operator(s) that the handles stand for: one, or Y and X of a diagonal pair. `index` None: not made yet."""

    operators: tuple[Operator, ...]
    index: int | None

    @property
    def first(self) -> Operator:
        """The operator whose regions, channels and baseline are shown."""
        return self.operators[0]

    @property
    def regions(self) -> Regions:
        """(a, b, c, d) in radians."""
        return self.first.regions

    @property
    def pair(self) -> bool:
        """Whether two operators move as one."""
        return len(self.operators) == 2


@dataclass(frozen=True)
class Knob:
    """Where the magnitude handle stands: angle and curve value; `anchor` is the same place without the operator."""

    x: float
    y: float
    anchor: tuple[float, float]


def hand_of(operators: tuple[CurveEdit, ...], view: ViewState) -> Hand:
    """The operator that the view has selected, else the one that the active tool would make."""
    if view.operator is not None and 0 <= view.operator < len(operators):
        chosen = operators[view.operator]
        if isinstance(chosen, Operator):
            index = view.operator
            pair = is_pair(operators, index)
            members = (chosen, cast(Operator, operators[index + 1])) if pair else (chosen,)
            return Hand(members, index)
    return Hand(fresh(view.active_tool, view.regions, view.channels), None)


def is_pair(operators: tuple[CurveEdit, ...], index: int) -> bool:
    """Whether the operators at `index` and above it are Y and X of one diagonal edit."""
    if index + 1 >= len(operators):
        return False
    low, high = operators[index], operators[index + 1]
    if not isinstance(low, Operator) or not isinstance(high, Operator):
        return False
    alike = (low.kind, low.regions, low.channels) == (high.kind, high.regions, high.channels)
    return alike and (low.axis, high.axis) == ("y", "x")


def fresh(tool: Tool, regions: Regions, channels: tuple[bool, bool, bool]) -> tuple[Operator, ...]:
    """Operators that a tool makes, at the magnitude that changes nothing."""
    kind, _, axes = tool.partition("_")
    neutral = 1.0 if kind == "amplify" else 0.0
    order: tuple[Literal["x", "y"], ...] = ("y", "x") if axes == "xy" else (cast(Literal["x", "y"], axes),)
    return tuple(
        Operator(cast(Literal["translate", "amplify"], kind), axis, *regions, magnitude=neutral, channels=channels)
        for axis in order
    )


def tool_of(hand: Hand) -> Tool:
    """The tool that makes operators like these."""
    axes = "xy" if hand.pair else hand.first.axis
    return cast(Tool, f"{hand.first.kind}_{axes}")


def regions_around(x: float, span: float) -> Regions:
    """Regions for an edit at angle `x` when `span` radians are visible: a core of 8 %, falloffs of 12 % each."""
    ends = (x - 0.16 * span, x - 0.04 * span, x + 0.04 * span, x + 0.16 * span)
    a, b, c, d = (min(max(end, 0.0), HALF_PI) for end in ends)
    return a, b, c, d


def core(regions: Regions) -> float:
    """The angle at the middle of the region of full strength."""
    return 0.5 * (regions[1] + regions[2])


def knob_of(hand: Hand, below: Curve) -> Knob:
    """Where the knob stands on the curve `below` (without these operators)."""
    x = core(hand.regions)
    y = reference_value(hand.first, below, x)
    moved_x, moved_y = x, y
    for operator in hand.operators:
        if operator.axis == "y":
            moved_y = lifted(operator, y)
        else:
            moved_x = carried(operator.clamped(), x)
    return Knob(moved_x, moved_y, (x, y))


def reference_value(operator: Operator, below: Curve, x: float) -> float:
    """The curve's value at `x` in that channel, of those the operator changes, where it is largest."""
    values = below(np.array([x]))[0]
    chosen = [float(value) for value, on in zip(values, operator.channels, strict=True) if on]
    return max(chosen, default=float(values.max()))


def lifted(operator: Operator, y: float) -> float:
    """Value y after a Y-operator at full strength."""
    if operator.kind == "translate":
        return y + operator.magnitude
    return operator.baseline + (y - operator.baseline) * operator.magnitude


def carried(operator: Operator, x: float) -> float:
    """Angle to which an X-operator carries the feature at x."""
    if operator.kind == "translate":
        return x + operator.magnitude
    if abs(x - operator.baseline) < NEAR_BASELINE:
        return x + EXPONENTIAL_REACH * math.log(operator.magnitude)
    return operator.baseline + (x - operator.baseline) * operator.magnitude


def magnitude_for(operator: Operator, anchor: tuple[float, float], wanted: tuple[float, float]) -> Operator:
    """The operator whose magnitude brings the feature from `anchor` (x, y) as near as it can to `wanted`."""
    axis = 0 if operator.axis == "x" else 1
    start, end = anchor[axis], wanted[axis]
    if operator.kind == "translate":
        return dataclasses.replace(operator, magnitude=end - start).clamped()
    return dataclasses.replace(operator, magnitude=_amplification(operator, start, end)).clamped()


def _amplification(operator: Operator, start: float, end: float) -> float:
    lever = start - operator.baseline
    if operator.axis == "x":
        near = abs(lever) < NEAR_BASELINE
        factor = math.exp((end - start) / EXPONENTIAL_REACH) if near else (end - operator.baseline) / lever
        return min(max(factor, 1e-3), 1e3)
    if abs(lever) < 1e-30:
        return operator.magnitude
    return min(max((end - operator.baseline) / lever, 0.0), LARGEST_AMPLIFICATION)


def drag_knob(grip: CurveGrip, hand: Hand, generated: Curve, wanted: tuple[float, float]) -> tuple[CurveEdit, ...]:
    """The curve's operators when the knob has been dragged to `wanted` (angle, value)."""
    at = len(grip.operators) if grip.index is None else grip.index
    below = apply_operators(grip.operators[:at], generated)
    x = core(grip.regions)
    anchor = (x, reference_value(hand.first, below, x))
    changed = tuple(magnitude_for(operator, anchor, wanted) for operator in hand.operators)
    rest = grip.operators[at + len(hand.operators) :] if grip.index is not None else ()
    return (*grip.operators[:at], *changed, *rest)


def drag_region(grip: CurveGrip, to: float) -> Regions:
    """The regions when the handle held has been dragged to angle `to` (for "region": that far from the start)."""
    if grip.handle == "region":
        shift = min(max(to, -grip.regions[0]), HALF_PI - grip.regions[3])
        a, b, c, d = (min(max(end + shift, 0.0), HALF_PI) for end in grip.regions)
        return a, b, c, d
    to = min(max(to, 0.0), HALF_PI)
    held = Operator("translate", "y", *grip.regions, magnitude=0.0).with_regions(**{grip.handle: to})
    return held.regions


def with_regions(grip: CurveGrip, regions: Regions) -> tuple[CurveEdit, ...]:
    """The curve's operators when those in hand have new regions; X-magnitudes are held where they stay monotone."""
    if grip.index is None:
        return grip.operators
    count = 2 if grip.pair else 1
    changed = list(grip.operators)
    for index in range(grip.index, grip.index + count):
        operator = cast(Operator, changed[index])
        changed[index] = operator.with_regions(*regions).clamped()
    return tuple(changed)
