"""The rows of groups in the list of objects."""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.commands.groups import RenameGroup, switching
from app.document.selection import toggled
from ui.panels import object_rows, widgets
from ui.panels.actions import Action, RunOperator
from ui.panels.context import PanelContext
from ui.theme import Icon


def draw(context: PanelContext, group: str) -> tuple[bool, list[Action]]:
    """The row of a group; whether it is open, and what is requested."""
    members, chosen = context.document.groups[group], context.view.selected_objects
    states = [state for state in context.document.objects if state.in_group == group]
    actions: list[Action] = []
    imgui.push_id(f"group {group}")
    storage, open_id = imgui.get_state_storage(), imgui.get_id("open")
    is_open = storage.get_bool(open_id, True)
    is_chosen = set(members) <= set(chosen)
    corner, width, quiet = object_rows.ground(context, is_chosen, False)
    if object_rows.arrow(context, f"groups.{group}", is_open, "Show or hide the objects of this group."):
        storage.set_bool(open_id, not is_open)
    imgui.same_line()
    hint, is_seen = f"Select all of {group}.", any(state.visible for state in states)
    if object_rows.name(context, f"groups.{group}", group, hint, Icon.GROUP, corner, width, not is_seen):
        io = imgui.get_io()
        names = toggled(context.view, *members) if io.key_ctrl or io.key_shift else members
        actions.append(RunOperator("select", names))
    actions += _menu(context, group, members)
    for field, icons, value, hint in (
        ("visible", (Icon.VISIBLE, Icon.HIDDEN), is_seen, "Show or hide all of this group; their shadows stay."),
        ("frozen", (Icon.FROZEN, Icon.FROZEN), all(state.frozen for state in states),
         "Freeze: protects the materials of all of this group from edits."),
    ):  # fmt: skip
        is_normal = value if field == "visible" else not value
        if object_rows.toggle(context, f"{field}.groups.{group}", *icons, is_normal, quiet, hint):
            actions.append(switching(members, field, not value, group))
    imgui.pop_id()
    return is_open, actions


def _menu(context: PanelContext, group: str, members: tuple[str, ...]) -> list[Action]:
    """The context menu of a group."""
    actions: list[Action] = []
    if not imgui.begin_popup_context_item("menu"):
        return actions
    imgui.set_next_item_width(context.px(160))
    _, typed = imgui.input_text("##name", group, imgui.InputTextFlags_.auto_select_all)
    context.handles.note_item(f"groups.{group}.name")
    widgets.tooltip("Another name, then Enter.")
    if imgui.is_item_deactivated_after_edit() and typed.strip() != group:
        imgui.close_current_popup()
        actions.append(RenameGroup(group, typed.strip()))
    select = RunOperator("select", members)
    for text, operator, is_possible in (
        ("Duplicate", "duplicate", True), ("Linked duplicate", "linked_duplicate", True),
        ("Delete", "delete_object", len(members) < len(context.document.objects)),
        ("Ungroup", "ungroup_selected", True),
    ):  # fmt: skip
        if imgui.menu_item_simple(text, context.keys_of(operator), False, is_possible):
            actions += [select, RunOperator(operator)]
        context.handles.note_item(f"groups.{group}.{operator}")
    imgui.end_popup()
    return actions
