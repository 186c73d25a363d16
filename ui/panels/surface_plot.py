"""Draws the lobe of a picked pixel over the picture: faces in the colour of the reflection, and wires."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from ui import theme as look
from ui.panels.context import PanelContext
from ui.surface_lobe import SurfaceLobe

SIZE = 110.0


def draw(context: PanelContext, x: float, y: float, scale: float) -> None:
    """Draw over a picture whose upper left corner is at (x, y), `scale` screen pixels for each of its own."""
    board = context.brdf
    if context.view.lobe_pixel is None:
        return
    board.shown.add("surface")
    lobe = board.surface
    if lobe is None:
        return
    draw_list = imgui.get_window_draw_list()
    places = lobe.pixels(context.px(SIZE) / scale) * scale + (x, y)
    base = ImVec2(x + scale * (lobe.point.column + 0.5), y + scale * (lobe.point.row + 0.5))
    context.handles.note("viewport.lobe", base.x, base.y)
    _faces(draw_list, lobe, places)
    _wires(draw_list, places)
    draw_list.add_circle_filled(base, context.px(3), look.pack(look.grey(20)))
    draw_list.add_circle_filled(base, context.px(2), look.pack(look.ACCENT))


def _faces(draw_list: imgui.ImDrawList, lobe: SurfaceLobe, places: np.ndarray) -> None:
    """Quads between neighbouring rings and azimuths; those of no extent are left out."""
    beside = np.roll(places, -1, axis=1)
    corners = np.stack([places[:-1], beside[:-1], beside[1:], places[1:]], axis=2).reshape(-1, 4, 2)
    spread = np.abs(corners - corners[:, :1]).max(axis=(1, 2))
    inks = packed(lobe.shades.reshape(-1, 3))
    for face in lobe.order[spread[lobe.order] > 0.3].tolist():
        one, two, three, four = (ImVec2(*corner) for corner in corners[face].tolist())
        draw_list.add_quad_filled(one, two, three, four, int(inks[face]))


def _wires(draw_list: imgui.ImDrawList, places: np.ndarray) -> None:
    """Some rings, and lines outwards from the normal: the shape is visible on a picture of its own colour."""
    ink = look.pack(look.grey(255, 0.4))
    for ring in places[2::3]:
        draw_list.add_polyline([ImVec2(*place) for place in ring.tolist()], ink, 1.0, int(imgui.ImDrawFlags_.closed))
    for line in np.moveaxis(places, 1, 0)[::5]:
        draw_list.add_polyline([ImVec2(*place) for place in line.tolist()], ink, 1.0, 0)


def packed(colours: np.ndarray, alpha: float = 0.9) -> np.ndarray:
    """Linear colours (N, 3) in [0, 1] as imgui's 32-bit values, sRGB encoded."""
    encoded = np.clip(colours, 0.0, 1.0) ** (1.0 / 2.2)
    red, green, blue = np.rint(255.0 * encoded).astype(np.uint32).T
    return np.asarray(red | green << 8 | blue << 16 | np.uint32(round(255 * alpha)) << 24)
