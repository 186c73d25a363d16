"""Draws the curve and its handles: grid, generated curve (thin, dashed), edited curve per channel, regions, knob.

It draws on imgui's draw list (rejected: a plotting library's plot, whose own panning and picking conflict with handles
that must feel like objects). `Frame` has the layout; the drawing functions take it and return nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui

from engine.curve.operators import Edit, Operator, strength, unique_sorted
from ui import theme as look
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import END_NAMES, Knob, OperatorGroup, Regions
from ui.panels.plot_axes import Axis, angle_ticks, value_ticks
from ui.panels.widgets import rich_text

Point = ImVec2 | tuple[int | float, int | float] | list[int | float]

LEFT_GUTTER = 46.0
FLAG_STRIP = 22.0
BOTTOM_GUTTER = 20.0
RIGHT_GUTTER = 10.0
FLAG = 16.0
STRIPS = 14
BAND_STEP = 2.0


@dataclass(frozen=True)
class Frame:
    """The plot's axes in screen pixels; the flag strip is above the plot."""

    x: Axis
    y: Axis

    @property
    def corner(self) -> ImVec2:
        """Upper left of the plot's area."""
        return ImVec2(self.x.start, self.y.end)

    @property
    def end(self) -> ImVec2:
        """Lower right of the plot's area."""
        return ImVec2(self.x.end, self.y.start)

    def contains(self, x: float, y: float) -> bool:
        """Whether a screen position is inside the plot's area."""
        return self.x.start <= x <= self.x.end and self.y.end <= y <= self.y.start


def layout(
    context: PanelContext,
    corner: ImVec2,
    size: ImVec2,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    log_y: bool,
) -> Frame:
    """Axes of a plot that fills `size` from `corner`, with room for labels and flags."""
    left, right = corner.x + context.px(LEFT_GUTTER), corner.x + size.x - context.px(RIGHT_GUTTER)
    top, bottom = corner.y + context.px(FLAG_STRIP), corner.y + size.y - context.px(BOTTOM_GUTTER)
    y = Axis(*y_range, max(bottom, top + 20), top, "log" if log_y else "symlog")
    return Frame(Axis(*x_range, left, max(right, left + 20)), y)


def draw_ground(context: PanelContext, frame: Frame, title: str, variable: str) -> None:
    """Background, grid and labelled axes. `title` is in the upper right, the variable at the end of the x axis."""
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(frame.corner, frame.end, look.pack(look.WELL), context.px(4))
    imgui.push_font(None, look.SMALL_SIZE)
    _draw_angle_grid(context, draw, frame)
    _draw_value_grid(context, draw, frame)
    extent = imgui.calc_text_size(title)
    place = ImVec2(frame.x.end - extent.x - context.px(9), frame.y.end + context.px(6))
    draw.add_text(place, look.pack(look.TEXT_FAINT), title)
    imgui.pop_font()
    place = ImVec2(frame.x.start - context.px(28), frame.y.start + context.px(3))
    rich_text(draw, place, look.pack(look.TEXT), variable)


def _draw_angle_grid(context: PanelContext, draw: imgui.ImDrawList, frame: Frame) -> None:
    for tick in angle_ticks(frame.x, context.px(52)):
        x = round(frame.x.to_pixel(tick.value)) + 0.5
        if frame.x.start + 1 < x < frame.x.end - 1:
            draw.add_line(ImVec2(x, frame.y.end), ImVec2(x, frame.y.start), look.pack(look.GRID), 1.0)
        width = imgui.calc_text_size(tick.label).x
        left = min(x - 0.5 * width, frame.x.end + context.px(RIGHT_GUTTER) - width)
        draw.add_text(ImVec2(round(left), frame.y.start + context.px(4)), look.pack(look.TEXT_SOFT), tick.label)


