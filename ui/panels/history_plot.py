"""Frame times and picture errors over the last two minutes: the cost of an edit, and its benefit."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.editor.performance_record import SECONDS
from engine.render.picture_error import percent
from ui import theme as look
from ui.panels import widgets
from ui.panels.context import PanelContext
from ui.panels.curve_plot import Point
from ui.panels.plot_axes import Axis

LEAST_HEIGHT, MOST_HEIGHT = 28.0, 90.0
LABELLED_HEIGHT, FAINT = 60.0, 0.55  # labels are behind lines of the same colour
FRAME_MS = 1.0, 1000.0
ERROR = 1e-4, 1.0
FRAME_LINES = (10.0, 100.0)
ERROR_TICKS = (1e-3, 1e-2, 1e-1)
HALF_MINUTES = (30.0, 60.0, 90.0)
INKS = FRAME_INK, ERROR_INK = look.ACCENT, look.GOOD
HINT = (
    "The slowest frame of each quarter of a second, and the estimated error of the picture, in the last two minutes. "
    "Grid lines are factors of ten, and half minutes. Gaps: no frame was drawn, or the error was not known."
)


def draw(context: PanelContext, hint: str = "") -> None:
    """The last values, and beside them both lines in a frame; hint: what else there is to say of the error. A line is
    left free below."""
    record = context.record.samples_at(context.now)
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    height = room.y - imgui.get_frame_height() - 2.0 * imgui.get_style().item_spacing.y
    height = min(max(height, context.px(LEAST_HEIGHT)), context.px(MOST_HEIGHT))
    imgui.invisible_button("history", ImVec2(room.x, height))
    context.handles.note_item("accuracy.history")
    widgets.tooltip("\n".join(filter(None, (HINT, hint))))
    _last(context, corner)
    draw_list, inner = imgui.get_window_draw_list(), context.px(2)
    left, end = corner.x + context.px(widgets.LABEL_WIDTH), ImVec2(corner.x + room.x, corner.y + height)
    draw_list.add_rect_filled(ImVec2(left, corner.y), end, look.pack(look.WELL), inner)
    across = Axis(SECONDS, 0.0, left + inner, end.x - inner)
    scales = [Axis(*limits, end.y - inner, corner.y + inner, "log") for limits in (FRAME_MS, ERROR)]
    _grid(draw_list, across, scales[0])
    if height >= context.px(LABELLED_HEIGHT):
        _labels(draw_list, across, scales[0], scales[1], inner)
    for axis, values, ink in zip(scales, record[:, 1:].T, INKS, strict=True):
        _line(context, draw_list, across.to_pixels(record[:, 0]), _heights(axis, values), ink)


def _last(context: PanelContext, corner: ImVec2) -> None:
    """The names of the lines, and their last values."""
    error = context.status.image_error
    texts = f"frame {context.status.frame_ms:.0f} ms", "error –" if error is None else f"error {percent(error)}"
    imgui.push_font(None, look.SMALL_SIZE)
    step = context.px(0.5 * LEAST_HEIGHT)
    for i, (text, ink) in enumerate(zip(texts, INKS, strict=True)):
        place = ImVec2(corner.x, corner.y + i * step + 0.5 * (step - imgui.get_text_line_height()))
        imgui.get_window_draw_list().add_text(place, look.pack(ink), text)
    imgui.pop_font()


def _grid(draw_list: imgui.ImDrawList, across: Axis, upward: Axis) -> None:
    """A grid line per decade and half minute, with the frame times that the former mark."""
    for ms in FRAME_LINES:
        y = upward.to_pixel(ms)
        draw_list.add_line(ImVec2(across.start, y), ImVec2(across.end, y), look.pack(look.GRID), 1.0)
    for ago in HALF_MINUTES:
        x = across.to_pixel(ago)
        draw_list.add_line(ImVec2(x, upward.start), ImVec2(x, upward.end), look.pack(look.GRID), 1.0)


def _labels(draw_list: imgui.ImDrawList, across: Axis, frames: Axis, errors: Axis, inner: float) -> None:
    """Labels: frame times at the left, errors at the right, ages at the bottom."""
    imgui.push_font(None, look.SMALL_SIZE)
    middle = 0.5 * imgui.get_text_line_height()
    of_frames, of_errors = (look.pack(look.with_alpha(ink, FAINT)) for ink in INKS)
    for ms in FRAME_LINES:
        draw_list.add_text(ImVec2(across.start + inner, frames.to_pixel(ms) - middle), of_frames, f"{ms:.0f} ms")
    for error in ERROR_TICKS:
        text = f"{100.0 * error:g} %"
        left = across.end - inner - imgui.calc_text_size(text).x
        draw_list.add_text(ImVec2(left, errors.to_pixel(error) - middle), of_errors, text)
    place = ImVec2(across.to_pixel(HALF_MINUTES[1]) + inner, frames.start - 2.0 * middle)
    draw_list.add_text(place, look.pack(look.TEXT_FAINT), "1 min ago")
    imgui.pop_font()


def _heights(axis: Axis, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels of values, clamped to the ends of the axis."""
    return axis.to_pixels(np.clip(values, axis.low, axis.high))


def _line(
    context: PanelContext, draw_list: imgui.ImDrawList, x: NDArray[np.float64], y: NDArray[np.float64], ink: look.Colour
) -> None:
    """A line through the known points, in pieces; a single point is a dot."""
    known = np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    packed = look.pack(ink)
    for begin, end in edges.reshape(-1, 2):
        points: list[Point] = list(zip(x[begin:end].tolist(), y[begin:end].tolist(), strict=True))
        if len(points) == 1:
            draw_list.add_circle_filled(points[0], context.px(1.2), packed)
        else:
            draw_list.add_polyline(points, packed, context.px(1.2), 0)
