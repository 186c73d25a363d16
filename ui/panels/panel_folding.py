"""Folding panels away, so that the picture takes their room: a button on their tabs, and a strip to bring them back.

A folded panel is closed (`ViewState.panels`); the layout remembers its place. Panels in one dock fold together.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.document.view_state import OpenPanel
from ui import theme as look
from ui.layout import PANELS, VIEWPORT, Panel
from ui.panels import widgets
from ui.panels.actions import Action, ShowPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

HEIGHT = 26.0
MENU = "folded panels"


def draw_buttons(context: PanelContext) -> list[Action]:
    """A button at the right end of the tabs of each dock, except the picture's."""
    actions: list[Action] = []
    for node_id, panels in _places(context).items():
        node = imgui.internal.dock_builder_get_node(node_id)
        if VIEWPORT in panels or node is None or not imgui.internal.dock_node_begin_amend_tab_bar(node):
            continue
        if not _overflows(node.tab_bar) and _button(context, node.tab_bar.bar_rect, panels):
            actions += [OpenPanel(panel.key, False) for panel in panels]
        imgui.internal.dock_node_end_amend_tab_bar()
    return actions


def _overflows(bar: imgui.internal.TabBar) -> bool:
    """Whether the tabs need all of their bar; its ends then have arrows."""
    return bool(bar.width_all_tabs > bar.bar_rect.max.x - bar.bar_rect.min.x - imgui.get_frame_height())


def _button(context: PanelContext, bar: imgui.internal.ImRect, panels: list[Panel]) -> bool:
    side = imgui.get_frame_height()
    imgui.set_cursor_screen_pos(ImVec2(bar.max.x - side, 0.5 * (bar.min.y + bar.max.y) - 0.5 * side))
    names = ", ".join(panel.title for panel in panels)
    return widgets.icon_button(
        context, f"fold.{panels[0].key}", Icon.DOWN, f"Fold away: {names}. The picture takes the room."
    )


def _places(context: PanelContext) -> dict[int, list[Panel]]:
    """The open panels by the dock node they are in."""
    places: dict[int, list[Panel]] = {}
    for panel in PANELS:
        window = imgui.internal.find_window_by_name(panel.window)
        if context.view.panel_open(panel.key) and window is not None and window.dock_id:
            places.setdefault(window.dock_id, []).append(panel)
    return places


def draw_strip(context: PanelContext) -> list[Action]:
    """The names of folded panels, along the lower edge of the window; a click brings a panel back."""
    folded = [panel for panel in PANELS if not context.view.panel_open(panel.key)]
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
    if imgui.internal.begin_viewport_side_bar("folded", viewport, imgui.Dir.down, context.px(HEIGHT), flags):
        actions += _tabs(context, folded)
    imgui.end()
    imgui.pop_style_color(3)
    imgui.pop_style_var()
    return actions


def _tabs(context: PanelContext, folded: list[Panel]) -> list[Action]:
    """A button for each; where they do not fit side by side, one that lists them."""
    texts = [f"{Icon.UP}  {panel.title}" for panel in folded]
    pad = 2 * imgui.get_style().frame_padding.x + imgui.get_style().item_spacing.x
    if sum(imgui.calc_text_size(text).x + pad for text in texts) > imgui.get_content_region_avail().x:
        return _list(context, folded)
    actions: list[Action] = []
    for panel, text in zip(folded, texts, strict=True):
        if widgets.text_button(context, f"unfold.{panel.key}", text, f"Bring {panel.title} back."):
            actions.append(ShowPanel(panel.key))
        imgui.same_line()
    return actions


def _list(context: PanelContext, folded: list[Panel]) -> list[Action]:
    if widgets.text_button(context, "unfold", f"{Icon.UP}  {len(folded)} panels", "Bring a panel back."):
        imgui.open_popup(MENU)
    if not imgui.begin_popup(MENU):
        return []
    actions: list[Action] = [ShowPanel(panel.key) for panel in folded if imgui.menu_item_simple(panel.title)]
    imgui.end_popup()
    return actions
