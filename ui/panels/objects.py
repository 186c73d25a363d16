"""The list of objects and their layers: selection, visibility, freezing, and which layers carry edits."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, ImVec4, imgui

from app.document.commands.layers import AddLayers, RemoveLayer, SetEditable, SetFrozen, SetVisible, new_layer
from app.document.commands.objects import DeleteObject, RenameObject
from app.document.commands.several import Several, named_together
from app.document.document import ObjectState, layer_key
from app.document.selection import is_layer_visible, solo_layer, toggle_solo, toggled
from app.files.materials import copy_layer, copy_material
from app.operators.registry import keys_of
from engine.material import MODELS
from engine.material.layer import Layer
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, Copy, Paste, RunOperator
from ui.panels.context import PanelContext
from ui.panels.library import apply, dropped_material
from ui.theme import Icon

BUTTONS = 3


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    actions: list[Action] = []
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, context.px(1)))
    selected, storage, last = context.view.selected, imgui.get_state_storage(), imgui.get_id("last selected")
    chosen = 0 if selected is None else imgui.get_id(selected.object) & 0x7FFFFFFF
    is_new = storage.get_int(last, 0) != chosen
    storage.set_int(last, chosen)
    for state in context.document.objects:
        top = imgui.get_cursor_screen_pos().y
        actions += _object(context, state)
        if is_new and selected is not None and selected.object == state.name:
            _scroll_to(top, imgui.get_item_rect_max().y)  # it may have been selected in the picture, or just been added
    imgui.pop_style_var()
    return actions


def _scroll_to(top: float, bottom: float) -> None:
    """Scroll the panel no farther than so that rows from top to bottom on screen are seen, at least their first."""
    shown = imgui.internal.get_current_window().inner_rect
    beyond = min(top - shown.min.y, 0.0) or min(max(bottom - shown.max.y, 0.0), top - shown.min.y)
    if beyond:
        imgui.set_scroll_y(imgui.get_scroll_y() + beyond)


def _object(context: PanelContext, state: ObjectState) -> list[Action]:
    selected = context.view.selected
    chosen = selected is not None and selected.object == state.name
    also = state.name in context.view.others
    actions: list[Action] = []
    imgui.push_id(state.name)
    hovered = context.view.hovered == state.name
    open_id = imgui.get_id("open")
    storage = imgui.get_state_storage()
    is_open = storage.get_bool(open_id, chosen or state.editable)
    has_rows = len(state.layers) > 1
    corner, width, quiet = _ground(context, chosen and not has_rows, hovered, also)
    if has_rows:
        if _arrow(context, is_open):
            storage.set_bool(open_id, not is_open)
    else:
        imgui.dummy(ImVec2(context.px(18), imgui.get_frame_height()))
    imgui.same_line()
    what = "the colour and strength of its light" if state.is_lamp else "its curves and parameters"
    icon = Icon.EMITTER if state.emits else ""
    if _name(context, state.name, state.name, what, icon, corner, width, not state.visible):
        actions.append(RunOperator("select", _clicked(context, state.name)))
    actions += _drop(context, state) + _object_menu(context, state)
    actions += _object_buttons(context, state, quiet)
    if is_open and has_rows:
        for index, layer in enumerate(state.layers):
            actions += _layer(context, state, index, layer)
    imgui.pop_id()
    return actions


def _clicked(context: PanelContext, name: str) -> str | tuple[str, ...]:
    """What is selected after a click on an object's name: it alone, with Ctrl it as well or no longer, with Shift all
    from the active one to it."""
    io, selected = imgui.get_io(), context.view.selected
    if io.key_ctrl:
        return toggled(context.view, name)
    if not io.key_shift or selected is None:
        return name
    names = [state.name for state in context.document.objects]
    start, end = names.index(selected.object), names.index(name)
    between = names[start : end + 1] if start <= end else names[end : start + 1]
    return (*(each for each in between if each != selected.object), selected.object)


def _together(context: PanelContext, name: str) -> tuple[str, ...]:
    """What a switch in an object's row sets: all selected objects where it is one of them, else it alone."""
    chosen = context.view.selected_objects
    return chosen if name in chosen else (name,)


