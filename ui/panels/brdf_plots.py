"""The three plots of the BRDF panel: lobe, slice, directional albedo. Each fills a box and notes what it needs.

The selected curve's regions are marked where the plot has its angle: b to c as an arc around the lobe, as bars on the
slice, as a strip of the albedo.
"""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.document.view_state import SetView
from ui import theme as look
from ui.gl.brdf_views import BrdfSlice
from ui.panels import widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.curve_plot import Point, distinct_channels
from ui.panels.plot_axes import HALF_PI, Axis, angle_ticks, nice_ceiling, value_label, value_ticks

LOG_DECADES = 4.0
KNOB = 5.0
GRAB = 9.0


# ----------------------------------------------------------------------------------------------------------------- lobe


def lobe(context: PanelContext, place: ImVec2, size: ImVec2) -> list[Action]:
    """A half disc: the normal upwards, light from the left, the radius proportional to the reflection."""
    context.brdf.shown.add("lobe")
    draw = _well(context, place, size)
    radius = min(0.5 * size.x - context.px(13), size.y - context.px(34))
    centre = ImVec2(round(place.x + 0.5 * size.x), round(place.y + size.y - context.px(16)))
    imgui.set_cursor_screen_pos(place)
    imgui.set_next_item_allow_overlap()
    imgui.invisible_button("lobe", size)
    found = context.brdf.lobe
    _polar_grid(context, draw, centre, radius)
    _arcs(context, draw, centre, radius)
    if found is not None:
        top = _lobe_lines(context, draw, found, centre, radius)
        _scale_label(context, draw, place, size, top)
    return _light_ray(context, draw, centre, radius)


def _polar_grid(context: PanelContext, draw: imgui.ImDrawList, centre: ImVec2, radius: float) -> None:
    rings = (0.25, 0.5, 0.75, 1.0) if context.view.lobe_log else (0.5, 1.0)
    for ring in rings:
        draw.path_arc_to(centre, ring * radius, math.pi, 2.0 * math.pi, 48)
        draw.path_stroke(look.pack(look.GRID_STRONG if ring == 1.0 else look.GRID), 1.0)
    imgui.push_font(None, look.SMALL_SIZE - 1.5)
    for degrees in (-90, -60, -30, 0, 30, 60, 90):
        end = _at(centre, math.radians(degrees), radius)
        draw.add_line(centre, end, look.pack(look.GRID_STRONG if degrees in (-90, 90) else look.GRID), 1.0)
        if degrees in (-60, -30, 30, 60):
            text = f"{abs(degrees)}°"
            extent = imgui.calc_text_size(text)
            spot = _at(centre, math.radians(degrees), radius + context.px(9))
            corner = ImVec2(round(spot.x - 0.5 * extent.x), round(spot.y - 0.5 * extent.y))
            draw.add_text(corner, look.pack(look.TEXT_FAINT), text)
    imgui.pop_font()


def _at(centre: ImVec2, angle: float, radius: float) -> ImVec2:
    """The point at an angle from the normal, to the right where positive."""
    return ImVec2(centre.x + radius * math.sin(angle), centre.y - radius * math.cos(angle))


def radii(values: np.ndarray, top: float, logarithmic: bool) -> np.ndarray:
    """Shares of the plot's radius for values of at most `top`; logarithmic: four decades."""
    share = np.clip(values / top, 0.0, 1.0)
    if not logarithmic:
        return np.asarray(share)
    return np.asarray(np.maximum(1.0 + np.log10(np.maximum(share, 1e-12)) / LOG_DECADES, 0.0))


def _lobe_lines(
    context: PanelContext, draw: imgui.ImDrawList, found: BrdfSlice, centre: ImVec2, radius: float
) -> float:
    """Draw the lobe of each channel, and the point under the mouse; returns the value at the outermost ring."""
    top = nice_ceiling(max(float(found.values.max()), 1e-6))
    shown = distinct_channels(found.values)
    for channel in shown:
        r = radius * radii(found.values[:, channel], top, context.view.lobe_log)
        points = np.stack([centre.x + r * np.sin(found.angles), centre.y - r * np.cos(found.angles)], axis=1)
        ink = look.grey(225) if len(shown) == 1 else look.CHANNELS[channel]
        line: list[Point] = [centre, *(ImVec2(x, y) for x, y in points.tolist()), centre]
        draw.add_concave_poly_filled(line, look.pack(look.with_alpha(ink, 0.10 if len(shown) == 1 else 0.06)))
        draw.add_polyline(line, look.pack(ink), context.px(1.5), 0)
    mouse = imgui.get_mouse_pos()
    reach = math.hypot(mouse.x - centre.x, mouse.y - centre.y)
    if imgui.is_item_hovered() and not imgui.is_item_active() and reach <= radius + context.px(12):
        angle = math.atan2(mouse.x - centre.x, max(centre.y - mouse.y, 0.0))
        index = int(np.abs(found.angles - angle).argmin())
        draw.add_line(centre, _at(centre, angle, radius), look.pack(look.with_alpha(look.TEXT, 0.35)), 1.0)
        side = "" if angle >= 0.0 else ", on the light's side"
        _tooltip_now(f"{abs(math.degrees(angle)):.0f}° from the normal{side}\n{_triple(found.values[index])} per sr")
    return top


