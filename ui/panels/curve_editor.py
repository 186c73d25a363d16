"""The curve editor: the selected layer's 1D factor, with handles that bend it [BenArtzi07, ch. 9].

The plot with its toolbar is left; the tools, the operator list and the numbers are right (`operator_list`). The handles
belong to the selected operator, or, when none is selected, to the one that the active tool makes at the first drag.
Dragging the curve itself, anywhere, puts the regions there. The wheel zooms the angle about the mouse, Shift-wheel the
value, middle drag pans, double click shows all; Tab and the arrow keys work without a mouse
(`curve_input`).
"""

from __future__ import annotations

from typing import cast

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.document.commands.curves import operator_title
from app.document.document import all_factors
from app.document.node_layers import layers_at_nodes, picked_node
from app.document.view_state import CHANNELS, SetView
from engine.curve.bands import band_nodes
from engine.curve.operators import Operator, apply_operators
from engine.material.parameters import Value
from ui import theme as look
from ui.panels import curve_helper, curve_keyboard, curve_links, operator_list, widgets
from ui.panels import curve_plot as plot
from ui.panels.actions import Action, RunOperator
from ui.panels.brdf import energy_warning
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import (
    HALF_PI,
    DrawnCurves,
    OperatorGroup,
    channel_of,
    knob,
    limit_text,
    operators_in_use,
)
from ui.panels.curve_input import grip_of, handle_places, interact
from ui.panels.plot_axes import value_range
from ui.theme import Icon

SIDE_WIDTH = 222.0
# In a panel narrower than this the tools are under the plot; both then have at least these heights.
STACKED_WIDTH, PLOT_HEIGHT, TOOLS_HEIGHT = 400.0, 210.0, 190.0
NARROW_CHANNEL, WIDE_CHANNEL = 24.0, 32.0
NODE_HINT = (
    "A parameter varies over the surface, and the picture blends the curves of these values of it, its nodes. The plot "
    "has all of them; this one has the handles. Edits change all."
)


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    curves = selected_curves(context)
    if curves is None:
        _draw_empty(context)
        return []
    room, gap = imgui.get_content_region_avail(), context.px(12)
    stacked = room.x < context.px(STACKED_WIDTH)
    side = room.x if stacked else min(context.px(SIDE_WIDTH), 0.4 * room.x)
    plot_size = ImVec2(room.x - side - gap, room.y)
    if stacked:
        plot_size = ImVec2(room.x, max(context.px(PLOT_HEIGHT), room.y - context.px(TOOLS_HEIGHT) - gap))
    actions: list[Action] = []
    if imgui.begin_child("plot", plot_size, 0, imgui.WindowFlags_.no_scroll_with_mouse):
        actions += _toolbar(context, curves)
        actions += _plot(context, curves)
    imgui.end_child()
    if not stacked:
        imgui.same_line(0.0, gap)
    if imgui.begin_child("operators", ImVec2(side, context.px(TOOLS_HEIGHT) if stacked else room.y)):
        actions += _node(context, curves)
        actions += operator_list.draw(context, curves.key, curves.factor, curves.operators, curves.editable)
    imgui.end_child()
    return actions


def selected_curves(context: PanelContext) -> DrawnCurves | None:
    """The selected curve; of a layer without a selected curve the first; None when nothing is selected."""
    selection = context.selected_layer
    if selection is None:
        return None
    layer = context.document.layer(selection.key)
    factors = all_factors(layer.model)
    factor = selection.factor or (factors[0].name if factors else None)
    if factor is None:
        return None
    state = context.document.object(selection.object)
    editable = state.editable and not context.document.is_frozen(selection.key)
    nodes = layers_at_nodes(context.document, selection.key, context.status.map_nodes, factor)
    picked = picked_node(nodes, context.view.node)
    return DrawnCurves(selection.key, factor, nodes, picked, layer.operators(factor), editable)


def _node(context: PanelContext, curves: DrawnCurves) -> list[Action]:
    """The choice of the node whose curve has the handles, where a parameter varies over the surface."""
    if len(curves.nodes) == 1:
        return []
    varying = [p for p in curves.layer.model.parameters if len({node.values[p.name] for node in curves.nodes}) > 1]
    choices = [
        widgets.Choice(", ".join(f"{p.label} {plain(node.values[p.name])}" for p in varying), key=str(k))
        for k, node in enumerate(curves.nodes)
    ]
    imgui.set_next_item_width(-1.0)
    picked = widgets.choose(context, "curve.node", choices, [curves.picked], NODE_HINT)
    return [] if picked is None else [SetView.of(node=picked)]


