"""Rows of panels: the label and the control of a parameter, drawn from its declaration.

A `Row` is a `Parameter`, its value, and the action that sets it. The parameter's kind decides on the control: a slider
or a number, two numbers, a colour, a list of choices. All have a tooltip with range and unit, can be typed into, and go
back to their own value on a right click. A drag is one step of the history.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from engine.core.colour import decode_srgb, encode_srgb
from engine.material.parameters import Parameter, Value
from ui import theme as look
from ui.panels import number_fields, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag
from ui.panels.context import PanelContext

RGB = tuple[float, float, float]
# The width that three numbers, or a model's name, need.
WIDE_CONTROL = 136.0
GAP = 4.0
EDIT: tuple[Action, Action] = (BeginDrag(), EndDrag())
# The three numbers of a row: letters for scripts, and names.
CHANNELS, AXES = (("r", "red"), ("g", "green"), ("b", "blue")), (("x", "X"), ("y", "Y"), ("z", "Z"))
HOW = "Drag sideways, or double-click to type."


@dataclass(frozen=True)
class Row:
    """A parameter as a panel shows it.

    make: the action that sets it to a value. handle: its control's name for scripts. own: what a right click sets it
    back to, None for nothing. drag: the actions around a drag, which make it one step of a history; None for none.
    origin: where a slider's fill starts, None for its least value. pixels_a_unit: a drag of its slider by so many
    changes the value by 1, instead of following the track. note: added to the tooltip. shown: words in place of the
    number. parts: what its three numbers are, `CHANNELS` or `AXES`.
    """

    parameter: Parameter
    value: Any
    make: Callable[[Any], Action]
    handle: str
    own: Value | None = None
    drag: tuple[Action, Action] | None = EDIT
    origin: float | None = None
    pixels_a_unit: float | None = None
    note: str = ""
    shown: str = ""
    parts: tuple[tuple[str, str], ...] = CHANNELS

    @property
    def hint(self) -> str:
        """The tooltip: what it does, its range, and how to set it back."""
        parameter, parts = self.parameter, [self.parameter.tooltip]
        if self.note:
            parts.append(self.note)
        if parameter.kind in ("scalar", "pair", "rgb"):
            low, high = parameter.limits
            unit = unit_of(parameter)
            parts.append(f"From {low:.4g} to {high:.4g}{unit}.")
        if parameter.kind in ("pair", "rgb") or parameter.step is not None:
            parts.append(HOW)
        if self.own is not None:
            parts.append(f"Right click: back to {value_text(parameter, self.own)}.")
        return " ".join(parts)


def draw(context: PanelContext, row: Row, width: float = widgets.LABEL_WIDTH) -> list[Action]:
    """The label, `width` wide at scale 1, and the control, which fills the rest of the line."""
    least = WIDE_CONTROL if row.parameter.kind == "rgb" else widgets.LEAST_CONTROL
    reset = _is_right_clicked(2 if widgets.is_stacked(context, width, least) else 1)
    widgets.label(context, row.parameter.label, width, least)
    actions = control(context, row)
    return _reset(row) if reset and row.own is not None else actions


def control(context: PanelContext, row: Row) -> list[Action]:
    """The control alone, as wide as imgui's next item."""
    imgui.push_id(row.handle)
    match row.parameter.kind:
        case "choice":
            actions = _choice(context, row)
        case "rgb":
            actions = _colour(context, row)
        case "pair":
            actions = pair(context, row, imgui.get_content_region_avail().x)
        case _:
            actions = _number(context, row)
    imgui.pop_id()
    return actions


def _reset(row: Row) -> list[Action]:
    return one_step(number_fields.WHOLE, [row.make(row.own)], row.drag)


def one_step(
    touch: number_fields.Touch, changed: list[Action], drag: tuple[Action, Action] | None = EDIT
) -> list[Action]:
    """What a control changed in this pass, between the actions with which its drag begins and ends."""
    actions = changed if touch.changed else []
    if drag is None:
        return actions
    return [*([drag[0]] if touch.began else []), *actions, *([drag[1]] if touch.ended else [])]


