"""All panels of a frame, each in its window; returns their actions in the order of the panels.

A panel that fails is left out by the barrier and shows so in its own window; the others are drawn.
"""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from app.system.barrier import Barrier
from ui import layout
from ui.panels import (
    accuracy,
    brdf,
    camera,
    curve_editor,
    file_dialog,
    library,
    light,
    material,
    menus,
    objects,
    paint,
    panel_folding,
    plan,
    resolution_dialog,
    status_bar,
    unsaved_dialog,
    viewport,
)
from ui.panels import shortcuts as shortcuts
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.panel_guard import draw_fault, draw_guarded

Draw = Callable[[PanelContext], list[Action]]


def draw_panels(context: PanelContext, barrier: Barrier, begin_space: Callable[[], None]) -> list[Action]:
    """Draw all; begin_space: begins the area that windows are docked in, between the bars."""
    actions = draw_guarded(barrier, "The menu", menus.draw, context) or []
    actions += draw_guarded(barrier, "The status bar", status_bar.draw, context) or []
    actions += draw_guarded(barrier, "The strip of panels", panel_folding.draw_strip, context) or []
    begin_space()
    actions += _window(barrier, context, layout.OBJECTS, objects.draw)
    actions += _window(barrier, context, layout.LIBRARY, library.draw)
    actions += _window(barrier, context, layout.BRDF, brdf.draw)
    actions += _picture_window(barrier, context)
    actions += _window(barrier, context, layout.CURVE, curve_editor.draw)
    actions += _window(barrier, context, layout.MATERIAL, material.draw)
    actions += _window(barrier, context, layout.LIGHT, light.draw)
    actions += _window(barrier, context, layout.ACCURACY, accuracy.draw)
    actions += _window(barrier, context, layout.PLAN, plan.draw)
    actions += draw_guarded(barrier, "The tabs", panel_folding.draw_buttons, context) or []
    actions += draw_guarded(barrier, "The dialog", file_dialog.draw, context) or []
    actions += draw_guarded(barrier, "The resolution", resolution_dialog.draw, context) or []
    actions += draw_guarded(barrier, "The question", unsaved_dialog.draw, context) or []
    actions += draw_guarded(barrier, "The help", shortcuts.draw, context) or []
    return actions


def _window(barrier: Barrier, context: PanelContext, panel: layout.Panel, draw: Draw, flags: int = 0) -> list[Action]:
    """A dockable window around a panel; closing it is an action like any other."""
    if not is_shown(context, panel):
        return []
    if panel.key in context.state.front:
        imgui.set_next_window_focus()
    # The narrow tabs of panels in one dock have no room for it; they are folded, or closed in the menu.
    closable = None if layout.shares_place(panel) else True
    visible, is_open = imgui.begin(panel.window, closable, flags | imgui.WindowFlags_.no_collapse)
    actions = _panel(barrier, f"The panel {panel.title}", draw, context) if visible else []
    imgui.end()
    return [*actions, layout.closed(panel)] if is_open is False else actions


def _panel(barrier: Barrier, name: str, draw: Draw, context: PanelContext) -> list[Action]:
    """A panel's contents, or a message in their place."""
    actions = draw_guarded(barrier, name, draw, context)
    if actions is None:
        draw_fault(name)
    return actions or []


def _picture_window(barrier: Barrier, context: PanelContext) -> list[Action]:
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
    # Docked, it shows what the window was cleared with: painting that again would be a sixth of a software frame.
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse | imgui.WindowFlags_.no_background
    actions = _window(barrier, context, layout.VIEWPORT, _picture_and_brush, flags)
    imgui.pop_style_var()
    return actions


def is_shown(context: PanelContext, panel: layout.Panel) -> bool:
    """Whether a panel is in the window; with only the picture shown, no other is."""
    if context.state.single_panel:
        return panel is layout.VIEWPORT
    return context.view.panel_open(panel.key)


def _picture_and_brush(context: PanelContext) -> list[Action]:
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    return viewport.draw(context) + paint.draw_strip(context, corner, room) + camera.draw(context, corner, room)