def _scale_label(context: PanelContext, draw: imgui.ImDrawList, place: ImVec2, size: ImVec2, top: float) -> None:
    """Label the outermost ring, in the lower right corner."""
    imgui.push_font(None, look.SMALL_SIZE - 1.5)
    text = f"ring {value_label(top, top)} /sr"
    extent = imgui.calc_text_size(text)
    corner = ImVec2(round(place.x + size.x - extent.x - context.px(6)), round(place.y + size.y - extent.y - 1))
    draw.add_text(corner, look.pack(look.TEXT_SOFT), text)
    imgui.pop_font()


def _light_ray(context: PanelContext, draw: imgui.ImDrawList, centre: ImVec2, radius: float) -> list[Action]:
    """The ray of light with its knob, which can be dragged, and the mirror direction."""
    angle = context.view.lobe_angle
    outer, mirrored = _at(centre, -angle, radius), _at(centre, angle, radius)
    context.handles.note("brdf.light", outer.x, outer.y)
    mouse = imgui.get_mouse_pos()
    near = math.hypot(mouse.x - outer.x, mouse.y - outer.y) <= context.px(GRAB)
    hovered, active = imgui.is_item_hovered(), imgui.is_item_active()
    _dashes(draw, centre, mirrored, context.px(4), look.pack(look.with_alpha(look.ACCENT, 0.5)))
    draw.add_line(outer, centre, look.pack(look.with_alpha(look.ACCENT, 0.85)), context.px(1.5))
    draw.add_circle_filled(outer, context.px(KNOB + 1), look.pack(look.WELL))
    lit = active or (hovered and near)
    ink = look.ACCENT if lit else look.with_alpha(look.ACCENT, 0.85)
    draw.add_circle_filled(outer, context.px(KNOB if lit else KNOB - 1), look.pack(ink))
    _light_label(context, draw, centre, angle)
    if hovered and near:
        imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
    if active and mouse.y < centre.y + context.px(30):
        turned = math.atan2(centre.x - mouse.x, max(centre.y - mouse.y, 1e-6))
        return [SetView.of(lobe_angle=abs(turned))]
    return []


def _light_label(context: PanelContext, draw: imgui.ImDrawList, centre: ImVec2, angle: float) -> None:
    text = f"θ_i {math.degrees(angle):.0f}°"
    body, _, rest = text.partition("_i")
    imgui.push_font(None, look.SMALL_SIZE - 1.5)
    x, y = round(centre.x - context.px(80)), round(centre.y + context.px(2))
    widgets.rich_text(draw, ImVec2(x, y), look.pack(look.ACCENT), f"{body}_i")
    draw.add_text(ImVec2(x + widgets.rich_width(f"{body}_i") + 2, y), look.pack(look.ACCENT), rest)
    imgui.pop_font()


def _dashes(draw: imgui.ImDrawList, start: ImVec2, end: ImVec2, length: float, ink: int) -> None:
    whole = math.hypot(end.x - start.x, end.y - start.y)
    for k in range(0, int(whole / length), 2):
        one, two = k * length / whole, min((k + 1) * length / whole, 1.0)
        near, far = (ImVec2(start.x + t * (end.x - start.x), start.y + t * (end.y - start.y)) for t in (one, two))
        draw.add_line(near, far, ink, 1.0)


def _arcs(context: PanelContext, draw: imgui.ImDrawList, centre: ImVec2, radius: float) -> None:
    """Mark on the rim where the selected curve's b to c is."""
    for low, high in arcs_of_region(_factor(context), context.view.lobe_angle, *_region(context)):
        draw.path_arc_to(centre, radius, low - HALF_PI, high - HALF_PI, 24)
        draw.path_stroke(look.pack(look.with_alpha(look.ACCENT, 0.75)), context.px(2.5))


