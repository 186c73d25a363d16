"""Drawing on the curve: freehand strokes, and control points that are set, dragged and removed.

A stroke is smoothed as it looks, in pixels, on whatever scale the height has. All of a gesture is measured from the
`CurveGrip` that its press made.
"""

from __future__ import annotations

import dataclasses
from typing import cast

import numpy as np
from imgui_bundle import imgui

from app.document.commands.curves import RemoveOperator, SetOperators
from app.document.view_state import SetView
from engine.curve import drawing
from engine.curve.operators import apply_operators
from engine.curve.tables import Float64Array, TabulatedCurve
from ui.panels import curve_plot as plot
from ui.panels.actions import Action, BeginDrag, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import DrawnCurves, OperatorGroup, defaults_from, grip_at, new_operators
from ui.panels.window_state import CurveGrip, Place, StrokeGrip, Travel

# Pixels, on a display of scale 1: a stroke's samples are this far apart, it is smoothed by a Gaussian of this standard
# deviation, and less is a click.
SAMPLE_PIXELS, SMOOTHING_PIXELS, LEAST_PIXELS = 1.5, 5.0, 3.0


def begin_stroke(curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup, mouse: Place) -> list[Action]:
    """The pointer goes down to draw: a new stroke on top of all operators."""
    blank = OperatorGroup(new_operators("stroke", group.regions, group.first.channels), None)
    grip = grip_at(StrokeGrip, curves, frame, blank, "stroke", mouse)
    path = (_inside(frame, mouse),)
    return [BeginDrag(None), HoldGrip(dataclasses.replace(grip, path=path)),
            SetView.of(operator=None, **defaults_from(blank))]  # fmt: skip


def continue_stroke(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, grip: StrokeGrip, mouse: Place
) -> list[Action]:
    """The stroke with the pointer here, on the curve as it was before it."""
    place = _inside(frame, mouse)
    if place == grip.path[-1]:
        return []
    grip = dataclasses.replace(grip, path=(*grip.path, place))
    drawn = _stroke_of(context, curves, frame, grip)
    if drawn is None:
        return [HoldGrip(grip)]
    edit = SetOperators(curves.key, curves.factor, (*grip.operators, drawn))
    return [HoldGrip(grip), edit, SetView.of(operator=len(grip.operators), regions=drawn.regions)]


def _stroke_of(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, grip: StrokeGrip
) -> TabulatedCurve | None:
    """What the path draws; None while it is not yet wider than a click."""
    width = max(x for x, _ in grip.path) - min(x for x, _ in grip.path)
    if width < context.px(LEAST_PIXELS):
        return None
    n_samples = min(max(int(width / context.px(SAMPLE_PIXELS)), 2), drawing.MOST_SAMPLES)
    across, down = drawing.follow_pointer(grip.path, n_samples)
    down = drawing.smooth(down, context.px(SMOOTHING_PIXELS) * (n_samples - 1) / width)
    gammas = np.array([frame.x.to_value(pixel) for pixel in across.tolist()])
    heights = np.array([frame.y.to_value(pixel) for pixel in down.tolist()])
    below = apply_operators(grip.operators, curves.generated)(gammas)
    falloff = drawing.FALLOFF * (frame.x.high - frame.x.low)
    channels = context.view.channels
    return drawing.stroke(gammas, heights, below, falloff, channels)


def _inside(frame: plot.Frame, mouse: Place) -> Place:
    """The pointer's place, kept inside the plot."""
    return min(max(mouse[0], frame.x.start), frame.x.end), min(max(mouse[1], frame.y.end), frame.y.start)


def add_point(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup, mouse: Place
) -> list[Action]:
    """A new control point where the curve is, which this gesture drags: of the points in use, or the first of new
    ones."""
    gamma = frame.x.to_value(min(max(mouse[0], frame.x.start), frame.x.end))
    points, at = group.points, len(curves.operators) if group.index is None else group.index
    if points is None:
        value = _value_at(curves, len(curves.operators), gamma)
        falloff = drawing.FALLOFF * (frame.x.high - frame.x.low)
        channels = context.view.channels
        at, i = len(curves.operators), 0
        points = drawing.first_point(gamma, _largest(value, channels), value, falloff, channels)
    else:
        height = _largest(_value_at(curves, at + 1, gamma), points.channels) / (points.magnitude or 1.0)
        points, i = drawing.add_point(points, gamma, height, _value_at(curves, at, gamma))
    operators = (*curves.operators[:at], points, *curves.operators[at + 1 :])
    changed = OperatorGroup((points,), at)
    after, handle = dataclasses.replace(curves, operators=operators), f"point.{i}"
    held = grip_at(CurveGrip, after, frame, changed, handle, point_place(frame, points, i))
    held = dataclasses.replace(held, travel=Travel(mouse, fine=imgui.get_io().key_shift))
    edit = SetOperators(curves.key, curves.factor, operators)
    return [BeginDrag(None), HoldGrip(held), edit, SetView.of(operator=at, **defaults_from(changed)),
            SetPanel({"handle": handle})]  # fmt: skip


def move_point(curves: DrawnCurves, frame: plot.Frame, grip: CurveGrip, moved: Place) -> list[Action]:
    """The control point of a gesture, so many pixels to the right and down from where it was."""
    assert grip.index is not None
    points, i = cast(TabulatedCurve, grip.operators[grip.index]), int(grip.handle.removeprefix("point."))
    gamma, height = points.gammas[i], drawing.point_height(points, i)
    # What has not moved along an axis keeps its number to the last bit.
    if moved[0]:
        gamma = frame.x.to_value(grip.offset[0] + moved[0])
    if moved[1]:
        wanted = frame.y.to_value(grip.offset[1] + moved[1])
        height = max(wanted, min(0.0, frame.y.low)) / (points.magnitude or 1.0)
    changed = drawing.move_point(points, i, gamma, height)
    operators = (*grip.operators[: grip.index], changed, *grip.operators[grip.index + 1 :])
    return [SetOperators(curves.key, curves.factor, operators), SetView.of(regions=changed.regions)]


def remove_point(curves: DrawnCurves, group: OperatorGroup, handle: str) -> list[Action]:
    """The points in use without one; without the last, the operator is gone."""
    points = group.points
    if points is None or group.index is None:
        return []
    rest = drawing.remove_point(points, int(handle.removeprefix("point.")))
    chosen = SetPanel({"handle": None})
    if rest is None:
        return [RemoveOperator(curves.key, curves.factor, group.index), SetView.of(operator=None), chosen]
    operators = (*curves.operators[: group.index], rest, *curves.operators[group.index + 1 :])
    return [SetOperators(curves.key, curves.factor, operators), chosen]


def point_place(frame: plot.Frame, points: TabulatedCurve, i: int) -> Place:
    """The true pixel of a control point, also off the plot."""
    height = points.magnitude * drawing.point_height(points, i)
    return frame.x.to_pixel(points.gammas[i]), frame.y.to_pixel(height)


def _value_at(curves: DrawnCurves, n_operators: int, gamma: float) -> Float64Array:
    """The value (3,) of the curve with its first operators."""
    return apply_operators(curves.operators[:n_operators], curves.generated)(np.array([gamma]))[0]


def _largest(value: Float64Array, channels: tuple[bool, bool, bool]) -> float:
    return max(float(v) for v, on in zip(value, channels, strict=True) if on)
