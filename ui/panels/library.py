"""The library panel: materials to drag onto objects of the picture, the user's own among them; search, and adding
one."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, ImVec4, imgui

from app.document.commands.layers import SetMaterial
from app.files.materials import LibraryEntry, categories
from ui import theme as look
from ui.panels import material_matching, widgets
from ui.panels.actions import Action, DeleteMaterial, SaveMaterial, SetPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

CELL, GAP = 78.0, 8.0
PAYLOAD = "insitu.material"
MATCH = "Match with model"


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    actions = _search_line(context)
    shown = [entry for entry in context.library if entry.matches(context.state.library.search)]
    if imgui.begin_child("materials"):
        for category in categories(shown):
            actions += _category(context, category, [entry for entry in shown if entry.category == category])
        if not shown:
            imgui.text_disabled("Nothing found" if context.library else "")
    imgui.end_child()
    return actions


def dropped_material(context: PanelContext, deliver: bool = True) -> LibraryEntry | None:
    """Within a drag-and-drop target: the material that is dropped here, or with `deliver` False the one above it."""
    flags = imgui.DragDropFlags_.accept_no_draw_default_rect
    if not deliver:
        flags |= imgui.DragDropFlags_.accept_peek_only
    payload = imgui.accept_drag_drop_payload_py_id(PAYLOAD, flags)
    if payload is None or not 0 <= payload.data_id < len(context.library):
        return None
    return context.library[payload.data_id]


def apply(entry: LibraryEntry, object_name: str) -> SetMaterial:
    """The edit that gives an object this material."""
    return SetMaterial(object_name, entry.material.layers, entry.name)


def _search_line(context: PanelContext) -> list[Action]:
    library, actions = context.state.library, []
    button = imgui.get_frame_height()
    imgui.set_next_item_width(imgui.get_content_region_avail().x - button - context.px(4))
    changed, typed = imgui.input_text_with_hint("##search", "Search", library.search)
    context.handles.note_item("library.search")
    widgets.tooltip("Words of a material's name, category, layers or models.")
    if changed:
        actions.append(SetPanel({"library": replace(library, search=typed)}))
    imgui.same_line(0.0, context.px(4))
    selected = context.selected_layer
    hint = "Select an object to save its material here."
    if selected is not None:
        hint = f"Save the material of {selected.object} among your own."
    if widgets.icon_button(context, "library.add", Icon.ADD, hint, enabled=selected is not None):
        imgui.open_popup("save")
    return actions + _save_popup(context)


def _save_popup(context: PanelContext) -> list[Action]:
    """Asks for the name under which the selected object's material is stored."""
    selected, library = context.selected_layer, context.state.library
    if selected is None or not imgui.begin_popup("save"):
        return []
    actions: list[Action] = []
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(context.px(180))
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    entered, typed = imgui.input_text_with_hint("##name", "Name", library.name or selected.object, flags)
    context.handles.note_item("library.name")
    if typed != library.name:
        actions.append(SetPanel({"library": replace(library, name=typed)}))
    imgui.same_line()
    pressed = widgets.text_button(context, "library.save", "Save", "Replaces a material of yours of the same name.")
    if (entered or pressed) and typed.strip():
        actions += [SaveMaterial(selected.object, typed), SetPanel({"library": replace(library, name="")})]
        imgui.close_current_popup()
    imgui.end_popup()
    return actions