def _draw_value_grid(context: PanelContext, draw: imgui.ImDrawList, frame: Frame) -> None:
    for tick in value_ticks(frame.y, context.px(30)):
        y = round(frame.y.to_pixel(tick.value)) + 0.5
        strong = tick.value == 0.0 and frame.y.scale != "log"
        if frame.y.end + 1 < y < frame.y.start - 1:
            ink = look.GRID_STRONG if strong else look.GRID if tick.label else look.grey(32)
            draw.add_line(ImVec2(frame.x.start, y), ImVec2(frame.x.end, y), look.pack(ink), 1.0)
        if not tick.label:
            continue
        extent = imgui.calc_text_size(tick.label)
        top = min(max(y - 0.5 * extent.y, frame.y.end - context.px(3)), frame.y.start - extent.y + context.px(3))
        draw.add_text(
            ImVec2(round(frame.x.start - context.px(7) - extent.x), round(top)), look.pack(look.TEXT_SOFT), tick.label
        )


def draw_note(context: PanelContext, frame: Frame, line: int, text: str, colour: look.Colour) -> tuple[float, float]:
    """Draw a line of small text below the title, the first is 1; returns where it begins."""
    imgui.push_font(None, look.SMALL_SIZE)
    extent = imgui.calc_text_size(text)
    top = frame.y.end + context.px(6) + line * (extent.y + context.px(3))
    place = ImVec2(max(frame.x.end - extent.x - context.px(9), frame.x.start + context.px(6)), top)
    imgui.get_window_draw_list().add_text(place, look.pack(colour), text)
    imgui.pop_font()
    return place.x, place.y


def sample_angles(frame: Frame, features: tuple[float, ...]) -> np.ndarray:
    """(N,) angles at which to evaluate the curve: one per screen pixel, and beside every sharp feature."""
    low, high = frame.x.low, frame.x.high
    even = np.linspace(low, high, max(2, round((frame.x.end - frame.x.start) / 1.5)))
    sharp = np.array([f for f in features if low < f < high])
    return unique_sorted(
        np.concatenate([even, sharp, np.clip(sharp - 1e-9, low, high), np.clip(sharp + 1e-9, low, high)])
    )


def draw_generated(frame: Frame, gamma: np.ndarray, values: np.ndarray, scale: float) -> None:
    """The curve that the parameters generate: thin, dashed, one line for each channel that differs."""
    for channel in distinct_channels(values):
        points = _points(frame, gamma, values[:, channel])
        _dashed(imgui.get_window_draw_list(), points, look.pack(look.with_alpha(look.TEXT, 0.55)), 1.0 * scale, scale)


def draw_faint(frame: Frame, gamma: np.ndarray, values: np.ndarray, scale: float) -> None:
    """A curve beside the one with the handles: a thin line for each channel that differs."""
    shown = distinct_channels(values)
    for channel in shown:
        ink = look.TEXT if len(shown) == 1 else look.CHANNELS[channel]
        draw_line(frame, gamma, values[:, channel], look.with_alpha(ink, 0.4), 1.0 * scale)


def draw_samples(frame: Frame, gamma: np.ndarray, values: np.ndarray, scale: float) -> None:
    """The samples that a curve was fitted to, as dots, of each channel that differs."""
    draw, shown = imgui.get_window_draw_list(), distinct_channels(values)
    for channel in shown:
        ink = look.TEXT if len(shown) == 1 else look.CHANNELS[channel]
        for place in _points(frame, gamma, values[:, channel]):
            draw.add_circle_filled(ImVec2(*place), 2.0 * scale, look.pack(look.with_alpha(ink, 0.7)))


def draw_curve(frame: Frame, gamma: np.ndarray, values: np.ndarray, channels: tuple[bool, ...], scale: float) -> None:
    """The edited curve: one white line where the channels agree, else three coloured ones, those not edited dimmed."""
    draw = imgui.get_window_draw_list()
    shown = distinct_channels(values)
    if len(shown) == 1:
        ink = look.grey(235) if all(channels) else look.CHANNELS[channels.index(True)]
        draw.add_polyline(_points(frame, gamma, values[:, 0]), look.pack(ink), 2.0 * scale, 0)
        return
    for channel in sorted(shown, key=lambda c: channels[c]):
        alpha = 1.0 if channels[channel] else 0.35
        colour = look.pack(look.with_alpha(look.CHANNELS[channel], alpha))
        draw.add_polyline(_points(frame, gamma, values[:, channel]), colour, 2.0 * scale, 0)


