"""The status bar at the bottom: the state of what is on screen.

The last message or the worker's progress, where they do not fit, are above it on as many lines as they need.
"""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from app.document.view_state import LIGHTING_WORDS
from app.messages.editor_status import Status
from engine.render.picture_error import percent
from ui import theme as look
from ui.panels import picture_overlays, widgets
from ui.panels.accuracy import STOPPED, error_parts, error_text, work_text
from ui.panels.actions import Action, DrawLooks, SetPanel, StopLayers, StopMaterialMatch, StopPhoto
from ui.panels.context import PanelContext
from ui.theme import Icon

HEIGHT = 28.0
STRIP_WIDTH = 560.0
HEADLIGHT = "headlight only"
HEADLIGHT_HINT = "A headlight without shadows, until the first picture is computed."
STAYS_HINT = "The picture stays until this mode has computed its own."
MESSAGE_SECONDS, ERROR_SECONDS = 8.0, 30.0
# Noise of the whole picture above this is visible.
NOISY = 0.05
FINISHED_HINT = (
    "The picture is finished. What is left is noise in indirect light: grain and bright dots. There is less with "
    "fewer bounces, or where no curve is raised far."
)


VIEW_BEFORE = (
    "The camera has moved: the lines are the objects' boxes as seen from there. The previous picture stays until the "
    "new view is traced. In Orbit the picture follows the camera. Esc while dragging goes back."
)
PICTURE_BEFORE_MOVING = (
    "The camera has moved: the previous picture is moved as a whole until the first of this mode is drawn."
)
PICTURE_BEFORE = "The picture stays until the one with the new size, pose or bumps is traced and lit."
EDIT_BEFORE = "The picture from before the last edit stays until the new one is as good."
ESTIMATED_LATER_HINT = "The picture is finished. Its error is estimated when idle."
MODES_OWN = "The picture is finished for this mode. The Accuracy panel says what it leaves out."
ESTIMATED_HINT = (
    "Estimated error of the picture, relative to its mean: some hundred points are compared with more lights, patches "
    "and bands, and with path tracing. Correct within a factor of about two."
)
ESTIMATED_DRAWN_HINT = (
    "Estimated error of the pictures in this mode, relative to their mean, at rest and while something moves: some "
    "hundred points inside objects are compared with more lights and with path tracing. Edges are left out."
)


@dataclass(frozen=True)
class ColouredText:
    """A text and its colour."""

    text: str = ""
    ink: look.Colour = look.TEXT_SOFT


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
        left_over, actions = _contents(context)
    else:
        left_over, actions = [], []
    imgui.end()
    imgui.pop_style_color()
    imgui.pop_style_var()
    return actions + (_strip(context, left_over) if left_over else [])


def _contents(context: PanelContext) -> tuple[list[ColouredText], list[Action]]:
    """The line; what it had no room for, and the actions of a click."""
    status = context.status
    ink, text, hint = picture_state(status, placeholder_text(context), picture_overlays.has_moved(context))
    lighting = LIGHTING_WORDS[context.view.lighting] if context.view.mode == "placement" else ""
    text = " · ".join(filter(None, (status.shown_by, lighting, text)))
    # Text lies in the line as in that of buttons, whether there are any or not.
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() - imgui.get_style().frame_padding.y)
    imgui.align_text_to_frame_padding()
    _dot(context, ink)
    imgui.text_unformatted(text)
    context.handles.note_item("status.picture")
    widgets.tooltip(hint)
    end = _right(context, status, draw=False) - context.px(20)
    left_over: list[ColouredText] = []
    actions: list[Action] = []
    work, message = work_line(status), _message(context)
    advice = "" if status.estimate is None else status.estimate.advice
    if not work and not message.text and advice and _has_room(advice, end - context.px(36)):
        _gap(context)
        _words(ColouredText(advice, look.TEXT_FAINT), hint)
    if context.saving:
        hint = "The picture is drawn with its layers, while you go on."
        actions += _work(context, "saving", context.saving, hint, "Stop; the file stays as it was.", StopLayers())
    if status.material_match:
        hint, stops = "The material is matched, while you go on.", "Stop; the material stays as it is."
        actions += _work(context, "match_material", status.material_match, hint, stops, StopMaterialMatch())
    if context.photo:
        hint = "The photograph is matched, while you go on."
        actions += _work(context, "photo", context.photo, hint, "Stop; the material stays as it is.", StopPhoto())
    if context.looks.progress or context.looks.is_stopped:
        actions += _drawing_looks(context)
    if work and _has_room(work, end - context.px(36)):
        _gap(context)
        _words(ColouredText(work, look.TEXT_SOFT), status.text or "What is being computed.")
    elif work:
        left_over.append(ColouredText(work, look.TEXT_SOFT))
    if message.text and _has_room(message.text, end - context.px(16)):
        imgui.same_line(end - imgui.calc_text_size(message.text).x)
        _words(message, f"{message.text}\nA click closes this.")
        context.handles.note_item("status.message")
        actions += [SetPanel({"message": None})] if imgui.is_item_clicked() else []
    elif message.text:
        left_over.append(message)
    _right(context, status)
    return left_over, actions