def value_text(parameter: Parameter, value: Value) -> str:
    """A parameter's value for a tooltip."""
    if isinstance(value, tuple):
        return f"{value[0]:.4g}" if len(set(value)) == 1 else ", ".join(f"{each:.3g}" for each in value)
    return parameter.title_of(value) if isinstance(value, str) else f"{value:.4g}{unit_of(parameter)}"


def legible(form: str, value: float) -> str:
    """A printf format for a value: a number of five or six digits is shown whole, not by its exponent."""
    return form.replace("%.4g", "%.0f").replace("%.3g", "%.0f") if 999.5 <= abs(value) < 999_999.5 else form


def unit_of(parameter: Parameter) -> str:
    """What follows a number of the parameter: "°", or " mm"."""
    return number_fields.split_format(parameter.number_format)[1]


def _is_right_clicked(n_lines: int) -> bool:
    """Whether the row about to be drawn, of so many lines, is clicked with the right button."""
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    height = imgui.get_frame_height() + (n_lines - 1) * imgui.get_frame_height_with_spacing()
    end = ImVec2(corner.x + room.x, corner.y + height)
    inside = imgui.is_mouse_hovering_rect(corner, end) and imgui.is_window_hovered()
    return inside and imgui.is_mouse_clicked(1) and not number_fields.is_disabled()


# -------------------------------------------------------------------------------------------------------- the controls


def _choice(context: PanelContext, row: Row) -> list[Action]:
    parameter = row.parameter
    choices = [widgets.Choice(parameter.title_of(each), key=each) for each in parameter.choices]
    picked = widgets.choose(context, row.handle, choices, [parameter.choices.index(row.value)], row.hint)
    return [] if picked is None else [row.make(parameter.choices[picked])]


def _number(context: PanelContext, row: Row) -> list[Action]:
    parameter, value = row.parameter, row.value
    low, high = parameter.limits
    if parameter.step is not None:
        touch, moved = number_fields.number(
            context, parameter.name, value, legible(parameter.number_format, value), row.handle, low, high,
            _pace(parameter, value),
            parameter.label,
        )  # fmt: skip
    else:
        touch, moved = number_fields.slider(
            context, parameter.name, value, low, high, legible(parameter.number_format, value), parameter.logarithmic,
            handle=row.handle, origin=row.origin, title=parameter.label, shown=row.shown,
            pixels_a_unit=row.pixels_a_unit,
            pixels_to_double=abs(parameter.power) * number_fields.PIXELS_TO_DOUBLE if parameter.logarithmic else None,
        )  # fmt: skip
    if row.own is not None and imgui.is_item_clicked(1):
        return _reset(row)
    widgets.tooltip(row.hint)
    return one_step(touch, [row.make(moved)], row.drag)


def _pace(parameter: Parameter, value: float) -> float:
    """The change of a number per pixel of a drag: a hundredth of the number, or of a tenth of its default."""
    default = parameter.default[0] if isinstance(parameter.default, tuple) else parameter.default
    assert isinstance(default, float)
    return parameter.step or 0.01 * max(abs(value), 0.1 * abs(default))


def pair(context: PanelContext, row: Row, room: float) -> list[Action]:
    """One number along u and one along v, in `room` pixels."""
    parameter, gap, actions = row.parameter, context.px(GAP), list[Action]()
    low, high = parameter.limits
    for index, axis in enumerate("uv"):
        imgui.set_next_item_width(0.5 * (room - gap))
        value = row.value[index]
        touch, moved = number_fields.number(
            context, f"{parameter.name} {axis}", value, f"{axis} × %.3g", f"{row.handle}.{axis}", low, high,
            _pace(parameter, value), parameter.label,
        )  # fmt: skip
        widgets.tooltip(row.hint)
        touch = replace(touch, changed=touch.changed and abs(moved) >= parameter.least)
        both = (moved, row.value[1]) if index == 0 else (row.value[0], moved)
        actions += one_step(touch, [row.make(both)], row.drag)
        if index == 0:
            imgui.same_line(0.0, gap)
    return actions


