"""The effect of dragging a handle of the curve on its operators [BenArtzi07, ch. 9]. Pure functions: nothing here
draws.

The ring is at the edited feature. A translation is direct: its magnitude puts the feature under the mouse. An
amplification multiplies, by the same factor per pixel everywhere: where the curve is near 0, putting it under the mouse
would take a factor of thousands. A diagonal tool has two operators, Y below X, that share regions and move together
(`diagonal` order). Every function measures against the `CurveGrip`, the gesture's beginning, so a drag that returns to
its start undoes itself exactly (rejected: summing mouse steps, which drifts at clamps).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast

import numpy as np

from app.document.commands.curves import CurveEdit
from app.document.view_state import CHANNELS, Channel, Tool, ViewState, channels_of
from engine.curve.operators import HALF_PI, Curve, Operator, apply_operators, edit_at
from engine.curve.tables import TabulatedCurve
from engine.material.layer import Layer
from ui.panels.window_state import CurveGrip

if TYPE_CHECKING:
    from ui.panels.curve_plot import Frame

Regions = tuple[float, float, float, float]
END_NAMES = ("a", "b", "c", "d")
LEAST_AMPLIFICATION, LARGEST_AMPLIFICATION = 0.01, 1e6
# Amplify-x about a baseline closer than this to the knob (radians) uses the exponential of the distance instead.
NEAR_BASELINE = 0.02
EXPONENTIAL_REACH = 0.3


@dataclass(frozen=True)
class DrawnCurves:
    """The selected curve: what generates it, and its operators. nodes: its layer at each node, where a parameter that
    drives it varies over the surface; `layer` is the one of them that is `picked`."""

    key: str
    factor: str
    nodes: tuple[Layer, ...]
    picked: int
    operators: tuple[CurveEdit, ...]
    editable: bool

    @property
    def layer(self) -> Layer:
        return self.nodes[self.picked]

    @property
    def generated(self) -> Curve:
        return self.layer.generated_curve(self.factor)

    @property
    def others(self) -> list[Curve]:
        """The edited curves of the nodes that are not picked."""
        nodes = (node for k, node in enumerate(self.nodes) if k != self.picked)
        return [apply_operators(self.operators, node.generated_curve(self.factor)) for node in nodes]


@dataclass(frozen=True)
class OperatorGroup:
    """The operator(s) that the handles belong to: one, or Y and X of a diagonal pair. `index` None: not made yet."""

    operators: tuple[CurveEdit, ...]
    index: int | None

    @property
    def first(self) -> CurveEdit:
        """The operator whose regions, channels and baseline are shown."""
        return self.operators[0]

    @property
    def regions(self) -> Regions:
        """(a, b, c, d) in radians."""
        return self.first.regions

    @property
    def points(self) -> TabulatedCurve | None:
        """The control points that the handles belong to; None where it is something else."""
        first = self.first
        if self.index is None or not isinstance(first, TabulatedCurve) or first.kind != "points":
            return None
        return first

    @property
    def is_drawn_next(self) -> bool:
        """Whether a stroke or points are about to be drawn: there are no handles yet."""
        return self.index is None and isinstance(self.first, TabulatedCurve)

    @property
    def handles(self) -> tuple[str, ...]:
        """The names of its handles, in the order of the Tab key. Control points are dragged one by one, all else has a
        ring."""
        if self.is_drawn_next:
            return ()
        table = self.points
        first = ("magnitude",) if table is None else tuple(f"point.{i}" for i in range(len(table.gammas)))
        return (*first, *END_NAMES, "region")

    @property
    def pair(self) -> bool:
        """Whether two operators move as one."""
        return len(self.operators) == 2


@dataclass(frozen=True)
class Knob:
    """The place of the magnitude handle: angle and curve value; `anchor` is the same place without the operator, or
    with a table at magnitude 1."""

    x: float
    y: float
    anchor: tuple[float, float]


def operators_in_use(operators: tuple[CurveEdit, ...], view: ViewState) -> OperatorGroup:
    """The operator that is selected, else the one that the active tool would make."""
    if view.operator is not None and 0 <= view.operator < len(operators):
        places = edit_at(operators, view.operator)
        return OperatorGroup(tuple(operators[index] for index in places), places.start)
    return OperatorGroup(new_operators(view.active_tool, view.regions, view.channels), None)


def new_operators(tool: Tool, regions: Regions, channels: tuple[bool, bool, bool]) -> tuple[CurveEdit, ...]:
    """Operators that a tool makes, with the magnitude that changes nothing; of a stroke and of points that are about to
    be drawn, one that is muted."""
    if tool == "stroke" or tool == "points":
        return (TabulatedCurve((regions[1],), ((0.0, 0.0, 0.0),), True, tool, regions, channels=channels),)
    kind, _, axes = tool.partition("_")
    neutral = 1.0 if kind == "amplify" else 0.0
    order: tuple[Literal["x", "y"], ...] = ("y", "x") if axes == "xy" else (cast(Literal["x", "y"], axes),)
    return tuple(
        Operator(
            cast(Literal["translate", "amplify"], kind), axis, *regions, magnitude=neutral, channels=channels,
            joined=(axis, axes) == ("y", "xy"),
        )
        for axis in order
    )  # fmt: skip


def tool_of(group: OperatorGroup) -> Tool:
    """The tool that makes operators like these; a table is drawn over by strokes."""
    if isinstance(group.first, TabulatedCurve):
        return "points" if group.first.kind == "points" else "stroke"
    axes = "xy" if group.pair else group.first.axis
    return cast(Tool, f"{group.first.kind}_{axes}")


def channel_of(group: OperatorGroup) -> Channel | None:
    """The channel, or all three, that operators like these change; None for two channels."""
    return next((name for name in CHANNELS if channels_of(name) == group.first.channels), None)


def defaults_from(group: OperatorGroup) -> dict[str, Any]:
    """The fields of the view with which the next new operator is one like these."""
    channel = channel_of(group)
    fields = {"active_tool": tool_of(group), "regions": group.regions}
    return fields if channel is None else {**fields, "channel": channel}


def regions_around(x: float, span: float) -> Regions:
    """Regions for an edit at angle `x` when `span` radians are visible: a core of 8 %, falloffs of 12 % each."""
    ends = (x - 0.16 * span, x - 0.04 * span, x + 0.04 * span, x + 0.16 * span)
    a, b, c, d = (min(max(end, 0.0), HALF_PI) for end in ends)
    return a, b, c, d


def core(regions: Regions) -> float:
    """The angle at the middle of the region of full strength."""
    return 0.5 * (regions[1] + regions[2])


def knob_of(group: OperatorGroup, below: Curve) -> Knob:
    """The place of the knob on the curve `below` (without these operators)."""
    x, first = core(group.regions), group.first
    if isinstance(first, TabulatedCurve):
        without = dataclasses.replace(first, magnitude=1.0) if first.replaces else below
        changed = apply_operators((dataclasses.replace(first, muted=False),), below)
        return Knob(x, reference_value(first, changed, x), (x, reference_value(first, without, x)))
    y = reference_value(first, below, x)
    moved_x, moved_y = x, y
    for operator in group.operators:
        if operator.axis == "y":
            moved_y = raise_value(operator, y)
        else:
            moved_x = move_angle(operator.clamp_magnitude(), x)
    return Knob(moved_x, moved_y, (x, y))


def reference_value(operator: CurveEdit, below: Curve, x: float) -> float:
    """The curve's value at `x` in that channel, of those the operator changes, where it is largest."""
    values = below(np.array([x]))[0]
    chosen = [float(value) for value, on in zip(values, operator.channels, strict=True) if on]
    return max(chosen, default=float(values.max()))


