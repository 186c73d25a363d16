"""The Accuracy panel: the cost of the picture and its error, both measured, and the settings that trade them.

One slider moves all settings of a mode along the accuracy front, which no other settings beat in both
(`app.document.pareto_front`). It shows the error and the time that were measured for the front's own scenes, scaled to
the picture's pixels; the estimated error of the picture itself is below. Settings off the front are "custom". The time
of a frame and the worker's progress are shown in each mode; what is between them is the mode's own.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from imgui_bundle import ImVec2, imgui

from app.document.effective_settings import effective_view, override_lines_of
from app.document.pareto_front import FrontPoint, ParetoFront, load_front
from app.document.view_state import FRAME_BUDGET, SetView
from app.messages.editor_status import Status, duration
from app.system.lazy_import import import_named
from engine.render.picture_error import ErrorEstimate, percent
from ui import theme as look
from ui.panels import history_plot, number_fields, rows, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag, RunOperator
from ui.panels.context import PanelContext
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
    history_plot.draw(context, error_hint(context.status))
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
    make, own = partial(_set_view, "frame_budget_ms"), FRAME_BUDGET.default
    budget = rows.Row(FRAME_BUDGET, context.view.frame_budget_ms, make, "accuracy.frame_time", own, drag=None)
    return actions + rows.control(context, budget)


def _set_view(name: str, value: Any) -> SetView:
    return SetView.of(**{name: value})


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