def _set_all(
    context: PanelContext, name: str, command: Callable[[str, bool], SetVisible | SetFrozen], value: bool
) -> Several | SetVisible | SetFrozen:
    """Set a switch of an object, and of all that are selected with it, in one step."""
    first, *rest = (command(each, value) for each in _together(context, name))
    label = f"{first.label.split()[0]} {named_together(_together(context, name))}"
    return Several((first, *rest), label) if rest else first


def _arrow(context: PanelContext, is_open: bool) -> bool:
    size = ImVec2(context.px(18), imgui.get_frame_height())
    corner = imgui.get_cursor_screen_pos()
    pressed = imgui.invisible_button("arrow", size)
    x, y, half = corner.x + 0.5 * size.x, corner.y + 0.5 * size.y, context.px(3.5)
    ink = look.pack(look.TEXT if imgui.is_item_hovered() else look.TEXT_SOFT)
    draw = imgui.get_window_draw_list()
    if is_open:
        points = (ImVec2(x - half, y - 0.6 * half), ImVec2(x + half, y - 0.6 * half), ImVec2(x, y + 0.8 * half))
    else:
        points = (ImVec2(x - 0.6 * half, y - half), ImVec2(x + 0.8 * half, y), ImVec2(x - 0.6 * half, y + half))
    draw.add_triangle_filled(*points, ink)
    widgets.tooltip("Show or hide the layers of this object.")
    return pressed


def _ground(
    context: PanelContext, chosen: bool, hovered: bool, also: bool = False
) -> tuple[ImVec2, float, look.Colour]:
    """Row background, `also` of an object that is selected besides the active one; returns (corner, width, the colour
    of icons in their normal state on it)."""
    corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    end = ImVec2(corner.x + width, corner.y + imgui.get_frame_height())
    inside = imgui.is_mouse_hovering_rect(corner, end) and imgui.is_window_hovered(
        imgui.HoveredFlags_.allow_when_blocked_by_active_item
    )
    draw = imgui.get_window_draw_list()
    if chosen or also or inside or hovered:
        draw.add_rect_filled(corner, end, look.pack(look.grey(62 if chosen else 54 if also else 46)), context.px(4))
    if chosen or also:
        bar = ImVec2(corner.x + context.px(2), end.y - context.px(4))
        draw.add_rect_filled(
            ImVec2(corner.x, corner.y + context.px(4)),
            bar,
            look.pack(look.ACCENT if chosen else look.with_alpha(look.ACCENT, 0.55)),
        )
    return corner, width, look.TEXT_SOFT if inside else look.grey(108 if chosen else 84)


def _name(
    context: PanelContext, path: str, text: str, what: str, icon: str, corner: ImVec2, width: float, faint: bool
) -> bool:
    """The name of a row, on a button over the row's room; returns whether it was pressed."""
    height = imgui.get_frame_height()
    place = imgui.get_cursor_screen_pos()
    room = corner.x + width - BUTTONS * height - place.x
    imgui.set_next_item_allow_overlap()
    pressed = imgui.invisible_button("name", ImVec2(max(room, 1.0), height))
    context.handles.note_item(f"objects.{path}")
    widgets.tooltip(f"Select {text} to see {what}; its outline shows in the picture.")
    ink = look.TEXT_FAINT if faint else look.TEXT
    draw = imgui.get_window_draw_list()
    y = place.y + imgui.get_style().frame_padding.y
    after_text = context.px(7) + imgui.calc_text_size(icon).x if icon else 0.0
    shown = widgets.shortened(text, room - after_text)
    draw.push_clip_rect(place, ImVec2(place.x + room, place.y + height), True)
    draw.add_text(ImVec2(place.x, y), look.pack(ink), shown)
    if icon:
        after = place.x + imgui.calc_text_size(shown).x + context.px(7)
        draw.add_text(ImVec2(after, y), look.pack(look.TEXT_SOFT), icon)
    draw.pop_clip_rect()
    return pressed


