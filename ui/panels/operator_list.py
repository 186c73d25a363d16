"""Right of the plot: the active tool, the operators of the curve in their order, and their numbers as fields."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, cast

from imgui_bundle import ImVec2, imgui

from app.document.commands.curves import (
    CollapseOperators,
    CurveEdit,
    MoveOperator,
    MuteOperator,
    RemoveOperator,
    SetOperators,
    operator_title,
)
from app.document.view_state import SetView, Tool
from engine.curve.operators import HALF_PI, SMALLEST_STRETCH, OperatorError, edits_of
from engine.curve.tables import TabulatedCurve
from ui import theme as look
from ui.panels import number_fields, rows, widgets, window_operators
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import END_NAMES, OperatorGroup, defaults_from, operators_in_use, tool_of
from ui.theme import Icon

KINDS = ("translate", "amplify", "stroke", "points")
AXES = ("x", "y", "xy")
LEAST_ROWS = 1
DEGREES_A_PIXEL = 0.25
CHANNEL_MARKS = tuple(zip("RGB", look.CHANNELS, strict=True))


def draw(
    context: PanelContext, key: str, factor: str, operators: tuple[CurveEdit, ...], editable: bool
) -> list[Action]:
    """The column. A curve that may not be edited shows why, and its operators greyed."""
    group = operators_in_use(operators, context.view)
    actions: list[Action] = []
    if not editable:
        widgets.caption(f"{Icon.FROZEN}  Frozen: thaw it in the object list to edit this curve.")
    imgui.begin_disabled(not editable)
    actions += _kinds(context, group)
    actions += _table_buttons(context) if isinstance(group.first, TabulatedCurve) else _axes(context, group)
    imgui.same_line(0.0, context.px(4))
    actions += _whole(context, key, factor, operators, group)
    imgui.spacing()
    actions += _list(context, key, factor, operators, group)
    actions += _numbers(context, key, factor, operators, group)
    imgui.end_disabled()
    return actions


def _kinds(context: PanelContext, group: OperatorGroup) -> list[Action]:
    """The active tool: that of the selected operator, else the one that makes the next."""
    kind, _, axes = tool_of(group).partition("_")
    choices = (
        ("Translate", "Translate: pulling the curve moves that part of it. (T)"),
        ("Amplify", "Amplify: pulling the curve stretches that part. (A)"),
        (Icon.PENCIL, "Draw: the curve takes the shape that you draw. (W)"),
        (Icon.POINTS, "Control points: click the curve to set them, and drag them. (P)"),
    )
    icons = widgets.segments_width(context, [text for text, _ in choices[2:]])
    half = 0.5 * (imgui.get_content_region_avail().x - icons - 2.0) / context.theme.scale
    pressed = widgets.segments(context, "curve.kind", choices[:2], KINDS.index(kind) if axes else -1, least=half)
    imgui.same_line(0.0, 1.0)
    drawn = -1 if axes else KINDS.index(kind) - 2
    pressed_icon = widgets.segments(context, "curve.drawn", choices[2:], drawn)
    if pressed is not None:
        return [SetView.of(active_tool=cast(Tool, f"{KINDS[pressed]}_{axes or 'y'}"), operator=None)]
    if pressed_icon is not None:
        return [SetView.of(active_tool=cast(Tool, KINDS[2 + pressed_icon]), operator=None)]
    return []


def _axes(context: PanelContext, group: OperatorGroup) -> list[Action]:
    """The axes along which the tool acts."""
    kind, _, axes = tool_of(group).partition("_")
    across = (
        (f"{Icon.HORIZONTAL} X", "Along the angle: a highlight gets wider, narrower or moves outwards."),
        (f"{Icon.VERTICAL} Y", "In height: that part of the highlight gets brighter or darker."),
        (f"{Icon.DIAGONAL} XY", "Both at once: two operators, Y below X, that move together."),
    )
    third = (imgui.get_content_region_avail().x - 2.0 - 2 * imgui.get_frame_height() - context.px(4)) / 3.0
    pressed = widgets.segments(context, "curve.axis", across, AXES.index(axes), least=third / context.theme.scale)
    return [] if pressed is None else [SetView.of(active_tool=cast(Tool, f"{kind}_{AXES[pressed]}"), operator=None)]


def _table_buttons(context: PanelContext) -> list[Action]:
    """Tables of values from files and by the clipboard."""
    actions: list[Action] = []
    gap = context.px(4)
    room = imgui.get_content_region_avail().x - 2 * imgui.get_frame_height() - 3 * gap
    columns = "angle in degrees, one value or red, green, blue"
    buttons = (
        ("Load…", "table", f"Load a table (CSV: {columns}) onto the curve, as an operator."),
        ("Paste", "paste", f"Paste a table from a spreadsheet ({columns}) onto the curve. (Ctrl V)"),
        ("Copy", "copy_table", "Copy the curve as a table, for a spreadsheet."),
    )
    for text, name, hint in buttons:
        if widgets.text_button(context, f"curve.{name}", text, hint, width=room / 3.0):
            actions += window_operators.perform(context, name)
        if name != "copy_table":
            imgui.same_line(0.0, gap)
    return actions


def _whole(
    context: PanelContext, key: str, factor: str, operators: tuple[CurveEdit, ...], group: OperatorGroup
) -> list[Action]:
    """A new operator, and one table in place of all."""
    actions: list[Action] = []
    hint = "New: put the handles back on a new operator, leaving those in the list as they are."
    if widgets.icon_button(context, "curve.new", Icon.ADD, hint, enabled=group.index is not None):
        actions.append(SetView.of(operator=None))
    imgui.same_line(0.0, 0.0)
    hint = "Collapse: evaluate the edited curve into one table. The picture stays; sliders no longer change this curve."
    if widgets.icon_button(context, "curve.collapse", Icon.COLLAPSE, hint, enabled=bool(operators)):
        actions += [CollapseOperators(key, factor), SetView.of(operator=None)]
    return actions


def _list(
    context: PanelContext, key: str, factor: str, operators: tuple[CurveEdit, ...], group: OperatorGroup
) -> list[Action]:
    """The operators, the last to apply on top, in the height that the numbers below leave."""
    actions: list[Action] = []
    row = imgui.get_frame_height()
    below = 0 if group.is_drawn_next else len(group.operators) + 1
    footer = below * imgui.get_frame_height_with_spacing() + 2 * imgui.get_style().item_spacing.y
    height = max(imgui.get_content_region_avail().y - footer, LEAST_ROWS * row)
    corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(corner, ImVec2(corner.x + width, corner.y + height), look.pack(look.WELL), context.px(4))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, 0))
    if imgui.begin_child("list", ImVec2(0, height)):
        if not operators:
            _hint(context, group, width, height)
        for places in reversed(edits_of(operators)):
            actions += _row(context, key, factor, operators, places)
    imgui.end_child()
    imgui.pop_style_var()
    imgui.spacing()
    return actions


def _hint(context: PanelContext, group: OperatorGroup, width: float, height: float) -> None:
    hints = {
        "stroke": "Draw in the plot, or load\na table of values.",
        "points": "Click the curve to set\npoints; drag them.",
    }
    text = hints.get(tool_of(group), "Drag the ring or the curve\nto make the first operator.")
    imgui.push_font(None, look.SMALL_SIZE)
    extent = imgui.calc_text_size(text)
    if extent.y > height:
        text, _, _ = text.partition("\n")
        extent = imgui.calc_text_size(text)
    imgui.set_cursor_pos(ImVec2(0.5 * (width - extent.x), 0.5 * (height - extent.y)))
    imgui.text_disabled(text)
    imgui.pop_font()


def _row(context: PanelContext, key: str, factor: str, operators: tuple[CurveEdit, ...], places: range) -> list[Action]:
    """One edit: mute, title, magnitude; under the mouse instead of the magnitude: up, down, delete."""
    edit, index, actions = operators[places.start : places.stop], places.start, list[Action]()
    imgui.push_id(index)
    height, width = imgui.get_frame_height(), imgui.get_content_region_avail().x
    corner = imgui.get_cursor_screen_pos()
    inside = imgui.is_mouse_hovering_rect(corner, ImVec2(corner.x + width, corner.y + height))
    inside = inside and imgui.is_window_hovered(imgui.HoveredFlags_.allow_when_blocked_by_active_item)
    _row_ground(context, corner, width, height, context.view.operator in places, inside)
    muted = all(operator.muted for operator in edit)
    if widgets.icon_button(
        context, f"mute.{index}", Icon.HIDDEN if muted else Icon.VISIBLE,
        "Mute or unmute this operator.", lit=False,
    ):  # fmt: skip
        actions.append(MuteOperator(key, factor, index, not muted))
    imgui.same_line()
    tail = 3 * height if inside else 0.0
    imgui.set_next_item_allow_overlap()
    if imgui.invisible_button("row", ImVec2(max(width - height - tail, 1.0), height)):
        actions.append(_select(operators, places))
    context.handles.note_item(f"curve.operator.{index}")
    widgets.tooltip("Select this operator: its handles appear on the curve. The first in effect is the lowest.")
    ink = look.TEXT_FAINT if muted else look.TEXT
    middle = corner.y + imgui.get_style().frame_padding.y
    _title(context, ImVec2(corner.x + height + context.px(4), middle), edit, ink)
    if inside:
        imgui.same_line()
        actions += _row_buttons(context, key, factor, operators, places)
    else:
        text = "  ".join(magnitude_text(operator) for operator in edit)
        place = ImVec2(corner.x + width - imgui.calc_text_size(text).x - context.px(8), middle)
        imgui.get_window_draw_list().add_text(place, look.pack(look.TEXT_SOFT), text)
    imgui.pop_id()
    return actions


def _title(context: PanelContext, place: ImVec2, edit: tuple[CurveEdit, ...], ink: look.Colour) -> None:
    """The name of the edit, and the channels that it changes where it does not change all."""
    draw, text, first = imgui.get_window_draw_list(), operator_title(*edit), edit[0]
    draw.add_text(place, look.pack(ink), text)
    if all(first.channels):
        return
    x = place.x + imgui.calc_text_size(text).x + context.px(6)
    for name, colour in (pair for pair, on in zip(CHANNEL_MARKS, first.channels, strict=True) if on):
        draw.add_text(ImVec2(x, place.y), look.pack(look.with_alpha(colour, 0.5 if first.muted else 1.0)), name)
        x += imgui.calc_text_size(name).x + context.px(2)


def _row_ground(
    context: PanelContext, corner: ImVec2, width: float, height: float, selected: bool, inside: bool
) -> None:
    draw_list = imgui.get_window_draw_list()
    end = ImVec2(corner.x + width, corner.y + height)
    if selected or inside:
        draw_list.add_rect_filled(corner, end, look.pack(look.grey(58 if selected else 40)), context.px(4))
    if selected:
        draw_list.add_rect_filled(
            ImVec2(corner.x, corner.y + context.px(4)),
            ImVec2(corner.x + context.px(2), end.y - context.px(4)),
            look.pack(look.ACCENT),
        )


def _row_buttons(
    context: PanelContext, key: str, factor: str, operators: tuple[CurveEdit, ...], places: range
) -> list[Action]:
    actions: list[Action] = []
    index = places.start
    up = "Apply later: the operators below it come first."
    if widgets.icon_button(context, f"up.{index}", Icon.UP, up, enabled=places.stop < len(operators)):
        actions.append(MoveOperator(key, factor, index, places.stop))
    imgui.same_line()
    if widgets.icon_button(context, f"down.{index}", Icon.DOWN, "Apply earlier.", enabled=index > 0):
        actions.append(MoveOperator(key, factor, index, index - 1))
    imgui.same_line()
    if widgets.icon_button(context, f"delete.{index}", Icon.DELETE, "Delete: its effect leaves the picture."):
        actions.append(RemoveOperator(key, factor, index))
    return actions


def _select(operators: tuple[CurveEdit, ...], places: range) -> Action:
    """Select an operator; the next new one is made like it."""
    group = OperatorGroup(operators[places.start : places.stop], places.start)
    return SetView.of(operator=places.start, **defaults_from(group))


def magnitude_text(operator: CurveEdit) -> str:
    """The magnitude as it is shown: degrees along the angle, a signed value or a factor in height."""
    if isinstance(operator, TabulatedCurve):
        n = len(operator.gammas)
        samples = f"{n} point{'s' * (n != 1)}" if operator.kind == "points" else f"{n} samples"
        return samples if operator.magnitude == 1.0 else f"× {operator.magnitude:.3g}"
    if operator.kind == "amplify":
        return f"× {operator.magnitude:.3g}"
    if operator.axis == "x":
        return f"{math.degrees(operator.magnitude):+.3g}°"
    return f"{operator.magnitude:+.3g}"


def _numbers(
    context: PanelContext, key: str, factor: str, operators: tuple[CurveEdit, ...], group: OperatorGroup
) -> list[Action]:
    """a, b, c, d in degrees; magnitude and baseline of the operator in use."""
    if group.is_drawn_next:
        return []
    actions = _region_fields(context, key, factor, operators, group)
    for offset, operator in enumerate(group.operators):
        actions += _magnitude_fields(context, key, factor, operators, group, offset, operator)
    return actions


def _region_fields(
    context: PanelContext, key: str, factor: str, operators: tuple[CurveEdit, ...], group: OperatorGroup
) -> list[Action]:
    actions: list[Action] = []
    gap = context.px(5)
    width = (imgui.get_content_region_avail().x - 3 * gap) / 4
    for k, name in enumerate(END_NAMES):
        if k:
            imgui.same_line(0.0, gap)
        imgui.set_next_item_width(width)
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(context.px(5), imgui.get_style().frame_padding.y))
        touch, moved = number_fields.number(context, name, math.degrees(group.regions[k]), f"{name} %.1f°",
                                      f"curve.{name}.number", 0.0, 90.0, DEGREES_A_PIXEL)  # fmt: skip
        imgui.pop_style_var()
        widgets.tooltip(f"{name} in degrees, 0 to 90: where the edit {_REGION_WORDS[name]}. {_HOW}")
        changed = _with_region(key, factor, operators, group, name, math.radians(moved))
        actions += rows.one_step(touch, changed)
    return actions


_HOW = "Drag sideways, or double-click to type."
_REGION_WORDS = {"a": "begins", "b": "reaches full strength", "c": "leaves full strength", "d": "ends"}


def _with_region(
    key: str, factor: str, operators: tuple[CurveEdit, ...], group: OperatorGroup, name: str, to: float
) -> list[Action]:
    changed = tuple(each.with_regions(**{name: min(to, HALF_PI)}) for each in group.operators)
    return [*_replaced(key, factor, operators, group, changed), SetView.of(regions=changed[0].regions)]


def _magnitude_fields(
    context: PanelContext,
    key: str,
    factor: str,
    operators: tuple[CurveEdit, ...],
    group: OperatorGroup,
    offset: int,
    operator: CurveEdit,
) -> list[Action]:
    actions: list[Action] = []
    amplify, degrees = operator.kind == "amplify", math.radians(1.0)
    unit = degrees if operator.axis == "x" and not amplify else 1.0
    gap = context.px(5)
    room = imgui.get_content_region_avail().x
    imgui.set_next_item_width(0.5 * (room - gap) if amplify else room)
    multiplies = amplify or isinstance(operator, TabulatedCurve)
    text = f"{operator.axis.upper()} {'× %.4g' if multiplies else '%+.4g'}{'°' if unit == degrees else ''}"
    low, high = (end / unit for end in magnitude_range(operator))
    touch, moved = number_fields.number(
        context, f"magnitude{offset}", operator.magnitude / unit, text, f"curve.magnitude.{operator.axis}.number",
        low, high, title="magnitude",
    )  # fmt: skip
    widgets.tooltip(f"How strong the edit is. Along X it stops where the curve would fold over. {_HOW}")
    changed = _with_member(key, factor, operators, group, offset, _checked(operator, magnitude=moved * unit))
    actions += rows.one_step(touch, changed)
    if not amplify:
        return actions
    imgui.same_line(0.0, gap)
    imgui.set_next_item_width(-1.0)
    along = operator.axis == "x"
    unit = degrees if along else 1.0
    touch, moved = number_fields.number(
        context, f"baseline{offset}", operator.baseline / unit, f"base %.4g{'°' if along else ''}",
        f"curve.baseline.{operator.axis}.number",
        *((0.0, 90.0) if along else (-number_fields.LARGEST, number_fields.LARGEST)),
        title="baseline",
    )  # fmt: skip
    widgets.tooltip(f"Where amplifying leaves the curve as it is: what lies here does not move. {_HOW}")
    changed = _with_member(key, factor, operators, group, offset, _checked(operator, baseline=moved * unit))
    return actions + rows.one_step(touch, changed)


def magnitude_range(operator: CurveEdit) -> tuple[float, float]:
    """The least and largest magnitude of the operator: along X until the curve would fold over."""
    if isinstance(operator, TabulatedCurve) or operator.axis == "y":
        return -number_fields.LARGEST, number_fields.LARGEST
    least = SMALLEST_STRETCH if operator.kind == "amplify" else -HALF_PI
    low, high = (
        dataclasses.replace(operator, magnitude=end).clamp_magnitude().magnitude
        for end in (least, number_fields.LARGEST)
    )
    return low, high


def _with_member(
    key: str,
    factor: str,
    operators: tuple[CurveEdit, ...],
    group: OperatorGroup,
    offset: int,
    member: CurveEdit,
) -> list[Action]:
    """One of the operators in use, replaced."""
    members = (*group.operators[:offset], member, *group.operators[offset + 1 :])
    return _replaced(key, factor, operators, group, members) if members != group.operators else []


def _checked(operator: CurveEdit, **changes: Any) -> CurveEdit:
    """The operator with the typed numbers, or as it was where they make no valid operator."""
    try:
        return dataclasses.replace(operator, **changes).clamp_magnitude()
    except OperatorError:
        return operator


def _replaced(
    key: str, factor: str, operators: tuple[CurveEdit, ...], group: OperatorGroup, members: tuple[CurveEdit, ...]
) -> list[Action]:
    """Put the changed operators in place; new ones with an effect go on top and are selected."""
    if group.index is not None:
        rest = operators[group.index + len(members) :]
        return [SetOperators(key, factor, (*operators[: group.index], *members, *rest))]
    if all(operator.magnitude == operator.neutral_magnitude for operator in members):
        return []
    return [SetOperators(key, factor, (*operators, *members)), SetView.of(operator=len(operators))]
