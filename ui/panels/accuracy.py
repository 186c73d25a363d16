"""The Accuracy panel: the cost of the picture and its error, both measured, and the settings that trade them.

One slider moves all settings of a mode along the accuracy front, which no other settings beat in both
(`app.document.pareto_front`). It shows the error and the time that were measured for the front's own scenes, scaled to
the picture's pixels; the estimated error of the picture itself is below. Settings off the front are "custom". The time
of a frame and the worker's progress are shown in each mode; what is between them is the mode's own.

The Plan panel is beside it: every line shows its value and the reason, and can be overridden and set back. An override
is an edit of the document, undone and saved as any other; a dot marks it.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.document.commands.plan import OverrideLine
from app.document.display_names import with_display_names
from app.document.effective_settings import effective_view, override_lines_of
from app.document.pareto_front import FrontPoint, ParetoFront, load_front
from app.document.view_state import FRAME_BUDGET, SetView
from app.messages.editor_status import Status, duration
from app.modes.placement.plan_table import PlanTableRow, plan_table
from app.system.lazy_import import import_named
from engine.render.picture_error import ErrorEstimate, percent
from ui import theme as look
from ui.frame_times import RECORDED_SECONDS
from ui.panels import number_fields, rows, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag, RunOperator
from ui.panels.context import PanelContext
from ui.panels.curve_plot import Point
from ui.panels.plot_axes import Axis
from ui.theme import Icon

GAP, SLIDER_SHARE = 4.0, 0.68
# The width that the slider with its labels and the frame time need side by side.
TRADE_WIDTH = 152.0
CUSTOM = "custom"
SLIDER_HINT = (
    "Trades speed for accuracy: sets all quality options of this mode along the measured Pareto front. Error and "
    "processor time there:"
)
STOPPED, RESUME = "stopped", "Resume"
SMALLEST_ERROR = 1e-7


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    actions = _trade(context)
    if context.mode.accuracy:
        actions += import_named(context.mode.accuracy)(context)
    draw_history(context, error_hint(context.status))
    actions += _work(context)
    return actions


def _trade(context: PanelContext) -> list[Action]:
    """The slider, and beside it the frame time."""
    widgets.label(context, "Accuracy", least=TRADE_WIDTH)
    room, gap = imgui.get_content_region_avail().x, context.px(GAP)
    actions: list[Action] = []
    if context.mode.name in load_front().points:
        imgui.set_next_item_width(SLIDER_SHARE * (room - gap))
        actions += _slider(context)
        imgui.same_line(0.0, gap)
        imgui.set_next_item_width((1.0 - SLIDER_SHARE) * (room - gap))
    else:
        imgui.set_next_item_width(room)

    def set_budget(milliseconds: float) -> SetView:
        return SetView.of(frame_budget_ms=milliseconds)

    value, own = context.view.frame_budget_ms, FRAME_BUDGET.default
    return actions + rows.control(
        context, rows.Row(FRAME_BUDGET, value, set_budget, "accuracy.frame_time", own, drag=None)
    )


def _slider(context: PanelContext) -> list[Action]:
    table, mode, document = load_front(), context.mode.name, context.document
    view = effective_view(context.view, document)
    at = table.position(mode, view)
    shown = CUSTOM if at is None else expected(table, table.nearest_point(mode, at), context.resolution)
    hand, moved = number_fields.slider(
        context, "speed_accuracy", 0.5 if at is None else at, 0.0, 1.0, "%.2f", handle="accuracy.slider",
        title="from speed to accuracy", shown=shown,
    )  # fmt: skip
    widgets.tooltip(f"{SLIDER_HINT}\n{table.origin}")
    chosen = table.nearest_point(mode, moved)
    moving = override_lines_of(chosen.command, document) if hand.changed and not chosen.is_set(view) else ()
    begun = [BeginDrag("accuracy")] if hand.began and document.overrides else []
    return [*begun, *moving, *([EndDrag()] if hand.ended and document.overrides else [])]


def expected(table: ParetoFront, stop: FrontPoint, resolution: tuple[int, int]) -> str:
    """The error and time to expect of a stop, for a picture of (width, height) pixels, in words."""
    return f"{percent(stop.error)} · {duration(table.seconds(stop, resolution[0] * resolution[1]))}"


def _work(context: PanelContext) -> list[Action]:
    """The worker's progress, and a button to stop it; or what was stopped, and a button to resume."""
    status = context.status
    if not status.stage:
        return _stopped(context) if status.stopped else []
    button = imgui.get_frame_height()
    corner = imgui.get_cursor_screen_pos()
    room = imgui.get_content_region_avail().x
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(widgets.fitting(work_text(status), room - button - imgui.get_style().item_spacing.x))
    imgui.same_line()
    widgets.align_right(button)
    pressed = widgets.icon_button(context, "cancel", Icon.CLOSE, "Stop computing; the picture stays as it is.")
    height = context.px(3)
    top = corner.y + button
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(
        ImVec2(corner.x, top), ImVec2(corner.x + room, top + height), look.pack(look.FRAME), height
    )
    if status.fraction > 0.0:
        end = corner.x + max(height, room * min(status.fraction, 1.0))
        draw_list.add_rect_filled(ImVec2(corner.x, top), ImVec2(end, top + height), look.pack(look.ACCENT), height)
    return [RunOperator("stop")] if pressed else []


