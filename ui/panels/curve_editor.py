"""The curve editor: the selected layer's 1D factor, with handles that bend it [BenArtzi07, ch. 9].

Left the plot with its toolbar, right the tools, the operator list and the numbers (`operator_list`). The handles stand
for the selected operator, or, when none is selected, for the one that the active tool makes at the first pull. Pulling
the curve itself, anywhere, puts the regions there. Wheel zooms the angle about the mouse, Shift-wheel the value,
middle drag pans, double click shows all (`curve_mouse`). Tab and the arrow keys do without a mouse (`curve_keys`).
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.commands import ResetCurve, operator_title
from app.document import all_factors
from app.view_state import CHANNELS, SetView
from engine.curve.operators import apply_operators
from ui import theme as look
from ui.panels import curve_keys, operator_list, widgets
from ui.panels import curve_plot as plot
from ui.panels.actions import Action, Select
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import HALF_PI, Hand, hand_of
from ui.panels.curve_mouse import Curves, grip_of, interact, knob
from ui.panels.plot_axes import value_range
from ui.theme import Icon

SIDE_WIDTH = 222.0


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
    hot, actions = interact(context, curves, frame, hand)
    _draw_curves(context, curves, frame, hand, hot)
    return actions + curve_keys.move(context, curves, frame, hand)


def _frame(context: PanelContext, curves: Curves, corner: ImVec2, room: ImVec2) -> plot.Frame:
    grip, zoom = grip_of(context), context.view.curve_zoom
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
    grip = grip_of(context)
    held = grip.handle if grip else None
    edited = apply_operators(curves.operators, curves.generated)
    gamma = plot.sample_angles(frame, (*edited.features, *getattr(curves.generated, "features", ())))
    draw_list = imgui.get_window_draw_list()
    if curves.editable:
        plot.draw_regions(context, frame, hand, held, hot)
    draw_list.push_clip_rect(frame.corner, frame.end, True)
    layer = curves.layer
    samples = layer.model.samples(layer.model.leader(curves.factor), layer.values)
    if samples is not None:
        plot.draw_samples(frame, *samples, context.theme.scale)
    if curves.operators:
        plot.draw_generated(frame, gamma, curves.generated(gamma), context.theme.scale)
    plot.draw_curve(frame, gamma, edited(gamma), context.view.channels, context.theme.scale)
    draw_list.pop_clip_rect()
    if not curves.editable:
        return
    places = plot.flag_places(frame, hand.regions, context.px(plot.FLAG) + 1)
    plot.draw_flags(context, frame, hand.regions, places, held, hot)
    plot.draw_knob(context, frame, hand, knob(curves, hand), "magnitude" in (held, hot))
    plot.draw_chosen(context, frame, places, knob(curves, hand), context.state.handle)
    if hot == "pull":
        mouse = imgui.get_mouse_pos()
        draw_list.add_circle(mouse, context.px(5), look.pack(look.ACCENT), 0, context.px(1.5))