def _object_buttons(context: PanelContext, state: ObjectState, quiet: look.Colour) -> list[Action]:
    actions: list[Action] = []
    if _toggle(context, f"visible.{state.name}", Icon.VISIBLE, Icon.HIDDEN, state.visible, quiet,
               "Show or hide this object's reflection in the picture; its shadow stays."):  # fmt: skip
        actions.append(_set_all(context, state.name, SetVisible, not state.visible))
    if _toggle(context, f"frozen.{state.name}", Icon.FROZEN, Icon.FROZEN, not state.frozen, quiet,
               "Freeze: protects this object's material from edits. "
               "Indirect light then precomputes nothing for it."):  # fmt: skip
        actions.append(_set_all(context, state.name, SetFrozen, not state.frozen))
    hint = "Editable or fixed: a fixed object has no bands of transport, so its material cannot be edited."
    if not state.is_lamp and _toggle(
        context, f"editable.{state.name}", Icon.EDITABLE, Icon.LOCKED, state.editable, quiet, hint
    ):
        actions.append(SetEditable(state.name, not state.editable))
    return actions


def _layer(context: PanelContext, state: ObjectState, index: int, layer: Layer) -> list[Action]:
    actions: list[Action] = []
    path = layer_key(state.name, index)
    selected = context.view.selected
    chosen = selected is not None and selected.key == path
    imgui.push_id(index)
    corner, width, quiet = _ground(context, chosen, False)
    imgui.dummy(ImVec2(context.px(32), imgui.get_frame_height()))
    imgui.same_line()
    faint = not is_layer_visible(context.document, context.view, path)
    if _name(context, path, layer.title, "its curves and parameters", "", corner, width, faint):
        actions.append(RunOperator("select", path))
    actions += _drop(context, state) + _layer_menu(context, state, path, layer)
    if layer.edits:
        place = ImVec2(corner.x + context.px(23), corner.y + 0.5 * imgui.get_frame_height())
        imgui.get_window_draw_list().add_circle_filled(place, context.px(3), look.pack(look.ACCENT))
    if _toggle(context, f"visible.{path}", Icon.VISIBLE, Icon.HIDDEN, layer.visible, quiet,
               "Show or hide this layer in the picture."):  # fmt: skip
        actions.append(SetVisible(path, not layer.visible))
    if _toggle(context, f"frozen.{path}", Icon.FROZEN, Icon.FROZEN, not layer.frozen, quiet,
               "Freeze: protects this layer from edits. "
               "Indirect light then precomputes nothing for it."):  # fmt: skip
        actions.append(SetFrozen(path, not layer.frozen))
    if not layer.rises and _toggle(
        context, f"solo.{path}", Icon.SOLO, Icon.SOLO, solo_layer(context.document, context.view) != path, quiet,
        "Solo: see this layer without the others of its object; again: all of them. Not an edit. "
        f"({keys_of('solo')})",
    ):  # fmt: skip
        actions.append(toggle_solo(context.view, path))
    imgui.pop_id()
    return actions


def _drop(context: PanelContext, state: ObjectState) -> list[Action]:
    """A material of the library that is dropped on the row drawn last."""
    if not imgui.begin_drag_drop_target():
        return []
    entry = dropped_material(context)
    imgui.end_drag_drop_target()
    return [] if entry is None else [apply(entry, state.name), RunOperator("select", state.name)]


