"""The keyboard: which operators the keys pressed invoke; and the overlay under `?` that lists them."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.view_state import SetView
from app.operators.camera import CHOICES
from app.operators.operator import Operator
from app.operators.registry import OPERATORS, listed_lines
from ui import theme as look
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.window_operators import chord_of, perform, play_or_leave_alone

TWO_COLUMNS, THREE_COLUMNS, KEYS_WIDTH = 840.0, 1200.0, 106.0
CHORDS = {name: tuple(map(chord_of, operator.keys)) for name, operator in OPERATORS.items()}


def keyboard(context: PanelContext) -> list[Action]:
    """The actions of the key pressed in this pass; none while the user types, or chooses from a list or a file."""
    if context.keys_taken or context.state.question is not None:
        return []
    actions: list[Action] = []
    for name, chords in CHORDS.items():
        operator = OPERATORS[name]
        if context.state.grip is not None and operator.waits:
            continue
        if name == "alone" and imgui.get_io().nav_visible:  # the key presses the control that has the frame
            continue
        if any(imgui.is_key_chord_pressed(chord) or _repeats(context, operator, chord) for chord in chords):
            actions += play_or_leave_alone(context) if name == "alone" else perform(context, name)
    return actions


def _repeats(context: PanelContext, operator: Operator, chord: int) -> bool:
    """Whether the system repeats the operator's keys while they are held, and it goes step by step."""
    if context.repeated is None or not operator.repeats:
        return False
    return chord == imgui.get_io().key_mods | int(context.repeated)


def draw(context: PanelContext) -> list[Action]:
    """The overlay that lists all shortcuts; closes at the next click or key."""
    if not context.view.show_shortcuts:
        return []
    viewport = imgui.get_main_viewport()
    imgui.set_next_window_pos(viewport.get_work_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.set_next_window_size_constraints(ImVec2(0, 0), viewport.work_size)
    flags = (
        imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_collapse | imgui.WindowFlags_.no_docking
        | imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move
    )  # fmt: skip
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.grey(40, 0.985)))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(context.px(28), context.px(22)))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    imgui.begin("Shortcuts###shortcuts", None, flags)
    context.theme.push_bold()
    imgui.text_unformatted("Shortcuts")
    imgui.pop_font()
    imgui.dummy(ImVec2(1, context.px(4)))
    _columns(context)
    focused = imgui.is_window_hovered(imgui.HoveredFlags_.allow_when_blocked_by_popup)
    imgui.end()
    imgui.pop_style_var(2)
    imgui.pop_style_color()
    if imgui.is_mouse_clicked(0) and not focused:
        return [SetView.of(show_shortcuts=False)]
    return []


def _columns(context: PanelContext) -> None:
    imgui.begin_group()
    for group in ("File", "Edit", "Material", "Help"):
        _group(context, group)
    imgui.end_group()
    for least, groups in ((TWO_COLUMNS, ("Picture", "Curve")), (THREE_COLUMNS, (*CHOICES, "Camera"))):
        if imgui.get_main_viewport().work_size.x >= context.px(least):
            imgui.same_line(0.0, context.px(32))
        imgui.begin_group()
        for group in groups:
            _group(context, group)
        imgui.end_group()


def _group(context: PanelContext, group: str) -> None:
    name, value = CHOICES.get(group, ("", ""))
    is_chosen = not name or getattr(context.preferences, name) == value
    imgui.push_style_color(imgui.Col_.text, look.pack(look.ACCENT if is_chosen else look.TEXT_FAINT))
    imgui.text_unformatted(group if is_chosen else f"{group} (View > Camera)")
    imgui.pop_style_color()
    for keys, text in listed_lines(group):
        imgui.text_unformatted(keys)
        imgui.same_line(context.px(KEYS_WIDTH))
        imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
        imgui.text_unformatted(text)
        imgui.pop_style_color()
    imgui.dummy(ImVec2(1, context.px(6)))
