"""The mouse on the curve: which handle is under it, what pressing, dragging and the wheel do.

Everything is measured from the `CurveGrip` that the press made; mouse and keys (`curve_keyboard`) share the effect of
moving a handle (`move_handle`).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.document.commands.curves import SetOperators
from app.document.view_state import SetView
from engine.curve.operators import apply_operators
from engine.curve.tables import TabulatedCurve
from ui.panels import curve_drawing, widgets
from ui.panels import curve_plot as plot
from ui.panels.actions import Action, BeginDrag, EndDrag, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import (
    END_NAMES,
    HALF_PI,
    DrawnCurves,
    OperatorGroup,
    Pull,
    defaults_from,
    drag_knob,
    drag_region,
    grip_at,
    knob,
    new_operators,
    regions_around,
    tool_of,
    with_regions,
)
from ui.panels.number_fields import PIXELS_TO_DOUBLE
from ui.panels.plot_axes import zoomed
from ui.panels.window_state import CurveGrip, StrokeGrip, Travel

GRAB_DISTANCE = 9.0
PULL_DISTANCE = 10.0
SMALLEST_X_SPAN = 0.002


def grip_of(context: PanelContext) -> CurveGrip | None:
    """The gesture on the curve, when one is under way."""
    grip = context.state.grip
    return grip if isinstance(grip, CurveGrip) else None


def interact(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup
) -> tuple[str | None, list[Action]]:
    """The mouse on the plot: which handle is under it, and what its drag does."""
    corner = ImVec2(frame.x.start - context.px(10), frame.y.end - context.px(plot.FLAG_STRIP))
    size = ImVec2(frame.x.end + context.px(10) - corner.x, frame.y.start - corner.y)
    imgui.set_cursor_screen_pos(corner)
    buttons = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_middle
    buttons |= imgui.ButtonFlags_.mouse_button_right
    imgui.invisible_button("ground", size, buttons)
    handles = handle_places(context, curves, frame, group) if curves.editable else {}
    for name, place in handles.items():
        context.handles.note(f"curve.{name}", *place)
    context.handles.note("curve.line", *_on_the_line(curves, frame))
    context.handles.note("curve.plot", 0.5 * (frame.x.start + frame.x.end), 0.5 * (frame.y.start + frame.y.end))
    mouse, grip = imgui.get_mouse_pos(), grip_of(context)
    hot = None
    if imgui.is_item_hovered() and grip is None:
        hot = _under_mouse(context, curves, frame, group, handles, mouse)
        _show_cursor(hot, group)
        _explain(hot, group)
    actions: list[Action] = []
    if imgui.is_item_activated():
        actions += _take_hold(context, curves, frame, group, hot, mouse)
    elif imgui.is_item_active() and grip is not None:
        actions += _drag(context, curves, frame, group, grip, mouse)
    if imgui.is_item_deactivated() and grip is not None:
        actions += [EndDrag(), HoldGrip(None)]
    if imgui.is_item_hovered() and grip is None:
        actions += _zoom(context, frame, mouse)
    return hot, actions


def _on_the_line(curves: DrawnCurves, frame: plot.Frame) -> tuple[float, float]:
    """A place on the curve, a twentieth of the visible angle from the left, where a script can drag it."""
    gamma = frame.x.low + 0.05 * (frame.x.high - frame.x.low)
    value = float(apply_operators(curves.operators, curves.generated)(np.array([gamma])).max())
    return frame.x.to_pixel(gamma), frame.y.to_pixel(value)


def handle_places(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup
) -> dict[str, tuple[float, float]]:
    """Where each handle can be grabbed, by name, those drawn on top first."""
    if group.is_drawn_next:
        return {}
    flags = plot.flag_places(frame, group.regions, context.px(plot.FLAG) + 1)
    top = frame.y.end - context.px(plot.FLAG_STRIP - 2) + 0.5 * context.px(plot.FLAG)
    places: dict[str, tuple[float, float]] = {}
    if (points := group.points) is not None:
        inside = (curve_drawing.point_place(frame, points, i) for i in range(len(points.gammas)))
        places = {f"point.{i}": place for i, place in enumerate(inside) if frame.contains(*place)}
    else:
        places["magnitude"] = plot.knob_place(context, frame, knob(curves, group))
    places |= {name: (x, top) for name, x in zip(END_NAMES, flags, strict=True)}
    return places | {"region": (0.5 * (flags[1] + flags[2]), top)}


def _under_mouse(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    handles: dict[str, tuple[float, float]],
    mouse: ImVec2,
) -> str | None:
    if not curves.editable:
        return None
    reach = context.px(GRAB_DISTANCE)
    for name, (x, y) in handles.items():
        if name != "region" and np.hypot(mouse.x - x, mouse.y - y) <= reach:
            return name
    if handles and mouse.y < frame.y.end:
        inside = handles["a"][0] <= mouse.x <= handles["d"][0]
        return "region" if inside else None
    if not frame.contains(mouse.x, mouse.y):
        return None
    if tool_of(group) == "stroke":
        return "stroke"
    gamma = frame.x.to_value(mouse.x)
    values = apply_operators(curves.operators, curves.generated)(np.array([gamma]))[0]
    if np.abs(frame.y.to_pixels(values) - mouse.y).min() <= context.px(PULL_DISTANCE):
        return "add" if tool_of(group) == "points" else "pull"
    if not handles:
        return None
    bars = {name: abs(frame.x.to_pixel(end) - mouse.x) for name, end in zip(END_NAMES, group.regions, strict=True)}
    nearest = min(bars, key=lambda name: bars[name])
    return nearest if bars[nearest] <= context.px(5) else None


def _show_cursor(hot: str | None, group: OperatorGroup) -> None:
    cursor = imgui.MouseCursor_
    if hot in (*END_NAMES, "region"):
        imgui.set_mouse_cursor(cursor.resize_ew)
    elif hot is not None and hot.startswith("point."):
        imgui.set_mouse_cursor(cursor.resize_all)
    elif hot in ("magnitude", "pull"):
        axes = {operator.axis for operator in group.operators}
        both = cursor.resize_all if len(axes) == 2 else cursor.resize_ew if "x" in axes else cursor.resize_ns
        imgui.set_mouse_cursor(both)


def _explain(hot: str | None, group: OperatorGroup) -> None:
    if hot is not None and hot.startswith("point."):
        widgets.tooltip("A control point: drag it; the curve goes through it. Right click removes it.")
        return
    is_table = isinstance(group.first, TabulatedCurve)
    texts = {
        "a": "a: the edit begins here; nothing left of it changes.",
        "b": "b: from here the edit acts at full strength.",
        "c": "c: up to here the edit acts at full strength.",
        "d": "d: the edit ends here; nothing right of it changes.",
        "region": "Move the whole region along the angle.",
        "magnitude": (
            "Scale what was drawn: drag up or down. The picture follows."
            if is_table
            else f"How strong: drag to {group.first.kind} the curve. The picture follows."
        ),
        "stroke": "Draw the curve: it takes this shape, and goes over smoothly into what is beside it.",
        "add": "Set a control point here.",
        "pull": f"Pull the curve here: add a new {group.first.kind} of this part.",
    }
    if hot in texts:
        widgets.tooltip(texts[hot])


def _take_hold(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    hot: str | None,
    mouse: ImVec2,
) -> list[Action]:
    place = (mouse.x, mouse.y)
    if imgui.is_mouse_clicked(1):
        is_point = hot is not None and hot.startswith("point.")
        return curve_drawing.remove_point(curves, group, hot) if hot is not None and is_point else []
    if imgui.is_mouse_clicked(0) and hot == "stroke":
        return curve_drawing.begin_stroke(curves, frame, group, place)
    if imgui.is_mouse_clicked(0) and hot == "add":
        return curve_drawing.add_point(context, curves, frame, group, place)
    if imgui.is_mouse_double_clicked(0) and hot is None:
        return [SetView.of(curve_zoom=None)]
    hot = "pan" if imgui.is_mouse_clicked(2) else hot
    if hot is None:
        return [SetView.of(operator=None), SetPanel({"handle": None})]
    if hot == "pull":
        regions = regions_around(frame.x.to_value(mouse.x), frame.x.high - frame.x.low)
        group = OperatorGroup(new_operators(tool_of(group), regions, group.first.channels), None)
    handle = "magnitude" if hot == "pull" else hot
    place = place if handle == "pan" else handle_position(curves, frame, group, handle)
    grip = dataclasses.replace(
        grip_at(CurveGrip, curves, frame, group, handle, place),
        travel=Travel((mouse.x, mouse.y), fine=imgui.get_io().key_shift),
    )
    actions: list[Action] = [BeginDrag(None), HoldGrip(grip)]
    if hot == "pull":
        actions.append(SetView.of(operator=None, **defaults_from(group)))
    return actions if hot == "pan" else [*actions, SetPanel({"handle": grip.handle})]


def handle_position(curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup, handle: str) -> tuple[float, float]:
    """The true position of a handle, pixels, also off the plot, so that nothing jumps; of the region its left end."""
    if handle == "magnitude":
        feature = knob(curves, group)
        return frame.x.to_pixel(feature.x), frame.y.to_pixel(feature.y)
    if (points := group.points) is not None and handle.startswith("point."):
        return curve_drawing.point_place(frame, points, int(handle.removeprefix("point.")))
    end = 0 if handle == "region" else END_NAMES.index(handle)
    return frame.x.to_pixel(group.regions[end]), frame.y.start


def _drag(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup, grip: CurveGrip, mouse: ImVec2
) -> list[Action]:
    if grip.handle == "pan":
        return _pan(frame, grip, mouse)
    if isinstance(grip, StrokeGrip):
        return curve_drawing.continue_stroke(context, curves, frame, grip, (mouse.x, mouse.y))
    if grip.index is None and not imgui.is_mouse_dragging(0, 1.0) and group.index is None:
        return []
    travel = grip.travel.with_fine((mouse.x, mouse.y), imgui.get_io().key_shift)
    held = dataclasses.replace(grip, travel=travel)
    actions = move_handle(context, curves, frame, group, held, travel.distance_to((mouse.x, mouse.y)))
    return actions if held == grip else [HoldGrip(held), *actions]


def move_handle(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    grip: CurveGrip,
    moved: tuple[float, float],
) -> list[Action]:
    """The actions of moving the grabbed handle by so many pixels right and down."""
    if grip.handle.startswith("point."):
        return curve_drawing.move_point(curves, frame, grip, moved)
    if grip.handle == "magnitude":
        return move_knob(context, curves, frame, group, grip, moved)
    # The shift is exactly 0 where the pointer is back at its start, or has moved only up and down.
    shift = frame.x.to_value(grip.offset[0] + moved[0]) - frame.x.to_value(grip.offset[0])
    start = 0.0 if grip.handle == "region" else grip.regions[END_NAMES.index(grip.handle)]
    return move_ends(curves, grip, start + shift)


def move_ends(curves: DrawnCurves, grip: CurveGrip, to: float) -> list[Action]:
    """The grabbed handle, an end or the region, moved to angle `to` (the region: by it, from its start)."""
    regions = drag_region(grip, to)
    actions: list[Action] = [SetView.of(regions=regions)]
    if grip.index is not None:
        actions.insert(0, SetOperators(curves.key, curves.factor, with_regions(grip, regions)))
    return actions


def move_knob(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    grip: CurveGrip,
    moved: tuple[float, float],
) -> list[Action]:
    """The ring dragged by so many pixels right and down."""
    if grip.index is None:
        group = OperatorGroup(new_operators(context.view.active_tool, grip.regions, context.view.channels), None)
    wanted = frame.y.to_value(grip.offset[1] + moved[1])
    to = (frame.x.to_value(grip.offset[0] + moved[0]), max(wanted, min(0.0, frame.y.low)))
    right, up = moved[0] / context.px(PIXELS_TO_DOUBLE), -moved[1] / context.px(PIXELS_TO_DOUBLE)
    operators = grip.operators
    if grip.index is None or moved != (0.0, 0.0):
        operators = drag_knob(grip, group, curves.generated, Pull(to, (2.0**right, 2.0**up)))
    index = len(grip.operators) if grip.index is None else grip.index
    actions: list[Action] = [SetOperators(curves.key, curves.factor, operators)]
    return [*actions, SetView.of(operator=index)] if context.view.operator != index else actions


def _pan(frame: plot.Frame, grip: CurveGrip, mouse: ImVec2) -> list[Action]:
    dx = frame.x.to_value(mouse.x) - frame.x.to_value(grip.offset[0])
    shift = min(max(-dx, -grip.x_range[0]), HALF_PI - grip.x_range[1])
    x_range = (grip.x_range[0] + shift, grip.x_range[1] + shift)
    return [SetView.of(curve_zoom=(*x_range, *grip.y_range)), HoldGrip(dataclasses.replace(
        grip, x_range=x_range, offset=(mouse.x, mouse.y)))]  # fmt: skip


def _zoom(context: PanelContext, frame: plot.Frame, mouse: ImVec2) -> list[Action]:
    wheel = imgui.get_io().mouse_wheel
    if wheel == 0.0 or not frame.contains(mouse.x, mouse.y):
        return []
    factor = 0.85**wheel
    x_range, y_range = (frame.x.low, frame.x.high), (frame.y.low, frame.y.high)
    if imgui.get_io().key_shift:
        y_range = (y_range[0], y_range[0] + (y_range[1] - y_range[0]) * factor)
    else:
        x_range = zoomed(*x_range, frame.x.to_value(mouse.x), max(factor, SMALLEST_X_SPAN / (x_range[1] - x_range[0])),
                         (0.0, HALF_PI))  # fmt: skip
    return [SetView.of(curve_zoom=(*x_range, *y_range))]
