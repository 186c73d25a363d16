"""The timeline below the picture, where files of the scene have animations: play, scrub, loop, choice of animation."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.commands import SetTime
from app.document.timeline import Timeline, timeline
from app.document.view_state import SetView
from app.operators.registry import keys_of
from ui import theme as look
from ui.panels import number_fields, rows, widgets
from ui.panels.actions import Action, RunOperator
from ui.panels.context import PanelContext
from ui.theme import Icon

_PADDING, _CLIP_WIDTH = 6.0, 130.0


def draw(context: PanelContext, corner: ImVec2, room: ImVec2) -> tuple[float, list[Action]]:
    """Draw it at the lower end of a rectangle; returns the height that it takes: 0 where nothing is animated."""
    line = timeline(context.document, context.view)
    padding = context.px(_PADDING)
    height = imgui.get_frame_height() + 2.0 * padding
    if line is None or room.y < 3.0 * height:
        return 0.0, []
    upper, lower = ImVec2(corner.x, corner.y + room.y - height), ImVec2(corner.x + room.x, corner.y + room.y)
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(upper, lower, look.pack(look.SURFACE))
    draw_list.add_line(upper, ImVec2(lower.x, upper.y), look.pack(look.LINE))
    imgui.set_cursor_screen_pos(ImVec2(upper.x + padding, upper.y + padding))
    plays = context.view.playing is not None
    keys = keys_of("alone")
    icon, hint = (Icon.PAUSE, f"Stop here ({keys}).") if plays else (Icon.RESUME, f"Play ({keys}).")
    pressed = widgets.icon_button(context, "timeline.play", icon, hint, lit=plays)
    actions = toggle_playback(context) if pressed else []
    imgui.same_line()
    actions += _scrub(context, line, lower.x - padding)
    imgui.same_line()
    actions += _playback_options(context, line)
    imgui.set_cursor_screen_pos(corner)
    return height, actions


def toggle_playback(context: PanelContext) -> list[Action]:
    """Play or stop; does nothing where nothing is animated."""
    is_animated = timeline(context.document, context.view) is not None
    return [RunOperator("play", context.view.playing is None)] if is_animated else []


def _scrub(context: PanelContext, line: Timeline, end: float) -> list[Action]:
    """The time at the pointer: one drag is one step of the history."""
    gap = imgui.get_style().item_spacing.x
    options = gap + 2.0 * imgui.get_frame_height() + (context.px(_CLIP_WIDTH) + gap if len(line.clips) > 1 else 0.0)
    imgui.set_next_item_width(max(end - imgui.get_cursor_screen_pos().x - options, 1.0))
    hand, time = number_fields.slider(
        context, "time", line.time or 0.0, 0.0, max(line.duration, 1e-3), f"%.2f s of {line.duration:.2f} s",
        handle="timeline.time", title="Time", jumps=True,
    )  # fmt: skip
    widgets.tooltip("Press or drag to go to a time; double-click to type one. One drag is one step of the history.")
    stop: list[Action] = [RunOperator("play", False)] if hand.began and context.view.playing is not None else []
    return stop + rows.one_step(hand, [SetTime(time)])


def _playback_options(context: PanelContext, line: Timeline) -> list[Action]:
    """The choice of the animation, whether it loops, and a button back to the pose of the file."""
    actions: list[Action] = []
    if len(line.clips) > 1:
        imgui.set_next_item_width(context.px(_CLIP_WIDTH))
        choices, chosen = [widgets.Choice(clip) for clip in line.clips], [line.clips.index(line.clip)]
        picked = widgets.choose(context, "timeline.clip", choices, chosen, "The animation to play.")
        if picked is not None:
            actions += [RunOperator("play", False), SetTime(0.0, line.clips[picked])]
        imgui.same_line()
    loops = context.view.loops
    if widgets.icon_button(context, "timeline.loop", Icon.LOOP, "Loop, or stop at the end.", lit=loops):
        actions.append(SetView.of(loops=not loops))
    imgui.same_line(0.0, 0.0)
    moves = line.time is not None
    hint = "Back to rest: the pose that the file has without its animation."
    if widgets.icon_button(context, "timeline.rest", Icon.CLOSE, hint, enabled=moves):
        actions += [RunOperator("play", False), SetTime(None)]
    return actions
