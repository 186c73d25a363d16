"""What inspects the picture in its panel: the values of pixels, a grid between them, and the legend of stops."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.operators.inspect import FALSE_COLOUR
from engine.render.display import false_colour
from ui import theme as look
from ui.panels import stored_pictures
from ui.panels.actions import Action, CopyText, SetPanel
from ui.panels.context import PanelContext
from ui.panels.viewport_layout import PictureRect, ViewportRect, zoom_at

# Screen pixels for each of the picture, from where on a grid is between them.
GRID_SCALE = 12.0
LEGEND_WIDTH, BAR = 300.0, 10.0
N_STOPS = 8  # on either side of 1


def magnify(context: PanelContext, room: ViewportRect, placed: PictureRect) -> list[Action]:
    """The steps of zoom that keys asked for, about the mouse over the picture, else about the panel's centre."""
    steps = context.state.zoom_steps
    if not steps:
        return []
    mouse, is_over = imgui.get_mouse_pos(), imgui.is_item_hovered()
    x = mouse.x if is_over else room.x + 0.5 * room.width
    y = mouse.y if is_over else room.y + 0.5 * room.height
    return [zoom_at(room, placed, float(steps), x, y), SetPanel({"zoom_steps": 0})]


# ------------------------------------------------------------------------------------------------- the values of pixels


def draw_values(context: PanelContext, pixel: tuple[int, int], name: str) -> list[Action]:
    """The values of a pixel, or of the square about it, beside the mouse: where it is, its light, and its colour."""
    side = context.state.values_side
    values = context.values_at(*pixel, side)
    copies = [SetPanel({"copies_values": False})] if context.state.copies_values else []
    if values is None:
        return [*copies]
    where = f"{pixel[0]}, {pixel[1]}" + (f"   mean of {side} x {side}" if side > 1 else "")
    text = "\n".join((where + (f"   {name}" if name else ""), *values.lines()))
    if copies:
        return [CopyText(text, "the pixel's values"), *copies]
    if not context.state.shows_values:
        return []
    mouse, screen, pad = imgui.get_mouse_pos(), imgui.get_main_viewport().size, context.px(8)
    extent, swatch = imgui.calc_text_size(text), imgui.get_text_line_height()
    x = min(mouse.x + context.px(14), screen.x - extent.x - swatch - 2 * pad)
    y = min(mouse.y + context.px(12), screen.y - extent.y - pad)
    draw_list = imgui.get_foreground_draw_list()
    low, high = ImVec2(x - pad, y - 0.5 * pad), ImVec2(x + extent.x + swatch + 2 * pad, y + extent.y + 0.5 * pad)
    draw_list.add_rect_filled(low, high, look.pack(look.grey(26, 0.92)), context.px(4))
    draw_list.add_text(ImVec2(x, y), look.pack(look.TEXT), text)
    red, green, blue = (part / 255.0 for part in values.shown)
    corner = ImVec2(x + extent.x + pad, y)
    end = ImVec2(corner.x + swatch, y + extent.y)
    draw_list.add_rect_filled(corner, end, look.pack((red, green, blue, 1.0)), context.px(2))
    return []


# ----------------------------------------------------------------------------------------------------- over the picture


