"""The keyboard on the curve: Tab chooses a handle, the arrow keys move it.

A key that is held is one gesture, however often it repeats: it begins at the press and ends when all arrow keys are up,
so it is one step of the history. The keys belong to the curve unless another panel's controls have the keyboard.
"""

from __future__ import annotations

import dataclasses
import math

from imgui_bundle import imgui

from ui.panels import curve_plot as plot
from ui.panels.actions import Action, BeginDrag, EndDrag, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import DrawnCurves, OperatorGroup, grip_at
from ui.panels.curve_input import handle_position, move_handle
from ui.panels.number_fields import PIXELS_TO_DOUBLE
from ui.panels.window_state import FINE, KeyGrip

# Shares of the plot's width and height, so that zooming in makes the keys finer: one degree where all 90 are shown.
WIDTH_A_STEP, HEIGHT_A_STEP = 1.0 / 90.0, 1.0 / 50.0
AMPLIFIED_A_STEP = 0.05

Key = imgui.Key
ARROWS = {Key.left_arrow: (-1, 0), Key.right_arrow: (1, 0), Key.up_arrow: (0, -1), Key.down_arrow: (0, 1)}


def move_by_keys(context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup) -> list[Action]:
    """The actions of the keys pressed or held in this pass on the handles."""
    grip = context.state.grip
    if isinstance(grip, KeyGrip):
        _claim()
        if not any(imgui.is_key_down(key) for key in ARROWS):
            return [EndDrag(), HoldGrip(None)]
        return _moved_by_keys(context, curves, frame, group, grip, _key_steps(context.repeated))
    if grip is not None or not curves.editable or not group.handles or not _has_keyboard(context):
        return []
    _claim()
    if context.repeated == Key.tab or imgui.internal.is_key_pressed(Key.tab, 0, _OWNER):
        chosen = next_handle(group.handles, context.state.handle, back=imgui.get_io().key_shift)
        return [SetPanel({"handle": chosen})]
    steps = _key_steps()
    if steps == (0, 0):
        return []
    handle = context.state.handle if context.state.handle in group.handles else group.handles[0]
    begun = grip_at(KeyGrip, curves, frame, group, handle, offset=handle_position(curves, frame, group, handle))
    return [BeginDrag(None), SetPanel({"handle": handle}), *_moved_by_keys(context, curves, frame, group, begun, steps)]


def next_handle(handles: tuple[str, ...], handle: str | None, back: bool = False) -> str:
    """The handle after (or before) this one; the first, or last, where none of them is chosen."""
    if handle not in handles:
        return handles[-1 if back else 0]
    return handles[(handles.index(handle) + (-1 if back else 1)) % len(handles)]


_OWNER = 0x1A5170


def _has_keyboard(context: PanelContext) -> bool:
    """Whether the curve has the keyboard.

    It does not while the user types, a list or a dialog is open, another panel has the keyboard, or a modifier makes
    shortcuts of the keys.
    """
    io = imgui.get_io()
    if context.keys_taken or io.key_ctrl or io.key_alt or io.key_super or imgui.is_any_item_active():
        return False
    state = context.state
    takes_input = state.grip is not None and state.grip.takes_input
    if state.question is not None or takes_input or context.view.show_shortcuts:
        return False
    return not io.nav_visible or imgui.is_window_focused(int(imgui.FocusedFlags_.root_and_child_windows))


def _claim() -> None:
    """Keep imgui from moving between controls by the same keys."""
    for key in (*ARROWS, Key.tab):
        imgui.internal.set_key_owner(key, _OWNER)


def _key_steps(repeated: imgui.Key | None = None) -> tuple[int, int]:
    """Steps right and down of the arrow keys pressed in this pass, or repeated."""
    pressed = [ARROWS[key] for key in ARROWS if key == repeated or imgui.internal.is_key_pressed(key, 0, _OWNER)]
    return sum(right for right, _ in pressed), sum(down for _, down in pressed)


def _moved_by_keys(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    grip: KeyGrip,
    steps: tuple[int, int],
) -> list[Action]:
    """The gesture continued by so many steps, and its actions now."""
    if steps == (0, 0):
        return []
    size = FINE if imgui.get_io().key_shift else 1.0
    across, down = (size * step for step in _key_step(context, frame, group, grip))
    moved = grip.moved[0] + steps[0] * across, grip.moved[1] + steps[1] * down
    grip = dataclasses.replace(grip, moved=moved)
    return [HoldGrip(grip), *move_handle(context, curves, frame, group, grip, moved)]


def _key_step(context: PanelContext, frame: plot.Frame, group: OperatorGroup, grip: KeyGrip) -> tuple[float, float]:
    """Pixels right and down per press."""
    if grip.handle == "magnitude" and group.first.kind == "amplify":
        step = math.log2(1.0 + AMPLIFIED_A_STEP) * context.px(PIXELS_TO_DOUBLE)
        return step, step
    return WIDTH_A_STEP * (frame.x.end - frame.x.start), HEIGHT_A_STEP * (frame.y.start - frame.y.end)