def _object_menu(context: PanelContext, state: ObjectState) -> list[Action]:
    """The context menu of an object."""
    actions: list[Action] = []
    if not imgui.begin_popup_context_item("menu"):
        return actions
    actions += _name_field(context, state)
    names = _together(context, state.name)
    select: list[Action] = [] if len(names) > 1 else [RunOperator("select", state.name)]
    if imgui.menu_item_simple("Duplicate"):
        actions += [*select, RunOperator("duplicate")]
    context.handles.note_item(f"objects.{state.name}.duplicate")
    if imgui.menu_item_simple("Delete", None, False, len(context.document.objects) > len(names)):
        actions.append(RunOperator("delete_object") if len(names) > 1 else DeleteObject(state.name))
    context.handles.note_item(f"objects.{state.name}.delete")
    if state.layers:
        imgui.separator()
        if imgui.menu_item_simple("Copy the material"):
            actions.append(Copy(copy_material(context.document, state.name), f"the material of {state.name}"))
        if imgui.menu_item_simple("Paste"):
            actions += [RunOperator("select", state.name), Paste()]
        if imgui.menu_item_simple("Paste as further layers"):
            actions += [RunOperator("select", state.name), Paste(as_layers=True)]
        if imgui.begin_menu("Add a layer"):
            actions += _new_layers(state)
            imgui.end_menu()
    imgui.end_popup()
    return actions


def _name_field(context: PanelContext, state: ObjectState) -> list[Action]:
    """The object's name, to be typed."""
    imgui.set_next_item_width(context.px(160))
    _, typed = imgui.input_text("##name", state.name, imgui.InputTextFlags_.auto_select_all)
    context.handles.note_item(f"objects.{state.name}.name")
    widgets.tooltip("Another name, then Enter.")
    if not imgui.is_item_deactivated_after_edit() or typed.strip() == state.name:
        return []
    imgui.close_current_popup()
    return [RenameObject(state.name, typed.strip())]


def _new_layers(state: ObjectState) -> list[Action]:
    for model in (each for each in MODELS.values() if not each.needs_file):
        pressed = imgui.menu_item_simple(model.label)
        widgets.tooltip(model.tooltip)
        if pressed:
            return [AddLayers(state.name, (new_layer(model.name),)), RunOperator("select", state.name)]
    return []


def _layer_menu(context: PanelContext, state: ObjectState, path: str, layer: Layer) -> list[Action]:
    """The context menu of a layer."""
    actions: list[Action] = []
    if imgui.begin_popup_context_item("menu"):
        if imgui.menu_item_simple("Copy the layer"):
            actions.append(Copy(copy_layer(context.document, path), f"the layer {layer.title}"))
        if imgui.menu_item_simple("Paste"):
            actions += [RunOperator("select", path), Paste()]
        if imgui.menu_item_simple("Delete the layer", None, False, len(state.layers) > 1):
            actions.append(RemoveLayer(path))
        imgui.end_popup()
    return actions


def _toggle(
    context: PanelContext, name: str, on_icon: str, off_icon: str, normal: bool, quiet: look.Colour, hint: str
) -> bool:
    """An icon that is dim in its normal state (faint until the row is hovered) and plain otherwise."""
    imgui.same_line()
    height = imgui.get_frame_height()
    corner = imgui.get_cursor_screen_pos()
    pressed = imgui.invisible_button(name, ImVec2(height, height))
    context.handles.note_item(f"button.{name}")
    hovered = imgui.is_item_hovered()
    widgets.tooltip(hint)
    ink = look.TEXT if hovered else quiet if normal else look.ACCENT
    icon = on_icon if normal else off_icon
    imgui.push_font(None, look.SMALL_SIZE)
    extent = imgui.calc_text_size(icon)
    place = ImVec2(round(corner.x + 0.5 * (height - extent.x)), round(corner.y + 0.5 * (height - extent.y)))
    imgui.get_window_draw_list().add_text(place, imgui.get_color_u32(ImVec4(*ink)), icon)
    imgui.pop_font()
    return pressed