def _stopped(context: PanelContext) -> list[Action]:
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(STOPPED)
    imgui.same_line()
    widgets.align_right(imgui.calc_text_size(RESUME).x + 2 * imgui.get_style().frame_padding.x)
    hint = "Go on computing the picture from where it was stopped."
    return [RunOperator("resume")] if widgets.text_button(context, "resume", RESUME, hint) else []


def work_text(status: Status) -> str:
    """Stage, fraction done (once there is one) and time left, on one line: "transport 78 % · 12 s left"."""
    parts = [f"{status.stage} {100.0 * status.fraction:.0f} %" if status.fraction > 0.0 else status.stage]
    if status.seconds_left is not None:
        parts.append(f"{duration(status.seconds_left)} left")
    return " · ".join(parts)


def error_text(error: float) -> str:
    """A picture's relative error in digits; 0 where single precision could not show it."""
    return "0" if error < SMALLEST_ERROR else f"{error:.2g}"


def error_hint(status: Status) -> str:
    """The known parts of the picture's error."""
    parts = "" if status.estimate is None else error_parts(status.estimate)
    return "\n".join(filter(None, (parts, status.error_note)))


def error_parts(estimate: ErrorEstimate) -> str:
    """The parts of the error, line by line; "" where unknown."""
    parts = {"direct light": estimate.direct, "light between surfaces": estimate.indirect}
    return "\n".join(f"{name}: {percent(error)}" for name, error in parts.items() if error is not None)


# ----------------------------------------------------------------------- frame times and errors of the last two minutes


LEAST_HEIGHT, MOST_HEIGHT = 28.0, 90.0
LABELLED_HEIGHT, FAINT = 60.0, 0.55  # labels are behind lines of the same colour
FRAME_MS = 1.0, 1000.0
ERROR_RANGE = 1e-4, 1.0
FRAME_LINES = (10.0, 100.0)
ERROR_TICKS = (1e-3, 1e-2, 1e-1)
HALF_MINUTES = (30.0, 60.0, 90.0)
INKS = FRAME_INK, ERROR_INK = look.ACCENT, look.GOOD
HISTORY_HINT = (
    "The slowest frame of each quarter of a second, and the estimated error of the picture, in the last two minutes. "
    "Grid lines are factors of ten, and half minutes. Gaps: no frame was drawn, or the error was not known."
)


