"""The list of objects and their layers: selection, visibility, freezing, and which layers carry edits."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from imgui_bundle import ImVec2, imgui

from app.document.commands.groups import SetGroup, switching
from app.document.commands.layers import (
    AddLayers,
    RemoveLayer,
    SetEditable,
    SetFrozen,
    SetShadowCatcher,
    SetVisible,
    new_layer,
)
from app.document.commands.objects import DeleteObject, RenameObject
from app.document.document import Document, ObjectState, layer_key
from app.document.linked_objects import linked_objects
from app.document.selection import is_layer_visible, solo_layer, toggle_solo, toggled
from app.files.materials import copy_layer, copy_material
from engine.core.errors import list_names
from engine.material import MODELS
from engine.material.layer import Layer
from ui import theme as look
from ui.panels import object_groups, widgets
from ui.panels import object_rows as rows
from ui.panels.actions import Action, Copy, Paste, RunOperator
from ui.panels.context import PanelContext
from ui.panels.library import apply, dropped_material
from ui.theme import Icon

INDENT = 12.0
CATCHER_HINT = (
    "The picture shows only the shadows that others throw on it, over what is behind it. While something is computed "
    "or compared it is shown as an object, and a label says so."
)
CURVES = "its curves and parameters"


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    actions: list[Action] = []
    if not context.document.objects:
        imgui.text_disabled("No objects")
        widgets.caption(f"The Add menu ({context.keys_of('add')}) has shapes, lights and objects of files.")
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, context.px(1)))
    selected, storage, last = context.view.selected, imgui.get_state_storage(), imgui.get_id("last selected")
    chosen = 0 if selected is None else imgui.get_id(selected.object) & 0x7FFFFFFF
    is_new = storage.get_int(last, 0) != chosen
    storage.set_int(last, chosen)
    for group, members in _in_order(context.document):
        is_open, requested = (True, []) if not group else object_groups.draw(context, group)
        actions += requested
        indent = context.px(INDENT) if group else 0.0
        for state in members if is_open else ():
            top = imgui.get_cursor_screen_pos().y
            actions += _indented(indent, partial(_object, context, state))
            if is_new and selected is not None and selected.object == state.name:
                _scroll_to(top, imgui.get_item_rect_max().y)  # selected in the picture, or just added
    imgui.pop_style_var()
    return actions


def _indented(by: float, row: Callable[[], list[Action]]) -> list[Action]:
    """Draw rows so many pixels to the right."""
    if not by:
        return row()
    imgui.indent(by)
    actions = row()
    imgui.unindent(by)
    return actions


def _in_order(document: Document) -> list[tuple[str, list[ObjectState]]]:
    """The objects in the order of their rows: those of a group stand where its first one does, together under its name;
    others under none."""
    found: dict[str, list[ObjectState]] = {}
    for number, state in enumerate(document.objects):
        found.setdefault(state.in_group and f"group {state.in_group}" or str(number), []).append(state)
    return [(members[0].in_group, members) for members in found.values()]


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
    corner, width, quiet = rows.ground(context, chosen and not has_rows, hovered, also)
    if has_rows:
        if rows.arrow(context, state.name, is_open, "Show or hide the layers of this object."):
            storage.set_bool(open_id, not is_open)
    else:
        imgui.dummy(ImVec2(context.px(18), imgui.get_frame_height()))
    imgui.same_line()
    what = "the colour and strength of its light" if state.is_lamp else CURVES
    hint = f"Select {state.name} to see {what}; its outline shows in the picture."
    linked = linked_objects(context.document, state.name)
    icon = (Icon.EMITTER if state.emits else "") + (Icon.LINK if linked else "")
    hint += f" Its material is shared with {list_names(linked, 3)}." if linked else ""
    if rows.name(context, state.name, state.name, hint, icon, corner, width, not state.visible):
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
    names = [state.name for _, members in _in_order(context.document) for state in members]
    start, end = names.index(selected.object), names.index(name)
    between = names[start : end + 1] if start <= end else names[end : start + 1]
    return (*(each for each in between if each != selected.object), selected.object)


def _together(context: PanelContext, name: str) -> tuple[str, ...]:
    """What a switch in an object's row sets: all selected objects where it is one of them, else it alone."""
    chosen = context.view.selected_objects
    return chosen if name in chosen else (name,)


