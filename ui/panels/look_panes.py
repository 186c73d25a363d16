"""Looks side by side: the current one, which is edited, in a pane of its own, and finished pictures of others.

A click on a picture makes its look current, in its place: panes do not move. Pictures that are out of date are dimmed.
All are seen from the same camera, in the same part of the picture, which zoom and pan change in any pane.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app.document.looks import look_names, shown_looks
from app.operators.registry import keys_of
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, RunOperator, SetPanel
from ui.panels.context import PanelContext
from ui.panels.viewport_layout import PAN, gestures, is_magnifying, pane_places, viewport_rect

LABEL_HEIGHT, GAP = 26.0, 6.0
# Of what is out of date: how much of the backdrop lies over it.
DIM = 0.5
DrawPicture = Callable[[PanelContext, ImVec2, ImVec2], list[Action]]


def draw(context: PanelContext, corner: ImVec2, room: ImVec2, draw_current: DrawPicture) -> list[Action]:
    """The panes in their place; draw_current: draws the picture that is edited."""
    count, document = context.view.looks_shown, context.document
    names: list[str] = [*(shown_looks(document, count) if document.looks else [""])]
    picture, label = context.picture, context.px(LABEL_HEIGHT)
    aspect = 1.0 if picture is None else picture.width / max(picture.height, 1)
    places = pane_places((room.x, room.y), count, aspect, label, context.px(GAP))
    actions: list[Action] = []
    for index, (x, y, width, height) in enumerate(places):
        at, size = ImVec2(corner.x + x, corner.y + y), ImVec2(width, height - label)
        imgui.set_cursor_screen_pos(at)
        if index >= len(names):
            actions += _draw_empty(context, index, at, size)
        elif names[index] == document.look:
            actions += draw_current(context, at, size)
            actions += _draw_label(context, names[index], at, size, is_current=True)
        else:
            actions += _draw_other(context, names[index], at, size)
            actions += _draw_label(context, names[index], at, size, is_current=False)
    return actions


def _draw_other(context: PanelContext, name: str, at: ImVec2, size: ImVec2) -> list[Action]:
    """A finished picture, or what there is of it."""
    board, draw_list = context.looks, imgui.get_window_draw_list()
    pressed = imgui.invisible_button(f"look.{name}", size)
    context.handles.note_item(f"look.{look_names(context.document).index(name)}")
    is_hovered = imgui.is_item_hovered()
    end = ImVec2(at.x + size.x, at.y + size.y)
    draw_list.push_clip_rect(at, end, True)
    picture = board.pictures.get(name)
    grip, actions = context.state.grip, list[Action]()
    pans = grip is not None and grip.handle.startswith(PAN)
    if context.picture is not None:
        # The place of the picture that is edited, whose pixels may be smaller.
        room = viewport_rect(at, size, context.picture)
        place = room.place(context.view)
        actions += gestures(context, room, place, f".{name}")
        board.shown[name] = round(place.width), round(place.height)
        low, far = ImVec2(place.x, place.y), ImVec2(place.x + place.width, place.y + place.height)
        if picture is not None:
            upper, lower = picture.corners()
            draw_list.add_image(picture.reference, low, far, upper, lower)
        if picture is None:
            draw_list.add_rect_filled(low, far, look.pack(look.WELL))
        elif name in board.outdated:
            draw_list.add_rect_filled(low, far, look.pack(look.with_alpha(look.BACKDROP, DIM)))
        if is_hovered and not pans:
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
            draw_list.add_rect(low, far, look.pack(look.grey(200, 0.6)), 0.0, context.px(1))
    draw_list.pop_clip_rect()
    widgets.tooltip(f"Edit the look {name}. ({keys_of('previous_look')} and {keys_of('next_look')} go on to others)")
    chooses = pressed and not pans and not is_magnifying()
    return [*actions, RunOperator("look", name)] if chooses else actions


def _draw_label(context: PanelContext, name: str, at: ImVec2, size: ImVec2, is_current: bool) -> list[Action]:
    """The look's name under its picture, and what is still missing of that; a right click opens its menu."""
    draw_list, pad, height = imgui.get_window_draw_list(), context.px(8), context.px(LABEL_HEIGHT)
    low = ImVec2(at.x, at.y + size.y)
    imgui.set_cursor_screen_pos(low)
    pressed = imgui.invisible_button(f"look.label.{name}", ImVec2(size.x, height))
    place = ImVec2(low.x + pad, low.y + 0.5 * (height - imgui.get_text_line_height()))
    state = "edited" if is_current else context.looks.states.get(name, "")
    extent = imgui.calc_text_size(state).x if state else 0.0
    title = widgets.fitting(name or "This scene", size.x - extent - 3.0 * pad)
    if is_current:
        line = ImVec2(low.x, low.y + height - context.px(2))
        draw_list.add_rect_filled(line, ImVec2(low.x + size.x, low.y + height), look.pack(look.ACCENT))
    draw_list.add_text(place, look.pack(look.TEXT if is_current else look.TEXT_SOFT), title)
    if state:
        ink = look.ACCENT if is_current else look.TEXT_FAINT
        draw_list.add_text(ImVec2(low.x + size.x - pad - extent, place.y), look.pack(ink), state)
    widgets.tooltip(
        state if not is_current and state else "A right click renames, moves or deletes it." if name else ""
    )
    actions: list[Action] = [RunOperator("look", name)] if pressed and not is_current else []
    return actions + (_menu(context, name) if name else [])


def _menu(context: PanelContext, name: str) -> list[Action]:
    """What can be done with a look."""
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(context.px(8), context.px(8)))  # the picture has none
    is_open = imgui.begin_popup_context_item(f"look.menu.{name}")
    imgui.pop_style_var()
    if not is_open:
        return []
    actions: list[Action] = []
    choose: list[Action] = [] if name == context.document.look else [RunOperator("look", name)]
    if imgui.menu_item_simple("New look, like this one"):
        actions += [*choose, RunOperator("new_look")]
    if imgui.menu_item_simple("Rename…"):
        actions += [*choose, SetPanel({"look_name": name})]
    for text, operator in (("Move forward", "look_up"), ("Move back", "look_down")):
        if imgui.menu_item_simple(text, None, False, len(context.document.looks) > 1):
            actions += [*choose, RunOperator(operator)]
    if imgui.menu_item_simple("Delete"):
        actions.append(RunOperator("delete_look", name))
    imgui.end_popup()
    return actions


def _draw_empty(context: PanelContext, index: int, at: ImVec2, size: ImVec2) -> list[Action]:
    """A pane that no look has yet: the first one makes one."""
    draw_list = imgui.get_window_draw_list()
    end = ImVec2(at.x + size.x, at.y + size.y + context.px(LABEL_HEIGHT))
    draw_list.add_rect(at, end, look.pack(look.FRAME), context.px(4), context.px(1))
    text = "New look"
    width = imgui.calc_text_size(text).x + 2.0 * context.px(14)
    imgui.set_cursor_screen_pos(ImVec2(at.x + 0.5 * (size.x - width), at.y + 0.5 * size.y))
    hint = f"A look like the one that is edited. ({keys_of('new_look')})"
    pressed = widgets.text_button(context, f"look.new.{index}", text, hint)
    return [RunOperator("new_look")] if pressed else []


def with_stand_in(context: PanelContext) -> PanelContext:
    """The context whose picture is what stands for the current one after a switch, at its size."""
    stand_in, picture = context.looks.stand_in, context.picture
    if stand_in is None or picture is None:
        return context
    shown = replace(picture, reference=stand_in.reference, flipped=stand_in.flipped)
    return replace(context, picture=shown)
