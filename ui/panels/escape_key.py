"""The actions of Esc, in one list. The first line that applies is all that a press does.

Imgui's own uses come before the list: Esc leaves a text field, a list or menu, the control that the mouse drags, and
the frame that the keyboard moves from control to control. Any other press would make imgui show that frame, so imgui
does not get it.
"""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from app.document.view_state import SetView
from ui.panels.actions import Action, CancelDrag, RunOperator, SetPanel
from ui.panels.context import PanelContext

_OWNER = 0x1A5172


def keys_are_taken() -> bool:
    """Whether keys go to a text field, a list or a menu; to be called before a pass, because imgui acts on Esc at its
    start."""
    state = imgui.get_current_context()
    if state.open_popup_stack.size() > 0 or state.nav_layer == imgui.internal.NavLayer.menu:
        return True
    return is_typing()


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
    return next((actions for way_out in ESCAPE_ACTIONS if (actions := way_out(context))), [])


def _leave_no_frame() -> None:
    """Leave the text field. Imgui would frame a control of the panel that was last in use, and the next Esc would only
    remove that."""
    imgui.internal.clear_active_id()
    imgui.set_nav_cursor_visible(False)


def _cancel_unsaved_dialog(context: PanelContext) -> list[Action]:
    return [SetPanel({"pending_action": None})] if context.state.pending_action is not None else []


def _resolution(context: PanelContext) -> list[Action]:
    return [SetPanel({"resolution": None})] if context.state.resolution is not None else []


def _shortcuts(context: PanelContext) -> list[Action]:
    return [SetView.of(show_shortcuts=False)] if context.view.show_shortcuts else []


def _camera(context: PanelContext) -> list[Action]:
    return [SetPanel({"shows_camera": False, "renames": None})] if context.state.shows_camera else []


def _leave_single_panel(context: PanelContext) -> list[Action]:
    return [SetPanel({"single_panel": False})] if context.state.single_panel else []


def _brush(context: PanelContext) -> list[Action]:
    return [SetPanel({"paints": False})] if context.state.paints else []


def _pick(context: PanelContext) -> list[Action]:
    return [SetPanel({"picks_lobe": False})] if context.state.picks_lobe else []


def _dismiss_message(context: PanelContext) -> list[Action]:
    notice = context.state.message
    return [SetPanel({"message": None})] if notice is not None and notice.is_error else []


def _operator(context: PanelContext) -> list[Action]:
    return [SetView.of(operator=None)] if context.view.operator is not None else []


def _lobe(context: PanelContext) -> list[Action]:
    return [SetView.of(lobe_pixel=None)] if context.view.lobe_pixel is not None else []


def _selection(context: PanelContext) -> list[Action]:
    return [RunOperator("select")] if context.view.selected is not None else []


ESCAPE_ACTIONS: tuple[Callable[[PanelContext], list[Action]], ...] = (
    _cancel_unsaved_dialog, _resolution, _shortcuts, _brush, _camera, _leave_single_panel, _pick, _dismiss_message,
    _operator, _lobe, _selection,
)  # fmt: skip
