"""The few controls that all panels share, so that labels, heights and tooltips are the same everywhere.

Each draws one control and returns what the user did with it. None depends on what it is used for.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from imgui_bundle import ImVec2, ImVec4, imgui

from ui import theme as look
from ui.panels.context import PanelContext

LABEL_WIDTH, LEAST_CONTROL = 84.0, 96.0
SUBSCRIPTS, LETTERS = "ᵢᵣᵤᵥₐₑₒₓₕₖₗₘₙₚₛₜ₀₁₂₃₄₅₆₇₈₉", "iruvaeoxhklmnpst0123456789"


def tooltip(text: str) -> None:
    """Show a tooltip of the control drawn last while the mouse hovers over it, not while it is in use, at a readable
    width."""
    if not text or imgui.is_item_active():
        return
    scale = imgui.get_style().font_scale_dpi
    padding = ImVec2(scale * look.WINDOW_PADDING.x, scale * look.WINDOW_PADDING.y)  # the picture's window has none
    imgui.push_style_var(imgui.StyleVar_.window_padding, padding)
    if imgui.begin_item_tooltip():
        imgui.push_text_wrap_pos(imgui.get_font_size() * 22.0)
        imgui.text_unformatted(subscripted(text))
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()
    imgui.pop_style_var()


def label(context: PanelContext, text: str, width: float = LABEL_WIDTH, least: float = LEAST_CONTROL) -> None:
    """A dim label of fixed width; the control follows on the same line and fills the rest, or where that is less than
    `least` on the next line."""
    start = imgui.get_cursor_pos_x()
    stacked = is_stacked(context, width, least)
    rich_label(subscripted(text), look.TEXT_SOFT)
    if not stacked:
        imgui.same_line(start + context.px(width))
    imgui.set_next_item_width(-1.0)


def is_stacked(context: PanelContext, width: float, least: float = LEAST_CONTROL) -> bool:
    """Whether a control goes below its label."""
    return imgui.get_content_region_avail().x - context.px(width) < context.px(least)


def caption(text: str) -> None:
    """A line of small dim text."""
    imgui.push_style_color(imgui.Col_.text, ImVec4(*look.TEXT_SOFT))
    imgui.push_font(None, look.SMALL_SIZE)
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.pop_font()
    imgui.pop_style_color()


def fitting(text: str, room: float) -> str:
    """Shorten a text to so many pixels, keeping its end: that is where file names differ."""
    if imgui.calc_text_size(text).x <= room:
        return text
    n = _n_that_fit(len(text), lambda n: "…" + text[len(text) - n :], room)
    return "…" + text[len(text) - max(n, min(len(text), 4)) :]


def shortened(text: str, room: float) -> str:
    """Shorten a text to so many pixels, keeping its start."""
    if imgui.calc_text_size(text).x <= room:
        return text
    return text[: _n_that_fit(len(text), lambda n: text[:n] + "…", room)].rstrip() + "…"


def _n_that_fit(most: int, cut: Callable[[int], str], room: float) -> int:
    """The most characters, fewer than `most`, of which the cut text has so many pixels; 0 where none fits. Found by
    halves: names of files may be long, and each measurement takes as long as the text."""
    return bisect_right(range(1, most), room, key=lambda n: imgui.calc_text_size(cut(n)).x)


class Choice(NamedTuple):
    """A line of a list: its text and tooltip; its name for scripts, where that is not its text; apart: below a line."""

    text: str
    hint: str = ""
    key: str = ""
    apart: bool = False


def choose(
    context: PanelContext, name: str, choices: Sequence[Choice], chosen: Sequence[int], hint: str, shown: str = ""
) -> int | None:
    """A list, with the indices of those that are chosen; `shown` while it is closed, the chosen one where empty.
    Returns the index of another one that was picked, or None."""
    picked = None
    if begin_combo(f"##{name}", shown or choices[chosen[0]].text):
        for index, (text, explanation, key, apart) in enumerate(choices):
            if apart:
                imgui.separator()
            if imgui.selectable(text, index in chosen)[0] and index not in chosen:
                picked = index
            context.handles.note_item(f"{name}.{key or text}")
            tooltip(explanation)
        imgui.end_combo()
    context.handles.note_item(name)
    tooltip(hint)
    return picked


def begin_combo(name: str, shown: str, is_tall: bool = False) -> bool:
    """imgui's list and its choice; a choice that is too long first takes the room of the arrow, then loses its end.
    is_tall: the list is as high as the window, where it has so much."""
    room = imgui.calc_item_width() - 2.0 * imgui.get_style().frame_padding.x
    fits = imgui.calc_text_size(shown).x <= room - imgui.get_frame_height()
    flags = (0 if fits else imgui.ComboFlags_.no_arrow_button) | (imgui.ComboFlags_.height_largest if is_tall else 0)
    return imgui.begin_combo(name, shortened(shown, room), flags)


@contextmanager
def strip(context: PanelContext, name: str, at: ImVec2, pivot: ImVec2, padding: ImVec2) -> Iterator[bool]:
    """A small window over the picture, its pivot (fractions of its size) at a place; yields whether it is visible."""
    imgui.set_next_window_pos(at, imgui.Cond_.always, pivot)
    flags = (
        imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.always_auto_resize
        | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_focus_on_appearing
    )  # fmt: skip
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.grey(30, 0.95)))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(context.px(padding.x), context.px(padding.y)))
    yield bool(imgui.begin(name, None, flags)[0])
    imgui.end()
    imgui.pop_style_var(2)
    imgui.pop_style_color()


def icon_button(
    context: PanelContext, name: str, icon: str, hint: str, enabled: bool = True, lit: bool = False
) -> bool:
    """A square button without background until hovered; `lit` shows it switched on. Returns whether it was pressed."""
    side = imgui.get_frame_height()
    clear = ImVec4(0, 0, 0, 0)
    ink = look.ACCENT if lit else look.TEXT_SOFT
    imgui.begin_disabled(not enabled)
    imgui.push_style_color(imgui.Col_.button, clear)
    imgui.push_style_color(imgui.Col_.text, ImVec4(*ink))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, imgui.get_style().frame_padding.y))
    pressed = imgui.button(f"{icon}##{name}", ImVec2(side, side))
    imgui.pop_style_var()
    imgui.pop_style_color(2)
    imgui.end_disabled()
    context.handles.note_item(f"button.{name}")
    tooltip(hint)
    return pressed


def segments(
    context: PanelContext,
    name: str,
    choices: Sequence[tuple[str, str]],
    chosen: int,
    inks: Sequence[look.Colour] | None = None,
    least: float = 30.0,
) -> int | None:
    """A row of joined buttons, one of them on. `choices` are (text, tooltip). Returns the index that was pressed, or
    None.

    The line between two belongs to the left one, so that no click on the row is lost.
    """
    pressed = None
    draw = imgui.get_window_draw_list()
    height, top = imgui.get_frame_height(), imgui.get_cursor_pos_y()
    for index, (text, hint) in enumerate(choices):
        if index:
            imgui.same_line(0.0, 0.0)
            imgui.set_cursor_pos_y(top)
        width = _segment_width(context, text, least)
        corner = imgui.get_cursor_screen_pos()
        gap = 1.0 if index < len(choices) - 1 else 0.0
        if imgui.invisible_button(f"{name}.{index}", ImVec2(width + gap, height)):
            pressed = index
        context.handles.note_item(f"{name}.{index}")
        _segment(draw, corner, ImVec2(width, height), text, index == chosen, _corners(index, len(choices)),
                 inks[index] if inks else None)  # fmt: skip
        tooltip(hint)
    return pressed


def switch(context: PanelContext, name: str, text: str, hint: str, is_on: bool, least: float = 30.0) -> bool:
    """A button that stays on; returns whether it was pressed."""
    return segments(context, name, [(text, hint)], 0 if is_on else -1, least=least) is not None


def segments_width(context: PanelContext, texts: Sequence[str], least: float = 30.0) -> float:
    """The width in pixels of `segments` with these texts."""
    return sum(_segment_width(context, text, least) for text in texts) + len(texts) - 1


def _segment_width(context: PanelContext, text: str, least: float) -> float:
    return max(rich_width(text) + context.px(16), context.px(least))


def _corners(index: int, count: int) -> int:
    if count == 1:
        return int(imgui.ImDrawFlags_.round_all)
    if index == 0:
        return int(imgui.ImDrawFlags_.round_left)
    return int(imgui.ImDrawFlags_.round_right if index == count - 1 else imgui.ImDrawFlags_.round_none)


def _segment(
    draw: imgui.ImDrawList, corner: ImVec2, size: ImVec2, text: str, on: bool, corners: int, ink: look.Colour | None
) -> None:
    end = ImVec2(corner.x + size.x, corner.y + size.y)
    ground = look.grey(88) if on else look.FRAME_HOVER if imgui.is_item_hovered() else look.FRAME
    draw.add_rect_filled(corner, end, look.pack(ground), imgui.get_style().frame_rounding, corners)
    colour = ink if ink and on else look.TEXT if on else look.TEXT_SOFT
    place = ImVec2(
        round(corner.x + 0.5 * (size.x - rich_width(text))), round(corner.y + 0.5 * (size.y - imgui.get_font_size()))
    )
    rich_text(draw, place, look.pack(colour), text)
    if on:
        line = max(1.0, round(size.y / 13.0))
        draw.add_rect_filled(
            ImVec2(corner.x + size.x * 0.25, end.y - line), ImVec2(end.x - size.x * 0.25, end.y), look.pack(look.ACCENT)
        )


def text_button(
    context: PanelContext, name: str, text: str, hint: str, enabled: bool = True, width: float = 0.0
) -> bool:
    """A plain button with words, so many pixels wide; 0: as its words. Returns whether it was pressed."""
    imgui.begin_disabled(not enabled)
    pressed = imgui.button(f"{text}##{name}", ImVec2(width, 0.0))
    imgui.end_disabled()
    context.handles.note_item(f"button.{name}")
    tooltip(hint)
    return pressed


def align_right(width: float) -> None:
    """Move the cursor so that what follows, `width` pixels wide, ends at the right edge."""
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(0.0, imgui.get_content_region_avail().x - width))


def same_line_if_room(width: float) -> None:
    """Continue in the same line, or below it where what follows, `width` pixels wide, does not fit."""
    imgui.same_line()
    if imgui.get_content_region_avail().x < width:
        imgui.new_line()


def same_line_at_right(width: float) -> None:
    """Continue at the right edge of the same line, or below it where what follows, `width` pixels wide, does not
    fit."""
    imgui.same_line()
    if imgui.get_content_region_avail().x < width:
        imgui.new_line()
    else:
        align_right(width)


def figure(name: str, value: str, hint: str) -> None:
    """A measured number at the right of its name, or below it where they do not fit."""
    start, room = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    imgui.text_unformatted(name)
    imgui.pop_style_color()
    tooltip(hint)
    width = imgui.calc_text_size(value).x
    if imgui.calc_text_size(name).x + imgui.get_style().item_spacing.x + width <= room:
        imgui.same_line(start)
    align_right(width)
    imgui.text_unformatted(value)
    tooltip(hint)


def subscripted(text: str) -> str:
    """Text for `rich_text`: the font has no subscripts, so they become letters and digits after an underscore."""
    marked = re.sub(f"([{SUBSCRIPTS}]+)", r"_\1", text)
    return marked.translate(str.maketrans(SUBSCRIPTS, LETTERS))


def rich_text(draw: imgui.ImDrawList, place: ImVec2, colour: int, text: str) -> None:
    """Text on one line; what follows an underscore is a subscript."""
    body, _, subscript = text.partition("_")
    draw.add_text(place, colour, body)
    if subscript:
        width, drop = imgui.calc_text_size(body).x, round(0.3 * imgui.get_font_size())
        imgui.push_font(None, look.SMALL_SIZE - 1.5)
        draw.add_text(ImVec2(place.x + width + 1, place.y + drop), colour, subscript)
        imgui.pop_font()


def rich_width(text: str) -> float:
    """The width in pixels of `rich_text`."""
    body, _, subscript = text.partition("_")
    width = imgui.calc_text_size(body).x
    if subscript:
        imgui.push_font(None, look.SMALL_SIZE - 1.5)
        width += 1 + imgui.calc_text_size(subscript).x
        imgui.pop_font()
    return width


def rich_label(text: str, colour: look.Colour = look.TEXT) -> None:
    """`rich_text` as an item of the layout, on a line of a frame's height."""
    place = imgui.get_cursor_screen_pos()
    place.y += imgui.get_style().frame_padding.y
    rich_text(imgui.get_window_draw_list(), place, look.pack(colour), text)
    imgui.dummy(ImVec2(rich_width(text), imgui.get_frame_height()))


def rich_checkbox(text: str, name: str, is_on: bool) -> bool:
    """A check box with `rich_text` as its label, which can be clicked as well; returns whether it was pressed."""
    style, place = imgui.get_style(), imgui.get_cursor_screen_pos()
    place = ImVec2(place.x + imgui.get_frame_height() + style.item_inner_spacing.x, place.y + style.frame_padding.y)
    room = " " * math.ceil(rich_width(text) / imgui.calc_text_size(" ").x)
    pressed, _ = imgui.checkbox(f"{room}##{name}", is_on)
    rich_text(imgui.get_window_draw_list(), place, imgui.get_color_u32(imgui.Col_.text), text)
    return pressed


def angle_symbol(name: str) -> str:
    """A curve's variable as `rich_text`: "theta_h" → "θ_h"."""
    stem, _, suffix = name.partition("_")
    letters = {"theta": "θ", "gamma": "γ", "phi": "φ"}
    greek = {"alpha": "α", "beta": "β", "ratio": "r"}
    return f"{letters.get(stem, stem)}_{greek.get(suffix, suffix)}"
