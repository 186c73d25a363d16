"""All panels of a frame, each in its window; returns their actions in the order of the panels.

A panel that fails is left out by the barrier, leaves imgui as it found it, and shows so in its own window; the others
are drawn. A panel that is folded away, so that the picture takes its room, is closed (`ViewState.panels`); the layout
remembers its place. Panels in one dock fold together.
"""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, ImVec4, imgui

from app.document.view_state import OpenPanel
from app.system.barrier import Barrier
from ui import layout
from ui import theme as look
from ui.panels import (
    accuracy,
    brdf,
    camera,
    curve_editor,
    dialogs,
    file_dialog,
    highlight,
    import_sheet,
    library,
    light,
    material,
    menus,
    objects,
    paint,
    photo_panel,
    picture_marks,
    scopes,
    status_bar,
    stored_pictures,
    viewport,
    viewport_header,
    widgets,
)
from ui.panels import shortcuts as shortcuts
from ui.panels.actions import Action, ShowPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

Draw = Callable[[PanelContext], list[Action]]


def draw_panels(context: PanelContext, barrier: Barrier, begin_space: Callable[[], None]) -> list[Action]:
    """Draw all; begin_space: begins the area that windows are docked in, between the bars."""
    actions = draw_guarded(barrier, "The menu", menus.draw, context) or []
    actions += draw_guarded(barrier, "The status bar", status_bar.draw, context) or []
    actions += draw_guarded(barrier, "The strip of panels", draw_folded, context) or []
    begin_space()
    actions += _window(barrier, context, layout.OBJECTS, objects.draw)
    actions += _window(barrier, context, layout.LIBRARY, library.draw)
    actions += _window(barrier, context, layout.BRDF, brdf.draw)
    actions += _picture_window(barrier, context)
    actions += _window(barrier, context, layout.CURVE, curve_editor.draw)
    actions += _window(barrier, context, layout.MATERIAL, material.draw)
    actions += _window(barrier, context, layout.LIGHT, light.draw)
    actions += _window(barrier, context, layout.ACCURACY, accuracy.draw)
    actions += _window(barrier, context, layout.PLAN, accuracy.draw_plan)
    actions += draw_guarded(barrier, "The tabs", draw_folding_buttons, context) or []
    actions += draw_guarded(barrier, "The import report", import_sheet.draw, context) or []
    actions += draw_guarded(barrier, "The match", photo_panel.draw, context) or []
    actions += draw_guarded(barrier, "The dialog", file_dialog.draw, context) or []
    actions += draw_guarded(barrier, "The resolution", dialogs.draw_resolution, context) or []
    actions += draw_guarded(barrier, "The name of a look", dialogs.draw_look_name, context) or []
    actions += draw_guarded(barrier, "The question", dialogs.draw_unsaved, context) or []
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
    return (
        viewport.draw(context)
        + paint.draw_strip(context, corner, room)
        + highlight.draw_strip(context, corner, room)
        + viewport_header.draw(context, corner, room)
        + camera.draw(context, corner, room)
        + scopes.draw(context, corner, room)
        + stored_pictures.draw(context, corner, room)
        + picture_marks.draw_list_of_probes(context, corner, room)
    )


# --------------------------------------------------------------------------------------------------- a panel that fails


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


# -------------------------------------------------------------------------------------------------------- folded panels


STRIP_HEIGHT = 26.0
MENU = "folded panels"


def draw_folding_buttons(context: PanelContext) -> list[Action]:
    """A button at the right end of the tabs of each dock, except the picture's."""
    actions: list[Action] = []
    for node_id, panels in _places(context).items():
        node = imgui.internal.dock_builder_get_node(node_id)
        if layout.VIEWPORT in panels or node is None or not imgui.internal.dock_node_begin_amend_tab_bar(node):
            continue
        if not _overflows(node.tab_bar) and _folding_button(context, node.tab_bar.bar_rect, panels):
            actions += [OpenPanel(panel.key, False) for panel in panels]
        imgui.internal.dock_node_end_amend_tab_bar()
    return actions


def _overflows(bar: imgui.internal.TabBar) -> bool:
    """Whether the tabs need all of their bar; its ends then have arrows."""
    return bool(bar.width_all_tabs > bar.bar_rect.max.x - bar.bar_rect.min.x - imgui.get_frame_height())


def _folding_button(context: PanelContext, bar: imgui.internal.ImRect, panels: list[layout.Panel]) -> bool:
    side = imgui.get_frame_height()
    imgui.set_cursor_screen_pos(ImVec2(bar.max.x - side, 0.5 * (bar.min.y + bar.max.y) - 0.5 * side))
    names = ", ".join(panel.title for panel in panels)
    return widgets.icon_button(
        context, f"fold.{panels[0].key}", Icon.DOWN, f"Fold away: {names}. The picture takes the room."
    )


def _places(context: PanelContext) -> dict[int, list[layout.Panel]]:
    """The open panels by the dock node they are in."""
    places: dict[int, list[layout.Panel]] = {}
    for panel in layout.PANELS:
        window = imgui.internal.find_window_by_name(panel.window)
        if context.view.panel_open(panel.key) and window is not None and window.dock_id:
            places.setdefault(window.dock_id, []).append(panel)
    return places


def draw_folded(context: PanelContext) -> list[Action]:
    """The names of folded panels, along the lower edge of the window; a click brings a panel back."""
    folded = [panel for panel in layout.PANELS if not context.view.panel_open(panel.key)]
    if not folded or context.state.single_panel:
        return []
    actions: list[Action] = []
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(context.px(8), context.px(2)))
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.CHROME))
    imgui.push_style_color(imgui.Col_.button, ImVec4(0, 0, 0, 0))
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    flags = (
        imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
        | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_scroll_with_mouse
    )  # fmt: skip
    viewport = imgui.get_main_viewport()
    if imgui.internal.begin_viewport_side_bar("folded", viewport, imgui.Dir.down, context.px(STRIP_HEIGHT), flags):
        actions += _folded_tabs(context, folded)
    imgui.end()
    imgui.pop_style_color(3)
    imgui.pop_style_var()
    return actions


def _folded_tabs(context: PanelContext, folded: list[layout.Panel]) -> list[Action]:
    """A button for each; where they do not fit side by side, one that lists them."""
    texts = [f"{Icon.UP}  {panel.title}" for panel in folded]
    pad = 2 * imgui.get_style().frame_padding.x + imgui.get_style().item_spacing.x
    if sum(imgui.calc_text_size(text).x + pad for text in texts) > imgui.get_content_region_avail().x:
        return _folded_list(context, folded)
    actions: list[Action] = []
    for panel, text in zip(folded, texts, strict=True):
        if widgets.text_button(context, f"unfold.{panel.key}", text, f"Bring {panel.title} back."):
            actions.append(ShowPanel(panel.key))
        imgui.same_line()
    return actions


def _folded_list(context: PanelContext, folded: list[layout.Panel]) -> list[Action]:
    if widgets.text_button(context, "unfold", f"{Icon.UP}  {len(folded)} panels", "Bring a panel back."):
        imgui.open_popup(MENU)
    if not imgui.begin_popup(MENU):
        return []
    actions: list[Action] = [ShowPanel(panel.key) for panel in folded if imgui.menu_item_simple(panel.title)]
    imgui.end_popup()
    return actions
