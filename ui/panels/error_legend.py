"""The legend of the false colours of errors: a bar of them, with labels."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from engine.render.display import false_colour
from engine.render.error_colours import LEAST, MOST, error_to_radiance
from ui import theme as look
from ui.panels.context import PanelContext

N_SHADES, TICKS = 32, (0.001, 0.01, 0.1)
BAR = 10.0


def height(context: PanelContext) -> float:
    """The height of the bar and the labels below it, in small type."""
    return context.px(BAR + 2 + look.SMALL_SIZE)


def draw(context: PanelContext, draw_list: imgui.ImDrawList, corner: ImVec2, room: float) -> None:
    """Draw it from an upper left corner, in this width."""
    bar, gap = context.px(BAR), context.px(2)
    shares = np.geomspace(LEAST, MOST, N_SHADES + 1)
    colours = false_colour(np.repeat(error_to_radiance(np.sqrt(shares[:-1] * shares[1:]))[:, None], 3, axis=1))
    for i, colour in enumerate(colours):
        left, right = corner.x + room * i / N_SHADES, corner.x + room * (i + 1) / N_SHADES
        packed = look.pack((float(colour[0]), float(colour[1]), float(colour[2]), 1.0))
        draw_list.add_rect_filled(ImVec2(left, corner.y), ImVec2(right, corner.y + bar), packed)
    imgui.push_font(None, look.SMALL_SIZE)
    for share in TICKS:
        text = f"{100.0 * share:g} %"
        x = corner.x + room * np.log(share / LEAST) / np.log(MOST / LEAST)
        width = imgui.calc_text_size(text).x
        place = ImVec2(min(max(x - 0.5 * width, corner.x), corner.x + room - width), corner.y + bar + gap)
        draw_list.add_text(place, look.pack(look.TEXT_SOFT), text)
    imgui.pop_font()
