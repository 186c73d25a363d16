"""Colour controls: three numbers marked red, green and blue, and a swatch that opens a colour wheel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from engine.core.colour import decode_srgb, encode_srgb
from ui import theme as look
from ui.panels import number_fields, widgets
from ui.panels.context import PanelContext

RGB = tuple[float, float, float]
GAP = 4.0


@dataclass(frozen=True)
class NumberTriple:
    """Three numbers of a kind: `handle` for scripts, `title` and `hint` for the user; `speed` per pixel of a drag."""

    handle: str
    title: str
    hint: str
    low: float
    high: float
    speed: float
    text: str


def row(
    context: PanelContext, numbers: NumberTriple, value: RGB, swatch: bool
) -> Iterator[tuple[number_fields.Touch, RGB]]:
    """The touch of each number, and the resulting colour; with room for a swatch."""
    height, gap = imgui.get_frame_height(), context.px(GAP)
    room = imgui.get_content_region_avail().x - (height + gap if swatch else 0.0)
    width = (room - 2 * gap) / 3.0
    for channel in range(3):
        imgui.set_next_item_width(width)
        corner = imgui.get_cursor_screen_pos()
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(gap, imgui.get_style().frame_padding.y))
        touch, moved = number_fields.number(
            context, str(channel), value[channel], numbers.text, f"{numbers.handle}.{'rgb'[channel]}",
            numbers.low, numbers.high, numbers.speed, f"{numbers.title}, {('red', 'green', 'blue')[channel]}",
        )  # fmt: skip
        imgui.pop_style_var()
        widgets.tooltip(numbers.hint)
        _mark(context, corner, width, height, look.CHANNELS[channel])
        red, green, blue = (moved if each == channel else value[each] for each in range(3))
        yield touch, (red, green, blue)
        if channel < 2 or swatch:
            imgui.same_line(0.0, gap)


def _mark(context: PanelContext, corner: ImVec2, width: float, height: float, ink: look.Colour) -> None:
    inset, line = context.px(4), context.px(2)
    low, high = ImVec2(corner.x + inset, corner.y + height - line), ImVec2(corner.x + width - inset, corner.y + height)
    imgui.get_window_draw_list().add_rect_filled(low, high, look.pack(look.with_alpha(ink, 0.75)))


def swatch(context: PanelContext, numbers: NumberTriple, value: RGB, hint: str) -> tuple[number_fields.Touch, RGB]:
    """A square of a colour, 0 to 1, and the colour wheel that a click on it opens; returns the touch and the picked
    colour."""
    shown = encode_srgb(np.clip(value, 0.0, 1.0)).tolist()
    if imgui.color_button("##swatch", ImVec4(shown[0], shown[1], shown[2], 1.0), imgui.ColorEditFlags_.no_tooltip):
        imgui.open_popup("picker")
    context.handles.note_item(f"{numbers.handle}.swatch")
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
