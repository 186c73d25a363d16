"""The keyboard: which operators the keys pressed invoke; and the overlay under `?` that lists them.

A press of Esc does one thing, the first of a list that applies. Imgui's own uses come before the list: Esc leaves a
text field, a list or menu, the control that the mouse drags, and the frame that the keyboard moves from control to
control. Any other press would make imgui show that frame, so imgui does not get it.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.view_state import SetView
from app.operators.camera import CHOICES
from app.operators.keymap import KEYMAPS, in_keymap
from app.operators.operator import Operator
from app.operators.registry import OPERATORS, listed_lines
from ui import theme as look
from ui.panels import pair_picking
from ui.panels.actions import Action, CancelDrag, RunOperator, SetPanel
from ui.panels.context import PanelContext
from ui.panels.window_operators import chord_of, perform, play_or_leave_alone

TWO_COLUMNS, THREE_COLUMNS, KEYS_WIDTH = 840.0, 1200.0, 106.0
MARGIN = 12.0  # beside the list, where a click closes it
CHORDS = {
    keys: {name: tuple(map(chord_of, in_keymap(operator, keys).keys)) for name, operator in OPERATORS.items()}
    for keys in KEYMAPS
}


def keyboard(context: PanelContext) -> list[Action]:
    """The actions of the key pressed in this pass; none while the user types, or chooses from a list or a file."""
    grip = context.state.grip
    if context.keys_taken or context.state.question is not None or (grip is not None and grip.takes_input):
        return []
    actions: list[Action] = []
    for name, chords in CHORDS[context.preferences.keys].items():
        operator = OPERATORS[name]
        if grip is not None and operator.waits:
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
    most = ImVec2(viewport.work_size.x - 2 * context.px(MARGIN), viewport.work_size.y)
    imgui.set_next_window_size_constraints(ImVec2(0, 0), most)
    flags = (
        imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_collapse | imgui.WindowFlags_.no_docking
        | imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move
    )  # fmt: skip
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.grey(40, 0.985)))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(context.px(20), context.px(18)))
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
    for group in ("File", "Edit", "Select", "Inspect", "Help"):
        _group(context, group)
    imgui.end_group()
    for least, groups in (
        (TWO_COLUMNS, ("Picture", "Curve", "Material")),
        (THREE_COLUMNS, (*CHOICES, "Camera", "Arrange")),
    ):
        if imgui.get_main_viewport().work_size.x >= context.px(least):
            imgui.same_line(0.0, context.px(22))
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
    for keys, text in listed_lines(group, context.preferences.keys):
        imgui.text_unformatted(keys)
        imgui.same_line(context.px(KEYS_WIDTH))
        imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
        imgui.text_unformatted(text)
        imgui.pop_style_color()
    imgui.dummy(ImVec2(1, context.px(6)))


# ------------------------------------------------------------------------------------------------------- the escape key


_OWNER = 0x1A5172


def keys_are_taken() -> bool:
    """Whether keys go to a text field, a list or a menu; to be called before a pass, because imgui acts on Esc at its
    start."""
    state = imgui.get_current_context()
    # A click on a control of the menu bar leaves its layer active, too, but without the frame.
    is_in_menu_bar = state.nav_layer == imgui.internal.NavLayer.menu and imgui.get_io().nav_visible
    return state.open_popup_stack.size() > 0 or is_in_menu_bar or is_typing()


def is_typing() -> bool:
    """Whether a field takes text; to be called before a pass."""
    # imgui wants text for one pass longer than there is a field.
    return imgui.get_io().want_text_input and imgui.internal.get_active_id() != 0


def imgui_takes_escape() -> bool:
    """Whether imgui has a use for Esc; to be called before a pass. If not, imgui does not get it."""
    state = imgui.get_current_context()
    if keys_are_taken() or imgui.internal.get_active_id() != 0 or imgui.get_io().nav_visible:
        return True
    imgui.internal.set_key_owner(imgui.Key.escape, _OWNER)
    return state.drag_drop_active


def answer_escape(context: PanelContext, is_imguis: bool, is_dragging: bool) -> list[Action]:
    """The actions of a press of Esc, besides imgui's own."""
    if is_dragging:
        return [CancelDrag()]
    if context.state.question is not None:
        _leave_no_frame()
        return [SetPanel({"question": None})]
    if is_imguis:
        imgui.internal.clear_drag_drop()
        if not imgui.get_current_context().open_popup_stack.size():
            _leave_no_frame()
        return []
    return _way_out(context)


def _leave_no_frame() -> None:
    """Leave the text field. Imgui would frame a control of the panel that was last in use, and the next Esc would only
    remove that."""
    imgui.internal.clear_active_id()
    imgui.set_nav_cursor_visible(False)


def _way_out(context: PanelContext) -> list[Action]:
    """The action that leaves the first of what Esc can leave, in this order."""
    state, view, message = context.state, context.view, context.state.message
    ways_out: tuple[tuple[bool, Action | list[Action]], ...] = (
        (state.pending_action is not None, SetPanel({"pending_action": None})),
        (state.resolution is not None, SetPanel({"resolution": None})),
        (state.picking is not None, pair_picking.step_back(context)),
        (state.match is not None, SetPanel({"match": None})),
        (state.look_name is not None, SetPanel({"look_name": None})),
        (view.show_shortcuts, SetView.of(show_shortcuts=False)),
        (state.paints, SetPanel({"paints": False})),
        (state.paints_highlight, SetPanel({"paints_highlight": False})),
        (state.shows_report, SetPanel({"shows_report": False})),
        (state.shows_camera, SetPanel({"shows_camera": False, "renames": None})),
        (state.single_panel, SetPanel({"single_panel": False})),
        (state.picks_lobe, SetPanel({"picks_lobe": False})),
        (state.draws_crop, SetPanel({"draws_crop": False})),
        (bool(state.gizmo), SetPanel({"gizmo": ""})),
        (message is not None and message.is_error, SetPanel({"message": None})),
        (view.operator is not None, SetView.of(operator=None)),
        (view.lobe_pixel is not None, SetView.of(lobe_pixel=None)),
        (view.selected is not None, RunOperator("select")),
    )
    out = next((actions for is_there, actions in ways_out if is_there), [])
    return out if isinstance(out, list) else [out]