def draw_grid(context: PanelContext, room: ViewportRect, placed: PictureRect) -> None:
    """Lines between the pixels that are seen, where these are large; and a frame around the one under the mouse."""
    if context.view.fit or placed.scale < context.px(GRID_SCALE):
        return
    draw_list, ink = imgui.get_window_draw_list(), look.pack(look.grey(128, 0.35))
    left, top = max(placed.x, room.x), max(placed.y, room.y)
    right = min(placed.x + placed.width, room.x + room.width)
    bottom = min(placed.y + placed.height, room.y + room.height)
    first, last = ((x - placed.x) / placed.scale for x in (left, right))
    for column in range(math.ceil(first), math.floor(last) + 1):
        x = placed.x + column * placed.scale
        draw_list.add_line(ImVec2(x, top), ImVec2(x, bottom), ink)
    first, last = ((y - placed.y) / placed.scale for y in (top, bottom))
    for row in range(math.ceil(first), math.floor(last) + 1):
        y = placed.y + row * placed.scale
        draw_list.add_line(ImVec2(left, y), ImVec2(right, y), ink)
    mouse = imgui.get_mouse_pos()
    pixel = placed.pixel(mouse.x, mouse.y, room.picture)
    if context.state.shows_values and pixel is not None and imgui.is_item_hovered():
        half, side = context.state.values_side // 2, context.state.values_side * placed.scale
        x, y = (placed.x + (pixel[0] - half) * placed.scale, placed.y + (pixel[1] - half) * placed.scale)
        draw_list.add_rect(ImVec2(x, y), ImVec2(x + side, y + side), look.pack(look.ACCENT), 0.0, context.px(1.5))


def channel_label(context: PanelContext) -> str:
    """What is said over a picture of which one channel is seen; "" where all are."""
    channel = context.view.picture_channel
    return "" if channel == "colour" else f"{channel.capitalize()} alone"


def shows_error(context: PanelContext) -> bool:
    """Whether the map of the picture's error is wanted, and not covered by a stored picture."""
    return context.view.shows_error and stored_pictures.shows_present(context)


def shows_stops(context: PanelContext) -> bool:
    """Whether stops are seen in false colours: not of alpha, nor where other false colours cover them."""
    view = context.view
    covers_all = shows_error(context) and context.error_overlay is not None
    covers_all = covers_all and view.compare is None and not stored_pictures.is_split(context)
    is_covered = bool(stored_pictures.legend(context)) or covers_all
    return view.tone_mapping == FALSE_COLOUR and view.picture_channel != "alpha" and not is_covered


def draw_stops_legend(context: PanelContext, end: ImVec2) -> None:
    """The legend of stops, at the panel's lower end, where they are seen."""
    if not shows_stops(context):
        return
    channel = context.view.picture_channel
    kind = "Luminance" if channel == "colour" else channel.capitalize()
    pad, width, bar = context.px(12), context.px(LEGEND_WIDTH), context.px(BAR)
    small = context.px(look.SMALL_SIZE)
    height = imgui.get_text_line_height() + bar + small + context.px(8)
    x, y = end.x - width - pad, end.y - height - pad
    draw_list = imgui.get_window_draw_list()
    low, high = ImVec2(x - 0.5 * pad, y - 0.3 * pad), ImVec2(x + width + 0.5 * pad, y + height + 0.3 * pad)
    draw_list.add_rect_filled(low, high, look.pack(look.grey(26, 0.88)), context.px(4))
    draw_list.add_text(ImVec2(x, y), look.pack(look.TEXT), f"{kind} in stops, 0 is 1.0; middle grey is -2.5")
    top = y + imgui.get_text_line_height() + context.px(2)
    halves = np.arange(-N_STOPS, N_STOPS, 0.5) + 0.25
    for i, colour in enumerate(false_colour(np.repeat(2.0 ** halves[:, None], 3, axis=1))):
        left, right = x + width * i / len(halves), x + width * (i + 1) / len(halves)
        ink = look.pack((float(colour[0]), float(colour[1]), float(colour[2]), 1.0))
        draw_list.add_rect_filled(ImVec2(left, top), ImVec2(right, top + bar), ink)
    imgui.push_font(None, look.SMALL_SIZE)
    for stops in range(-N_STOPS, N_STOPS + 1, 2):
        text = f"{stops:+d}" if stops else "0"
        extent = imgui.calc_text_size(text).x
        place = x + width * (stops + N_STOPS) / (2 * N_STOPS) - 0.5 * extent
        place = min(max(place, x), x + width - extent)
        draw_list.add_text(ImVec2(place, top + bar + context.px(2)), look.pack(look.TEXT_SOFT), text)
    imgui.pop_font()
    context.handles.note("viewport.stops", x, top)