def _category(context: PanelContext, title: str, entries: list[LibraryEntry]) -> list[Action]:
    imgui.push_style_color(imgui.Col_.header, ImVec4(0, 0, 0, 0))
    is_open = imgui.collapsing_header(title, imgui.TreeNodeFlags_.default_open)
    imgui.pop_style_color()
    if imgui.is_item_visible():
        context.handles.note_item(f"library.category.{title}")
    actions: list[Action] = []
    if not is_open:
        return actions
    room, gap = imgui.get_content_region_avail().x, context.px(GAP)
    columns = max(int((room + gap) // (context.px(CELL) + gap)), 1)
    side = min((room - (columns - 1) * gap) / columns, context.px(1.4 * CELL))
    for index, entry in enumerate(entries):
        if index % columns:
            imgui.same_line(0.0, gap)
        actions += _cell(context, entry, side)
    imgui.dummy(ImVec2(1, context.px(2)))
    return actions


def _cell(context: PanelContext, entry: LibraryEntry, side: float) -> list[Action]:
    """A thumbnail over its name: to drag, to double-click, and for the right button."""
    imgui.push_id(str(entry.path))
    imgui.begin_group()
    corner = imgui.get_cursor_screen_pos()
    imgui.invisible_button("material", ImVec2(side, side + context.px(20)))
    visible, hovered = imgui.is_item_visible(), imgui.is_item_hovered()
    if visible:
        context.handles.note(f"library.{entry.name}", corner.x + 0.5 * side, corner.y + 0.5 * side)
    # At the release: the second press may also begin a drag.
    double = hovered and imgui.is_item_deactivated() and imgui.get_io().mouse_clicked_last_count[0] == 2
    widgets.tooltip(_hint(context, entry))
    if not entry.problem and imgui.begin_drag_drop_source(imgui.DragDropFlags_.source_no_hold_to_open_others):
        imgui.set_drag_drop_payload_py_id(PAYLOAD, context.library.index(entry))
        draw_thumbnail(context, entry, imgui.get_cursor_screen_pos(), context.px(56))
        imgui.dummy(ImVec2(context.px(56), context.px(56)))
        imgui.text_unformatted(entry.name)
        imgui.end_drag_drop_source()
    actions = _menu(context, entry)
    if visible:
        draw_thumbnail(context, entry, corner, side, hovered)
        _name(context, entry, ImVec2(corner.x, corner.y + side + context.px(2)), side)
    imgui.end_group()
    imgui.pop_id()
    selected = context.selected_layer
    if double and selected is not None and not entry.problem:
        actions.append(apply(entry, selected.object))
    return actions


def _hint(context: PanelContext, entry: LibraryEntry) -> str:
    if entry.problem:
        return entry.problem
    layers = ", ".join(
        layer.title if layer.title == layer.model.label else f"{layer.title} ({layer.model.label})"
        for layer in entry.material.layers
    )
    selected = context.selected_layer
    onto = f" Double-click applies it to {selected.object}." if selected is not None else ""
    return f"{entry.name}: {layers}. Drag it onto an object in the picture or in the list.{onto}"


def _menu(context: PanelContext, entry: LibraryEntry) -> list[Action]:
    actions: list[Action] = []
    if not imgui.begin_popup_context_item("menu"):
        return actions
    selected = context.selected_layer
    usable = selected is not None and not entry.problem
    onto = selected.object if selected is not None else "the selected object"
    if imgui.menu_item_simple(f"Apply to {onto}", None, False, usable) and selected is not None:
        actions.append(apply(entry, selected.object))
    corner, extent = imgui.get_cursor_screen_pos(), imgui.calc_text_size(MATCH)
    context.handles.note(f"library.match_material.{entry.name}", corner.x + 0.5 * extent.x, corner.y + 0.5 * extent.y)
    if imgui.begin_menu(MATCH, usable) and selected is not None:
        actions += material_matching.models(
            context, f"library.match_material.{entry.name}", str(entry.path), selected.object
        )
        imgui.end_menu()
    else:
        widgets.tooltip(material_matching.HINT)
    if entry.is_own and imgui.menu_item_simple("Delete"):
        actions.append(DeleteMaterial(entry.path))
    imgui.end_popup()
    return actions


def draw_thumbnail(
    context: PanelContext, entry: LibraryEntry, corner: ImVec2, side: float, hovered: bool = False
) -> None:
    """The picture of a material in a square, empty until there is one."""
    draw_list, rounding = imgui.get_window_draw_list(), context.px(5)
    end = ImVec2(corner.x + side, corner.y + side)
    draw_list.add_rect_filled(corner, end, look.pack(look.WELL), rounding)
    picture = None if entry.problem else context.thumbnail(entry)
    if picture is not None:
        upper, lower = picture.corners()
        draw_list.add_image_rounded(picture.reference, corner, end, upper, lower, look.pack(look.grey(255)), rounding)
    elif entry.problem:
        extent = imgui.calc_text_size(Icon.WARNING)
        place = ImVec2(corner.x + 0.5 * (side - extent.x), corner.y + 0.5 * (side - extent.y))
        draw_list.add_text(place, look.pack(look.BAD), Icon.WARNING)
    if hovered:
        draw_list.add_rect(corner, end, look.pack(look.ACCENT), rounding, context.px(1.5))


def _name(context: PanelContext, entry: LibraryEntry, place: ImVec2, width: float) -> None:
    imgui.push_font(None, look.SMALL_SIZE)
    draw_list = imgui.get_window_draw_list()
    draw_list.push_clip_rect(place, ImVec2(place.x + width, place.y + context.px(18)), True)
    draw_list.add_text(place, look.pack(look.TEXT_SOFT), entry.name)
    draw_list.pop_clip_rect()
    imgui.pop_font()