def raise_value(operator: CurveEdit, y: float) -> float:
    """Value y after a Y-operator at full strength."""
    if operator.kind == "translate":
        return y + operator.magnitude
    return operator.baseline + (y - operator.baseline) * operator.magnitude


def move_angle(operator: Operator, x: float) -> float:
    """The angle to which an X-operator moves the feature at x."""
    if operator.kind == "translate":
        return x + operator.magnitude
    if abs(x - operator.baseline) < NEAR_BASELINE:
        return x + EXPONENTIAL_REACH * math.log(operator.magnitude)
    return operator.baseline + (x - operator.baseline) * operator.magnitude


def limit_text(group: OperatorGroup) -> str:
    """The limit of an X-operator, and how to lift it, in words; empty where there is none."""
    along = [each for each in group.operators if isinstance(each, Operator) and each.axis == "x"]
    held = next((o for o in along if o.at_limit and o.regions[0] < o.regions[3]), None)
    if held is None or abs(held.magnitude) >= HALF_PI:
        return ""
    if held.kind == "amplify":
        return "At its limit: widen a–b and c–d to stretch it further."
    ends, way = ("a–b", "right") if held.magnitude >= 0.0 else ("c–d", "left")
    return f"At its limit: widen {ends} to move it further {way}."


@dataclass(frozen=True)
class Pull:
    """How far the ring was dragged: the angle and value to which a translation brings it, the factors along X and Y by
    which an amplification multiplies; 1 in a direction in which it was not dragged."""

    to: tuple[float, float]
    factors: tuple[float, float]