def arcs_of_region(factor: str, theta_i: float, low: float, high: float) -> list[tuple[float, float]]:
    """Angles of the camera, in the plane of light and normal, at which a curve's angle is between low and high.

    There theta_h = |theta - theta_i| / 2, theta_r = |theta - theta_i|, theta_d = |theta + theta_i| / 2.
    """
    middle, stretch = {
        "theta_h": (theta_i, 2.0), "theta_r": (theta_i, 1.0), "theta_d": (-theta_i, 2.0), "theta_o": (0.0, 1.0),
    }.get(factor, (0.0, 0.0))  # fmt: skip
    spans = [(middle + stretch * low, middle + stretch * high), (middle - stretch * high, middle - stretch * low)]
    cut = [(max(one, -HALF_PI), min(two, HALF_PI)) for one, two in spans]
    return [(one, two) for one, two in cut if two - one > 1e-3]


# ---------------------------------------------------------------------------------------------------------------- slice


def slice_image(context: PanelContext, place: ImVec2, size: ImVec2) -> None:
    """The image with its axes in degrees."""
    board = context.brdf
    board.shown.add("slice")
    left, below = context.px(30), context.px(30)
    side = min(size.x - left - context.px(8), size.y - below - context.px(4))
    spare = size.x - left - context.px(8) - side
    corner = ImVec2(round(place.x + left + 0.5 * spare), round(place.y + context.px(4)))
    end = ImVec2(corner.x + side, corner.y + side)
    across, up = Axis(0.0, HALF_PI, corner.x, end.x), Axis(0.0, HALF_PI, end.y, corner.y)
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(corner, end, look.pack(look.WELL))
    _slice_axes(context, draw, across, up)
    imgui.set_cursor_screen_pos(corner)
    imgui.set_next_item_allow_overlap()
    imgui.invisible_button("slice", ImVec2(side, side))
    context.handles.note_item("brdf.slice")
    if board.slice is None:
        return
    upper, lower = board.slice.corners()
    draw.add_image(board.slice.reference, corner, end, upper, lower)
    _slice_marks(context, draw, across, up)
    if imgui.is_item_hovered():
        mouse = imgui.get_mouse_pos()
        h, d = across.to_value(mouse.x), up.to_value(mouse.y)
        _tooltip_now(f"θh {math.degrees(h):.0f}°  θd {math.degrees(d):.0f}°\n{_triple(board.slice_value(h, d))} per sr")


def _slice_axes(context: PanelContext, draw: imgui.ImDrawList, across: Axis, up: Axis) -> None:
    imgui.push_font(None, look.SMALL_SIZE - 1.5)
    for tick in angle_ticks(across, context.px(34)):
        x, extent = across.to_pixel(tick.value), imgui.calc_text_size(tick.label)
        spot = ImVec2(round(x - 0.5 * extent.x), up.start + context.px(2))
        draw.add_text(spot, look.pack(look.TEXT_SOFT), tick.label)
    for tick in angle_ticks(up, context.px(26)):
        y, extent = up.to_pixel(tick.value), imgui.calc_text_size(tick.label)
        top = min(max(y - 0.5 * extent.y, up.end - context.px(3)), up.start - 0.6 * extent.y)
        spot = ImVec2(round(across.start - context.px(5) - extent.x), round(top))
        draw.add_text(spot, look.pack(look.TEXT_SOFT), tick.label)
    imgui.pop_font()
    imgui.push_font(None, look.SMALL_SIZE)
    below = ImVec2(round(0.5 * (across.start + across.end) - context.px(6)), up.start + context.px(13))
    widgets.rich_text(draw, below, look.pack(look.TEXT), "θ_h")
    side = ImVec2(round(across.start - context.px(29)), round(0.5 * (up.start + up.end) - context.px(8)))
    widgets.rich_text(draw, side, look.pack(look.TEXT), "θ_d")
    imgui.pop_font()


def _slice_marks(context: PanelContext, draw: imgui.ImDrawList, across: Axis, up: Axis) -> None:
    factor = _factor(context)
    for value in _region(context):
        ink = look.pack(look.with_alpha(look.ACCENT, 0.85))
        if factor == "theta_h":
            x = round(across.to_pixel(value)) + 0.5
            draw.add_line(ImVec2(x, up.end), ImVec2(x, up.start), ink, 1.0)
        elif factor == "theta_d":
            y = round(up.to_pixel(value)) + 0.5
            draw.add_line(ImVec2(across.start, y), ImVec2(across.end, y), ink, 1.0)


# --------------------------------------------------------------------------------------------------------------- albedo