def _work(context: PanelContext, name: str, progress: str, hint: str, stop_hint: str, stop: Action) -> list[Action]:
    """Work in the background, with a button that stops it: before the words, whose width changes."""
    _gap(context)
    actions = [stop] if widgets.icon_button(context, f"{name}.stop", Icon.CLOSE, stop_hint) else []
    imgui.same_line(0.0, context.px(2))
    _words(ColouredText(progress), hint)
    return actions


def _drawing_looks(context: PanelContext) -> list[Action]:
    """The look that is being drawn beside the current one, with a button that stops it, or goes on."""
    stopped = context.looks.is_stopped
    _gap(context)
    icon, hint = (Icon.RESUME, "Go on.") if stopped else (Icon.CLOSE, "Stop; the pictures stay as they are.")
    actions: list[Action] = [DrawLooks(stopped)] if widgets.icon_button(context, "looks.stop", icon, hint) else []
    imgui.same_line(0.0, context.px(2))
    _words(ColouredText("looks stopped" if stopped else context.looks.progress), "Pictures of looks, side by side.")
    return actions


def placeholder_text(context: PanelContext) -> str:
    """The words for what is shown while the picture is awaited."""
    if context.picture is None:
        return ""
    return f"{context.mode_before}'s picture" if context.mode_before else HEADLIGHT


def picture_state(status: Status, meanwhile: str = "", camera_moved: bool = True) -> tuple[look.Colour, str, str]:
    """Colour, words and explanation of the picture's state: waiting, preview, refining, finished or exact. meanwhile:
    what is shown while it is awaited, "" where that is nothing. camera_moved: whether it is awaited for another
    camera."""
    error = "" if status.image_error is None else f" (error {error_text(status.image_error)})"
    if status.estimate is not None:
        error = f", {status.estimate.short}"
    if not status.worker_alive:
        return look.BAD, "computing stopped", "The worker stopped and is being restarted; edits are safe."
    if status.is_away and not status.follows_input:
        if not camera_moved:
            return look.ACCENT, "before the change", PICTURE_BEFORE
        return look.ACCENT, "the view before", PICTURE_BEFORE_MOVING if status.draws_moving else VIEW_BEFORE
    if status.is_finished:
        return _finished_state(status)
    if status.is_held:
        return look.ACCENT, "before the edit", EDIT_BEFORE
    if status.picture != "waiting" and meanwhile not in ("", HEADLIGHT):
        return look.ACCENT, f"{status.picture}, {meanwhile}", STAYS_HINT
    if status.picture == "refining":
        return look.ACCENT, f"refining{error}", status.missing_note
    if status.picture == "preview":
        if status.missing_hint:
            return look.ACCENT, f"preview, {status.missing_note}", status.missing_hint
        coarse = "Coarse, with fewer lights, or not yet with the current light or roughness."
        return look.ACCENT, f"preview{error}", f"{coarse}\n{ESTIMATED_DRAWN_HINT}" if error else coarse
    words = f"waiting, {meanwhile}" if meanwhile else "waiting"
    return look.TEXT_FAINT, words, HEADLIGHT_HINT if meanwhile in ("", HEADLIGHT) else STAYS_HINT


def _finished_state(status: Status) -> tuple[look.Colour, str, str]:
    """The same for a finished picture: its error once it is estimated, until then what is known of it."""
    estimate, noise = status.estimate, status.image_error or 0.0
    if status.follows_input and estimate is None:
        return look.TEXT_SOFT, "finished", MODES_OWN
    if estimate is None and status.picture == "finished":
        return look.BAD if noise > NOISY else look.TEXT_SOFT, f"finished, noise {percent(noise)}", FINISHED_HINT
    if estimate is None:
        return look.GOOD, "finished", ESTIMATED_LATER_HINT
    if estimate.is_negligible:
        return look.GOOD, "picture exact", ESTIMATED_HINT
    if estimate.direct is None:
        hint = f"{MODES_OWN}\n{ESTIMATED_DRAWN_HINT}"
    else:
        hint = "\n".join(filter(None, (error_parts(estimate), estimate.advice, ESTIMATED_HINT)))
    return look.TEXT_SOFT if estimate.is_large else look.GOOD, f"finished, {estimate.short}", hint


