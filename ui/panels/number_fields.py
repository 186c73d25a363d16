"""Number controls: sliders and fields that are dragged or typed into.

A click changes nothing. A drag begins when the mouse has moved a few pixels, and continues from the value, a tenth as
fast with Shift. After a double click, or one with Ctrl, the number can be typed, all of it selected; a number out of
range changes nothing, and a message says so. The keyboard works as on imgui's own controls: Space, then arrow keys;
Enter types.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from imgui_bundle import ImVec2, ImVec4, imgui

from ui import theme as look
from ui.panels.context import HeldField, PanelContext
from ui.panels.window_state import Travel

# Pixels at scale 1 after which a press is a drag.
DRAG_DISTANCE = 3.0
# For operators and parameters without a range of their own.
LARGEST = 1e12
# For values that are perceived by ratio, such as light or the width of a highlight.
PIXELS_TO_DOUBLE = 100.0
Law = Callable[[float, float], float]


@dataclass(frozen=True)
class Touch:
    """The user's input to a control in this pass."""

    changed: bool = False
    began: bool = False
    ended: bool = False


WHOLE = Touch(changed=True, began=True, ended=True)


@dataclass(frozen=True)
class _Field:
    """A number on screen: its value, and the rectangle of its control; at: its value at a column, where a press takes
    it there."""

    name: str
    title: str
    value: float
    low: float
    high: float
    text: str
    corner: ImVec2
    size: ImVec2
    shown: str = ""
    at: Callable[[float], float] | None = None

    def parts(self) -> tuple[str, str]:
        """The number alone as it is shown and typed, and the unit after it."""
        number, unit = split_format(self.text)
        return (number % self.value, unit) if number else ("", "")


def split_format(text: str) -> tuple[str, str]:
    """The conversion of a printf format without what is before it, and the unit after it: "%.3g" and "°"."""
    found = re.search(r"%[-+ #0]*\d*(?:\.\d+)?[a-zA-Z]", text)
    return (found.group(), text[found.end() :].replace("%%", "%")) if found else ("", "")


def touch(changed: bool) -> Touch:
    """The touch of the control drawn last, one of imgui's."""
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
    title: str = "",
    pixels_to_double: float | None = None,
    pixels_a_unit: float | None = None,
    shown: str = "",
    jumps: bool = False,
) -> tuple[Touch, float]:
    """A horizontal slider filled from `origin` (its least value where None) to its value.

    `pixels_to_double`: a drag by so many doubles the value, instead of following the track: where the track covers many
    decades, a few pixels would change it far too much. A value that may be 0 leaves it evenly, and doubles well above
    1. `pixels_a_unit`: likewise, a drag by so many adds 1. shown: words in place of the number. jumps: to where it is
    pressed. Returns the touch and the value, clamped to [low, high]. `handle` names its grab for scripts, `title` it
    for the user.
    """
    corner = imgui.get_cursor_screen_pos()
    size = ImVec2(imgui.calc_item_width(), imgui.get_frame_height())
    zero = slider_zero(text) if logarithmic and low <= 0.0 else low
    share = slider_share(value, zero, high, logarithmic)
    travel = slider_travel(context, size.x)

    def at(x: float) -> float:
        shares = (x - corner.x - slider_inset(context)) / travel
        return slider_value(min(max(shares, 0.0), 1.0), zero, high, logarithmic)

    named = title or name.replace("_", " ")
    field = _Field(name, named, value, low, high, text, corner, size, shown, at if jumps else None)

    def law(start: float, pixels: float) -> float:
        if pixels_to_double is not None:
            knee = 0.0 if low > 0.0 else 1.0
            to = (max(start, low) + knee) * 2.0 ** (pixels / context.px(pixels_to_double)) - knee
            return min(max(to, low), high)
        if pixels_a_unit is not None:
            return min(max(start + pixels / context.px(pixels_a_unit), low), high)
        to = slider_share(start, zero, high, logarithmic) + pixels / travel
        return low if to <= 0.0 else slider_value(min(to, 1.0), zero, high, logarithmic)

    def ground(hovered: bool) -> None:
        _trough(corner, size, hovered)
        start = 0.0 if origin is None else slider_share(origin, zero, high, logarithmic)
        _slider_fill(corner, size.x, size.y, start, share, hovered)

    def keyboard() -> tuple[bool, float]:
        flags = imgui.SliderFlags_.no_round_to_format | (imgui.SliderFlags_.logarithmic if logarithmic else 0)
        return imgui.slider_float(f"##{name}", value, low, high, text, flags)

    hand, moved = _control(context, field, law, ground, keyboard)
    if context.fields.is_held(imgui.get_item_id()):
        _slider_mark(context, corner, size.x, size.y, share)
    if handle:
        context.handles.note(handle, corner.x + slider_inset(context) + share * travel, corner.y + 0.5 * size.y)
    return hand, moved