def albedo(context: PanelContext, place: ImVec2, size: ImVec2) -> None:
    """Directional albedo per channel over the angle of the light; nothing should exceed the line at 1."""
    context.brdf.shown.add("albedo")
    found = context.brdf.albedo
    largest = 1.0 if found is None else float(found.values.max())
    across = Axis(0.0, HALF_PI, place.x + context.px(28), place.x + size.x - context.px(10))
    up = Axis(0.0, nice_ceiling(max(1.02 * largest, 1e-3)) if largest > 1.0 or largest < 0.3 else 1.0,
              place.y + size.y - context.px(30), place.y + context.px(6))  # fmt: skip
    corner, end = ImVec2(across.start, up.end), ImVec2(across.end, up.start)
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(corner, end, look.pack(look.WELL), context.px(3))
    imgui.set_cursor_screen_pos(corner)
    imgui.invisible_button("albedo", ImVec2(end.x - corner.x, end.y - corner.y))
    context.handles.note_item("brdf.albedo")
    _albedo_grid(context, draw, across, up)
    if _factor(context) == "theta_i":
        low, high = (across.to_pixel(value) for value in _region(context))
        strip = look.pack(look.with_alpha(look.ACCENT, 0.12))
        draw.add_rect_filled(ImVec2(low, up.end), ImVec2(high, up.start), strip)
    if found is None:
        return
    shown = distinct_channels(found.values)
    for channel in shown:
        ink = look.grey(225) if len(shown) == 1 else look.CHANNELS[channel]
        xs, ys = across.to_pixels(found.angles), up.to_pixels(found.values[:, channel])
        points: list[Point] = [ImVec2(x, y) for x, y in np.stack([xs, ys], axis=1).tolist()]
        draw.add_polyline(points, look.pack(ink), context.px(1.5), 0)
    if imgui.is_item_hovered():
        x = imgui.get_mouse_pos().x
        index = int(np.abs(found.angles - across.to_value(x)).argmin())
        draw.add_line(ImVec2(x, up.end), ImVec2(x, up.start), look.pack(look.with_alpha(look.TEXT, 0.35)), 1.0)
        _tooltip_now(
            f"light from {math.degrees(found.angles[index]):.0f}°\n{_triple(found.values[index])} of it is reflected"
        )


def _albedo_grid(context: PanelContext, draw: imgui.ImDrawList, across: Axis, up: Axis) -> None:
    imgui.push_font(None, look.SMALL_SIZE - 1.5)
    for tick in angle_ticks(across, context.px(34)):
        x, extent = round(across.to_pixel(tick.value)) + 0.5, imgui.calc_text_size(tick.label)
        if across.start + 1 < x < across.end - 1:
            draw.add_line(ImVec2(x, up.end), ImVec2(x, up.start), look.pack(look.GRID), 1.0)
        spot = ImVec2(round(x - 0.5 * extent.x), up.start + context.px(2))
        draw.add_text(spot, look.pack(look.TEXT_SOFT), tick.label)
    for tick in value_ticks(up, context.px(24)):
        y, extent = round(up.to_pixel(tick.value)) + 0.5, imgui.calc_text_size(tick.label)
        ink = look.with_alpha(look.BAD, 0.8) if tick.value == 1.0 else look.GRID
        draw.add_line(ImVec2(across.start, y), ImVec2(across.end, y), look.pack(ink), 1.0)
        spot = ImVec2(round(across.start - context.px(5) - extent.x), round(y - 0.5 * extent.y))
        draw.add_text(spot, look.pack(look.TEXT_SOFT), tick.label)
    imgui.pop_font()
    imgui.push_font(None, look.SMALL_SIZE)
    below = ImVec2(round(0.5 * (across.start + across.end) - context.px(6)), up.start + context.px(13))
    widgets.rich_text(draw, below, look.pack(look.TEXT), "θ_i")
    imgui.pop_font()


# -------------------------------------------------------------------------------------------------------------- helpers


def _well(context: PanelContext, place: ImVec2, size: ImVec2) -> imgui.ImDrawList:
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(place, ImVec2(place.x + size.x, place.y + size.y), look.pack(look.WELL), context.px(4))
    return draw


def _factor(context: PanelContext) -> str:
    """The name of the selected curve."""
    return (context.view.selected and context.view.selected.factor) or ""


def _region(context: PanelContext) -> tuple[float, float]:
    """b and c of the operator in use."""
    return context.view.regions[1], context.view.regions[2]


def _triple(values: np.ndarray | tuple[float, float, float]) -> str:
    """Three numbers, or one where they agree."""
    numbers = [float(value) for value in values]
    texts = [f"{number:.3g}" for number in numbers]
    if len(set(texts)) == 1:
        return texts[0]
    return "  ".join(f"{name} {text}" for name, text in zip("RGB", texts, strict=True))


def _tooltip_now(text: str) -> None:
    """Show a tooltip at once, without delay."""
    imgui.begin_tooltip()
    imgui.text_unformatted(text)
    imgui.end_tooltip()
