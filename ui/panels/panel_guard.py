"""A panel that fails leaves imgui as it found it, and the other panels as they are."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from app.system.barrier import Barrier
from ui import theme as look
from ui.panels.actions import Action
from ui.panels.context import PanelContext


def draw_guarded(
    barrier: Barrier, name: str, draw: Callable[[PanelContext], list[Action]], context: PanelContext
) -> list[Action] | None:
    """The actions of a panel; None where it fails, or lately failed on the same input."""
    depth = depth_now()

    def drawn() -> list[Action] | None:
        try:
            return draw(context)
        except BaseException:
            close_what_is_open(depth)
            raise

    return barrier.run(name, drawn, None, (context.document, context.view, context.state))


def draw_fault(name: str) -> None:
    """In place of a panel that failed: what to do."""
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    imgui.text_wrapped(f"{name} cannot be drawn. Undo the last edit, or select something else.")
    imgui.pop_style_color()


def depth_now() -> imgui.internal.ErrorRecoveryState:
    """How much is begun and pushed in imgui."""
    depth = imgui.internal.ErrorRecoveryState()
    imgui.internal.error_recovery_store_state(depth)
    return depth


def close_what_is_open(depth: imgui.internal.ErrorRecoveryState) -> None:
    """End and pop what was begun and pushed since; imgui reports no error for each."""
    io = imgui.get_io()
    tells = io.config_error_recovery_enable_assert, io.config_error_recovery_enable_debug_log
    io.config_error_recovery_enable_assert = io.config_error_recovery_enable_debug_log = False
    shown, io.config_error_recovery_enable_tooltip = io.config_error_recovery_enable_tooltip, False
    try:
        imgui.internal.error_recovery_try_to_recover_state(depth)
    finally:
        io.config_error_recovery_enable_assert, io.config_error_recovery_enable_debug_log = tells
        io.config_error_recovery_enable_tooltip = shown