def _object_buttons(context: PanelContext, state: ObjectState, quiet: look.Colour) -> list[Action]:
    actions: list[Action] = []
    if rows.toggle(context, f"visible.{state.name}", Icon.VISIBLE, Icon.HIDDEN, state.visible, quiet,
               f"Show or hide it. Hidden, it shades and lights nothing. ({context.keys_of('hide')})"):  # fmt: skip
        actions.append(switching(_together(context, state.name), "visible", not state.visible))
    if rows.toggle(context, f"frozen.{state.name}", Icon.FROZEN, Icon.FROZEN, not state.frozen, quiet,
               "Freeze: protects this object's material from edits. "
               "Indirect light then precomputes nothing for it."):  # fmt: skip
        actions.append(switching(_together(context, state.name), "frozen", not state.frozen))
    hint = "Editable or fixed: a fixed object has no bands of transport, so its material cannot be edited."
    if not state.is_lamp and rows.toggle(
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
    corner, width, quiet = rows.ground(context, chosen, False)
    imgui.dummy(ImVec2(context.px(32), imgui.get_frame_height()))
    imgui.same_line()
    faint = not is_layer_visible(context.document, context.view, path)
    hint = f"Select {layer.title} to see {CURVES}; its outline shows in the picture."
    if rows.name(context, path, layer.title, hint, "", corner, width, faint):
        actions.append(RunOperator("select", path))
    actions += _drop(context, state) + _layer_menu(context, state, path, layer)
    if layer.edits:
        place = ImVec2(corner.x + context.px(23), corner.y + 0.5 * imgui.get_frame_height())
        imgui.get_window_draw_list().add_circle_filled(place, context.px(3), look.pack(look.ACCENT))
    if rows.toggle(context, f"visible.{path}", Icon.VISIBLE, Icon.HIDDEN, layer.visible, quiet,
               "Show or hide this layer in the picture."):  # fmt: skip
        actions.append(SetVisible(path, not layer.visible))
    if rows.toggle(context, f"frozen.{path}", Icon.FROZEN, Icon.FROZEN, not layer.frozen, quiet,
               "Freeze: protects this layer from edits. "
               "Indirect light then precomputes nothing for it."):  # fmt: skip
        actions.append(SetFrozen(path, not layer.frozen))
    if not layer.rises and rows.toggle(
        context, f"solo.{path}", Icon.SOLO, Icon.SOLO, solo_layer(context.document, context.view) != path, quiet,
        "Solo: see this layer without the others of its object; again: all of them. Not an edit. "
        f"({context.keys_of('solo')})",
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
    if imgui.menu_item_simple("Linked duplicate"):
        actions += [*select, RunOperator("linked_duplicate")]
    context.handles.note_item(f"objects.{state.name}.linked_duplicate")
    widgets.tooltip("Shares the material: edits of one are edits of both.")
    if linked_objects(context.document, state.name) and imgui.menu_item_simple("Make single user"):
        actions += [*select, RunOperator("make_single_user")]
    context.handles.note_item(f"objects.{state.name}.make_single_user")
    if imgui.menu_item_simple("Delete"):
        actions.append(RunOperator("delete_object") if len(names) > 1 else DeleteObject(state.name))
    context.handles.note_item(f"objects.{state.name}.delete")
    if state.in_group and imgui.menu_item_simple(f"Take out of {state.in_group}"):
        actions.append(SetGroup((state.name,)))
    context.handles.note_item(f"objects.{state.name}.take_out")
    if not state.emits:
        if imgui.menu_item_simple("Shadow catcher", None, state.shadow_catcher):
            actions.append(SetShadowCatcher(state.name, not state.shadow_catcher))
        context.handles.note_item(f"objects.{state.name}.shadow_catcher")
        widgets.tooltip(CATCHER_HINT)
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