def draw_history(context: PanelContext, hint: str = "") -> None:
    """The last values, and beside them both lines in a frame; hint: what else there is to say of the error. A line is
    left free below."""
    record = context.record.samples_at(context.now)
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    height = room.y - imgui.get_frame_height() - 2.0 * imgui.get_style().item_spacing.y
    height = min(max(height, context.px(LEAST_HEIGHT)), context.px(MOST_HEIGHT))
    imgui.invisible_button("history", ImVec2(room.x, height))
    context.handles.note_item("accuracy.history")
    widgets.tooltip("\n".join(filter(None, (HISTORY_HINT, hint))))
    _last_values(context, corner)
    draw_list, inner = imgui.get_window_draw_list(), context.px(2)
    left, end = corner.x + context.px(widgets.LABEL_WIDTH), ImVec2(corner.x + room.x, corner.y + height)
    draw_list.add_rect_filled(ImVec2(left, corner.y), end, look.pack(look.WELL), inner)
    across = Axis(RECORDED_SECONDS, 0.0, left + inner, end.x - inner)
    scales = [Axis(*limits, end.y - inner, corner.y + inner, "log") for limits in (FRAME_MS, ERROR_RANGE)]
    _grid(draw_list, across, scales[0])
    if height >= context.px(LABELLED_HEIGHT):
        _labels(draw_list, across, scales[0], scales[1], inner)
    for axis, values, ink in zip(scales, record[:, 1:].T, INKS, strict=True):
        heights = axis.to_pixels(np.clip(values, axis.low, axis.high))
        _history_line(context, draw_list, across.to_pixels(record[:, 0]), heights, ink)


def _last_values(context: PanelContext, corner: ImVec2) -> None:
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


def _history_line(
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


# ------------------------------------------------------------------------------------------------------------- the plan


VALUE_WIDTH, DOT = 118.0, 3.0
PLANNED = "As planned"
PICTURE = "The whole picture"
PLAN_HINT = "Override this line of the plan. It is an edit: it can be undone, and is saved with the session."
GIVE_BACK = "Back to the planned value."


def draw_plan(context: PanelContext) -> list[Action]:
    """The plan table, a heading above the lines of the picture and of each layer."""
    actions: list[Action] = []
    group: str | None = None
    for line in plan_table(context.document, context.view, context.status):
        if line.group != group:
            _plan_heading(context, line.group, is_first=group is None)
            group = line.group
        actions += _plan_line(context, line)
    return actions


def _plan_heading(context: PanelContext, key: str, is_first: bool) -> None:
    if not is_first:
        imgui.dummy(ImVec2(0.0, context.px(4)))
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_FAINT))
    imgui.separator_text(with_display_names(context.document, key) if key else PICTURE)
    imgui.pop_style_color()


def _plan_line(context: PanelContext, line: PlanTableRow) -> list[Action]:
    """Name and value on one line, the reason below."""
    actions: list[Action] = []
    side, gap = imgui.get_frame_height(), imgui.get_style().item_spacing.x
    start, corner = imgui.get_cursor_pos_x(), imgui.get_cursor_screen_pos()
    width = min(context.px(VALUE_WIDTH), 0.55 * imgui.get_content_region_avail().x)
    edge = start + imgui.get_content_region_avail().x
    if line.is_set:
        middle = ImVec2(corner.x - context.px(6), corner.y + 0.5 * side)
        imgui.get_window_draw_list().add_circle_filled(middle, context.px(DOT), look.pack(look.ACCENT))
    widgets.rich_label(widgets.subscripted(line.title))
    if line.is_set:
        imgui.same_line(edge - width - side - 0.5 * gap)
        if widgets.icon_button(context, f"plan.{line.line}.reset", Icon.RESET, GIVE_BACK):
            actions.append(OverrideLine(line.line, None))
    if line.choices:
        imgui.same_line(edge - width)
        actions += _plan_value(context, line, width)
    else:
        imgui.same_line(edge - imgui.calc_text_size(line.value).x)
        widgets.rich_label(line.value)
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() - 0.5 * imgui.get_style().item_spacing.y)
    widgets.caption(line.reason)
    return actions


def _plan_value(context: PanelContext, line: PlanTableRow, width: float) -> list[Action]:
    """The value, and a list of the choices, the plan's own first."""
    choices = [widgets.Choice(PLANNED), *(widgets.Choice(text) for text, _ in line.choices)]
    chosen = [1 + place for place, (text, _) in enumerate(line.choices) if text == line.value] if line.is_set else [0]
    imgui.set_next_item_width(width)
    picked = widgets.choose(context, f"plan.{line.line}", choices, chosen, PLAN_HINT, shown=line.value)
    return [] if picked is None else [OverrideLine(line.line, line.choices[picked - 1][1] if picked else None)]