def plain(value: Value) -> str:
    """A parameter's value in three digits."""
    return " ".join(f"{each:.3g}" for each in (value if isinstance(value, tuple) else (value,)))


def _draw_empty(context: PanelContext) -> None:
    room = imgui.get_content_region_avail()
    text = "Select a layer to see its curves: click an object in the picture or a layer in the list."
    if context.view.selected is not None:
        name = context.view.selected.object
        text = f"{name} is an emitter: it has no curves; its colour and strength are in the Material panel."
    extent = imgui.calc_text_size(text)
    imgui.set_cursor_pos(
        ImVec2(max(imgui.get_cursor_pos_x(), 0.5 * (room.x - extent.x)), imgui.get_cursor_pos_y() + 0.45 * room.y)
    )
    imgui.push_text_wrap_pos(0.0)
    imgui.text_disabled(text)
    imgui.pop_text_wrap_pos()


def _toolbar(context: PanelContext, curves: DrawnCurves) -> list[Action]:
    actions: list[Action] = []
    factors = all_factors(curves.layer.model)
    symbols = [widgets.angle_symbol(factor.name) for factor in factors]
    titles = [f"{factor.label.split()[0]} {symbol}" for factor, symbol in zip(factors, symbols, strict=True)]
    room, gap = imgui.get_content_region_avail().x, imgui.get_style().item_spacing.x
    chain = curve_links.width(context, curves.key, curves.factor)
    short = widgets.segments_width(context, titles) + gap + _right_width(context, WIDE_CHANNEL) + chain > room
    least = NARROW_CHANNEL if short else WIDE_CHANNEL
    right = _right_width(context, least) + chain
    choices = [(name, f.tooltip) for name, f in zip(symbols if short else titles, factors, strict=True)]
    names = [f.name for f in factors]
    pressed = widgets.segments(context, "curve.factor", choices, names.index(curves.factor))
    if pressed is not None and names[pressed] != curves.factor:
        actions.append(RunOperator("select", f"{curves.key}.{names[pressed]}"))
    widgets.same_line_at_right(right)
    actions += _channel_buttons(context, operators_in_use(curves.operators, context.view), least)
    if right <= room:
        imgui.same_line()
    log_hint = "Logarithmic height: shows the faint skirts of a highlight beside its peak. The picture does not change."
    if widgets.switch(context, "curve.log", "log", log_hint, context.view.log_y, 40.0):
        actions.append(RunOperator("log"))
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
        actions.append(RunOperator("reset_curve"))
    imgui.same_line(0.0, 0.0)
    return actions + curve_links.draw(context, curves.key, curves.factor, curves.editable)


def _right_width(context: PanelContext, least: float) -> float:
    """Pixels of what is at the right of the toolbar."""
    channels = widgets.segments_width(context, [name.upper() for name in CHANNELS], least)
    log = widgets.segments_width(context, ["log"], 40.0)
    return channels + log + 2 * imgui.get_frame_height() + 2 * imgui.get_style().item_spacing.x


def _channel_buttons(context: PanelContext, group: OperatorGroup, least: float) -> list[Action]:
    hints = (
        "Edit all three colour channels together.",
        "Edit the red channel alone: tints what the curve reflects.",
        "Edit the green channel alone: tints what the curve reflects.",
        "Edit the blue channel alone: tints what the curve reflects.",
    )
    choices = [(name.upper(), hint) for name, hint in zip(CHANNELS, hints, strict=True)]
    inks = (look.TEXT, *look.CHANNELS)
    channel = channel_of(group)
    chosen = -1 if channel is None else CHANNELS.index(channel)
    pressed = widgets.segments(context, "curve.channel", choices, chosen, inks, least)
    return [] if pressed is None else [SetView.of(channel=CHANNELS[pressed], operator=None)]


def _plot(context: PanelContext, curves: DrawnCurves) -> list[Action]:
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    frame = _frame(context, curves, corner, room)
    group = operators_in_use(curves.operators, context.view)
    title = operator_title(*group.operators)
    plot.draw_ground(context, frame, title if group.index is not None else f"new: {title}",
                     widgets.angle_symbol(curves.factor))  # fmt: skip
    hot, actions = interact(context, curves, frame, group)
    _draw_curves(context, curves, frame, group, hot)
    for line, (name, note) in enumerate(_notes(context, curves, group).items(), start=1):
        place = plot.draw_note(context, frame, line, note, look.ACCENT)
        context.handles.note(f"curve.{name}", *place)
    return actions + curve_keyboard.move_by_keys(context, curves, frame, group)


