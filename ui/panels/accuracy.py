"""Speed against accuracy: what the picture costs and how far it is from exact, both measured, and what trades them.

The time of a frame and the worker's progress are everybody's; what stands between them is the mode's own.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.naming import named
from app.status import Status
from app.view_state import SetView
from ui import theme as look
from ui.panels import fields, widgets
from ui.panels.actions import Action, CancelWork, ResumeWork
from ui.panels.context import PanelContext
from ui.theme import Icon

LEAST_BUDGET, LARGEST_BUDGET = 2.0, 200.0
STOPPED, RESUME = "stopped", "Resume"
SMALLEST_ERROR = 1e-7


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    actions = _budget(context)
    if context.mode.accuracy:
        actions += named(context.mode.accuracy)(context)
    actions += _work(context)
    return actions


def _budget(context: PanelContext) -> list[Action]:
    widgets.label(context, "Frame time")
    hand, moved = fields.slider(
        context, "budget", context.view.frame_budget_ms, LEAST_BUDGET, LARGEST_BUDGET, "%.0f ms", True,
        handle="accuracy.frame_time", title="frame time",
    )  # fmt: skip
    widgets.tooltip("Time for each frame while a curve moves. Less is smoother and coarser until the hand rests; "
                    "the resting picture is exact either way.")  # fmt: skip
    return [SetView.of(frame_budget_ms=moved)] if hand.changed else []


def _work(context: PanelContext) -> list[Action]:
    """What the worker does, with its progress, and a way to stop it; what was stopped, and a way to go on."""
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
    return [CancelWork()] if pressed else []


def _stopped(context: PanelContext) -> list[Action]:
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(STOPPED)
    imgui.same_line()
    widgets.align_right(imgui.calc_text_size(RESUME).x + 2 * imgui.get_style().frame_padding.x)
    hint = "Go on computing the picture from where it was stopped."
    return [ResumeWork()] if widgets.text_button(context, "resume", RESUME, hint) else []


def work_text(status: Status) -> str:
    """Stage, share done (once there is one) and time left, on one line: "transport 78 % · 12 s left"."""
    parts = [f"{status.stage} {100.0 * status.fraction:.0f} %" if status.fraction > 0.0 else status.stage]
    if status.seconds_left is not None:
        parts.append(f"{duration(status.seconds_left)} left")
    return " · ".join(parts)


def error_text(error: float) -> str:
    """A picture's relative error in digits; 0 where single precision could not show it."""
    return "0" if error < SMALLEST_ERROR else f"{error:.2g}"


def duration(seconds: float) -> str:
    """Seconds as a person says them: "0.4 s", "12 s", "3 min"."""
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
