"""The line at the bottom: the truth about what is on screen, always."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.status import Status
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.tradeoff import error_text, work_text
from ui.theme import Icon

HEIGHT = 28.0
MESSAGE_SECONDS = 8.0


def draw(context: PanelContext) -> list[Action]:
    """The whole bar, along the window's lower edge."""
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(context.px(12), context.px(5)))
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.CHROME))
    flags = (
        imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
        | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_scroll_with_mouse
    )  # fmt: skip
    viewport = imgui.get_main_viewport()
    if imgui.internal.begin_viewport_side_bar("status bar", viewport, imgui.Dir.down, context.px(HEIGHT), flags):
        _contents(context)
    imgui.end()
    imgui.pop_style_color()
    imgui.pop_style_var()
    return []


def _contents(context: PanelContext) -> None:
    status = context.status
    ink, text, hint = picture_state(status)
    _dot(context, ink)
    imgui.text_unformatted(text)
    context.handles.note_item("status.picture")
    widgets.tooltip(hint)
    work = work_line(status)
    if work:
        _gap(context)
        imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
        imgui.text_unformatted(work)
        imgui.pop_style_color()
        widgets.tooltip(status.text or "What the worker is computing.")
    _right(context, status)


def picture_state(status: Status) -> tuple[look.Colour, str, str]:
    """Colour, words and explanation of what the picture is: waiting, preview, refining or exact."""
    error = "" if status.image_error is None else f" (error {error_text(status.image_error)})"
    if not status.worker_alive:
        return look.BAD, "worker stopped", "The computing process ended and is being started again; edits are safe."
    if status.picture == "exact":
        return look.GOOD, f"picture exact{error}", "All of the curve is in the picture, with the final lights."
    if status.picture == "refining":
        hint = status.transport_note or "Wavelet coefficients are still being added, largest effect first."
        return look.ACCENT, f"refining{error}", hint
    if status.picture == "preview":
        return look.ACCENT, "preview", "Coarse or fewer lights, or not yet the present light or roughness."
    return look.TEXT_FAINT, "waiting", "Nothing has been computed yet."


def work_line(status: Status) -> str:
    """What the worker does, empty when it rests."""
    return work_text(status) if status.stage else ""


def _right(context: PanelContext, status: Status) -> None:
    frame, memory = f"{status.frame_ms:.1f} ms", f"{status.transport_mb:.0f} MB"
    icons = imgui.calc_text_size(f"{Icon.CLOCK}  ").x + imgui.calc_text_size(f"{Icon.MEMORY}  ").x
    frame_width = max(imgui.calc_text_size(frame).x, context.px(52))
    memory_width = max(imgui.calc_text_size(memory).x, context.px(52))
    width = frame_width + memory_width + icons + 2 * context.px(18)
    right_edge = imgui.get_window_width() - context.px(12)
    start = right_edge - width
    _message(context, status, start)
    imgui.same_line(start)
    _value(context, Icon.CLOCK, frame, frame_width, "Time of the last frame that drew the picture.")
    imgui.same_line(start + frame_width + context.px(18) + 0.5 * icons)
    _value(context, Icon.MEMORY, memory, memory_width, "Memory of the precomputed transport.")


def _value(context: PanelContext, icon: str, text: str, width: float, hint: str) -> None:
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_FAINT))
    imgui.text_unformatted(icon)
    imgui.pop_style_color()
    imgui.same_line(0.0, context.px(7))
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    imgui.text_unformatted(text)
    imgui.pop_style_color()
    widgets.tooltip(hint)


def _message(context: PanelContext, status: Status, end: float) -> None:
    """The last thing that happened, right of the middle; errors stay, others leave after a while."""
    notice = context.state.notice
    if notice is None or not notice.text:
        return
    if not notice.is_error and context.now - notice.shown_at > MESSAGE_SECONDS:
        return
    imgui.same_line()
    start = imgui.get_cursor_pos_x() + context.px(16)
    text = f"{Icon.WARNING}  {notice.text}" if notice.is_error else notice.text
    room = end - context.px(20) - start
    width = min(imgui.calc_text_size(text).x, room)
    if room < context.px(40):
        return
    imgui.same_line(end - context.px(20) - width)
    corner = imgui.get_cursor_screen_pos()
    imgui.push_clip_rect(corner, ImVec2(corner.x + width, corner.y + imgui.get_frame_height()), True)
    imgui.push_style_color(imgui.Col_.text, look.pack(look.BAD if notice.is_error else look.TEXT_SOFT))
    imgui.text_unformatted(text)
    imgui.pop_style_color()
    imgui.pop_clip_rect()
    widgets.tooltip(notice.text)


def _dot(context: PanelContext, ink: look.Colour) -> None:
    corner, height = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    centre = ImVec2(corner.x + context.px(5), corner.y + 0.5 * height + 1)
    imgui.get_window_draw_list().add_circle_filled(centre, context.px(4), look.pack(ink))
    imgui.dummy(ImVec2(context.px(10), height))
    imgui.same_line(0.0, context.px(6))


def _gap(context: PanelContext) -> None:
    imgui.same_line(0.0, context.px(12))
    corner, height = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    imgui.get_window_draw_list().add_line(
        ImVec2(corner.x, corner.y + 2), ImVec2(corner.x, corner.y + height), look.pack(look.LINE), context.px(1)
    )
    imgui.same_line(0.0, context.px(24))
