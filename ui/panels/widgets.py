"""The few controls that all panels share, so that labels, heights and tooltips are alike everywhere.

Each draws one control and says what the hand did with it. None knows what it is used for.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from imgui_bundle import ImVec2, ImVec4, imgui

from ui import theme as look
from ui.panels.context import PanelContext

LABEL_WIDTH = 84.0
SUBSCRIPTS, LETTERS = "ᵢᵣᵤᵥₐₑₒₓₕₖₗₘₙₚₛₜ", "iruvaeoxhklmnpst"


@dataclass(frozen=True)
class Touch:
    """What a hand did with a control in this frame."""

    changed: bool = False
    began: bool = False
    ended: bool = False


def tooltip(text: str) -> None:
    """Explain the control drawn last when the mouse rests on it, wrapped to a readable width."""
    if text and imgui.begin_item_tooltip():
        imgui.push_text_wrap_pos(imgui.get_font_size() * 22.0)
        imgui.text_unformatted(subscripted(text))
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def label(context: PanelContext, text: str, width: float = LABEL_WIDTH) -> None:
    """A soft label of fixed width, the control follows on the same line and fills the rest."""
    start = imgui.get_cursor_pos_x()
    rich_label(subscripted(text), look.TEXT_SOFT)
    imgui.same_line(start + context.px(width))
    imgui.set_next_item_width(-1.0)


def caption(text: str) -> None:
    """A line of small soft text."""
    imgui.push_style_color(imgui.Col_.text, ImVec4(*look.TEXT_SOFT))
    imgui.push_font(None, look.SMALL_SIZE)
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.pop_font()
    imgui.pop_style_color()


def fitting(text: str, room: float) -> str:
    """As much of a text as fits so many pixels, its end kept: that is where file names differ."""
    if imgui.calc_text_size(text).x <= room:
        return text
    while len(text) > 4 and imgui.calc_text_size("…" + text).x > room:
        text = text[1:]
    return "…" + text


def touch(changed: bool) -> Touch:
    """The hand's doings with the control drawn last."""
    return Touch(changed, imgui.is_item_activated(), imgui.is_item_deactivated())


def slider(
    context: PanelContext,
    name: str,
    value: float,
    low: float,
    high: float,
    text: str = "%.3f",
    logarithmic: bool = False,
    handle: str | None = None,
    origin: float | None = None,
) -> tuple[Touch, float]:
    """A horizontal slider filled from `origin` (its least value where None) to its value.

    Double-click or Ctrl-click types a number.

    Returns the touch and the value, kept in [low, high]. `handle` names its grab for scripts.
    """
    corner = imgui.get_cursor_screen_pos()
    width, height = imgui.calc_item_width(), imgui.get_frame_height()
    zero = slider_zero(text) if logarithmic and low <= 0.0 else low
    share = slider_share(value, zero, high, logarithmic)
    hovered = _slider_ground(corner, width, height)
    start = 0.0 if origin is None else slider_share(origin, zero, high, logarithmic)
    _slider_fill(corner, width, height, start, share, hovered)
    clear = ImVec4(0, 0, 0, 0)
    for index in (imgui.Col_.frame_bg, imgui.Col_.frame_bg_hovered, imgui.Col_.frame_bg_active):
        imgui.push_style_color(index, clear)
    imgui.push_style_color(imgui.Col_.slider_grab, clear)
    imgui.push_style_color(imgui.Col_.slider_grab_active, clear)
    flags = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.no_round_to_format
    if logarithmic:
        flags |= imgui.SliderFlags_.logarithmic
    with _typing(hovered and imgui.is_mouse_double_clicked(0)):
        changed, moved = imgui.slider_float(f"##{name}", value, low, high, text, flags)
    imgui.pop_style_color(5)
    hand = touch(changed)
    if imgui.is_item_active():
        _slider_mark(context, corner, width, height, share)
    if handle:
        context.handles.note(handle, corner.x + slider_inset(context) + share * slider_travel(context, width),
                             corner.y + 0.5 * height)  # fmt: skip
    return hand, moved


@contextmanager
def strip(context: PanelContext, name: str, at: ImVec2, pivot: ImVec2, padding: ImVec2) -> Iterator[bool]:
    """A small window over the picture, its pivot (shares of its size) at a place; whether anything of it is seen."""
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


@contextmanager
def _typing(begins: bool) -> Iterator[None]:
    """Have the slider drawn here take a number from the keyboard: imgui asks for Ctrl with the click."""
    held = imgui.get_io().key_ctrl
    imgui.get_io().key_ctrl = held or begins
    yield
    imgui.get_io().key_ctrl = held


def slider_share(value: float, low: float, high: float, logarithmic: bool) -> float:
    """Where between the ends a value stands, 0 to 1."""
    value = min(max(value, low), high)
    if logarithmic and low > 0.0:
        return math.log(value / low) / math.log(high / low)
    return (value - low) / (high - low)


def slider_zero(text: str) -> float:
    """Where a logarithmic slider that starts at 0 puts its start: the least number that its format shows."""
    digits = re.search(r"%\+?\.(\d+)", text)
    return 10.0 ** -(int(digits.group(1)) if digits else 3)


