"""The curve editor: the selected layer's 1D factor, with handles that bend it [BenArtzi07, ch. 9].

Left the plot with its toolbar, right the tools, the operator list and the numbers (`operator_list`). The handles stand
for the selected operator, or, when none is selected, for the one that the active tool makes at the first pull. Pulling
the curve itself, anywhere, puts the regions there. Wheel zooms the angle about the mouse, Shift-wheel the value,
middle drag pans, double click shows all.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.commands import CurveEdit, ResetCurve, SetOperators, operator_title
from app.document import all_factors
from app.view_state import CHANNELS, SetView
from engine.curve.operators import Curve, apply_operators
from engine.material.layer import Layer
from ui import theme as look
from ui.panels import curve_plot as plot
from ui.panels import operator_list, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag, Hold, Select
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import (
    END_NAMES,
    HALF_PI,
    Hand,
    Knob,
    drag_knob,
    drag_region,
    fresh,
    hand_of,
    knob_of,
    regions_around,
    with_regions,
)
from ui.panels.plot_axes import value_range, zoomed
from ui.panels.state import CurveGrip
from ui.theme import Icon

SIDE_WIDTH = 222.0
GRAB_DISTANCE = 9.0
PULL_DISTANCE = 10.0
SMALLEST_X_SPAN = 0.002


@dataclass(frozen=True)
class Curves:
    """The selected curve: what generates it, its operators, and the samples drawn (angles (N,), values (N, 3))."""

    key: str
    factor: str
    layer: Layer
    generated: Curve
    operators: tuple[CurveEdit, ...]
    editable: bool


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    curves = selected_curves(context)
    if curves is None:
        _draw_empty(context)
        return []
    actions: list[Action] = []
    room = imgui.get_content_region_avail()
    side = min(context.px(SIDE_WIDTH), 0.42 * room.x)
    gap = context.px(14)
    if imgui.begin_child("plot", ImVec2(room.x - side - gap, room.y), 0, imgui.WindowFlags_.no_scroll_with_mouse):
        actions += _toolbar(context, curves)
        actions += _plot(context, curves)
    imgui.end_child()
    imgui.same_line(0.0, gap)
    if imgui.begin_child("operators", ImVec2(side, room.y)):
        actions += operator_list.draw(context, curves.key, curves.factor, curves.operators, curves.editable)
    imgui.end_child()
    return actions


def selected_curves(context: PanelContext) -> Curves | None:
    """The curve that is selected; of a layer without a chosen curve the first; None when nothing is selected."""
    selection = context.view.selected
    if selection is None:
        return None
    layer = context.document.layer(selection.key)
    factors = all_factors(layer.model)
    factor = selection.factor or (factors[0].name if factors else None)
    if factor is None:
        return None
    state = context.document.object(selection.object)
    editable = state.editable and not context.document.is_frozen(selection.key)
    return Curves(selection.key, factor, layer, layer.generated(factor), layer.operators(factor), editable)


def _draw_empty(context: PanelContext) -> None:
    room = imgui.get_content_region_avail()
    text = "Select a layer to see its curves: click an object in the picture or a layer in the list."
    extent = imgui.calc_text_size(text)
    imgui.set_cursor_pos(
        ImVec2(max(imgui.get_cursor_pos_x(), 0.5 * (room.x - extent.x)), imgui.get_cursor_pos_y() + 0.45 * room.y)
    )
    imgui.push_text_wrap_pos(0.0)
    imgui.text_disabled(text)
    imgui.pop_text_wrap_pos()


def _toolbar(context: PanelContext, curves: Curves) -> list[Action]:
    actions: list[Action] = []
    factors = all_factors(curves.layer.model)
    choices = [(f"{f.label.split()[0]} {widgets.angle_symbol(f.name)}", f.tooltip) for f in factors]
    names = [f.name for f in factors]
    pressed = widgets.segments(context, "curve.factor", choices, names.index(curves.factor))
    if pressed is not None and names[pressed] != curves.factor:
        actions.append(Select(f"{curves.key}.{names[pressed]}"))
    imgui.same_line()
    right = context.px(4 * 34 + 44) + 2 * imgui.get_frame_height() + 3 * imgui.get_style().item_spacing.x
    widgets.align_right(right)
    actions += _channel_buttons(context)
    imgui.same_line()
    log_hint = "Logarithmic height: shows the faint skirts of a highlight beside its peak. The picture does not change."
    if widgets.segments(context, "curve.log", [("log", log_hint)], 0 if context.view.log_y else -1, least=40) == 0:
        actions.append(SetView.of(log_y=not context.view.log_y, curve_zoom=None))
    imgui.same_line()
    if widgets.icon_button(
        context, "curve.fit", Icon.FIT, "Show the whole curve (double click). The picture does not change.",
        enabled=context.view.curve_zoom is not None,
    ):  # fmt: skip
        actions.append(SetView.of(curve_zoom=None))
    imgui.same_line(0.0, 0.0)
    hint = "Remove all operators: the picture goes back to what the parameters say. Ctrl-Z takes it back."
    if widgets.icon_button(
        context, "curve.reset", Icon.RESET, hint, enabled=bool(curves.operators) and curves.editable
    ):
        actions += [ResetCurve(curves.key, curves.factor), SetView.of(operator=None)]
    return actions


def _channel_buttons(context: PanelContext) -> list[Action]:
    hints = (
        "Edit all three colour channels together.",
        "Edit the red channel alone: tints what the curve reflects.",
        "Edit the green channel alone: tints what the curve reflects.",
        "Edit the blue channel alone: tints what the curve reflects.",
    )
    choices = [(name.upper(), hint) for name, hint in zip(CHANNELS, hints, strict=True)]
    inks = (look.TEXT, *look.CHANNELS)
    pressed = widgets.segments(context, "curve.channel", choices, CHANNELS.index(context.view.channel), inks, least=32)
    return [] if pressed is None else [SetView.of(channel=CHANNELS[pressed], operator=None)]


def _plot(context: PanelContext, curves: Curves) -> list[Action]:
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    frame = _frame(context, curves, corner, room)
    hand = hand_of(curves.operators, context.view)
    title = operator_title(hand.first) if not hand.pair else f"{hand.first.kind.capitalize()} X and Y"
    plot.draw_ground(context, frame, title if hand.index is not None else f"new: {title}",
                     widgets.angle_symbol(curves.factor))  # fmt: skip
    hot, actions = _interact(context, curves, frame, hand)
    _draw_curves(context, curves, frame, hand, hot)
    return actions


def _grip(context: PanelContext) -> CurveGrip | None:
    """The gesture on the curve, when one is under way."""
    grip = context.state.grip
    return grip if isinstance(grip, CurveGrip) else None


def _frame(context: PanelContext, curves: Curves, corner: ImVec2, room: ImVec2) -> plot.Frame:
    grip, zoom = _grip(context), context.view.curve_zoom
    if grip is not None:
        x_range, y_range = grip.x_range, grip.y_range
    elif zoom is not None:
        x_range, y_range = (zoom[0], zoom[1]), (zoom[2], zoom[3])
    else:
        x_range, y_range = (0.0, HALF_PI), fitted_range(curves, context.view.log_y)
    return plot.layout(context, corner, room, x_range, y_range, context.view.log_y)


def fitted_range(curves: Curves, log_y: bool) -> tuple[float, float]:
    """Values that the axis must show: of the edited and the generated curve, everywhere."""
    gamma = np.concatenate([np.linspace(0.0, HALF_PI, 512), HALF_PI * 0.5 ** np.arange(2, 14)])
    edited = apply_operators(curves.operators, curves.generated)(gamma)
    return value_range(np.concatenate([edited, curves.generated(gamma)]), log_y)


def _draw_curves(context: PanelContext, curves: Curves, frame: plot.Frame, hand: Hand, hot: str | None) -> None:
    grip = _grip(context)
    held = grip.handle if grip else None
    edited = apply_operators(curves.operators, curves.generated)
    gamma = plot.sample_angles(frame, (*edited.features, *getattr(curves.generated, "features", ())))
    draw_list = imgui.get_window_draw_list()
    if curves.editable:
        plot.draw_regions(context, frame, hand, held, hot)
    draw_list.push_clip_rect(frame.corner, frame.end, True)
    if curves.operators:
        plot.draw_generated(frame, gamma, curves.generated(gamma), context.theme.scale)
    plot.draw_curve(frame, gamma, edited(gamma), context.view.channels, context.theme.scale)
    draw_list.pop_clip_rect()
    if not curves.editable:
        return
    places = plot.flag_places(frame, hand.regions, context.px(plot.FLAG) + 1)
    plot.draw_flags(context, frame, hand.regions, places, held, hot)
    plot.draw_knob(context, frame, hand, _knob(curves, hand), "magnitude" in (held, hot))
    if hot == "pull":
        mouse = imgui.get_mouse_pos()
        draw_list.add_circle(mouse, context.px(5), look.pack(look.ACCENT), 0, context.px(1.5))


def _knob(curves: Curves, hand: Hand) -> Knob:
    below = curves.operators if hand.index is None else curves.operators[: hand.index]
    return knob_of(hand, apply_operators(below, curves.generated))


def _interact(context: PanelContext, curves: Curves, frame: plot.Frame, hand: Hand) -> tuple[str | None, list[Action]]:
    """The mouse on the plot: which handle is under it, and what its drag does."""
    corner = ImVec2(frame.x.start - context.px(10), frame.y.end - context.px(plot.FLAG_STRIP))
    size = ImVec2(frame.x.end + context.px(10) - corner.x, frame.y.start - corner.y)
    imgui.set_cursor_screen_pos(corner)
    buttons = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_middle
    imgui.invisible_button("ground", size, buttons)
    handles = _handle_places(context, curves, frame, hand) if curves.editable else {}
    for name, place in handles.items():
        context.handles.note(f"curve.{name}", *place)
    context.handles.note("curve.line", *_on_the_line(curves, frame))
    context.handles.note("curve.plot", 0.5 * (frame.x.start + frame.x.end), 0.5 * (frame.y.start + frame.y.end))
    mouse, grip = imgui.get_mouse_pos(), _grip(context)
    hot = None
    if imgui.is_item_hovered() and grip is None:
        hot = _under_mouse(context, curves, frame, hand, handles, mouse)
        _show_cursor(hot, hand)
        _explain(hot, hand)
    actions: list[Action] = []
    if imgui.is_item_activated():
        actions += _take_hold(context, curves, frame, hand, hot, mouse)
    elif imgui.is_item_active() and grip is not None:
        actions += _drag(context, curves, frame, hand, grip, mouse)
    if imgui.is_item_deactivated() and grip is not None:
        actions += [EndDrag(), Hold(None)]
    if imgui.is_item_hovered() and grip is None:
        actions += _zoom(context, frame, mouse)
    return hot, actions


def _on_the_line(curves: Curves, frame: plot.Frame) -> tuple[float, float]:
    """A place on the curve, a twentieth of the visible angle from the left, where a script can pull it."""
    gamma = frame.x.low + 0.05 * (frame.x.high - frame.x.low)
    value = float(apply_operators(curves.operators, curves.generated)(np.array([gamma])).max())
    return frame.x.to_pixel(gamma), frame.y.to_pixel(value)


def _handle_places(
    context: PanelContext, curves: Curves, frame: plot.Frame, hand: Hand
) -> dict[str, tuple[float, float]]:
    """Where each handle is grasped, by name, those drawn on top first."""
    flags = plot.flag_places(frame, hand.regions, context.px(plot.FLAG) + 1)
    top = frame.y.end - context.px(plot.FLAG_STRIP - 2) + 0.5 * context.px(plot.FLAG)
    places = {"magnitude": plot.knob_place(context, frame, _knob(curves, hand))}
    places |= {name: (x, top) for name, x in zip(END_NAMES, flags, strict=True)}
    return places | {"region": (0.5 * (flags[1] + flags[2]), top)}


def _under_mouse(
    context: PanelContext,
    curves: Curves,
    frame: plot.Frame,
    hand: Hand,
    handles: dict[str, tuple[float, float]],
    mouse: ImVec2,
) -> str | None:
    reach = context.px(GRAB_DISTANCE)
    for name in ("magnitude", *END_NAMES):
        if name in handles and np.hypot(mouse.x - handles[name][0], mouse.y - handles[name][1]) <= reach:
            return name
    if not handles:
        return None
    if mouse.y < frame.y.end:
        inside = handles["a"][0] <= mouse.x <= handles["d"][0]
        return "region" if inside else None
    if not frame.contains(mouse.x, mouse.y):
        return None
    gamma = frame.x.to_value(mouse.x)
    values = apply_operators(curves.operators, curves.generated)(np.array([gamma]))[0]
    if np.abs(frame.y.to_pixels(values) - mouse.y).min() <= context.px(PULL_DISTANCE):
        return "pull"
    bars = {name: abs(frame.x.to_pixel(end) - mouse.x) for name, end in zip(END_NAMES, hand.regions, strict=True)}
    nearest = min(bars, key=lambda name: bars[name])
    return nearest if bars[nearest] <= context.px(5) else None


def _show_cursor(hot: str | None, hand: Hand) -> None:
    cursor = imgui.MouseCursor_
    if hot in (*END_NAMES, "region"):
        imgui.set_mouse_cursor(cursor.resize_ew)
    elif hot in ("magnitude", "pull"):
        axes = {operator.axis for operator in hand.operators}
        both = cursor.resize_all if len(axes) == 2 else cursor.resize_ew if "x" in axes else cursor.resize_ns
        imgui.set_mouse_cursor(both)


def _explain(hot: str | None, hand: Hand) -> None:
    texts = {
        "a": "a: the edit begins here; nothing left of it changes.",
        "b": "b: from here the edit acts at full strength.",
        "c": "c: up to here the edit acts at full strength.",
        "d": "d: the edit ends here; nothing right of it changes.",
        "region": "Move the whole region along the angle.",
        "magnitude": f"How strong: drag to {hand.first.kind} the curve. The picture follows.",
        "pull": f"Pull the curve here: a new {hand.first.kind} of this part.",
    }
    if hot in texts:
        widgets.tooltip(texts[hot])


def _take_hold(
    context: PanelContext,
    curves: Curves,
    frame: plot.Frame,
    hand: Hand,
    hot: str | None,
    mouse: ImVec2,
) -> list[Action]:
    if imgui.is_mouse_double_clicked(0) and hot is None:
        return [SetView.of(curve_zoom=None)]
    hot = "pan" if imgui.is_mouse_clicked(2) else hot
    if hot is None:
        return [SetView.of(operator=None)]
    grip = CurveGrip(
        handle=hot,
        offset=(mouse.x, mouse.y),
        operators=curves.operators,
        index=hand.index,
        pair=hand.pair,
        regions=hand.regions,
        x_range=(frame.x.low, frame.x.high),
        y_range=(frame.y.low, frame.y.high),
    )
    if hot == "pull":
        regions = regions_around(frame.x.to_value(mouse.x), frame.x.high - frame.x.low)
        grip = dataclasses.replace(grip, handle="magnitude", index=None, pair=False, regions=regions)
        hand = Hand(fresh(context.view.active_tool, regions, context.view.channels), None)
    if hot in ("pull", "magnitude"):
        # Measured from where the feature truly is, which may lie off the plot, so that nothing jumps.
        knob = _knob(curves, hand)
        place = frame.x.to_pixel(knob.x), frame.y.to_pixel(knob.y)
        grip = dataclasses.replace(grip, offset=(mouse.x - place[0], mouse.y - place[1]))
    elif hot in END_NAMES:
        place = frame.x.to_pixel(hand.regions[END_NAMES.index(hot)]), mouse.y
        grip = dataclasses.replace(grip, offset=(mouse.x - place[0], 0.0))
    actions: list[Action] = [SetView.of(operator=None, regions=grip.regions)] if hot == "pull" else []
    return [*actions, BeginDrag(None), Hold(grip)]


def _drag(
    context: PanelContext, curves: Curves, frame: plot.Frame, hand: Hand, grip: CurveGrip, mouse: ImVec2
) -> list[Action]:
    if grip.handle == "pan":
        return _pan(frame, grip, mouse)
    if grip.handle == "magnitude":
        moved = imgui.is_mouse_dragging(0, 1.0) or hand.index is not None
        return _drag_magnitude(context, curves, frame, hand, grip, mouse) if moved else []
    start = 0.0 if grip.handle != "region" else frame.x.to_value(grip.offset[0])
    to = frame.x.to_value(mouse.x - (grip.offset[0] if grip.handle != "region" else 0.0)) - start
    regions = drag_region(grip, to)
    actions: list[Action] = [SetView.of(regions=regions)]
    if grip.index is not None:
        actions.insert(0, SetOperators(curves.key, curves.factor, with_regions(grip, regions)))
    return actions


def _drag_magnitude(
    context: PanelContext, curves: Curves, frame: plot.Frame, hand: Hand, grip: CurveGrip, mouse: ImVec2
) -> list[Action]:
    if grip.index is None:
        hand = Hand(fresh(context.view.active_tool, grip.regions, context.view.channels), None)
    wanted = (frame.x.to_value(mouse.x - grip.offset[0]), frame.y.to_value(mouse.y - grip.offset[1]))
    floor = min(0.0, frame.y.low)
    operators = drag_knob(grip, hand, curves.generated, (wanted[0], max(wanted[1], floor)))
    index = len(grip.operators) if grip.index is None else grip.index
    actions: list[Action] = [SetOperators(curves.key, curves.factor, operators)]
    return [*actions, SetView.of(operator=index)] if context.view.operator != index else actions


def _pan(frame: plot.Frame, grip: CurveGrip, mouse: ImVec2) -> list[Action]:
    dx = frame.x.to_value(mouse.x) - frame.x.to_value(grip.offset[0])
    shift = min(max(-dx, -grip.x_range[0]), HALF_PI - grip.x_range[1])
    x_range = (grip.x_range[0] + shift, grip.x_range[1] + shift)
    return [SetView.of(curve_zoom=(*x_range, *grip.y_range)), Hold(dataclasses.replace(
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