def draw_band(frame: Frame, gamma: np.ndarray, values: np.ndarray, deviation: np.ndarray, scale: float) -> None:
    """How far a curve (N, 3) is determined: shaded between it minus and plus its standard deviation (N, 3)."""
    draw, shown = imgui.get_window_draw_list(), distinct_channels(values)
    # Upright bars of whole pixels: polygons with smooth edges would show as stripes side by side.
    edges, pixels = np.arange(frame.x.start, frame.x.end, BAND_STEP), frame.x.to_pixels(gamma)
    for channel in shown:
        ink = look.pack(look.with_alpha(look.TEXT if len(shown) == 1 else look.CHANNELS[channel], 0.25))
        middle, half = values[:, channel], deviation[:, channel]
        ends = (frame.y.to_pixels(each) for each in (np.maximum(middle - half, 0.0), middle + half))
        low, high = (np.interp(edges + 0.5 * BAND_STEP, pixels, each) for each in ends)
        for k in np.flatnonzero(low - high > scale):  # what is thinner is under the line
            start, end = ImVec2(float(edges[k]), float(high[k])), ImVec2(float(edges[k]) + BAND_STEP, float(low[k]))
            draw.add_rect_filled(start, end, ink)


def draw_line(frame: Frame, gamma: np.ndarray, values: np.ndarray, ink: look.Colour, thickness: float) -> None:
    """One function (N,) over the angle."""
    imgui.get_window_draw_list().add_polyline(_points(frame, gamma, values), look.pack(ink), thickness, 0)


def distinct_channels(values: np.ndarray) -> list[int]:
    """[0] where the three columns agree to within a thousandth of the largest value, else [0, 1, 2]."""
    largest = float(np.abs(values).max(initial=0.0))
    same = bool(np.abs(values - values[:, :1]).max(initial=0.0) <= 1e-3 * largest)
    return [0] if same else [0, 1, 2]


def draw_regions(
    context: PanelContext, frame: Frame, group: OperatorGroup, held: str | None, hovered: str | None
) -> None:
    """The falloff, shaded by the operator's strength, and a bar at each of a, b, c, d."""
    draw = imgui.get_window_draw_list()
    draw.push_clip_rect(frame.corner, frame.end, True)
    _shade(draw, frame, group.first)
    for name, angle in zip(END_NAMES, group.regions, strict=True):
        x = round(frame.x.to_pixel(angle)) + 0.5
        active = name in (held, hovered)
        ink = look.with_alpha(look.ACCENT, 0.95 if active else 0.6 if name in "bc" else 0.38)
        draw.add_line(ImVec2(x, frame.y.end), ImVec2(x, frame.y.start), look.pack(ink), context.px(2 if active else 1))
    draw.pop_clip_rect()


def _shade(draw: imgui.ImDrawList, frame: Frame, operator: Edit) -> None:
    a, b, c, d = operator.regions
    edges = unique_sorted(np.concatenate([np.linspace(a, b, STRIPS), np.linspace(c, d, STRIPS)]))
    weights = strength(operator, edges)
    pixels = np.clip(frame.x.to_pixels(edges), frame.x.start, frame.x.end)
    for k in range(len(edges) - 1):
        left = look.pack(look.with_alpha(look.ACCENT, 0.15 * float(weights[k])))
        right = look.pack(look.with_alpha(look.ACCENT, 0.15 * float(weights[k + 1])))
        draw.add_rect_filled_multi_color(
            ImVec2(pixels[k], frame.y.end), ImVec2(pixels[k + 1], frame.y.start), left, right, right, left
        )


def flag_places(frame: Frame, regions: Regions, width: float) -> tuple[float, float, float, float]:
    """Centres of the four flags: at their bars, moved apart just so far that none covers another."""
    places = [frame.x.to_pixel(angle) for angle in regions]
    for _ in range(24):
        moved = False
        for k in range(3):
            overlap = width - (places[k + 1] - places[k])
            if overlap > 1e-3:
                places[k] -= 0.5 * overlap
                places[k + 1] += 0.5 * overlap
                moved = True
        if not moved:
            break
    low, high = frame.x.start + 0.5 * width, frame.x.end - 0.5 * width
    for k in range(4):
        places[k] = max(places[k], low + k * width)
    for k in range(3, -1, -1):
        places[k] = min(places[k], high - (3 - k) * width)
    return places[0], places[1], places[2], places[3]


