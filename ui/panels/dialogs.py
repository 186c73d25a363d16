"""Small windows over the picture, which stays usable under them: the question before edits would be lost, the list of
edits that can be recovered, another resolution of the picture with its cost, and another name of a look.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime

from imgui_bundle import ImVec2, ImVec4, imgui

from app.files.journal import Recovery
from app.system.memory import bytes_for, gib, memory_bytes
from app.system.paths import display_name
from engine.material.parameters import Parameter
from engine.scene.description import MAX_RESOLUTION
from ui import theme as look
from ui.panels import rows, widgets
from ui.panels.actions import Action, AnswerUnsaved, Quit, Recover, RunOperator, SetPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

NAME_WIDTH = 150.0


def draw_unsaved(context: PanelContext) -> list[Action]:
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
                actions += _recovery(context, index, recovery)
    return actions


def _recovery(context: PanelContext, index: int, recovery: Recovery) -> list[Action]:
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


# --------------------------------------------------------------------------------------------------- another resolution


Size = tuple[int, int]
PRESETS = ((0.25, "1/4"), (0.5, "1/2"), (1.0, "Scene"), (2.0, "2 x"), (4.0, "4 x"))
PRESET_HINT = "Share of the scene's own resolution."
FIELD = 84.0
SIDES = tuple(
    Parameter(
        side, "scalar", 512.0, side.capitalize(), f"The picture's {side} in pixels.", minimum=1.0,
        maximum=float(MAX_RESOLUTION), step=2.0, form="%.0f",
    )
    for side in ("width", "height")
)  # fmt: skip


def draw_resolution(context: PanelContext) -> list[Action]:
    """A small window over the picture while the dialog is open."""
    size, picture = context.state.resolution, context.picture
    if size is None or picture is None:
        return []
    actions: list[Action] = []
    viewport = imgui.get_main_viewport()
    top = ImVec2(viewport.get_work_center().x, viewport.work_pos.y + context.px(12))
    with widgets.strip(context, "Resolution###resolution", top, ImVec2(0.5, 0.0), ImVec2(14, 12)) as is_seen:
        if is_seen:
            presets = [scale_size(context.own_resolution, share) for share, _ in PRESETS]
            chosen = presets.index(size) if size in presets else -1
            pressed = widgets.segments(
                context, "resolution", [(text, PRESET_HINT) for _, text in PRESETS], chosen, least=44.0
            )
            actions += _numbers(context, size)
            actions += [] if pressed is None else [SetPanel({"resolution": presets[pressed]})]
            costs_too_much = _cost(context, size, (picture.width, picture.height))
            actions += _buttons(context, size, not costs_too_much)
    return actions


def scale_size(size: Size, share: float) -> Size:
    """A size times a number, clamped to what a scene may have."""
    width, height = (min(max(round(side * share), 1), MAX_RESOLUTION) for side in size)
    return width, height


def _numbers(context: PanelContext, size: Size) -> list[Action]:
    actions: list[Action] = []
    for index, (name, other) in enumerate((("width", size[1]), ("height", size[0]))):
        if index:
            imgui.same_line()
            imgui.text_unformatted("x")
            imgui.same_line()
        imgui.set_next_item_width(context.px(FIELD))

        def set_side(side: float, other: int = other, is_width: bool = index == 0) -> Action:
            return SetPanel({"resolution": (round(side), other) if is_width else (other, round(side))})

        own = float(context.own_resolution[index])
        actions += rows.control(
            context, rows.Row(SIDES[index], float(size[index]), set_side, f"resolution.{name}", own, drag=None)
        )
    return actions


def _cost(context: PanelContext, size: Size, now: Size) -> bool:
    """The memory that the picture will need, beside its present need; returns whether that is more than there is."""
    needed, (free, _) = bytes_for(size), memory_bytes()
    times = size[0] * size[1] / (now[0] * now[1])
    too_much = free is not None and needed > free
    there = "" if free is None else f" of {gib(free)} that are free"
    imgui.push_style_color(imgui.Col_.text, ImVec4(*(look.BAD if too_much else look.TEXT_SOFT)))
    imgui.text_unformatted(f"About {gib(needed)} of memory{there}")
    imgui.text_unformatted(f"{times:.3g} times the pixels there are now, and the time" if times != 1.0 else "As now")
    imgui.pop_style_color()
    return too_much


def _buttons(context: PanelContext, size: Size, enabled: bool) -> list[Action]:
    close = SetPanel({"resolution": None})
    imgui.spacing()
    hint = "Compute the picture at this resolution. All edits stay."
    if widgets.text_button(context, "resolution.apply", "Apply", hint, enabled=enabled):
        return [RunOperator("resolution", size), close]
    imgui.same_line()
    return [close] if widgets.text_button(context, "resolution.cancel", "Cancel", "Cancel. (Esc)") else []


# -------------------------------------------------------------------------------------------------- the name of a look


def draw_look_name(context: PanelContext) -> list[Action]:
    """A field for another name of the current look; Enter accepts it."""
    name = context.state.look_name
    if name is None or not context.document.looks:
        return []
    actions: list[Action] = []
    close = SetPanel({"look_name": None})
    with _window(context, "Rename###look") as is_seen:
        if is_seen:
            imgui.align_text_to_frame_padding()
            imgui.text_unformatted(f"Name of the look {context.document.look}")
            imgui.same_line()
            imgui.set_next_item_width(context.px(NAME_WIDTH))
            if not imgui.get_io().want_text_input:
                imgui.set_keyboard_focus_here()
            flags = imgui.InputTextFlags_.auto_select_all | imgui.InputTextFlags_.enter_returns_true
            entered, typed = imgui.input_text("##look", name, flags)
            context.handles.note_item("look.name")
            if entered or imgui.is_item_deactivated_after_edit():
                actions += [RunOperator("rename_look", typed.strip()), close]
            elif imgui.is_item_deactivated():
                actions.append(close)
    return actions
