"""The parts of a row in the list of objects: its background, its arrow, its name, and its switches."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from ui import theme as look
from ui.panels import widgets
from ui.panels.context import PanelContext

BUTTONS = 3


def arrow(context: PanelContext, path: str, is_open: bool, hint: str) -> bool:
    """The arrow that opens and closes a row; returns whether it was pressed."""
    size = ImVec2(context.px(18), imgui.get_frame_height())
    corner = imgui.get_cursor_screen_pos()
    pressed = imgui.invisible_button("arrow", size)
    context.handles.note_item(f"arrow.{path}")
    x, y, half = corner.x + 0.5 * size.x, corner.y + 0.5 * size.y, context.px(3.5)
    ink = look.pack(look.TEXT if imgui.is_item_hovered() else look.TEXT_SOFT)
    draw = imgui.get_window_draw_list()
    if is_open:
        points = (ImVec2(x - half, y - 0.6 * half), ImVec2(x + half, y - 0.6 * half), ImVec2(x, y + 0.8 * half))
    else:
        points = (ImVec2(x - 0.6 * half, y - half), ImVec2(x + 0.8 * half, y), ImVec2(x - 0.6 * half, y + half))
    draw.add_triangle_filled(*points, ink)
    widgets.tooltip(hint)
    return pressed


def ground(context: PanelContext, chosen: bool, hovered: bool, also: bool = False) -> tuple[ImVec2, float, look.Colour]:
    """Row background, `also` of an object that is selected besides the active one; returns (corner, width, the colour
    of icons in their normal state on it)."""
    corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    end = ImVec2(corner.x + width, corner.y + imgui.get_frame_height())
    inside = imgui.is_mouse_hovering_rect(corner, end) and imgui.is_window_hovered(
        imgui.HoveredFlags_.allow_when_blocked_by_active_item
    )
    draw = imgui.get_window_draw_list()
    if chosen or also or inside or hovered:
        draw.add_rect_filled(corner, end, look.pack(look.grey(62 if chosen else 54 if also else 46)), context.px(4))
    if chosen or also:
        bar = ImVec2(corner.x + context.px(2), end.y - context.px(4))
        draw.add_rect_filled(
            ImVec2(corner.x, corner.y + context.px(4)),
            bar,
            look.pack(look.ACCENT if chosen else look.with_alpha(look.ACCENT, 0.55)),
        )
    return corner, width, look.TEXT_SOFT if inside else look.grey(108 if chosen else 84)


def name(
    context: PanelContext, path: str, text: str, hint: str, icon: str, corner: ImVec2, width: float, faint: bool
) -> bool:
    """The name of a row, on a button over the row's room; returns whether it was pressed."""
    height = imgui.get_frame_height()
    place = imgui.get_cursor_screen_pos()
    room = corner.x + width - BUTTONS * height - place.x
    imgui.set_next_item_allow_overlap()
    pressed = imgui.invisible_button("name", ImVec2(max(room, 1.0), height))
    context.handles.note_item(f"objects.{path}")
    widgets.tooltip(hint)
    ink = look.TEXT_FAINT if faint else look.TEXT
    draw = imgui.get_window_draw_list()
    y = place.y + imgui.get_style().frame_padding.y
    after_text = context.px(7) + imgui.calc_text_size(icon).x if icon else 0.0
    shown = widgets.shortened(text, room - after_text)
    draw.push_clip_rect(place, ImVec2(place.x + room, place.y + height), True)
    draw.add_text(ImVec2(place.x, y), look.pack(ink), shown)
    if icon:
        after = place.x + imgui.calc_text_size(shown).x + context.px(7)
        draw.add_text(ImVec2(after, y), look.pack(look.TEXT_SOFT), icon)
    draw.pop_clip_rect()
    return pressed


def toggle(
    context: PanelContext, name: str, on_icon: str, off_icon: str, normal: bool, quiet: look.Colour, hint: str
) -> bool:
    """An icon that is dim in its normal state (faint until the row is hovered) and plain otherwise."""
    imgui.same_line()
    height = imgui.get_frame_height()
    corner = imgui.get_cursor_screen_pos()
    pressed = imgui.invisible_button(name, ImVec2(height, height))
    context.handles.note_item(f"button.{name}")
    hovered = imgui.is_item_hovered()
    widgets.tooltip(hint)
    ink = look.TEXT if hovered else quiet if normal else look.ACCENT
    icon = on_icon if normal else off_icon
    imgui.push_font(None, look.SMALL_SIZE)
    extent = imgui.calc_text_size(icon)
    place = ImVec2(round(corner.x + 0.5 * (height - extent.x)), round(corner.y + 0.5 * (height - extent.y)))
    imgui.get_window_draw_list().add_text(place, imgui.get_color_u32(ImVec4(*ink)), icon)
    imgui.pop_font()
    return pressed