def slider_inset(context: PanelContext) -> float:
    """Pixels from a slider's edge to where its least value stands."""
    return 2.0 + 0.5 * imgui.get_style().grab_min_size


def slider_travel(context: PanelContext, width: float) -> float:
    """Pixels from a slider's least to its largest value."""
    return width - 4.0 - imgui.get_style().grab_min_size


def _slider_ground(corner: ImVec2, width: float, height: float) -> bool:
    """The trough; whether the mouse is over it."""
    end = ImVec2(corner.x + width, corner.y + height)
    hovered = imgui.is_mouse_hovering_rect(corner, end) and imgui.is_window_hovered()
    ground = look.FRAME_HOVER if hovered else look.FRAME
    imgui.get_window_draw_list().add_rect_filled(corner, end, look.pack(ground), imgui.get_style().frame_rounding)
    return hovered


def _slider_fill(corner: ImVec2, width: float, height: float, start: float, share: float, hovered: bool) -> None:
    """The trough's filled part, between two shares of its width."""
    rounding = imgui.get_style().frame_rounding
    low, high = sorted((start, share))
    if high - low < 1e-4:
        return
    left, right = corner.x + low * width, corner.x + high * width
    rounded = imgui.ImDrawFlags_
    at_left, at_right = low * width < rounding, (1.0 - high) * width < rounding
    flags = rounded.round_all if at_left and at_right else rounded.round_left if at_left else rounded.round_right
    if not (at_left or at_right):
        flags = rounded.round_none
    place, end = ImVec2(left, corner.y), ImVec2(max(right, left + 1.0), corner.y + height)
    imgui.get_window_draw_list().add_rect_filled(
        place, end, look.pack(look.grey(86 if hovered else 78)), rounding, flags
    )


def _slider_mark(context: PanelContext, corner: ImVec2, width: float, height: float, share: float) -> None:
    x = corner.x + slider_inset(context) + share * slider_travel(context, width)
    line = context.px(2)
    top, bottom = ImVec2(x - line / 2, corner.y + line), ImVec2(x + line / 2, corner.y + height - line)
    imgui.get_window_draw_list().add_rect_filled(top, bottom, look.pack(look.ACCENT), 1.0)


def number(context: PanelContext, name: str, value: float, text: str, handle: str | None = None) -> tuple[Touch, float]:
    """A field to type a number; returns the number when the person confirms it (Enter or leaving the field)."""
    _, typed = imgui.input_float(f"##{name}", value, 0.0, 0.0, text)
    done = imgui.is_item_deactivated_after_edit()
    if handle:
        context.handles.note_item(handle)
    return Touch(changed=done and math.isfinite(typed)), typed


def icon_button(
    context: PanelContext, name: str, icon: str, hint: str, enabled: bool = True, lit: bool = False
) -> bool:
    """A square button without ground until hovered; `lit` shows it switched on. Whether it was pressed."""
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
    """A row of joined buttons, one of them on. `choices` are (text, tooltip). The index that was pressed, or None."""
    pressed = None
    draw = imgui.get_window_draw_list()
    height, top = imgui.get_frame_height(), imgui.get_cursor_pos_y()
    for index, (text, hint) in enumerate(choices):
        if index:
            imgui.same_line(0.0, 1.0)
            imgui.set_cursor_pos_y(top)
        width = max(rich_width(text) + context.px(16), context.px(least))
        corner = imgui.get_cursor_screen_pos()
        if imgui.invisible_button(f"{name}.{index}", ImVec2(width, height)):
            pressed = index
        context.handles.note_item(f"{name}.{index}")
        _segment(draw, corner, ImVec2(width, height), text, index == chosen, _corners(index, len(choices)),
                 inks[index] if inks else None)  # fmt: skip
        tooltip(hint)
    return pressed


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


def text_button(context: PanelContext, name: str, text: str, hint: str, enabled: bool = True) -> bool:
    """A plain button with words. Whether it was pressed."""
    imgui.begin_disabled(not enabled)
    pressed = imgui.button(f"{text}##{name}")
    imgui.end_disabled()
    context.handles.note_item(f"button.{name}")
    tooltip(hint)
    return pressed


def align_right(width: float) -> None:
    """Move the cursor so that what follows, `width` pixels wide, ends at the right edge."""
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(0.0, imgui.get_content_region_avail().x - width))


def subscripted(text: str) -> str:
    """Text for `rich_text`: the font has no subscript letters, so they become letters after an underscore."""
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
    """Pixels that `rich_text` covers."""
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


def angle_symbol(name: str) -> str:
    """A curve's variable as `rich_text`: "theta_h" → "θ_h"."""
    stem, _, suffix = name.partition("_")
    letters = {"theta": "θ", "gamma": "γ", "phi": "φ"}
    greek = {"alpha": "α", "beta": "β", "ratio": "r"}
    return f"{letters.get(stem, stem)}_{greek.get(suffix, suffix)}"