def _colour(context: PanelContext, row: Row) -> list[Action]:
    """Three numbers; a swatch with a colour wheel where they are reflectances."""
    parameter, actions = row.parameter, list[Action]()
    has_swatch = parameter.maximum <= 1.0
    for touch, moved in triple(context, row, has_swatch):
        actions += one_step(touch, [row.make(moved)], row.drag)
    if has_swatch:
        touch, picked = swatch(context, row.handle, row.value, f"{parameter.tooltip} Click for a colour wheel.")
        red, green, blue = (min(max(v, parameter.minimum), parameter.maximum) for v in picked)
        actions += one_step(touch, [row.make((red, green, blue))], row.drag)
    return actions


def triple(context: PanelContext, row: Row, has_swatch: bool) -> Iterator[tuple[number_fields.Touch, RGB]]:
    """Three numbers marked red, green and blue, with room for a swatch: the touch of each, and the resulting three."""
    parameter, value = row.parameter, row.value
    height, gap = imgui.get_frame_height(), context.px(GAP)
    room = imgui.get_content_region_avail().x - (height + gap if has_swatch else 0.0)
    width = (room - 2 * gap) / 3.0
    low, high = parameter.limits
    speed = parameter.step or min((high - low) / 400.0, 0.02)
    for channel, (letter, name) in enumerate(row.parts):
        imgui.set_next_item_width(width)
        corner = imgui.get_cursor_screen_pos()
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(gap, imgui.get_style().frame_padding.y))
        form = legible(parameter.form or "%.3f", value[channel])
        touch, moved = number_fields.number(
            context, str(channel), value[channel], form, f"{row.handle}.{letter}", low, high, speed,
            f"{parameter.label}, {name}",
        )  # fmt: skip
        imgui.pop_style_var()
        widgets.tooltip(row.hint)
        _mark(context, corner, width, height, look.CHANNELS[channel])
        red, green, blue = (moved if each == channel else value[each] for each in range(3))
        yield touch, (red, green, blue)
        if channel < 2 or has_swatch:
            imgui.same_line(0.0, gap)


def _mark(context: PanelContext, corner: ImVec2, width: float, height: float, ink: look.Colour) -> None:
    """A line in the channel's colour under its number."""
    inset, line = context.px(4), context.px(2)
    low, high = ImVec2(corner.x + inset, corner.y + height - line), ImVec2(corner.x + width - inset, corner.y + height)
    imgui.get_window_draw_list().add_rect_filled(low, high, look.pack(look.with_alpha(ink, 0.75)))


def swatch(context: PanelContext, handle: str, value: RGB, hint: str) -> tuple[number_fields.Touch, RGB]:
    """A square of a colour, 0 to 1, and the colour wheel that a click on it opens; returns the touch and the picked
    colour."""
    shown = encode_srgb(np.clip(value, 0.0, 1.0)).tolist()
    if imgui.color_button("##swatch", ImVec4(shown[0], shown[1], shown[2], 1.0), imgui.ColorEditFlags_.no_tooltip):
        imgui.open_popup("picker")
    context.handles.note_item(f"{handle}.swatch")
    widgets.tooltip(hint)
    if not imgui.begin_popup("picker"):
        return number_fields.Touch(), value
    flags = imgui.ColorEditFlags_.picker_hue_wheel | imgui.ColorEditFlags_.no_side_preview
    imgui.set_next_item_width(context.px(190))
    changed, picked = imgui.color_picker3("##wheel", shown, flags)
    touch = number_fields.touch(changed)
    imgui.end_popup()
    red, green, blue = decode_srgb(np.array(picked, np.float64)).tolist()
    return touch, (red, green, blue)