def work_line(status: Status) -> str:
    """The worker's progress, or that it was stopped; empty when it is idle."""
    return work_text(status) if status.stage else STOPPED if status.stopped else ""


def _right(context: PanelContext, status: Status, draw: bool = True) -> float:
    """Frame time and memory at the right edge; returns where they begin."""
    frame, memory = f"{status.frame_ms:.1f} ms", f"{status.precomputed_mb:.0f} MB"
    icons = imgui.calc_text_size(f"{Icon.CLOCK}  ").x + imgui.calc_text_size(f"{Icon.MEMORY}  ").x
    frame_width = max(imgui.calc_text_size(frame).x, context.px(52))
    memory_width = max(imgui.calc_text_size(memory).x, context.px(52))
    start = imgui.get_window_width() - context.px(12) - frame_width - memory_width - icons - 2 * context.px(18)
    if draw:
        imgui.same_line(start)
        _value(context, Icon.CLOCK, frame, frame_width, "Time of the last frame that drew the picture.")
        imgui.same_line(start + frame_width + context.px(18) + 0.5 * icons)
        _value(context, Icon.MEMORY, memory, memory_width, "Memory of the precomputed transport.")
    return start


def _value(context: PanelContext, icon: str, text: str, width: float, hint: str) -> None:
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_FAINT))
    imgui.text_unformatted(icon)
    imgui.pop_style_color()
    imgui.same_line(0.0, context.px(7))
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    imgui.text_unformatted(text)
    imgui.pop_style_color()
    widgets.tooltip(hint)


def _message(context: PanelContext) -> ColouredText:
    """The last message, for a while."""
    notice = context.state.message
    if notice is None or not notice.text:
        return ColouredText()
    if context.now - notice.shown_at > (ERROR_SECONDS if notice.is_error else MESSAGE_SECONDS):
        return ColouredText()
    text = widgets.subscripted(notice.text)
    return ColouredText(f"{Icon.WARNING}  {text}", look.BAD) if notice.is_error else ColouredText(text)


def _has_room(text: str, end: float) -> bool:
    """Whether a text fits between what was drawn last and a place of the line."""
    imgui.same_line()
    return imgui.get_cursor_pos_x() + imgui.calc_text_size(text).x <= end


def _words(words: ColouredText, hint: str = "") -> None:
    imgui.push_style_color(imgui.Col_.text, look.pack(words.ink))
    imgui.text_unformatted(words.text)
    imgui.pop_style_color()
    widgets.tooltip(hint or words.text)


def _strip(context: PanelContext, left_over: list[ColouredText]) -> list[Action]:
    """A strip above the line, at its right end; a click dismisses the message."""
    viewport = imgui.get_main_viewport()
    room, bottom = viewport.size.x - context.px(48), viewport.pos.y + viewport.size.y - context.px(HEIGHT + 6)
    at, width = ImVec2(viewport.pos.x + viewport.size.x - context.px(12), bottom), min(context.px(STRIP_WIDTH), room)
    with widgets.strip(context, "##message", at, ImVec2(1.0, 1.0), ImVec2(12, 8)) as visible:
        if not visible:
            return []
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width)
        for words in left_over:
            imgui.push_style_color(imgui.Col_.text, look.pack(words.ink))
            imgui.text_unformatted(words.text)
            imgui.pop_style_color()
        imgui.pop_text_wrap_pos()
        context.handles.note_item("status.message")
        start, end = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        context.handles.note("status.strip.start", start.x, start.y)
        context.handles.note("status.strip.end", end.x, end.y)
        pressed = imgui.is_window_hovered() and imgui.is_mouse_clicked(0)
    return [SetPanel({"message": None})] if pressed else []


def _dot(context: PanelContext, ink: look.Colour) -> None:
    corner, height = imgui.get_cursor_screen_pos(), imgui.get_frame_height()
    centre = ImVec2(corner.x + context.px(5), corner.y + 0.5 * height + 1)
    imgui.get_window_draw_list().add_circle_filled(centre, context.px(4), look.pack(ink))
    imgui.dummy(ImVec2(context.px(10), height))
    imgui.same_line(0.0, context.px(6))


def _gap(context: PanelContext) -> None:
    imgui.same_line(0.0, context.px(12))
    corner, height = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    top = corner.y + imgui.get_style().frame_padding.y
    imgui.get_window_draw_list().add_line(
        ImVec2(corner.x, top + 2), ImVec2(corner.x, top + height), look.pack(look.LINE), context.px(1)
    )
    imgui.same_line(0.0, context.px(24))