def draw_flags(
    context: PanelContext, frame: Frame, regions: Regions, places: tuple[float, ...], held: str | None, hot: str | None
) -> None:
    """The strip above the plot: a band for the region and a lettered flag at each end, connected to its bar."""
    draw = imgui.get_window_draw_list()
    top, base = frame.y.end - context.px(FLAG_STRIP - 2), frame.y.end
    size = context.px(FLAG)
    middle = top + 0.5 * size
    band = look.with_alpha(look.ACCENT, 0.55 if "region" in (held, hot) else 0.28)
    half = context.px(2)
    draw.add_rect_filled(ImVec2(places[0], middle - half), ImVec2(places[3], middle + half), look.pack(band), half)
    draw.add_rect_filled(
        ImVec2(places[1], middle - 2 * half), ImVec2(places[2], middle + 2 * half), look.pack(band), half
    )
    for name, angle, place in zip(END_NAMES, regions, places, strict=True):
        active = name in (held, hot)
        bar = min(max(frame.x.to_pixel(angle), frame.x.start), frame.x.end)
        ink = look.pack(look.ACCENT if active or name in "bc" else look.with_alpha(look.ACCENT, 0.75))
        draw.add_line(ImVec2(place, top + size), ImVec2(bar, base), ink, context.px(1))
        _flag(context, draw, ImVec2(place - 0.5 * size, top), size, name, active)


def _flag(context: PanelContext, draw: imgui.ImDrawList, corner: ImVec2, size: float, name: str, active: bool) -> None:
    end = ImVec2(corner.x + size, corner.y + size)
    core = name in "bc"
    ground = look.ACCENT if active or core else look.grey(40)
    draw.add_rect_filled(corner, end, look.pack(ground), context.px(4))
    if not (active or core):
        draw.add_rect(corner, end, look.pack(look.with_alpha(look.ACCENT, 0.75)), context.px(4))
    imgui.push_font(context.theme.fonts.bold, look.SMALL_SIZE - 1)
    extent = imgui.calc_text_size(name)
    ink = look.grey(18) if active or core else look.ACCENT
    draw.add_text(
        ImVec2(round(corner.x + 0.5 * (size - extent.x)), round(corner.y + 0.5 * (size - extent.y)) - 1),
        look.pack(ink),
        name,
    )
    imgui.pop_font()


def knob_place(context: PanelContext, frame: Frame, knob: Knob) -> tuple[float, float]:
    """Screen position of the knob, clamped to the plot so that it can always be grabbed."""
    inset = context.px(9)
    x = min(max(frame.x.to_pixel(knob.x), frame.x.start + inset), frame.x.end - inset)
    y = min(max(frame.y.to_pixel(knob.y), frame.y.end + inset), frame.y.start - inset)
    return x, y


def draw_knob(context: PanelContext, frame: Frame, group: OperatorGroup, knob: Knob, active: bool) -> None:
    """The magnitude handle: a ring with arrows along the axes it acts on, connected to where the curve was."""
    draw = imgui.get_window_draw_list()
    x, y = knob_place(context, frame, knob)
    anchor_x = frame.x.to_pixel(knob.anchor[0])
    anchor_y = min(max(frame.y.to_pixel(knob.anchor[1]), frame.y.end), frame.y.start)
    faint = look.pack(look.with_alpha(look.ACCENT, 0.6))
    draw.add_line(ImVec2(anchor_x, anchor_y), ImVec2(x, y), faint, context.px(1))
    draw.add_circle_filled(ImVec2(anchor_x, anchor_y), context.px(2.6), faint)
    axes: set[str] = {operator.axis for operator in group.operators}
    ink = look.pack(look.ACCENT)
    radius = context.px(7.5 if active else 6.5)
    held = {
        math.copysign(1.0, o.magnitude - o.neutral_magnitude)
        for o in group.operators
        if isinstance(o, Operator) and o.axis == "x" and o.at_limit
    }
    directions = [(-1.0, 0.0), (1.0, 0.0)] if "x" in axes else []
    directions += [(0.0, -1.0), (0.0, 1.0)] if "y" in axes else []
    for dx, dy in directions:
        if dx in held:  # an upright bar in place of an arrow: the limit is reached
            bar, half, width = x + dx * (radius + context.px(5)), context.px(7), context.px(1.25)
            draw.add_rect_filled(ImVec2(bar - width, y - half), ImVec2(bar + width, y + half), ink)
            continue
        _arrow(draw, x + dx * (radius + context.px(4)), y + dy * (radius + context.px(4)), dx, dy, context.px(4), ink)
    draw.add_circle_filled(ImVec2(x, y), radius, look.pack(look.ACCENT if active else look.grey(24)))
    draw.add_circle(ImVec2(x, y), radius, ink, 0, context.px(2))
    if not active:
        draw.add_circle_filled(ImVec2(x, y), context.px(2), ink)