def magnitude_for(operator: CurveEdit, anchor: tuple[float, float], pull: Pull) -> CurveEdit:
    """The operator, whose feature would be at `anchor` without it, dragged as far as it allows."""
    axis = 0 if operator.axis == "x" else 1
    if pull.factors[axis] == 1.0:
        return operator  # to the last bit: moving pixels there and back leaves a remainder
    if operator.kind == "translate":
        magnitude = pull.to[axis] - anchor[axis]
    else:
        magnitude = amplify_magnitude(operator.magnitude, pull.factors[axis])
        magnitude = min(max(magnitude, 1e-3), 1e3) if operator.axis == "x" else magnitude
    return dataclasses.replace(operator, magnitude=magnitude).clamp_magnitude()


def amplify_magnitude(magnitude: float, factor: float) -> float:
    """A magnitude so many times as large, within limits; one at 0 leaves it by hundredths."""
    start = magnitude if abs(magnitude) >= LEAST_AMPLIFICATION else LEAST_AMPLIFICATION
    return min(max(start * factor, -LARGEST_AMPLIFICATION), LARGEST_AMPLIFICATION)


def drag_knob(grip: CurveGrip, group: OperatorGroup, generated: Curve, pull: Pull) -> tuple[CurveEdit, ...]:
    """The curve's operators when the ring has been dragged; `group`: the new ones, where none was selected."""
    at = len(grip.operators) if grip.index is None else grip.index
    count = len(group.operators)
    members = group.operators if grip.index is None else grip.operators[at : at + count]
    below = apply_operators(grip.operators[:at], generated)
    x = core(grip.regions)
    anchor = (x, reference_value(members[0], below, x))
    changed = tuple(magnitude_for(operator, anchor, pull) for operator in members)
    return (*grip.operators[:at], *changed, *grip.operators[at + count :])


def drag_region(grip: CurveGrip, to: float) -> Regions:
    """The regions when the grabbed handle has been dragged to angle `to` (for "region": that far from the start)."""
    if grip.handle == "region":
        shift = min(max(to, -grip.regions[0]), HALF_PI - grip.regions[3])
        a, b, c, d = (min(max(end + shift, 0.0), HALF_PI) for end in grip.regions)
        return a, b, c, d
    to = min(max(to, 0.0), HALF_PI)
    held = Operator("translate", "y", *grip.regions, magnitude=0.0).with_regions(**{grip.handle: to})
    return held.regions


def with_regions(grip: CurveGrip, regions: Regions) -> tuple[CurveEdit, ...]:
    """The curve's operators when those in use have new regions; X-magnitudes are clamped to where they stay
    monotone. The samples of a table move along with its whole region."""
    if grip.index is None:
        return grip.operators
    count = 2 if grip.pair else 1
    changed = list(grip.operators)
    for index in range(grip.index, grip.index + count):
        operator = changed[index]
        if isinstance(operator, TabulatedCurve) and grip.handle == "region":
            operator = operator.moved(regions[1] - grip.regions[1])
        changed[index] = operator.with_regions(*regions).clamp_magnitude()
    return tuple(changed)


def knob(curves: DrawnCurves, group: OperatorGroup) -> Knob:
    """The place of the magnitude handle on the curve as it is."""
    below = curves.operators if group.index is None else curves.operators[: group.index]
    return knob_of(group, apply_operators(below, curves.generated))


AnyGrip = TypeVar("AnyGrip", bound=CurveGrip)


def grip_at(
    kind: type[AnyGrip],
    curves: DrawnCurves,
    frame: Frame,
    group: OperatorGroup,
    handle: str,
    offset: tuple[float, float],
) -> AnyGrip:
    """A gesture that begins now, on a handle of the operators in use."""
    return kind(
        handle=handle,
        offset=offset,
        operators=curves.operators,
        index=group.index,
        pair=group.pair,
        regions=group.regions,
        x_range=(frame.x.low, frame.x.high),
        y_range=(frame.y.low, frame.y.high),
    )