def _notes(context: PanelContext, curves: DrawnCurves, group: OperatorGroup) -> dict[str, str]:
    """Notes on the curve in its plot: what limits it, and whether it reflects more than it receives."""
    notes = {"limit": limit_text(group)} if curves.editable and group.index is not None else {}
    if curves.layer.edits and not curves.layer.model.needs_file:
        context.brdf.shown.add("albedo")
        warning = "" if context.brdf.albedo is None else energy_warning(context.brdf.albedo)
        notes["gains_light"] = warning and f"{Icon.WARNING} The layer gains light: {warning}"
    return {name: note for name, note in notes.items() if note}


def _frame(context: PanelContext, curves: DrawnCurves, corner: ImVec2, room: ImVec2) -> plot.Frame:
    grip, zoom = grip_of(context), context.view.curve_zoom
    if grip is not None:
        x_range, y_range = grip.x_range, grip.y_range
    elif zoom is not None:
        x_range, y_range = (zoom[0], zoom[1]), (zoom[2], zoom[3])
    else:
        x_range, y_range = (0.0, HALF_PI), fitted_range(curves, context.view.log_y)
    return plot.layout(context, corner, room, x_range, y_range, context.view.log_y)


def fitted_range(curves: DrawnCurves, log_y: bool) -> tuple[float, float]:
    """Values that the axis must show: of the edited and the generated curve, everywhere. The heights of nodes differ by
    orders of magnitude: the picked one's counts."""
    gamma = np.concatenate([np.linspace(0.0, HALF_PI, 512), HALF_PI * 0.5 ** np.arange(2, 14)])
    edited = apply_operators(curves.operators, curves.generated)(gamma)
    return value_range(np.concatenate([edited, curves.generated(gamma)]), log_y)


def deviation_at(gamma: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """The standard deviation (N, 3) of a curve at angles, of that of its bands (J, 3)."""
    nodes = band_nodes(len(deviation))
    return np.stack([np.interp(gamma, nodes, column) for column in deviation.T], axis=1)


def _draw_curves(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup, hot: str | None
) -> None:
    grip = grip_of(context)
    held = grip.handle if grip else None
    edited = apply_operators(curves.operators, curves.generated)
    gamma = plot.sample_angles(frame, (*edited.features, *getattr(curves.generated, "features", ())))
    draw_list = imgui.get_window_draw_list()
    if curves.editable and group.handles:
        plot.draw_regions(context, frame, group, held, hot)
    draw_list.push_clip_rect(frame.corner, frame.end, True)
    layer = curves.layer
    samples = layer.model.samples(layer.model.leader(curves.factor), layer.values)
    if samples is not None:
        plot.draw_samples(frame, *samples, context.theme.scale)
    for other in curves.others:
        plot.draw_faint(frame, gamma, other(gamma), context.theme.scale)
    if context.found is not None:
        deviation = context.found.deviation(context.document, curves.key, curves.factor)
        if deviation is not None and len(curves.nodes) == 1:
            plot.draw_band(frame, gamma, edited(gamma), deviation_at(gamma, deviation), context.theme.scale)
    if curves.operators:
        plot.draw_generated(frame, gamma, curves.generated(gamma), context.theme.scale)
    plot.draw_curve(frame, gamma, edited(gamma), group.first.channels, context.theme.scale)
    draw_list.pop_clip_rect()
    if not curves.editable:
        return
    if group.handles:
        places = plot.flag_places(frame, group.regions, context.px(plot.FLAG) + 1)
        plot.draw_flags(context, frame, group.regions, places, held, hot)
        if "magnitude" in group.handles and held != "stroke":
            plot.draw_knob(context, frame, group, knob(curves, group), "magnitude" in (held, hot))
        grabbed = handle_places(context, curves, frame, group)
        points = {name: place for name, place in grabbed.items() if name.startswith("point.")}
        plot.draw_points(context, points, held or hot)
        plot.draw_chosen(context, frame, places, grabbed, context.state.handle)
    if grip is not None and group.index is not None and grip.handle != "pan" and isinstance(group.first, Operator):
        curve_helper.draw(context, frame, grip, cast(tuple[Operator, ...], group.operators))
    if hot in ("pull", "stroke", "add"):
        mouse = imgui.get_mouse_pos()
        draw_list.add_circle(mouse, context.px(5), look.pack(look.ACCENT), 0, context.px(1.5))