def draw_points(context: PanelContext, places: dict[str, tuple[float, float]], active: str | None) -> None:
    """Control points, by the names of their handles: squares, as in Blender's curves; filled while they are held."""
    draw, half = imgui.get_window_draw_list(), context.px(4)
    for name, (x, y) in places.items():
        corner, end = ImVec2(x - half, y - half), ImVec2(x + half, y + half)
        draw.add_rect_filled(corner, end, look.pack(look.ACCENT if name == active else look.grey(24)), context.px(1.5))
        draw.add_rect(corner, end, look.pack(look.ACCENT), context.px(1.5), context.px(1.75))


def draw_chosen(
    context: PanelContext,
    frame: Frame,
    places: tuple[float, ...],
    grabbed: dict[str, tuple[float, float]],
    chosen: str | None,
) -> None:
    """A light outline around the handle that the keyboard moves; none where none was chosen yet. `places`: the flags',
    `grabbed`: where each handle can be grabbed."""
    draw, ink = imgui.get_window_draw_list(), look.pack(look.grey(240))
    if chosen is None or chosen not in grabbed:
        return
    if chosen == "magnitude" or chosen.startswith("point."):
        draw.add_circle(ImVec2(*grabbed[chosen]), context.px(9.5), ink, 0, context.px(1.5))
        return
    top, size = frame.y.end - context.px(FLAG_STRIP - 2), context.px(FLAG)
    half = 0.5 * size
    if chosen == "region":
        low, high, reach = places[1] + half, places[2] - half, context.px(5)
        if high > low:
            corner, end = ImVec2(low, top + half - reach), ImVec2(high, top + half + reach)
            draw.add_rect(corner, end, ink, context.px(3), context.px(1.5))
    else:
        x = places[END_NAMES.index(chosen)]
        corner, end = ImVec2(x - half, top), ImVec2(x + half, top + size)
        draw.add_rect(corner, end, ink, context.px(4), context.px(1.5))


def _arrow(draw: imgui.ImDrawList, x: float, y: float, dx: float, dy: float, size: float, ink: int) -> None:
    tip = ImVec2(x + dx * size, y + dy * size)
    left, right = ImVec2(x - dy * size, y + dx * size), ImVec2(x + dy * size, y - dx * size)
    draw.add_triangle_filled(tip, left, right, ink)


def _points(frame: Frame, gamma: np.ndarray, values: np.ndarray) -> list[Point]:
    across = frame.x.to_pixels(gamma)
    room = 4.0 * abs(frame.y.start - frame.y.end)
    down = np.clip(frame.y.to_pixels(values), frame.y.end - room, frame.y.start + room)
    return list(zip(across.tolist(), down.tolist(), strict=True))


def _dashed(draw: imgui.ImDrawList, points: list[Point], ink: int, thickness: float, scale: float) -> None:
    """Dashes of 6 and gaps of 4 pixels along the line's length, on steep parts as on level ones."""
    on, off = 6.0 * scale, 4.0 * scale
    places = np.array(points)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    starts = np.arange(0.0, lengths[-1], on + off)
    inside = on * np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
    along = np.minimum(starts[:, None] + inside, lengths[-1])
    across, down = (np.interp(along, lengths, places[:, axis]) for axis in (0, 1))
    for dash in np.stack([across, down], axis=-1).tolist():
        draw.add_polyline([tuple(place) for place in dash], ink, thickness, 0)