def number(
    context: PanelContext,
    name: str,
    value: float,
    text: str,
    handle: str | None = None,
    low: float = -LARGEST,
    high: float = LARGEST,
    speed: float | None = None,
    title: str = "",
) -> tuple[Touch, float]:
    """A field without a track; a drag changes it by `speed` per pixel (None: by a hundredth of its value)."""
    corner = imgui.get_cursor_screen_pos()
    size = ImVec2(imgui.calc_item_width(), imgui.get_frame_height())
    field = _Field(name, title or name.replace("_", " "), value, low, high, text, corner, size)

    def pace(start: float) -> float:
        return 0.01 * max(abs(start), 0.1) if speed is None else speed

    def law(start: float, pixels: float) -> float:
        return min(max(start + pace(start) * pixels, low), high)

    def ground(hovered: bool) -> None:
        _trough(corner, size, hovered)
        if hovered:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)

    def keyboard() -> tuple[bool, float]:
        return imgui.drag_float(f"##{name}", value, pace(value), low, high, text)

    hand, moved = _control(context, field, law, ground, keyboard)
    if handle:
        context.handles.note(handle, corner.x + 0.5 * size.x, corner.y + 0.5 * size.y)
    return hand, moved


# ---------------------------------------------------------------------------------------------------------------- input


def _control(
    context: PanelContext,
    field: _Field,
    law: Law,
    ground: Callable[[bool], None],
    keyboard: Callable[[], tuple[bool, float]],
) -> tuple[Touch, float]:
    """Draw a number, and return what mouse or keyboard did with it. `keyboard` is imgui's control, which is not
    visible."""
    corner, size = field.corner, field.size
    hovered = imgui.is_mouse_hovering_rect(corner, ImVec2(corner.x + size.x, corner.y + size.y))
    hovered = hovered and imgui.is_window_hovered() and not is_disabled()
    if _is_typed(field, hovered):
        return _typed_text(context, field)
    ground(hovered)
    imguis = imgui.get_current_context().temp_input_id == imgui.get_id(f"##{field.name}") != 0
    clear = ImVec4(0, 0, 0, 0)
    colours = [imgui.Col_.slider_grab, imgui.Col_.slider_grab_active]
    colours += [] if imguis else [imgui.Col_.frame_bg, imgui.Col_.frame_bg_hovered, imgui.Col_.frame_bg_active]
    for index in [*colours, *([] if imguis else [imgui.Col_.text])]:
        imgui.push_style_color(index, clear)
    changed, keyed = keyboard()
    imgui.pop_style_color(len(colours) + (not imguis))
    if not imguis:
        _centred(field)
    return _moved(context, field, law, changed, keyed)


def is_disabled() -> bool:
    """Whether controls that are drawn now take no input."""
    return bool(imgui.get_current_context().current_item_flags & imgui.ItemFlags_.disabled)


def _is_typed(field: _Field, hovered: bool) -> bool:
    """Whether the number is being typed: before, from this press on, or until this pass, which accepts it."""
    state = imgui.get_current_context()
    if imgui.get_id(f"##{field.name}.typed") in (state.active_id, state.active_id_previous_frame):
        return True
    clicks = imgui.get_mouse_clicked_count(0)  # the fourth click of a row is the second of another double click
    return hovered and clicks > 0 and (clicks % 2 == 0 or bool(imgui.get_io().key_ctrl))


def _typed_text(context: PanelContext, field: _Field) -> tuple[Touch, float]:
    """The number as a text field; the press that opened it has given it the keyboard."""
    shown, unit = field.parts()
    imgui.set_next_item_width(field.size.x)
    _, typed = imgui.input_text(f"##{field.name}.typed", shown.strip(), imgui.InputTextFlags_.auto_select_all)
    if not imgui.is_item_deactivated_after_edit() or typed == shown.strip():
        return Touch(), field.value
    found, typed = read_number(typed, unit), typed.strip()[:24]
    if found is None:
        context.fields.refusal = f"{field.title} = {typed}, expected a number; nothing was changed"
    elif _is_allowed(context, field, found, typed):
        return WHOLE, found
    return Touch(), field.value


def read_number(typed: str, unit: str = "") -> float | None:
    """The typed number, with or without its unit, with a comma or a point; None where it is no number."""
    text = typed.strip().removesuffix(unit.strip()).strip().replace(",", ".")
    try:
        found = float(text)
    except ValueError:
        return None
    return found if math.isfinite(found) and "_" not in text else None


