"""The question before edits would be lost, and the list of edits that can be recovered.

Small windows over the picture, which stays usable under them: nothing here stops the program.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime

from imgui_bundle import ImVec2, imgui

from app.files.journal import Recovery
from app.system.paths import display_name
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, AnswerUnsaved, Quit, Recover, SetPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

NAME_WIDTH = 150.0


def draw(context: PanelContext) -> list[Action]:
    """The question, else the list; nothing while a file is being chosen."""
    if context.state.question is not None:
        return []
    if context.state.pending_action is not None:
        return _draw_question(context)
    return _draw_recoveries(context) if context.state.shows_recoveries and context.recoveries else []


@contextmanager
def _window(context: PanelContext, name: str) -> Iterator[bool]:
    """A window at the upper edge, in the middle."""
    viewport = imgui.get_main_viewport()
    top = ImVec2(viewport.get_work_center().x, viewport.work_pos.y + context.px(12))
    with widgets.strip(context, name, top, ImVec2(0.5, 0.0), ImVec2(14, 10)) as is_seen:
        yield is_seen


def _draw_question(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    with _window(context, "Unsaved###leaving") as is_seen:
        if is_seen:
            imgui.text_unformatted(f"{Icon.WARNING}  {context.name} has edits that are not saved.")
            if isinstance(context.state.pending_action, Quit):
                widgets.caption("Close the window once more to keep them for the next start.")
            imgui.spacing()
            actions += _answers(context)
    if imgui.is_key_pressed(imgui.Key.enter, False) and not context.keys_taken:
        return [AnswerUnsaved(is_saved=True)]
    return actions


def _answers(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    if widgets.text_button(context, "leave.save", "Save", "Save the session, then go on. (Enter)"):
        actions.append(AnswerUnsaved(is_saved=True))
    imgui.same_line()
    if widgets.text_button(context, "leave.discard", "Discard", "Discard these edits, and go on."):
        actions.append(AnswerUnsaved(is_saved=False))
    imgui.same_line()
    if widgets.text_button(context, "leave.cancel", "Cancel", "Cancel. (Esc)"):
        actions.append(SetPanel({"pending_action": None}))
    return actions


def _draw_recoveries(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    with _window(context, "Recovery###recovery") as is_seen:
        if is_seen:
            imgui.align_text_to_frame_padding()
            imgui.text_unformatted(f"{Icon.WARNING}  Edits that were not saved")
            imgui.same_line()
            widgets.align_right(imgui.get_frame_height())
            if widgets.icon_button(context, "recovery.later", Icon.CLOSE, "Later: File > Recover edits."):
                actions.append(SetPanel({"shows_recoveries": False}))
            for index, recovery in enumerate(context.recoveries):
                actions += _row(context, index, recovery)
    return actions


def _row(context: PanelContext, index: int, recovery: Recovery) -> list[Action]:
    written = datetime.fromtimestamp(recovery.written_at)
    imgui.align_text_to_frame_padding()
    name = display_name(str(recovery.session_path or recovery.scene))
    imgui.text_unformatted(widgets.fitting(name, context.px(NAME_WIDTH)))
    imgui.same_line(context.px(NAME_WIDTH + 20.0))
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    imgui.text_unformatted(f"{written:%d %B, %H:%M}")
    imgui.pop_style_color()
    imgui.same_line(context.px(NAME_WIDTH + 150.0))
    actions: list[Action] = []
    if widgets.text_button(context, f"recover.{index}", "Bring back", "Open these edits."):
        actions.append(Recover(recovery, True))
    imgui.same_line(0.0, context.px(4))
    if widgets.text_button(context, f"discard.{index}", "Discard", "Discard these edits."):
        actions.append(Recover(recovery, False))
    return actions