def _is_allowed(context: PanelContext, field: _Field, value: float, typed: str) -> bool:
    """Whether the number is in its range; a message says so where it is not."""
    if field.low <= value <= field.high:
        return True
    unit = field.parts()[1].rstrip()
    ends = f"{field.low:.5g}{unit} to {field.high:.5g}{unit}"
    typed = typed.removesuffix(unit.strip()).strip()
    context.fields.refusal = f"{field.title} = {typed}{unit}, expected {ends}; nothing was changed"
    return False


def _moved(context: PanelContext, field: _Field, law: Law, changed: bool, keyed: float) -> tuple[Touch, float]:
    """The value after a drag, or the keyboard. imgui's control was drawn last."""
    item, active = imgui.get_item_id(), imgui.is_item_active()
    if context.fields.is_held(item):
        if active:
            return _dragged_value(context, field)
        context.fields.held = None
        return Touch(ended=True), field.value
    if active and imgui.get_current_context().active_id_source == imgui.internal.InputSource.mouse:
        if not imgui.is_mouse_dragging(0, context.px(DRAG_DISTANCE)):
            return Touch(), field.value
        mouse, gone = imgui.get_mouse_pos(), imgui.get_mouse_drag_delta(0)
        pressed = (mouse.x - gone.x, mouse.y - gone.y)
        start = field.value if field.at is None else field.at(pressed[0])
        context.fields.held = HeldField(item, start, Travel(pressed, fine=imgui.get_io().key_shift), law)
        hand, to = _dragged_value(context, field)
        return replace(hand, began=True), to
    if field.at is not None and imgui.is_item_deactivated() and imgui.is_mouse_released(0):
        return WHOLE, field.at(imgui.get_mouse_pos().x)
    changed = changed and _is_allowed(context, field, keyed, f"{keyed:.6g}")
    ended = imgui.is_item_deactivated() and not imgui.is_mouse_released(0)
    return Touch(changed, imgui.is_item_activated(), ended), keyed


def _dragged_value(context: PanelContext, field: _Field) -> tuple[Touch, float]:
    """The value of the drag, measured from where it began."""
    held, mouse = context.fields.held, imgui.get_mouse_pos()
    assert held is not None
    at = (mouse.x, mouse.y)
    held.travel = held.travel.with_fine(at, imgui.get_io().key_shift)
    gone, _ = held.travel.distance_to(at)
    to = held.law(held.start, gone) if gone else held.start
    return Touch(changed=to != field.value), to


# -------------------------------------------------------------------------------------------------------- what is drawn


def slider_share(value: float, low: float, high: float, logarithmic: bool) -> float:
    """The place of a value between the ends, 0 to 1."""
    value = min(max(value, low), high)
    if logarithmic and low > 0.0:
        return math.log(value / low) / math.log(high / low)
    return (value - low) / (high - low)


def slider_value(share: float, low: float, high: float, logarithmic: bool) -> float:
    """The value at a place, 0 to 1, between the ends."""
    found = low * (high / low) ** share if logarithmic and low > 0.0 else low + share * (high - low)
    return min(max(found, low), high)


def slider_zero(text: str) -> float:
    """The place of 0 on a logarithmic slider that starts there: the least number that its format shows."""
    digits = re.search(r"%\+?\.(\d+)", text)
    return 10.0 ** -(int(digits.group(1)) if digits else 3)


def slider_inset(context: PanelContext) -> float:
    """Pixels from a slider's edge to its least value."""
    return 2.0 + 0.5 * imgui.get_style().grab_min_size


def slider_travel(context: PanelContext, width: float) -> float:
    """Pixels from a slider's least to its largest value."""
    return width - 4.0 - imgui.get_style().grab_min_size


def _trough(corner: ImVec2, size: ImVec2, hovered: bool) -> None:
    end = ImVec2(corner.x + size.x, corner.y + size.y)
    ground = look.FRAME_HOVER if hovered else look.FRAME
    imgui.get_window_draw_list().add_rect_filled(corner, end, look.pack(ground), imgui.get_style().frame_rounding)


def _centred(field: _Field) -> None:
    """The number in the middle of its control; where it is too long, from its start."""
    text, corner, size = field.shown or field.text % field.value, field.corner, field.size
    extent, inset = imgui.calc_text_size(text), imgui.get_style().frame_padding.x
    x = corner.x + max(0.5 * (size.x - extent.x), min(inset, 0.5 * size.x))
    end = ImVec2(corner.x + size.x, corner.y + size.y)
    draw_list = imgui.get_window_draw_list()
    draw_list.push_clip_rect(corner, end, True)
    place = ImVec2(round(x), corner.y + round(0.5 * (size.y - extent.y)))
    draw_list.add_text(place, imgui.get_color_u32(imgui.Col_.text), text)
    draw_list.pop_clip_rect()


def _slider_fill(corner: ImVec2, width: float, height: float, start: float, share: float, hovered: bool) -> None:
    """The track's filled part, between two fractions of its width."""
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
